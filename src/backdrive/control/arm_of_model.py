"""Settings of an arm's joints, from its identified model and the robot's description."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from backdrive.control.arm_joint import ArmJoint
from backdrive.control.compensators import Dither, alg_fc, nothing
from backdrive.control.compensators.compensator import SHARE
from backdrive.control.estimators.arm import ArmForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.control.estimators.of_model import BEND, at_rest, with_slow_sliding
from backdrive.control.joint_loop import JointLoop, torque_limit
from backdrive.errors import InvalidInput
from backdrive.model import FrictionModel, JointFriction
from backdrive.plans.limits import JointLimits
from backdrive.robot import Robot

SOFTER = 0.5  # stiffness of the compensator's contact relative to the model's; the compensator must not be stiffer [-]


def joints_of(  # noqa: PLR0913  (settings that `ArmLoop.from_model` hands over by name)
    model: FrictionModel,
    robot: str | Path | Robot,
    *,
    limits: Mapping[str, JointLimits] | None = None,
    share: float = SHARE,
    dither: Dither | None = None,
    bend: float | None = None,
    contact: float | None = None,
    encoder_count: float | None = None,
    method: str = "momentum",
    bandwidth: float = 50.0,
    frame: str | None = None,
) -> tuple[dict[str, ArmJoint], ArmForce]:
    """Return the settings of each joint of an identified arm, and the estimator of the external torque.

    Args:
        model: of a whole arm.
        robot: path of its description, or the robot, with limits of speed and torque.
        limits: of joints by name, instead of the description's.
        share: R, compensated share of the friction; 0: no compensation [-].
        dither: at rest; None: none.
        bend: deflection at which the contacts of compensator and estimator slide [rad or m]; None: twice that of the joint's
            own contact, or 1 mrad or 0.1 mm if that is unknown. A compensator whose contact is stiffer than the real one is
            positive feedback. For a `bend` below the joint's own, or below 1 mrad or 0.1 mm, the share is lowered in proportion.
        contact: deflection at which the joints' own contacts slide, if you know it [rad or m]; None: the model's.
        encoder_count: step of the encoders [rad or m]; None: the model's.
        method: of the estimate of the external torque.
        bandwidth: of the estimate [1/s].
        frame: at which a wrench is wanted; None: none.

    Raises:
        InvalidInput: the model is not of an arm or not of this one, or a speed, a torque or a count is not known.
        UnknownName: there is no such frame.
    """
    for name, value in (("bend", bend), ("contact", contact)):
        if value is not None and not 0.0 < value < math.inf:
            raise InvalidInput(
                f"{name} = {value:g}.", remedy="Give the deflection of a contact in rad or m, such as 1e-3."
            )
    force = ArmForce.from_model(model, robot, method=method, bandwidth=bandwidth, frame=frame)
    known = force.bodies.robot
    offsets = np.array(force.offset)
    if force.coupling is not None:  # those of the motors, brought to the joints
        offsets = np.linalg.solve(np.array(force.coupling).T, offsets)
    joints, contacts = {}, []
    for k, name in enumerate(known.joints):
        friction = with_slow_sliding(model.joint(name))
        own = (limits or {}).get(name) or _range(known, k)
        count = _count(friction, encoder_count)
        for what in ("velocity", "effort"):
            if not math.isfinite(getattr(own, what)):
                raise InvalidInput(
                    f"Joint '{name}': unknown largest {'speed' if what == 'velocity' else 'torque'}.",
                    remedy=f"Give `limits` with `JointLimits({what}=...)`, or write it into the description.",
                )
        K, inertia = _stiffness(friction, count, bend, contact), force.inertia[k]
        estimator = alg_fe(friction.law, K)
        compensator = nothing()
        if share > 0.0:
            most = _own(friction, contact)[0] / K if share <= 1.0 else share  # `JointLoop` refuses that
            compensator = alg_fc(friction.law, K, dither=dither, share=min(share, most))
        loop = JointLoop(
            compensator=compensator,
            limit=min(torque_limit(compensator, own.velocity), own.effort),
            top_speed=own.velocity,
            encoder_count=count,
        )
        joints[name] = ArmJoint(loop=loop, limits=own, inertia=inertia, offset=float(offsets[k]))
        contacts.append(estimator)
    return joints, force.replace(friction=tuple(contacts))


def _range(robot: Robot, k: int) -> JointLimits:
    """Return what the description allows a joint."""
    limits = JointLimits(name=robot.joints[k], unit=robot.units[k])
    if not robot.ranges:
        return limits
    own = robot.ranges[k]
    return replace(limits, lower=own.lower, upper=own.upper, velocity=own.velocity, effort=own.effort)


def _count(friction: JointFriction, count: float | None) -> float:
    """Return the step of a joint's encoder [rad or m]."""
    if count is not None:
        return count
    if friction.joint.encoder_counts is None:
        raise InvalidInput(
            f"Joint '{friction.joint.name}': the model has no encoder count.",
            remedy="Give `encoder_count`, the step of the encoder in rad or m.",
        )
    return 1.0 / friction.joint.encoder_counts


def _stiffness(friction: JointFriction, count: float, bend: float | None, contact: float | None) -> float:
    """Return the stiffness of the compensator's contact: half of the joint's own, or friction divided by a deflection that few
    joints exceed.
    """
    F = max(at_rest(friction.law), 1e-9)
    own, known = _own(friction, contact)
    K = SOFTER * own if known else own
    return min(K if bend is None else F / bend, F / count)


def _own(friction: JointFriction, contact: float | None) -> tuple[float, bool]:
    """Return the least stiffness that the joint's own contact may have, and whether it is known.

    The share times the stiffness of the compensator's contact must not exceed it.
    """
    F = max(at_rest(friction.law), 1e-9)
    if contact is not None:
        return F / contact, True
    own = getattr(friction.law.element, "stiffness", None)
    return (own, True) if isinstance(own, float) else (F / BEND[friction.joint.unit], False)
