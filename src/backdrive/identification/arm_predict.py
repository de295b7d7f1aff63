"""The torque that the model of a whole arm predicts along a motion, and its deviation from measured torque."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.arm_signals import ArmSignals, hold_out_all, prepare_arm
from backdrive.identification.arm_terms import Regressor
from backdrive.identification.delay import earlier
from backdrive.identification.quality import judge
from backdrive.logs.log import Log
from backdrive.model import ArmModel, FrictionModel, JointFriction, Quality
from backdrive.robot import Robot, load_robot

#: Terms that an arm's model contains for every joint.
DYNAMICS = ("inertia", "offset", "transition")


def predict_arm(model: FrictionModel, log: Log, urdf: str | Path | Robot) -> np.ndarray:
    """Return the torque that the model predicts for a log's motion.

    Args:
        model: of a whole arm.
        log: with position and torque of all its joints, in any order.
        urdf: the description that the model was identified with.

    Returns:
        Torque on the joint side [N.m or N], (n, J), joints in the model's order.

    Raises:
        InvalidInput: the model is not of an arm, or belongs to another description.
    """
    arm, robot = arm_of(model, urdf)
    frictions = [model.joint(name) for name in robot.joints]
    torque = np.full((len(log), len(robot.joints)), np.nan)
    late = slip_in(model)
    for s in prepare_arm(log, robot, coupling=coupling_of_model(model, robot)):
        predicted, _ = torque_parts(s, robot, arm, frictions)
        predicted = earlier(predicted.T, late * s.rate).T
        if s.coupling is not None:
            predicted = predicted @ np.linalg.inv(s.coupling)
        inside = (log.time >= s.time[0]) & (log.time <= s.time[-1] + 1.0 / s.rate)
        for j in range(len(robot.joints)):
            torque[inside, j] = np.interp(log.time[inside], s.time, predicted[:, j])
    return torque[:, [robot.joints.index(name) for name in model.names]]


def validate_arm(
    model: FrictionModel, logs: Sequence[Log], urdf: str | Path | Robot, remarks: list[str] | None = None
) -> dict[str, Quality]:
    """Return the quality of the predicted torque of each joint over all logs, rests included.

    Args:
        model: of a whole arm.
        logs: with position and torque of all its joints.
        urdf: the description that the model was identified with.
        remarks: list to which a sentence is added for every joint that moves outside the model's validity range.

    Raises:
        InvalidInput: the model is not of an arm, or belongs to another description.
    """
    arm, robot = arm_of(model, urdf)
    frictions = [model.joint(name) for name in robot.joints]
    coupling = coupling_of_model(model, robot)
    late = slip_in(model)
    prepared = [s.shift(late) for log in logs for s in prepare_arm(log, robot, coupling=coupling)]
    stretches = hold_out_all(prepared)
    everything = [(s, *torque_parts(s, robot, arm, frictions)) for s in stretches]
    qualities = {}
    for name in model.names:
        quality = assess_joint(everything, robot.joints.index(name), lambda s: s.held_out)
        assert quality is not None
        qualities[name] = quality
    for j, friction in enumerate(frictions):
        said = friction.extrapolation(np.concatenate([s.velocity[:, j] for s in stretches]))
        if said and remarks is not None:
            remarks.append(said)
    return qualities


def arm_of(model: FrictionModel, urdf: str | Path | Robot) -> tuple[ArmModel, Robot]:
    """Return the rigid bodies of a model and the robot that they belong to.

    Raises:
        InvalidInput: the model is not of an arm, or belongs to another description.
    """
    if model.arm is None:
        raise InvalidInput(
            "This model is not of a whole arm.", remedy="Identify with --method arm --urdf ROBOT."
        )
    read = urdf if isinstance(urdf, Robot) else load_robot(urdf)
    robot = read.for_model(model.names, model.arm.urdf_sha256, len(model.arm.parameters))
    return model.arm, robot


def coupling_of_model(model: FrictionModel, robot: Robot) -> np.ndarray | None:
    """Return the model's C of q_joint = C q_motor, in the robot's order, (J, J), or None."""
    return robot.coupling_of(model.coupling, model.coupled or model.names)


def slip_in(model: FrictionModel) -> float:
    """Return the delay of the torque in an arm's model [s], which is common to all joints."""
    dynamics = model.joints[0].dynamics
    return float(dynamics["time_slip"].value) if "time_slip" in dynamics else 0.0


def torque_parts(
    s: ArmSignals, robot: Robot, arm: ArmModel, frictions: Sequence[JointFriction]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the predicted torque along a stretch, and its part without the friction curve, each (n, J).

    If motors drive several joints, both are torques of the motors. A joint's load is the torque that moves and holds the bodies.
    The growth of friction with this load is not part of the curve.
    """
    bodies = Regressor(robot, [s]).bodies(0, robot.base.relation @ np.array(arm.parameters))
    rest, curve = np.empty_like(bodies), np.empty_like(bodies)
    for j, friction in enumerate(frictions):
        value = {name: e.value for name, e in friction.dynamics.items()}
        velocity = s.velocity[:, j]
        missing = [term for term in DYNAMICS if term not in value]
        if missing:
            raise InvalidInput(
                f"Joint '{friction.joint.name}': the arm's model lacks {', '.join(missing)}.",
                remedy="Identify it again.",
            )
        slides = np.abs(np.tanh(velocity / value["transition"]))
        rest[:, j] = bodies[:, j] + value["inertia"] * s.acceleration[:, j] + value["offset"]
        alone = friction.law.torque(velocity)
        rest[:, j] += slides * (friction.law.torque(velocity, bodies[:, j]) - alone)
        curve[:, j] = slides * alone
    return rest + curve, rest


def assess_joint(
    everything: Sequence[tuple[ArmSignals, np.ndarray, np.ndarray]],
    j: int,
    which: Callable[[ArmSignals], np.ndarray],
) -> Quality | None:
    """Return the quality of one joint's prediction over the samples that `which` selects; None if it selects none."""
    pairs = [(s.torque[:, j], p[:, j], s.rate, which(s)) for s, p, _ in everything if which(s).any()]
    return judge(pairs) if pairs else None
