"""A six-axis arm whose torque is exact, its model, and logs of it."""

import numpy as np

from backdrive.laws import Coulomb, Law
from backdrive.logs.log import Joint, Log
from backdrive.model import ArmModel, Band, Bands, Estimate, FrictionModel, JointFriction, Validity
from backdrive.robot import parse_robot

DT, L = 1e-3, 60.0
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
PLACES = ("0 0 0.2", "0 0 0.2", "0 0 0.4", "0.2 0 0.03", "0.2 0 0", "0.1 0 0")
MASSES = (6.0, 7.0, 4.0, 1.5, 1.0, 0.4)
MOTORS = np.array([0.9, 1.2, 0.6, 0.1, 0.08, 0.05])
OFFSET = np.array([0.5, -0.3, 0.2, 0.0, 0.05, 0.0])


def text_of(joints=6):
    opening = "".join(
        f'<body name="l{i}" pos="{PLACES[i]}"><joint name="j{i}" axis="{AXES[i]}"/><inertial pos="0.05 0.01 0.02" '
        f'mass="{MASSES[i]}" diaginertia="{0.01 * MASSES[i]} {0.008 * MASSES[i]} {0.006 * MASSES[i]}"/>'
        for i in range(joints)
    )
    text = f'<mujoco model="bench"><worldbody>{opening}<site name="tip" pos="0.08 0 0.02"/>'
    return text + "</body>" * joints + "</worldbody></mujoco>"


TEXT = text_of()
ROBOT = parse_robot(TEXT)


def model_of(robot=ROBOT, coulomb=0.0, growth=None, **changes):
    laws = Law(rate=Coulomb(coulomb=coulomb), growth=growth)
    frictions = tuple(
        JointFriction(
            joint=Joint(name=name),
            law=laws,
            validity=Validity(velocity=(-2.0, 2.0)),
            dynamics={
                "inertia": Estimate(value=float(MOTORS[i]), unit="kg.m^2"),
                "offset": Estimate(value=float(OFFSET[i]), unit="N.m"),
                "transition": Estimate(value=2e-3, unit="rad/s"),
            },
            bands=Bands(
                moving=Band(half_width=0.3, samples=500), reversing=Band(half_width=0.6, samples=100)
            ),
        )
        for i, name in enumerate(robot.joints)
    )
    arm = ArmModel(urdf_sha256=robot.sha256, parameters=tuple(robot.parameters.tolist()), condition=10.0)
    return FrictionModel(**({"joints": frictions, "arm": arm} | changes))


MODEL = model_of()


def motion(n=1500, amplitude=0.4):
    """Positions on the clock, and velocities and accelerations half a tick later, where the torque acts."""
    t = np.arange(n) * DT
    w = np.array([2.0, 1.6, 2.4, 3.0, 2.7, 3.5])
    phase = np.array([0.3, 1.2, 0.7, 2.0, 0.1, 1.0])
    center = np.array([0.0, 0.4, 0.6, 0.2, 0.8, 0.1])

    def at(t):
        x = np.outer(t, w) + phase
        return (
            center + amplitude * np.sin(x),
            amplitude * w * np.cos(x),
            -amplitude * w**2 * np.sin(x),
        )

    return at(t), at(t + 0.5 * DT)


def torque_of(wrench, between, robot=ROBOT):
    """Return the exact torques that move the arm while a wrench acts at its tip, and what the wrench does to the joints."""
    q, dq, ddq = between
    outside = np.einsum("nij,ni->nj", robot.jacobian(q, "tip"), np.broadcast_to(wrench, (q.shape[0], 6)))
    return robot.inverse_dynamics(q, dq, ddq) + MOTORS * ddq + OFFSET - outside, outside


def log_of(wrench, *, coulomb=0.5, n=6000, seed=0, names=ROBOT.joints):
    """Return a log of the arm in smooth motion with dry friction, some noise, and a wrench at the tip."""
    (q, _, _), (between, dq, ddq) = motion(n)
    u, outside = torque_of(wrench, (between, dq, ddq))
    rng = np.random.default_rng(seed)
    torque = u + coulomb * np.tanh(dq / 1e-3) + rng.normal(0.0, 0.02, q.shape)
    return Log(
        time=np.arange(n) * DT,
        position=q,
        torque=torque,
        external_torque=outside,
        joints=tuple(Joint(name=name) for name in names),
    )


SLIDING = model_of(coulomb=0.5)
PUSH = np.array([12.0, -8.0, 20.0, 0.6, -0.4, 0.3])
