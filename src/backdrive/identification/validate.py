"""Validation of a model on logs: measured and predicted torque, or motion given the drive's input, without torque."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from backdrive._arguments import guard_keywords
from backdrive.engine import Axis, DriveModel, forward
from backdrive.errors import BackdriveError, InvalidInput, NotIdentifiable, check_type
from backdrive.identification.auto import in_motion, moving_joints, standing
from backdrive.identification.coupling import other_coupling
from backdrive.identification.dynamics import predict
from backdrive.identification.names import same_names
from backdrive.identification.options import Options, settings_of
from backdrive.identification.quality import WHERE_SLIDING, judge
from backdrive.identification.runs import find_runs
from backdrive.identification.signals import prepare
from backdrive.identification.smoothing import smoothing
from backdrive.identification.validation import Validation
from backdrive.logs.log import Log
from backdrive.logs.tables import as_logs
from backdrive.model import FrictionModel, JointFriction, Quality

LEAST_STEP = 1e-7  # shortest integration step that a model file may contain [s]
Pairs = list[tuple[np.ndarray, np.ndarray, float, np.ndarray]]


@guard_keywords
def validate(
    model: FrictionModel,
    logs: Log | Sequence[Log] | Any,
    *,
    urdf: str | None = None,
    remarks: list[str] | None = None,
) -> Validation:
    """Return the relative torque residual of every joint that model and logs share.

    Args:
        model: with the friction of each joint.
        logs: one log or data frame, or several, with torque, of the same joints (by name).
        urdf: path of the robot description, for the model of a whole arm.
        remarks: list to which sentences are added, for example on joints that move outside the model's validity range.

    Returns:
        joint name -> quality over all logs, a dict that can be displayed.

    Raises:
        InvalidInput: model and logs share no joint, units or channels do not fit, or an arm's description is missing.
        NotIdentifiable: the logs contain no motion to judge.
    """
    logs = _logs(model, logs)
    shared = _common_joints(model, logs)
    said = [] if remarks is None else remarks
    before = len(said)
    units = {friction.joint.name: friction.joint.torque_unit for friction in model.joints}
    if model.arm is not None:
        if urdf is None:
            raise InvalidInput(
                "This is the model of a whole arm.", remedy="Pass its description with --urdf."
            )
        from backdrive.identification.arm import validate_arm

        qualities = validate_arm(model, logs, urdf, said)
        return Validation(qualities, units=units, remarks=said[before:])
    said += same_names(
        [j.joint for j in model.joints], [joint for log in logs for joint in log.joints], "model", "logs"
    )
    alone = [n for n in model.names if n not in shared], [n for n in logs[0].names if n not in model.names]
    if all(alone):
        ours, theirs = (", ".join(map(str, names)) for names in alone)
        said.append(
            f"Not compared: {ours} of the model, {theirs} of the logs. If they are the same joints, match them with --rename."
        )
    said += other_coupling(model, logs)
    idle = moving_joints(logs, None)[1]
    result: dict[str, Quality] = {}
    for name in shared:
        if name in idle:
            said.append(f"Joint '{name}' hardly moves in the logs and was not judged.")
            continue
        friction = model.joint(name)
        said += _of_identification(friction)
        measured = {log.joints[log.column(name)].unit for log in logs}
        if measured != {friction.joint.unit}:
            raise InvalidInput(
                f"Joint '{name}' is measured in {friction.joint.unit} in the model and in {', '.join(sorted(measured))} in the "
                "logs.",
                remedy=f"Read the logs with --unit {friction.joint.unit}.",
            )
        said += standing(logs, [name])
        each = [_predictions(model, friction, log) for log in in_motion(logs, name)]
        pairs = [pair for pairs, _ in each for pair in pairs]
        if not pairs:
            raise NotIdentifiable(
                f"Joint '{name}': the logs contain no motion to judge.",
                remedy="Give a log in which it moves.",
            )
        result[name] = judge(pairs)
        beyond = friction.extrapolation(np.concatenate([v for _, moved in each for v in moved]))
        if beyond:
            said.append(beyond)
    if not result:
        raise NotIdentifiable(
            "No joint that the model knows moves in the logs.", remedy="Give a log in which one moves."
        )
    return Validation(result, units=units, remarks=said[before:])


def _logs(model: Any, logs: Any) -> list[Log]:
    """Return logs of a model, both checked."""
    check_type(model, FrictionModel, "friction model", "Give one, such as identify(log).model.")
    several = as_logs(logs)
    if not several:
        raise InvalidInput(
            "There is no log to validate on.", remedy="Pass at least one `Log`, as `read_log` gives it."
        )
    return several


def _of_identification(friction: JointFriction) -> list[str]:
    """Return a sentence on a joint whose identification was poor or could not be judged."""
    grade = None if friction.verdict is None else friction.verdict.grade
    if grade not in ("poor", "unknown"):
        return []
    why = f": {friction.warnings[0]}" if friction.warnings else "."
    word = "not credible, or poor," if grade == "poor" else "not to be judged"
    return [f"Joint '{friction.joint.name}' was {word} when it was identified{why}"]


@guard_keywords
def validate_motion(model: FrictionModel, logs: Log | Sequence[Log] | Any) -> Validation:
    """Return the quality of the motion predicted from the drive's input, for every joint that model and logs share.

    As in the fit, a log under a controller is simulated as a whole, and a log without one in windows.

    Args:
        model: result of a fit from the drive's input, whose options contain the drive.
        logs: one log or data frame, or several, with position and the drive's input.

    Returns:
        joint name -> quality: root mean square error of the position [rad or m], and the same divided by the root mean square
        of the position about its mean [%]. The dict can be displayed.

    Raises:
        InvalidInput: the model contains no drive, or shares no joint with the logs.
    """
    from backdrive.identification.dynamic.drive_stretch import drive_stretches, whole

    logs = _logs(model, logs)
    result: dict[str, Quality] = {}
    for name in _common_joints(model, logs):
        axis, step = _axis(model, name)
        options = Options(drive=axis.drive, cutoff=_positive(model.options.get("cutoff")))
        parts = [part for log in logs for part in drive_stretches(log, name, axis.drive, options)]
        errors = []
        for log in whole(parts, axis.drive.controller != "open"):
            moved = forward(
                axis,
                log.drive_input,
                dt=log.dt,
                position=float(log.position[0]),
                velocity=log.launch,
                temperature=None if log.temperature is None else log.temperature[None],
                substeps=max(1, int(np.ceil(log.dt / step - 1e-6))),
            )
            errors.append(moved.position[0] - log.position)
        error = np.concatenate(errors)
        spread = np.concatenate([part.log.position - part.log.position.mean() for part in parts])
        rms, size = float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(spread**2)))
        residual = 100.0 * rms / size if size > 0.0 else float("nan")
        result[name] = Quality(residual=residual, residual_raw=residual, rms=rms, samples=error.size)
    units = {friction.joint.name: friction.joint.unit for friction in model.joints}
    return Validation(result, units=units, quantity="motion")


def _common_joints(model: FrictionModel, logs: Sequence[Log]) -> list[str]:
    """Return the names of the joints that a model and all logs have."""
    shared = [name for name in model.names if all(name in log.names for log in logs)]
    if not shared:
        raise InvalidInput(
            f"Model ({', '.join(model.names)}) and logs ({', '.join(logs[0].names)}) share no joint.",
            remedy=f"Name the log's joints as in the model: --rename {logs[0].names[0]}={model.names[0]}, or --names.",
        )
    return shared


def _predictions(
    model: FrictionModel, friction: JointFriction, log: Log
) -> tuple[Pairs, Sequence[np.ndarray]]:
    """Return the arguments of `judge` for one joint in one log, and the joint's velocities [rad/s or m/s]."""
    name = friction.joint.name
    if (
        friction.method == "constant-velocity"
        and log.position is None
        and not friction.dynamics.get("inertia")
    ):  # compares mean torques, one per run
        runs = find_runs(log, name)
        velocity = np.array([r.velocity for r in runs])
        offset = friction.dynamics["offset"].value if "offset" in friction.dynamics else 0.0
        measured, predicted = np.array([r.torque for r in runs]), friction.law.torque(velocity) + offset
        return [(measured, predicted, 1.0, np.ones(len(runs), dtype=bool))] if runs else [], [velocity]
    if log.torque is None and log.drive_input is not None:
        raise InvalidInput(
            f"The log holds no torque of joint '{name}', and here a model is judged by torque.",
            remedy="Map the torque (--map tau=COLUMN). A model of `identify --drive` is judged by motion: `backdrive "
            "validate`, or `backdrive.identification.validate_motion`.",
        )
    cutoff = _positive(settings_of(model, name).get("cutoff", model.options.get("cutoff")))
    if cutoff is None and friction.method == "motion":
        cutoff = smoothing([log], name).cutoff
    stretches = prepare(log, name, cutoff=cutoff)
    slides = friction.method.endswith(WHERE_SLIDING)
    through = friction.method.startswith("fit of") and not slides  # the reversals too
    return [
        (s.torque, predict(friction, s), s.rate, s.moving if through else s.sliding) for s in stretches
    ], [s.velocity for s in stretches]


def _positive(cutoff: Any) -> float | None:
    """Return the cutoff frequency in a model's options [Hz]; None: the default."""
    return float(cutoff) if isinstance(cutoff, (int, float)) and cutoff > 0 else None


def _axis(model: FrictionModel, name: str) -> tuple[Axis, float]:
    """Return a joint with its drive, and the integration step of the fit [s]."""
    from backdrive.identification.dynamic.motion_terms import OF_AXIS

    friction = model.joint(name)
    own = settings_of(model, name)
    drive = own.get("drive")
    values: dict[str, Any] = {n: friction.dynamics[n].value for n in OF_AXIS if n in friction.dynamics}
    if not isinstance(drive, dict) or "inertia" not in values:
        raise InvalidInput(
            f"The model of joint '{name}' holds no drive, and the log no torque.",
            remedy="Map the torque (--map tau=COLUMN); only a model of `identify --drive` can be judged by motion.",
        )
    try:
        step = float(own.get("step", 1e-3))
        if not LEAST_STEP <= step <= 1.0:
            raise ValueError(f"its integration step is {step:g} s")
        return Axis(law=friction.law, drive=DriveModel(**drive), **values), step
    except (TypeError, ValueError, BackdriveError) as error:
        raise InvalidInput(
            f"The drive of joint '{name}' in the model makes no sense: {error}", remedy="Fit it again."
        ) from error
