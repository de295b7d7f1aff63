"""The tables of an arm's loop before the first tick: ranges, largest torques and their allocation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from backdrive.control import arm_kernel as kernel
from backdrive.control import guard
from backdrive.control.arm_joint import ArmJoint
from backdrive.control.bodies import Bodies
from backdrive.control.estimators.arm import ArmForce, ArmForceTick
from backdrive.control.joint_loop import LATCH_TIME
from backdrive.control.table import (
    DUE,
    FADE,
    HALF_SPAN,
    LATCHING,
    LIMIT,
    NOMINAL,
    PATIENCE,
    RAMP,
    RATE,
    SPAN,
    TABLE,
    TOP,
)
from backdrive.errors import InvalidInput
from backdrive.robot import Robot

POSTURES = 300  # random postures for the extremes of gravity and inertia
HEAVIER = 1.25  # limit of gravity relative to its largest value over these [-]
SLOWER = 0.8  # largest speed of a virtual mass relative to the top speed [-]
BRISK = 0.05  # time in which walls and admittance may go from zero to their limit [s]


def limits(
    joints: Sequence[ArmJoint],
    bodies: Bodies,
    coupling: np.ndarray,
    interval: float,
    settings: Mapping[int, float],
) -> np.ndarray:
    """Return the arm's table for `arm_kernel.tick`, at rest at zero, (ROWS, J).

    Args:
        joints: settings of each joint.
        bodies: rigid bodies of the robot.
        coupling: C of q = C p, (J, J).
        interval: period [s].
        settings: the same for all joints, by row.

    Raises:
        InvalidInput: a motor's torque beside gravity and friction compensation is too small for the walls.
    """
    table = np.zeros((kernel.ROWS, len(joints)))
    for row, value in settings.items():
        table[row] = value
    lower = np.array([max(j.limits.lower, -np.pi) for j in joints])
    upper = np.array([min(j.limits.upper, np.pi) for j in joints])
    postures = np.random.default_rng(0).uniform(lower, upper, (POSTURES, len(joints)))
    weights, inertias = bodies.over(postures)
    least, most = inertias.min(axis=0), inertias.max(axis=0)
    heaviest = np.abs((weights + [joint.offset for joint in joints]) @ coupling).max(axis=0)
    back = np.linalg.inv(coupling)
    motors = np.diag(
        back.T @ np.diag([joint.inertia for joint in joints]) @ back
    )  # what they add to each joint
    for k, joint in enumerate(joints):
        weight = HEAVIER * float(heaviest[k]) if joint.gravity is None else joint.gravity
        inertia = (float(least[k] + motors[k]), float(most[k] + motors[k]))
        wall, stiffness, lead = joint.walls(weight, inertia, interval)
        depth = joint.depth
        table[kernel.EFFORT, k], table[kernel.WEIGHT, k] = joint.limits.effort, weight
        table[kernel.OFFSET, k] = joint.offset
        table[kernel.LOW, k], table[kernel.HIGH, k] = joint.limits.lower + depth, joint.limits.upper - depth
        table[kernel.WALL, k], table[kernel.STIFFNESS, k] = wall, stiffness
        table[kernel.LEAD, k] = lead
        table[kernel.FOLLOWS, k] = float(joint.admittance is not None)
        table[kernel.DEAD, k], table[kernel.FASTEST, k] = joint.threshold, SLOWER * joint.loop.top_speed
    return table


def output_stage(joints: Sequence[ArmJoint], table: np.ndarray, interval: float) -> np.ndarray:
    """Return the table of the output stage (`control.guard`) that walls and admittances pass, (J, TABLE).

    Args:
        joints: settings of each joint.
        table: the table that `limits` returns.
        interval: period [s].
    """
    by_motor, limit = np.zeros((len(joints), TABLE)), table[kernel.WALL]
    stage = by_motor.T
    stage[NOMINAL], stage[LIMIT] = interval, limit
    stage[SPAN], stage[HALF_SPAN] = guard.spans(interval)
    stage[DUE] = stage[HALF_SPAN]
    stage[TOP] = np.inf  # the loop's own watch sees the speed
    stage[RATE], stage[LATCHING] = limit / BRISK, limit / LATCH_TIME
    for k, joint in enumerate(joints):
        stage[RAMP, k] = limit[k] / joint.loop.ramp
        stage[FADE, k], stage[PATIENCE, k] = joint.loop.fade, joint.loop.patience
    return by_motor


def in_order(robot: Robot, joints: Mapping[str, ArmJoint]) -> dict[str, ArmJoint]:
    """Return the joints' settings in the robot's order; refuse joints that are missing or not the robot's."""
    if missing := [name for name in robot.joints if name not in joints]:
        raise InvalidInput(
            f"Nothing runs on {', '.join(missing)}, and {robot.name} has {len(robot.joints)} joints: {', '.join(robot.joints)}.",
            remedy="Give an `ArmJoint` for each joint by name; use the compensator `nothing()` for no compensation.",
        )
    if unknown := [str(name) for name in joints if name not in robot.joints]:
        raise InvalidInput(
            f"{robot.name} has no joint {', '.join(unknown)}.", remedy=f"It has {', '.join(robot.joints)}."
        )
    return {name: joints[name] for name in robot.joints}


def matching(
    force: ArmForce | None, robot: Robot, coupling: np.ndarray, interval: float
) -> ArmForceTick | None:
    """Return the loop's estimator of the external torque; refuse an estimator of other joints or motors."""
    if force is None:
        return None
    if force.joints != robot.joints:
        raise InvalidInput(
            f"The estimator belongs to {', '.join(force.joints)}, and {robot.name} has {', '.join(robot.joints)}.",
            remedy="Give one of this robot, its joints in this order.",
        )
    C = np.eye(len(robot.joints)) if force.coupling is None else np.array(force.coupling)
    if not np.array_equal(C, coupling):
        raise InvalidInput(
            "The estimator of the external torque and the loop have different couplings.",
            remedy="Give both the same (`force.replace(coupling=...)`).",
        )
    return force.online(interval)
