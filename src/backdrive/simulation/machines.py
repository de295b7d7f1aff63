"""The machines of Iwatani 2017 as simulated joints: the ball-screw axis (Setup A) and three joints of an HP3J arm.

Printed values of the thesis are used as they are. These are transmission ratios and largest torques (Table 2.1), and 65 536
counts a motor turn behind the ratio. The ball screw has a lead of 0.02 m, 4000 counts and a moving mass of 10 kg. Coulomb
friction is 6.85, 9.56 and 3.15 N.m on Joints 0, 1 and 2. The rest are estimates, each with its reason:

- Motor side: rotor inertia of the motors' size class (Yaskawa Sigma-II manual: 3.64e-6 kg.m^2 at 100 W, 1.06e-5 at
  200 W) times the ratio squared, plus wave generator or pulley.
- Load side: inertia of the links of a 27 kg arm of this size. Joint 1 has 1.6 kg.m^2 in total, so that a stroke of 5 degrees
  at 2 rad/s needs nearly its whole torque, as the thesis reports.
- Transmission: stiffer than the 5e4 N.m/rad that the thesis compensates with (1.2e6 N/m on Setup A), which would otherwise be
  unstable; damping ratio 0.05.
- Growth of friction with speed: 5, 7 and 2.5 N.m up to 2 rad/s, typical of such drives, with a smaller slope at high speed,
  as in Fig. 2.7. Setup A: 12 and 8 N by direction and 20 N.s/m, as Fig. 3.4(a) shows
  unequal directions and a nearly straight curve.
- Gravity: none on Setup A (horizontal) and Joint 0 (vertical axis); 30 and 12 N.m on Joints 1 and 2.

Joint 1 has a noise of 0.1 N.m on its actuator.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from backdrive._catalog import lookup
from backdrive.engine.servo import Servo
from backdrive.laws import CoulombViscous, Law, Polyline
from backdrive.simulation.joint import JointSimulation

COUNTS = 65536  # of the HP3J's encoders, a motor turn [1]
BEND = 1.0  # speed at which the friction curve bends [rad/s]
REACHED = 2.0  # speed at which the growth is counted [rad/s]
KNOTS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 1.15, 1.4, 1.7, 2.0, 2.4)  # of the friction curves [rad/s]


def bent_curve(coulomb: float, growth: float, stribeck: float = 0.0) -> Law:
    """Return a friction curve of falling slope, equal in both directions.

    Args:
        coulomb: friction at the slowest motion [N.m].
        growth: more than that at 2 rad/s [N.m].
        stribeck: added at rest and gone at 0.1 rad/s [N.m].
    """
    v = np.array(KNOTS)
    shape = (1.0 - np.exp(-v / BEND)) / (1.0 - np.exp(-REACHED / BEND))
    torque = tuple(coulomb + growth * shape + stribeck * np.exp(-((v / 0.05) ** 2)))
    return Law(rate=Polyline(velocity=KNOTS, positive=torque, negative=torque))


def setup_a() -> JointSimulation:
    """Return the ball-screw axis of chapter 3: friction on the load's side, an encoder too coarse for presliding."""
    return JointSimulation(
        name="setup_a",
        unit="m",
        law=Law(
            rate=CoulombViscous(
                coulomb_positive=12.0, coulomb_negative=8.0, viscous_positive=20.0, viscous_negative=20.0
            )
        ),
        servo=Servo.from_bandwidth(10.0, 60.0, filter_time=3e-3),
        motor_inertia=1.5,
        load_inertia=8.5,
        stiffness=2.4e6,
        damping=200.0,
        friction_side="load",
        encoder_count=0.02 / 4000,
        torque_limit=600.0,
    )


def _arm_joint(name: str, ratio: float, law: Law, motor: float, load: float, limit: float, b: float):
    return JointSimulation(
        name=name,
        law=law,
        servo=Servo.from_bandwidth(motor + load, 120.0),
        motor_inertia=motor,
        load_inertia=load,
        gravity_cos=b,
        encoder_count=2 * np.pi / COUNTS / ratio,
        torque_limit=limit,
    )


def joint_0(*, compliant: bool = False) -> JointSimulation:
    """Return Joint 0 of the arm (vertical axis), rigid or with its transmission's stiffness."""
    joint = _arm_joint("joint_0", 100, bent_curve(6.85, 5.0), 0.06, 0.65, 95.1, 0.0)
    return joint.replace(stiffness=1e5, damping=8.0) if compliant else joint


def joint_1(*, compliant: bool = False) -> JointSimulation:
    """Return Joint 1 of the arm (shoulder), the one with most inertia and gravity."""
    joint = _arm_joint("joint_1", 224, bent_curve(9.56, 7.0), 0.3, 1.3, 213.1, 30.0)
    joint = joint.replace(torque_noise=0.1)
    return joint.replace(stiffness=1e5, damping=17.0) if compliant else joint


def joint_2(*, compliant: bool = False) -> JointSimulation:
    """Return Joint 2 of the arm (elbow)."""
    joint = _arm_joint("joint_2", 120, bent_curve(3.15, 2.5), 0.09, 0.45, 114.1, 12.0)
    return joint.replace(stiffness=8e4, damping=8.5) if compliant else joint


#: Name -> what makes the machine.
MACHINES: dict[str, Callable[..., JointSimulation]] = {
    "setup_a": setup_a,
    "joint_0": joint_0,
    "joint_1": joint_1,
    "joint_2": joint_2,
}


def machine(name: str) -> JointSimulation:
    """Return a machine of the thesis by name; an unknown name is answered with the known ones."""
    return lookup(name, MACHINES, "machine of the thesis")()
