"""`estimate_force`: from a model and a log to the external torque on each joint, with bands by state of motion.

    tau_e = M ddq + offset + g(q) + tau_f - tau

M, g, offset, friction and the torque's delay are the model's. In motion the band is that within which the model held 95 % of the
torque of motion without contact; at rest friction may be anything within its bounds, and the band is as wide as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive._catalog import lookup
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.control.estimators.of_model import at_rest, bounds_at_rest, fields
from backdrive.errors import BackdriveError, InvalidInput, NotIdentifiable
from backdrive.external.choose import FASTEST, Noise, choose
from backdrive.external.result import ForceEstimate, JointForce
from backdrive.identification.bands import states
from backdrive.identification.delay import earlier
from backdrive.identification.signals import Signals, default_cutoff, prepare
from backdrive.logs.log import Log
from backdrive.logs.resolution import encoder_step, white_noise
from backdrive.model import FrictionModel, JointFriction

AUTO = "auto"
LEAST = 16  # samples of an estimate
SETTLED = 5.0  # lags from the beginning of a stretch, in which an estimate is not given
SLACK = 0.1  # of the friction, by which the band at rest is wider than friction alone, at most [-]


def estimate_force(
    model: FrictionModel,
    log: Log,
    *,
    joints: Sequence[str] | None = None,
    method: str = AUTO,
    bandwidth: float | None = None,
) -> ForceEstimate:
    """Return the external torque on the joints that model and log share.

    Args:
        model: of friction and the rest of each joint's dynamics.
        log: with position and torque.
        joints: names; None: all that both have and whose inertia the model knows.
        method: `direct`, `momentum`, `disturbance`, `extended` or `kalman`; `auto`: by the noise of the log.
        bandwidth: L [1/s]; None: by the noise of the log.

    Raises:
        InvalidInput: model and log share no joint, or differ in its unit; a bandwidth that is not positive.
        UnknownName: no such method.
        NotIdentifiable: the model holds no inertia of a joint, or the log is too short.
        MissingChannel: the log holds no torque or no position.
    """
    lookup(method, dict.fromkeys((AUTO, *METHODS), 0), "method")
    if bandwidth is not None and not 0.0 < bandwidth < np.inf:
        raise InvalidInput(f"A bandwidth of {bandwidth:g} 1/s.", remedy="Give a positive number, such as 50.")
    names = [n for n in model.names if n in log.names]
    if joints is not None:
        names = [model.joint(n).joint.name for n in joints if log.column(n) is not None]
    if not names:
        raise InvalidInput(
            f"Model ({', '.join(model.names)}) and log ({', '.join(log.names)}) share no joint.",
            remedy="Name the log's joints as in the model (--names).",
        )
    log.need("position")
    results, remarks, refused = [], [], []
    for name in names:
        try:
            result, said = _joint(model.joint(name), log, method, bandwidth)
        except BackdriveError as error:
            if joints is not None or len(names) == 1:
                raise
            refused.append(error)
            remarks.append(str(error))
            continue
        results.append(result)
        remarks += said
    if not results:
        raise refused[0]
    return ForceEstimate(joints=tuple(results), remarks=tuple(remarks))


def _joint(
    friction: JointFriction, log: Log, method: str, bandwidth: float | None
) -> tuple[JointForce, list[str]]:
    """Return the external torque on one joint, and what is to be said of it."""
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
            f"Joint '{name}': its model was not credible, or poor, when it was identified: the force is no better."
        )
    if one.external_torque is not None:  # what is sought is no part of the motor's torque
        one = replace(one, external_torque=None)
    stretches = prepare(one, 0)
    rate = stretches[0].rate
    size = max(at_rest(friction.law), 1e-9)
    fastest = max(float(np.abs(s.acceleration).max()) for s in stretches)
    inertia = fields(friction, "momentum", rate)["inertia"]
    if method == AUTO or bandwidth is None:
        plain = _forces(ExternalForce(**fields(friction, "momentum", FASTEST * rate)), friction, stretches)
        longest = max(plain, key=lambda part: part[0].size)[1]
        noise = _noise(friction, one, stretches, inertia)
        best = choose(longest, noise, None if method == AUTO else method)
        method, bandwidth = best[0], bandwidth or best[1]
    made = ExternalForce(**fields(friction, method, bandwidth, fastest + size / inertia))
    time, force, taken, state = (np.concatenate(x) for x in zip(*_forces(made, friction, stretches)))
    if time.size < LEAST:
        raise NotIdentifiable(
            f"Joint '{name}': every stretch of the log is over before an estimator of {bandwidth:.3g} 1/s has settled.",
            remedy="Give a larger --bandwidth, or a longer log.",
        )
    lower, upper = band(friction, force, taken, state, remarks)
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
        known=_known(log, name, time),
    )
    beyond = friction.extrapolated(np.concatenate([s.velocity for s in stretches]))
    return result, remarks + ([beyond] if beyond else [])


def _forces(
    made: ExternalForce, friction: JointFriction, stretches: Sequence[Signals]
) -> list[tuple[np.ndarray, ...]]:
    """Return time, force, friction and state of every stretch from where the estimator has settled, its lag taken out."""
    value = {term: e.value for term, e in friction.dynamics.items()}
    parts = []
    for s in stretches:
        known = None
        if "model_torque" in value:
            if s.model_torque is None:
                raise InvalidInput(
                    f"Joint '{friction.joint.name}': the model needs a torque known from elsewhere.",
                    remedy="Map it (--map tau_model=COLUMN).",
                )
            known = value["model_torque"] * s.model_torque
        dt = 1.0 / s.rate
        # the torque that acted between a reading and the next
        torque = earlier(s.torque, -(_delay(friction) * s.rate + 0.5), linear=True)
        force, taken = made.run(s.position, torque, dt, known, velocity=float(s.velocity[0]))  # type: ignore[arg-type]
        lag = made.lag(dt)
        back = 0.0 if np.isnan(lag) else -lag * s.rate
        settled = int(np.ceil(SETTLED * (1.0 / made.bandwidth + dt) * s.rate))
        series = s.time, earlier(force, back), earlier(taken, back), states(s)
        parts.append(tuple(x[settled:] for x in series))
    return parts


def band(
    friction: JointFriction, force: np.ndarray, taken: np.ndarray, state: np.ndarray, remarks: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the 95 % band, (n,) each; a state that the model has no band of has the widest that it has.

    Args:
        friction: of the model.
        force: external torque [N.m or N], (n,).
        taken: friction that was taken off [N.m or N], (n,).
        state: of motion, (n,).
        remarks: list that a sentence is added to where the model holds no band.
    """
    known = friction.bands
    widths = [
        np.nan if b is None else b.half_width
        for b in ((None, None) if known is None else (known.moving, known.reversing))
    ]
    if np.isnan(widths).all():
        remarks.append(
            f"Joint '{friction.joint.name}': the model holds no bands: identify it again for bands in motion."
        )
    else:
        widths = [np.nanmax(widths) if np.isnan(w) else w for w in widths]
    half = np.where(state == 0, widths[0], widths[1])
    lower, upper = force - half, force + half
    rest = state == 2
    forwards, backwards = bounds_at_rest(friction.law)
    slack = SLACK * 0.5 * (forwards + backwards)
    slack = min(slack, widths[1]) if np.isfinite(widths[1]) else slack
    lower[rest] = (force - taken)[rest] - backwards - slack
    upper[rest] = (force - taken)[rest] + forwards + slack
    return lower, upper


def _delay(friction: JointFriction) -> float:
    value = sum(friction.dynamics[t].value for t in ("delay", "time_slip") if t in friction.dynamics)
    return float(value)


def _noise(friction: JointFriction, log: Log, stretches: Sequence[Signals], inertia: float) -> Noise:
    """Return what disturbs the estimate: by the model, and where that does not say, by the log."""
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
    )


def _known(log: Log, name: str, time: np.ndarray) -> np.ndarray | None:
    """Return the external torque that the log holds, on a clock."""
    one = log.select(name)
    if one.external_torque is None:
        return None
    return np.interp(time, one.time, one.external_torque[:, 0])
