"""The external torque on one joint along a log, with its band by state of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.of_model import at_rest, fields
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.external.bands import band, states_along
from backdrive.external.choose import FASTEST, Noise, choose, turning_of
from backdrive.external.explanation import EXPLAINED, LEAST, explain
from backdrive.external.result import JointForce
from backdrive.external.temperature import along_stretches
from backdrive.identification.delay import earlier
from backdrive.identification.signals import Signals, default_cutoff, prepare
from backdrive.laws import REFERENCE
from backdrive.logs.log import Log
from backdrive.logs.resolution import encoder_step, white_noise
from backdrive.model import JointFriction

AUTO = "auto"
SETTLED = 5.0  # settling time at the start of a stretch, without an estimate [lag]


def joint_force(
    friction: JointFriction, log: Log, method: str, bandwidth: float | None, least: float = 0.0
) -> tuple[JointForce, list[str]]:
    """Return the external torque on one joint, and warnings on it; a bandwidth chosen by noise is at least `least`."""
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
    if one.external_torque is not None:  # the external torque to estimate must not be in the motor's torque
        one = replace(one, external_torque=None)
    stretches = prepare(one, 0)
    warmth = along_stretches(friction, stretches, remarks)
    rate = stretches[0].rate
    size = max(at_rest(friction.law), 1e-9)
    fastest = max(float(np.abs(s.acceleration).max()) for s in stretches)
    inertia = fields(friction, "momentum", rate)["inertia"]
    if method == AUTO or bandwidth is None:
        plain = _forces(
            ExternalForce(**fields(friction, "momentum", FASTEST * rate)), friction, stretches, warmth
        )
        longest = max(plain, key=lambda part: part[0].size)[1]
        noise = noise_of(friction, one, stretches, inertia)
        best = choose(longest, noise, None if method == AUTO else method)
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
    result = JointForce(
        joint=friction.joint,
        time=time,
        force=force,
        friction=taken,
        lower=lower,
        upper=upper,
        state=state.astype(np.int8),
        method=method,
        bandwidth=float(bandwidth),
        lag=made.lag(1.0 / rate),
        known=reference_torque(log, name, time),
        speed=speed_along(stretches, time),
    )
    share = explain(result, friction, stretches)
    if share is not None and share.share < EXPLAINED:
        remarks.append(
            f"Joint '{name}': the model explains {100.0 * max(share.share, 0.0):.0f} % of the torque in motion: a large "
            "force acts, or the log belongs to another joint or robot, or the torque's sign or unit differs."
        )
    beyond = friction.extrapolation(np.concatenate([s.velocity for s in stretches]))
    return result, remarks + ([beyond] if beyond else [])


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
        # the torque that acted between a reading and the next
        torque = earlier(s.torque, -(delay_of(friction) * s.rate + 0.5), linear=True)
        assert s.position is not None
        force, taken = made.run(s.position, torque, dt, known, float(s.velocity[0]), warm)
        lag = made.lag(dt)
        back = 0.0 if np.isnan(lag) else -lag * s.rate
        settled = int(np.ceil(SETTLED * (1.0 / made.bandwidth + dt) * s.rate))
        warm = np.full(s.time.size, REFERENCE) if warm is None else warm
        series = s.time, earlier(force, back), earlier(taken, back), state, warm
        parts.append(tuple(x[settled:] for x in series))
    return parts


def delay_of(friction: JointFriction) -> float:
    """Return the delay of the torque in a model [s]."""
    value = sum(friction.dynamics[t].value for t in ("delay", "time_slip") if t in friction.dynamics)
    return float(value)


def noise_of(friction: JointFriction, log: Log, stretches: Sequence[Signals], inertia: float) -> Noise:
    """Return the noise of the estimate, from the model or, if it has no value, from the log."""
    channel = friction.torque_channel
    white = None if channel is None else channel.noise
    if not white:
        white = max(white_noise(s.torque) for s in stretches)
    misfit = 0.0
    for quality in (friction.fitted, friction.held_out):
        if quality is not None and np.isfinite(quality.rms):
            misfit = float(np.sqrt(max(quality.rms**2 - white**2, 0.0)))
    long_run = None if channel is None else channel.long_run
    rate = stretches[0].rate
    return Noise(
        count=encoder_step(log),
        inertia=inertia,
        torque=white,
        misfit=misfit,
        correlation=0.5 * (long_run / misfit) ** 2 if long_run and misfit > 0.0 else 0.0,
        cutoff=default_cutoff(rate),
        rate=rate,
        turning=turning_of(friction, stretches),
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
