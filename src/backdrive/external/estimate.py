"""`estimate_force`: from a model and a log to the external torque on each joint, with bands by state of motion.

    tau_e = M ddq + offset + g(q) + tau_f - tau

M, g, offset, friction and the torque's delay are the model's. In motion the band is calibrated by free motion if that is
given (`calibrate`). Otherwise it is the band that contained 95 % of the torque in the identification. At rest friction is
undetermined within its bounds, and the band is as wide as they are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from backdrive._catalog import lookup
from backdrive.control.estimators.external import METHODS
from backdrive.errors import BackdriveError, InvalidInput, NotIdentifiable
from backdrive.external.calibrate import Calibration, calibrate
from backdrive.external.comparison import doubts
from backdrive.external.contacts import with_contacts
from backdrive.external.explanation import ACCEPT, check_free
from backdrive.external.joint import AUTO, joint_force
from backdrive.external.result import ForceEstimate, JointForce
from backdrive.external.wrench_axes import AXES
from backdrive.identification.coupling import other_coupling
from backdrive.logs.log import Log
from backdrive.model import FrictionModel, JointFriction
from backdrive.robot import Robot

CONTACTS = 100.0  # least bandwidth for contacts: a step of 1.5 thresholds is detected within 50 ms [1/s]
NO_FRAME = (
    "The log's wrench is not compared: give the frame at which it was measured (--urdf ROBOT --frame TOOL)."
)


def estimate_force(  # noqa: PLR0913  (keywords of one door)
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
    accept: Sequence[str] = (),
) -> ForceEstimate:
    """Return the external torque on the joints that model and log share.

    Args:
        model: of friction and the rest of each joint's dynamics.
        log: with position and torque.
        joints: names; None: all joints of both with a known inertia in the model.
        method: `direct`, `momentum`, `disturbance`, `extended` or `kalman`; `auto`: by the noise of the log.
        bandwidth: L [1/s]; None: by the noise of the log, with contacts at least 100.
        free: logs of motion without contact, for calibrating bands and thresholds; preferably not those that the model was
            fitted to.
        false_alarms: rate of false contacts over all joints [1/h]; None: contacts are not sought.
        robot: description (URDF or MJCF) that a model of a whole arm was identified with, or the robot read from it.
        frame: of the robot, at which the wrench is wanted: a link, a fixed tool or a site; None: no wrench.
        wrench_axes: axes of the log's own wrench, with which the estimate is compared: `frame` (those of `frame`) or `base`.
        accept: `torque-share` estimates an arm's log, too, whose torque the model does not explain; only remarks tell of it then.

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
    accept = (accept,) if isinstance(accept, str) else accept
    for name in accept:
        lookup(name, {ACCEPT: 0}, "check of an estimate")
    lookup(wrench_axes, dict.fromkeys(AXES, 0), "axes of a wrench")
    least = 0.0 if false_alarms is None else CONTACTS
    if robot is not None or model.arm is not None or frame is not None:
        return _arm(
            model,
            log,
            joints,
            method,
            bandwidth,
            least,
            free,
            false_alarms,
            robot,
            frame,
            wrench_axes,
            accept,
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
            untouched = _of_joint(name, free)
            result, said = joint_force(model.joint(name), log, method, bandwidth, least, untouched)
            if free:
                calibrations[name] = _calibration(model.joint(name), untouched, result)
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
    remarks += [*other_coupling(model, [log]), *_of_free_motion(model, log, free)]
    remarks += [*([] if log.wrench is None else [NO_FRAME]), *doubts(results)]
    estimate = ForceEstimate(joints=tuple(results), remarks=tuple(remarks), calibrations=calibrations)
    return estimate if false_alarms is None else with_contacts(estimate, false_alarms)


@contextmanager
def naming(log: Log) -> Iterator[None]:
    """Let an error name the file of a log of free motion."""
    try:
        yield
    except BackdriveError as error:
        where = log.sources[0].path if log.sources else "a log"
        raise type(error)(
            f"Free motion, {where}: {error.message}", remedy=error.remedy, **error.data
        ) from error


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
    accept: Sequence[str],
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
    whole = ArmEstimate(model, robot, frame, ACCEPT in accept)
    results, remarks = whole.forces(log, method, bandwidth, least)
    calibrations: dict[str, Calibration] = {}
    if free:
        like = results[0]
        parts = []
        for one in free:
            with naming(one):
                parts.append(whole.forces(one, like.method, like.bandwidth)[0])
        made = [calibrate([part[j] for part in parts]) for j in range(len(results))]
        calibrations = {one.joint.name: own for one, own in zip(results, made, strict=True)}
        remarks += check_free(whole.frictions, made)
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


def _of_joint(name: str, free: Sequence[Log]) -> list[Log]:
    """Return the logs of free motion that a joint is in."""
    logs = [log for log in free if name in log.names]
    if free and not logs:
        raise InvalidInput(
            f"Joint '{name}' is in no log of free motion.",
            remedy="Name their joints as in the model (--names).",
        )
    return logs


def _calibration(friction: JointFriction, free: Sequence[Log], like: JointForce) -> Calibration:
    """Return the calibration of a joint's estimate by its free motion, for its method and bandwidth."""
    forces = []
    for log in free:
        with naming(log):
            forces.append(joint_force(friction, log, like.method, like.bandwidth)[0])
    return calibrate(forces)
