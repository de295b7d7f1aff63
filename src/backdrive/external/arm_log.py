"""Signals of a log for an arm's estimate: of all joints on one clock, or of the motors if these drive several joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.control.estimators.arm import ArmForce
from backdrive.errors import InvalidInput
from backdrive.identification.signals import Signals, prepare
from backdrive.logs.log import Log
from backdrive.model import JointFriction

DEGREES = 20.0  # ratio of speed to the model's top speed above which positions cannot be radians [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmLog:
    """Signals of a log for an arm's estimate: stretches of all joints, on one clock, in the estimator's order.

    Attributes:
        log: with finite rows of the joints only.
        stretches: by stretch, the signals of every joint.
    """

    log: Log
    stretches: tuple[tuple[Signals, ...], ...]


def arm_log(estimator: ArmForce, frictions: Sequence[JointFriction], log: Log) -> ArmLog:
    """Return the signals of all joints, or motors, between gaps that any of them has.

    Args:
        estimator: of the arm.
        frictions: of its joints, in its order.
        log: with position and torque of all joints.

    Raises:
        InvalidInput: a joint is missing or in another unit, or positions are in degrees.
        MissingChannel: the log holds no torque or no position.
    """
    for channel in ("torque", "position"):
        log.need(channel)
    columns = estimator.bodies.robot.order_in(log.names)
    for friction, column in zip(frictions, columns, strict=True):
        if log.joints[column].unit != friction.joint.unit:
            raise InvalidInput(
                f"Joint '{friction.joint.name}' is measured in {friction.joint.unit} in the model and in "
                f"{log.joints[column].unit} in the log.",
                remedy=f"Read the log with --unit {friction.joint.unit}.",
            )
    good = np.isfinite(log.time)
    for values in (log.need("position"), log.need("torque")):
        good &= np.isfinite(values[:, columns]).all(axis=1)
    whole = at_motors(
        estimator, replace(log, external_torque=None)
    )  # the external torque to estimate must not be in the motors' torque
    whole = whole if good.all() else whole.rows(good)
    by_joint = [prepare(whole, name) for name in estimator.joints]
    for friction, signals in zip(frictions, by_joint, strict=True):
        fastest = max(float(np.percentile(np.abs(s.velocity), 99.0)) for s in signals)
        top = friction.validity.speeds[1]
        if fastest > DEGREES * top > 0.0:
            raise InvalidInput(
                f"Joint '{friction.joint.name}' moves at {fastest:.3g} {friction.joint.unit}/s, {fastest / top:.0f} times as "
                "fast as when the model was identified: its positions look like degrees.",
                remedy="State the factor in the map, for example --map q=deg*q1..q6, or --unit deg where no map names the column.",
            )
    return ArmLog(log=whole, stretches=tuple(zip(*by_joint, strict=True)))


def at_motors(estimator: ArmForce, log: Log) -> Log:
    """Return a log with positions and torques of the motors, where these drive several joints."""
    if estimator.coupling is None:
        return log
    C, one = np.array(estimator.coupling), log.select(estimator.joints)
    moved = {"position": one.need("position") @ np.linalg.inv(C).T}
    for channel in ("torque", "external_torque"):
        if channel in one.channels:
            moved[channel] = one.channels[channel] @ C
    others = {channel: None for channel in one.channels if channel not in (*moved, "temperature")}
    return one.replace(coupling=None, **others, **moved)


def coupling_notes(estimator: ArmForce, log: Log) -> list[str]:
    """Return remarks for motors that drive several joints, and on the side that a log without a coupling is taken for."""
    if estimator.coupling is None:
        return []
    tied = (np.array(estimator.coupling) != 0.0) & ~np.eye(len(estimator.joints), dtype=bool)
    names = [
        n for n, row, column in zip(estimator.joints, tied, tied.T, strict=True) if row.any() or column.any()
    ]
    assumed = (
        "The log was read as that of the joints, with the coupling of the model: for a log of the motors, give "
        "--coupling FILE (with --coupling-side joint where the log is of the joints)."
    )
    return [
        *([] if log.coupling is not None else [assumed]),
        f"Motors of {', '.join(names)} drive several joints. Torques, bands and contacts refer to the motors, where "
        f"friction acts, and the wrench to the arm.",
    ]
