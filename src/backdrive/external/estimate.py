"""`estimate_force`: from a model and a log to the external torque on each joint, with bands by state of motion.

    tau_e = M ddq + offset + g(q) + tau_f - tau

M, g, offset, friction and the torque's delay are the model's. In motion the band is calibrated by free motion if that is
given (`calibrate`). Otherwise it is the band that contained 95 % of the torque in the identification. At rest friction is
undetermined within its bounds, and the band is as wide as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from backdrive._catalog import lookup
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.control.estimators.of_model import at_rest, fields
from backdrive.errors import BackdriveError, InvalidInput, NotIdentifiable
from backdrive.external.bands import band, states_along
from backdrive.external.calibrate import Calibration, calibrate
from backdrive.external.choose import FASTEST, Noise, choose, turning_of
from backdrive.external.contacts import with_contacts
from backdrive.external.known_torque import doubts
from backdrive.external.result import ForceEstimate, JointForce
from backdrive.external.temperature import along_stretches
from backdrive.external.wrench_axes import AXES
from backdrive.identification.delay import earlier
from backdrive.identification.signals import Signals, default_cutoff, prepare
from backdrive.laws import REFERENCE
from backdrive.logs.log import Log
from backdrive.logs.resolution import encoder_step, white_noise
from backdrive.model import FrictionModel, JointFriction
from backdrive.robot import Robot

AUTO = "auto"
CONTACTS = 60.0  # least bandwidth for contacts: a step of 1.5 thresholds is detected within 50 ms [1/s]
LEAST = 16  # samples of an estimate
NO_FRAME = (
    "The log's wrench is not compared: give the frame at which it was measured (--urdf ROBOT --frame TOOL)."
)
SETTLED = 5.0  # settling time at the start of a stretch, without an estimate [lag]


def estimate_force(
    model: FrictionModel,
    log: Log,
    *,
    joints: Sequence[str] | None = None,
    method: str = AUTO,
    bandwidth: float | None = None,
    free: Sequence[Log] = (),
    false_alarms: float | None = None,
    robot: str | Path | Robot | None = None,
    frame: str | None = None,
    wrench_axes: str = "frame",
) -> ForceEstimate:
    """Return the external torque on the joints that model and log share.

    Args:
        model: of friction and the rest of each joint's dynamics.
        log: with position and torque.
        joints: names; None: all joints of both with a known inertia in the model.
        method: `direct`, `momentum`, `disturbance`, `extended` or `kalman`; `auto`: by the noise of the log.
        bandwidth: L [1/s]; None: by the noise of the log, with contacts at least 60.
        free: logs of motion without contact, for calibrating bands and thresholds; preferably not those that the model was
            fitted to.
        false_alarms: rate of false contacts over all joints [1/h]; None: contacts are not sought.
        robot: description (URDF or MJCF) that a model of a whole arm was identified with, or the robot read from it.
        frame: of the robot, at which the wrench is wanted: a link, a fixed tool or a site; None: no wrench.
        wrench_axes: axes of the log's own wrench, with which the estimate is compared: `frame` (those of `frame`) or `base`.

    Raises:
        InvalidInput: model and log share no joint, or differ in its unit; a bandwidth or a rate that is not positive; a model of a
            whole arm without its robot; a log of another robot.
        UnknownName: no such method.
        NotIdentifiable: the model holds no inertia of a joint, or the log is too short; no free motion for contacts.
        MissingChannel: the log holds no torque or no position.
    """
    lookup(method, dict.fromkeys((AUTO, *METHODS), 0), "method")
    if bandwidth is not None and not 0.0 < bandwidth < np.inf:
        raise InvalidInput(f"A bandwidth of {bandwidth:g} 1/s.", remedy="Give a positive number, such as 50.")
    if false_alarms is not None and not 0.0 < false_alarms < np.inf:
        raise InvalidInput(
            f"{false_alarms:g} false contacts an hour.", remedy="Give a positive number, such as 1."
        )
    if false_alarms is not None and not free:
        raise NotIdentifiable(
            "Contacts need free motion, by which their thresholds are calibrated.",
            remedy="Give a log in which nothing touched the joints (--free FREE.csv).",
        )
    lookup(wrench_axes, dict.fromkeys(AXES, 0), "axes of a wrench")
    least = 0.0 if false_alarms is None else CONTACTS
    if robot is not None or model.arm is not None or frame is not None:
        return _arm(
            model, log, joints, method, bandwidth, least, free, false_alarms, robot, frame, wrench_axes
        )
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
    calibrations: dict[str, Calibration] = {}
    for name in names:
        try:
            result, said = _joint(model.joint(name), log, method, bandwidth, least)
            if free:
                calibrations[name] = _calibration(model.joint(name), free, result)
                result = calibrations[name].apply(result)
                said += calibrations[name].remarks() + calibrations[name].faster(result)
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
    remarks += _of_free_motion(model, log, free)
    remarks += [*([] if log.wrench is None else [NO_FRAME]), *doubts(results)]
    estimate = ForceEstimate(joints=tuple(results), remarks=tuple(remarks), calibrations=calibrations)
    return estimate if false_alarms is None else with_contacts(estimate, false_alarms)


def _of_free_motion(model: FrictionModel, log: Log, free: Sequence[Log]) -> list[str]:
    """Return warnings on the logs of free motion."""
    said = []
    seen = {source.sha256 for source in model.sources}
    for source in {source.path: source for one in free for source in one.sources}.values():
        if source.sha256 in seen:
            said.append(
                f"{source.path}: the model was fitted to this free motion, so its bands are too narrow; record another one."
            )
    if any(source in log.sources for one in free for source in one.sources):
        said.append(
            "The log itself was given as free motion: it lies within its own bands, and shows no contact."
        )
    return said


def _arm(  # noqa: PLR0913  (what one door hands to the other)
    model: FrictionModel,
    log: Log,
    joints: Sequence[str] | None,
    method: str,
    bandwidth: float | None,
    least: float,
    free: Sequence[Log],
    false_alarms: float | None,
    robot: str | Path | Robot | None,
    frame: str | None,
    wrench_axes: str,
) -> ForceEstimate:
    """Return the external torque on the joints of a whole arm, and the wrench at a frame."""
    from backdrive.external.arm import ArmEstimate

    if robot is None:
        raise InvalidInput(
            "The model is that of a whole arm, whose joints are coupled."
            if model.arm is not None
            else f"A wrench at '{frame}' needs the arm's description.",
            remedy="Give its description (--urdf ROBOT, URDF or MJCF).",
        )
    whole = ArmEstimate(model, robot, frame)
    results, remarks = whole.forces(log, method, bandwidth, least)
    calibrations: dict[str, Calibration] = {}
    if free:
        like = results[0]
        parts = [whole.forces(one, like.method, like.bandwidth)[0] for one in free]
        made = [calibrate([part[j] for part in parts]) for j in range(len(results))]
        calibrations = {one.joint.name: own for one, own in zip(results, made, strict=True)}
        ratios = [
            one.speed / own.top_speed for one, own in zip(results, made, strict=True) if one.speed is not None
        ]
        remarks += [
            line
            for one, own in zip(results, made, strict=True)
            for line in (*own.remarks(), *own.faster(one))
        ]
        results = [own.apply(one, np.max(ratios, axis=0)) for one, own in zip(results, made, strict=True)]
    remarks += _of_free_motion(model, log, free)
    results = whole.widen(results)
    wrench = None
    if frame is not None:
        wrench, told = whole.wrench(log, results, wrench_axes)
        remarks += told
    elif log.wrench is not None:
        remarks.append(NO_FRAME)
    remarks += doubts(results)
    if joints is not None:
        results = [one for one in results if one.joint.name in {model.joint(n).joint.name for n in joints}]
    estimate = ForceEstimate(
        joints=tuple(results), remarks=tuple(remarks), calibrations=calibrations, wrench=wrench
    )
    return estimate if false_alarms is None else with_contacts(estimate, false_alarms)


def _calibration(friction: JointFriction, free: Sequence[Log], like: JointForce) -> Calibration:
    """Return the calibration of a joint's estimate by free motion, for its method and bandwidth."""
    name = friction.joint.name
    logs = [log for log in free if name in log.names]
    if not logs:
        raise InvalidInput(
            f"Joint '{name}' is in no log of free motion.",
            remedy="Name their joints as in the model (--names).",
        )
    return calibrate([_joint(friction, log, like.method, like.bandwidth)[0] for log in logs])


def _joint(
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
