"""Judge a model on logs: measured against predicted torque, joint by joint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.dynamics import predict
from backdrive.identification.options import settings_of
from backdrive.identification.quality import judge
from backdrive.identification.signals import prepare
from backdrive.identification.smoothing import smoothing
from backdrive.logs.log import Log
from backdrive.model import FrictionModel, Quality


def validate(
    model: FrictionModel, logs: Sequence[Log], *, urdf: str | None = None, remarks: list[str] | None = None
) -> dict[str, Quality]:
    """Return the relative residual of every joint that model and logs share.

    Args:
        model: with the friction of each joint.
        logs: with torque, of the same joints (by name).
        urdf: path of the robot description, for the model of a whole arm.
        remarks: list that sentences are added to: which joints the logs move outside the model's validity range.

    Returns:
        joint name -> quality over all logs.

    Raises:
        InvalidInput: model and logs share no joint, or the model is of an arm and its description is missing.
    """
    shared = [name for name in model.names if all(name in log.names for log in logs)]
    if not shared:
        raise InvalidInput(
            f"Model ({', '.join(model.names)}) and logs ({', '.join(logs[0].names)}) share no joint.",
            remedy="Name the log's joints as in the model (--names).",
        )
    if model.arm is not None:
        if urdf is None:
            raise InvalidInput(
                "This is the model of a whole arm.", remedy="Pass its description with --urdf."
            )
        from backdrive.identification.arm import validate_arm

        return validate_arm(model, logs, urdf, remarks)
    result = {}
    for name in shared:
        friction = model.joint(name)
        units = {log.joints[log.column(name)].unit for log in logs}
        if units != {friction.joint.unit}:
            raise InvalidInput(
                f"Joint '{name}' is measured in {friction.joint.unit} in the model and in {', '.join(sorted(units))} in the logs.",
                remedy=f"Read the logs with --unit {friction.joint.unit}.",
            )
        pairs, moved = [], []
        for log in logs:
            if (
                friction.method == "constant-velocity"
                and log.position is None
                and not friction.dynamics.get("inertia")
            ):
                pairs += _runs(friction, log, name, moved)
                continue
            if log.torque is None and log.drive_input is not None:
                raise InvalidInput(
                    f"The log holds no torque of joint '{name}', and here a model is judged by torque.",
                    remedy="Map the torque (--map tau=COLUMN). A model of `identify --drive` is judged by motion: `backdrive "
                    "validate`, or `backdrive.identification.dynamic.judging.judge_motion`.",
                )
            stretches = prepare(log, name, cutoff=_cutoff(model, name, log))
            pairs += [(s.torque, predict(friction, s), s.rate, s.moving) for s in stretches]
            moved += [s.velocity for s in stretches]
        if not pairs:
            raise NotIdentifiable(
                f"Joint '{name}': nothing to judge on.", remedy="Give a log in which it moves."
            )
        result[name] = judge(pairs)
        said = friction.extrapolated(np.concatenate(moved))
        if said and remarks is not None:
            remarks.append(said)
    return result


def _cutoff(model: FrictionModel, name: str, log: Log) -> float | None:
    """Return the low pass of the motion that a joint was fitted with [Hz]; None: the usual one."""
    cutoff = settings_of(model, name).get("cutoff", model.options.get("cutoff"))
    if isinstance(cutoff, (int, float)) and cutoff > 0:
        return float(cutoff)
    return smoothing([log], name).cutoff if model.joint(name).method == "motion" else None


def _runs(friction, log: Log, name: str, moved: list[np.ndarray]) -> list:
    """One pair of mean torques a run: what a constant-velocity model speaks of."""
    from backdrive.identification.runs import find_runs

    runs = find_runs(log, name)
    if not runs:
        return []
    velocity = np.array([r.velocity for r in runs])
    moved.append(velocity)
    offset = friction.dynamics["offset"].value if "offset" in friction.dynamics else 0.0
    measured, predicted = np.array([r.torque for r in runs]), friction.law.torque(velocity) + offset
    return [(measured, predicted, 1.0, np.ones(len(runs), dtype=bool))]
