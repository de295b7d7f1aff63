"""Draw the how-to's figure: a simulated six-axis arm guided by hand against its ranges, bare and through its loop."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from backdrive.control import ArmJoint, ArmLoop, JointLoop, torque_limit
from backdrive.control.compensators import Dither, alg_fc, nothing
from backdrive.plans.limits import JointLimits
from backdrive.report.pictures.guide import save_guide
from backdrive.robot import parse_robot
from backdrive.simulation.arm import Arm, mjcf
from backdrive.simulation.arm_loop import guide_whole, polygon
from backdrive.simulation.hand import Hand

TARGET = Path(__file__).resolve().parent.parent / "docs" / "figures" / "guide.png"
TOP, DEPTH = 3.0, 0.15  # top speed [rad/s], depth of the walls [rad]
MIDDLE, HALF = np.array([0.0, 0.5, -1.0, 0.0, 0.5, 0.0]), 0.45  # of the ranges [rad]


def loop_of(arm: Arm, share: float) -> ArmLoop:
    """Return the loop of an arm whose friction is known; share 0: gravity and walls alone."""
    joints = {}
    for own, middle in zip(arm.joints, MIDDLE, strict=False):
        compensator = nothing()
        if share > 0.0:
            compensator = alg_fc(own.law, 0.5 * own.stiffness, dither=Dither(share=0.3), share=share)
        limits = JointLimits(
            name=own.name, lower=middle - HALF, upper=middle + HALF, effort=own.torque_limit, velocity=TOP
        )
        loop = JointLoop(
            compensator=compensator,
            limit=torque_limit(compensator, TOP),
            top_speed=TOP,
            encoder_count=own.encoder_count,
        )
        joints[own.name] = ArmJoint(loop=loop, limits=limits, inertia=own.motor_inertia, margin=DEPTH)
    return ArmLoop(parse_robot(mjcf()), joints, interval=1e-3)


def main() -> None:
    """Guide and draw."""
    corners = [(0, 0, 0), (0, 0.16, 0), (-0.08, 0.16, 0.08), (-0.08, 0, 0.08), (0, 0, 0), (0, -0.3, 0)]
    path, velocity = polygon(corners, dt=1e-3, duration=0.9, interval=1.1, rounds=1)
    hand, wrist = Hand(stiffness=800.0, damping=40.0), Hand(stiffness=20.0, damping=0.5)
    records, limits = {}, {}
    for name, share in (("bare", 0.0), ("guided", 0.8)):
        arm = Arm()
        loop = loop_of(arm, share)
        limits = {name: joint.limits for name, joint in loop.joints.items()}
        records[name] = guide_whole(arm, path, velocity, hand=hand, wrist=wrist, loop=loop)
    save_guide(TARGET, records, limits)
    print(f"wrote {TARGET}")


if __name__ == "__main__":
    main()
