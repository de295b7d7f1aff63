"""The external torque on one joint along a log, with its band by state of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.of_model import WIDTH, at_rest, fields
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.external.bands import FASTER, abrupt_changes, band, states_along
from backdrive.external.choose import FASTEST, Noise, choose
from backdrive.external.explanation import EXPLAINED, LEAST, explain
from backdrive.external.result import JointForce
from backdrive.external.reversals import noise_of_reversals
from backdrive.external.temperature import along_stretches
from backdrive.identification.delay import earlier
from backdrive.identification.signals import Signals, default_cutoff, prepare
from backdrive.laws import REFERENCE
from backdrive.logs.log import Log
from backdrive.logs.resolution import encoder_step, white_noise
from backdrive.model import JointFriction

AUTO = "auto"
LONGEST = 0.5  # longest correlation time of the torque residual [s]
SETTLED = 5.0  # settling time at the start of a stretch, without an estimate [lag]


def joint_force(
    friction: JointFriction,
    log: Log,
    method: str,
    bandwidth: float | None,
    least: float = 0.0,
    free: Sequence[Log] = (),
) -> tuple[JointForce, list[str]]:
    """Return the external torque on one joint, and warnings on it.

    Args:
        friction: of a model.
        log: with the joint's position and torque.
        method: of the estimator; `auto`: by noise.
        bandwidth: L [1/s]; None: by noise.
        least: smallest bandwidth that is chosen [1/s].
        free: logs of the joint in free motion, which show the noise; none: the model's.

    Raises:
        InvalidInput: model and log differ in the joint's unit, or a known torque is missing.
        NotIdentifiable: the model holds no inertia, or the log is too short.
    """
    name = friction.joint.name
    one = log.select(name)
    if one.joints[0].unit != friction.joint.unit:
        raise InvalidInput(
            f"Joint '{name}' is measured in {friction.joint.unit} in the model and in {one.joints[0].unit} in the log.",
            remedy=f"Read the log with --unit {friction.joint.unit}.",
        )
    remarks = []
    if friction.verdict is not None and friction.verdict.grade in ("poor", "unknown"):
        remarks.append(
            f"Joint '{name}': its model was graded as not credible or poor, so the force is equally unreliable."
        )
    one, stretches = _stretches(one)
    warmth = along_stretches(friction, stretches, remarks)
    rate = stretches[0].rate
    size = max(at_rest(friction.law), 1e-9)
    fastest = max(float(np.abs(s.acceleration).max()) for s in stretches)
    inertia = fields(friction, "momentum", rate)["inertia"]
    if method == AUTO or bandwidth is None:
        plain = _raw_force(friction, stretches, warmth)
        longest = max(plain, key=lambda part: part[0].size)[0]
        turning, abrupt = noise_of_reversals(friction, stretches, plain)
        noise = replace(noise_of(friction, one, stretches, inertia), turning=turning, abrupt=abrupt)
        shown = [part for log in free for part in _noise_of_free_motion(friction, log)]
        best = choose(longest, noise, None if method == AUTO else method, shown)
        method, bandwidth = best[0], bandwidth or max(best[1], min(least, FASTEST * rate))
    made = ExternalForce(**fields(friction, method, bandwidth, fastest + size / inertia))
    parts = _forces(made, friction, stretches, warmth)
    time, force, taken, state, warm = (np.concatenate(x) for x in zip(*parts, strict=True))
    if time.size < LEAST:
        raise NotIdentifiable(
            f"Joint '{name}': every stretch of the log is over before an estimator of {bandwidth:.3g} 1/s has settled.",
            remedy="Give a larger --bandwidth, or a longer log.",
        )
    lower, upper = band(friction, force, taken, state, remarks, warm)
    lag = made.lag(1.0 / rate)
    quick = min(FASTER * bandwidth, FASTEST * rate)
    more = np.zeros(force.shape)
    if quick > bandwidth:
        made = ExternalForce(**fields(friction, method, quick, fastest + size / inertia))
        faster = [part[1] for part in _forces(made, friction, stretches, warmth)]
        more = np.concatenate(
            [
                abrupt_changes(part[1], other[other.size - part[1].size :], part[3], bandwidth, rate)
                for part, other in zip(parts, faster, strict=True)
            ]
        )
    result = JointForce(
        joint=friction.joint,
        time=time,
        force=force,
        friction=taken,
        lower=lower - more,
        upper=upper + more,
        state=state.astype(np.int8),
        method=method,
        bandwidth=float(bandwidth),
        lag=lag,
        known=reference_torque(log, name, time),
        speed=speed_along(stretches, time),
        abrupt=more,
    )
    share = explain(result, friction, stretches)
    if share is not None and share.share < EXPLAINED:
        remarks.append(
            f"Joint '{name}': the model explains {100.0 * max(share.share, 0.0):.0f} % of the torque in motion: a large "
            "force acts, or the log belongs to another joint or robot, or the torque's sign or unit differs."
        )
    beyond = friction.extrapolation(np.concatenate([s.velocity for s in stretches]))
    return result, remarks + ([beyond] if beyond else [])


def _stretches(one: Log) -> tuple[Log, list[Signals]]:
    """Return a joint's log without its external torque, which must not be in the motor's, and its stretches."""
    if one.external_torque is not None:
        one = replace(one, external_torque=None)
    return one, prepare(one, 0)


def _raw_force(
    friction: JointFriction, stretches: Sequence[Signals], warmth: Sequence[np.ndarray | None]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the external torque [N.m or N] and the state of every stretch by the fastest observer, (n,) each."""
    made = ExternalForce(**fields(friction, "momentum", FASTEST * stretches[0].rate))
    return [(part[1], part[3]) for part in _forces(made, friction, stretches, warmth)]


def _noise_of_free_motion(friction: JointFriction, log: Log) -> list[tuple[np.ndarray, float]]:
    """Return what the fastest observer makes of free motion by stretch [N.m or N], and the sampling frequency [Hz]."""
    stretches = _stretches(log.select(friction.joint.name))[1]
    series = _raw_force(friction, stretches, along_stretches(friction, stretches, []))
    return [(force, s.rate) for (force, _), s in zip(series, stretches, strict=True)]


def _forces(
    made: ExternalForce,
    friction: JointFriction,
    stretches: Sequence[Signals],
    warmth: Sequence[np.ndarray | None],
) -> list[tuple[np.ndarray, ...]]:
    """Return time, force, friction, state and temperature of every stretch, settled and with the lag taken out."""
    value = {term: e.value for term, e in friction.dynamics.items()}
    parts = []
    for s, warm in zip(stretches, warmth, strict=True):
        known = None
        if "model_torque" in value:
            if s.model_torque is None:
                raise InvalidInput(
                    f"Joint '{friction.joint.name}': the model needs a known torque (tau_model).",
                    remedy="Map it (--map tau_model=COLUMN).",
                )
            known = value["model_torque"] * s.model_torque
        dt = 1.0 / s.rate
        state = states_along(friction, s, made.bandwidth)
        # the torque between a reading and the next; its delay is the estimator's
        torque = earlier(s.torque, -0.5, linear=True)
        assert s.position is not None
        force, taken = made.run(s.position, torque, dt, known, float(s.velocity[0]), warm)
        lag = made.lag(dt)
        back = 0.0 if np.isnan(lag) else -lag * s.rate
        settled = int(np.ceil(SETTLED * (1.0 / made.bandwidth + dt) * s.rate))
        warm = np.full(s.time.size, REFERENCE) if warm is None else warm
        series = s.time, earlier(force, back), earlier(taken, back), state, warm
        parts.append(tuple(x[settled:] for x in series))
    return parts


def noise_of(friction: JointFriction, log: Log, stretches: Sequence[Signals], inertia: float) -> Noise:
    """Return the noise of the estimate without that of reversals, from the model or, if it has no value, from the log."""
    channel = friction.torque_channel
    white = None if channel is None else channel.noise
    if not white:
        white = max(white_noise(s.torque) for s in stretches)
    residual, moving = 0.0, None if friction.bands is None else friction.bands.moving
    for quality in (friction.fitted, friction.held_out):
        if quality is not None and np.isfinite(quality.rms):
            residual = quality.rms
    if moving is not None:  # the whole residual contains that of reversals, too
        residual = moving.half_width / WIDTH
    misfit = float(np.sqrt(max(residual**2 - white**2, 0.0)))
    long_run = None if channel is None else channel.long_run
    alike = 0.5 * (long_run / misfit) ** 2 if long_run and misfit > 0.0 else 0.0
    rate = stretches[0].rate
    return Noise(
        count=encoder_step(log),
        inertia=inertia,
        torque=white,
        misfit=misfit,
        correlation=min(alike, LONGEST),
        cutoff=default_cutoff(rate),
        rate=rate,
    )


def speed_along(stretches: Sequence[Signals], time: np.ndarray) -> np.ndarray:
    """Return the speed of a joint on a clock [rad/s or m/s]."""
    clock = np.concatenate([s.time for s in stretches])
    return np.interp(time, clock, np.concatenate([np.abs(s.velocity) for s in stretches]))


def reference_torque(log: Log, name: str, time: np.ndarray) -> np.ndarray | None:
    """Return the external torque that the log holds, on a clock."""
    one = log.select(name)
    if one.external_torque is None:
        return None
    return np.interp(time, one.time, one.external_torque[:, 0])
