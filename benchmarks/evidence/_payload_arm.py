"""A six-axis arm on a given motion: rigid bodies by MuJoCo, friction that slides and creeps by numpy; nothing of the package's.

    tau = C' tau_bodies + J m'' + offset + F(m'),      q = C m

m are the motors' positions. Friction is Dahl's with a level that falls with speed and grows with the torque transmitted; the log
is what drives say: torque by gain, with white and slow noise, positions in counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import mujoco
import numpy as np

JOINTS = 6
NAMES = tuple(f"axis_{i + 1}" for i in range(JOINTS))
AXES = ((0, 0, 1), (0, -1, 0), (0, -1, 0), (1, 0, 0), (0, -1, 0), (1, 0, 0))
PLACES = ((0, 0, 0.15), (0, 0, 0.15), (0.30, 0, 0), (0.14, 0, 0.02), (0.14, 0, 0), (0.06, 0, 0))
MASSES = (7.0, 6.0, 4.5, 1.6, 1.0, 0.5)
CENTERS = (
    (0.01, 0.02, 0.08),
    (0.14, 0.02, 0.01),
    (0.07, -0.02, 0.02),
    (0.06, 0.005, 0.0),
    (0.02, 0.01, 0.0),
    (0.02, 0.0, 0.005),
)
RADII = (
    (0.09, 0.08, 0.08),
    (0.06, 0.12, 0.12),
    (0.05, 0.09, 0.09),
    (0.03, 0.05, 0.05),
    (0.03, 0.03, 0.03),
    (0.02, 0.025, 0.025),
)
TOOL = ((0.05, 0.01, 0.02), (0.3, -0.2, 0.5))  # flange in the last link: xyz [m], rpy [rad]
MOTORS = np.array([1.2, 1.4, 0.7, 0.15, 0.10, 0.06])  # kg.m^2
COULOMB = np.array([7.0, 9.0, 6.0, 1.6, 1.2, 0.8])
VISCOUS = np.array([8.0, 9.0, 5.0, 1.0, 0.8, 0.5])
NOISE = np.array([0.4, 0.5, 0.35, 0.08, 0.06, 0.05])  # N.m
REACH = np.array([1.2, 0.5, 0.6, 1.2, 0.9, 1.5])  # rad
POSTURE = np.array([0.0, 0.6, -1.0, 0.0, 0.7, 0.0])
RATE = 200.0


def rotation(rpy) -> np.ndarray:
    """Return the rotation matrix of roll, pitch, yaw."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return z @ y @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])


def urdf(scale: float = 1.0) -> str:
    """Return the description, its masses wrong by a factor."""
    links, joints, parent = ['<link name="base"/>'], [], "base"
    for i, name in enumerate(NAMES):
        m = scale * MASSES[i]
        xx, yy, zz = m * np.square(RADII[i])
        links.append(
            f'<link name="link_{i + 1}"><inertial><origin xyz="{" ".join(map(str, CENTERS[i]))}"/><mass value="{m}"/>'
            f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
        joints.append(
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="link_{i + 1}"/>'
            f'<origin xyz="{" ".join(map(str, PLACES[i]))}"/><axis xyz="{" ".join(map(str, AXES[i]))}"/>'
            '<limit lower="-6" upper="6" velocity="6" effort="300"/></joint>'
        )
        parent = f"link_{i + 1}"
    place, turn = (" ".join(map(str, x)) for x in TOOL)
    tool = (
        f'<link name="tool"/><joint name="flange" type="fixed"><parent link="{parent}"/><child link="tool"/>'
        f'<origin xyz="{place}" rpy="{turn}"/></joint>'
    )
    return f'<robot name="arm">{"".join(links)}{"".join(joints)}{tool}</robot>'


@dataclass(frozen=True, kw_only=True)
class Load:
    """A body at the tool: mass [kg], center in the tool's frame [m], radii of gyration about it [m]."""

    mass: float
    center: tuple[float, float, float]
    radii: tuple[float, float, float] = (0.04, 0.04, 0.03)


def mjcf(load: Load | None) -> str:
    """Return the true bodies as MJCF."""
    opening = ""
    for i, name in enumerate(NAMES):
        inertia = MASSES[i] * np.square(RADII[i])
        opening += (
            f'<body pos="{" ".join(map(str, PLACES[i]))}"><joint name="{name}" type="hinge" axis="{" ".join(map(str, AXES[i]))}"/>'
            f'<inertial pos="{" ".join(map(str, CENTERS[i]))}" mass="{MASSES[i]}" diaginertia="{" ".join(map(str, inertia))}"/>'
        )
    held = ""
    if load is not None:
        R = rotation(TOOL[1])
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, R.ravel())
        inertia = load.mass * np.square(load.radii)
        held = (
            f'<body pos="{" ".join(map(str, TOOL[0]))}" quat="{" ".join(map(str, quat))}"><inertial mass="{load.mass}" '
            f'pos="{" ".join(map(str, load.center))}" diaginertia="{" ".join(map(str, inertia))}"/></body>'
        )
    return (
        '<mujoco><compiler angle="radian" inertiafromgeom="false"/><option gravity="0 0 -9.81"/><worldbody>'
        f"{opening}{held}{'</body>' * JOINTS}</worldbody></mujoco>"
    )


def motion(seconds: float, seed: int, still: tuple[int, ...] = (), size: float = 1.0):
    """Return time and position, velocity, acceleration of sums of sines of all joints but some, (n, J) each."""
    random = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    q, dq, ddq = np.zeros((3, t.size, JOINTS))
    for j in range(JOINTS):
        if j in still:
            continue
        a, tones = (
            random.standard_normal(6) / np.arange(1, 7) ** 0.7,
            0.1 * np.arange(1, 7) * random.uniform(0.8, 1.2, 6),
        )
        a *= size * REACH[j] / np.abs(a).sum()
        for k in range(6):
            w, phase = 2 * np.pi * tones[k], random.uniform(0, 2 * np.pi)
            q[:, j] += a[k] * np.sin(w * t + phase)
            dq[:, j] += a[k] * w * np.cos(w * t + phase)
            ddq[:, j] -= a[k] * w**2 * np.sin(w * t + phase)
    return t, POSTURE + q, dq, ddq


def bodies(q, dq, ddq, load: Load | None) -> np.ndarray:
    """Return the torque of the rigid bodies by MuJoCo's inverse dynamics, (n, J)."""
    model = mujoco.MjModel.from_xml_string(mjcf(load))
    data = mujoco.MjData(model)
    out = np.empty_like(q)
    for i in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[i], dq[i], ddq[i]
        mujoco.mj_inverse(model, data)
        out[i] = data.qfrc_inverse
    return out


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What differs from arm to arm."""

    gains: np.ndarray = field(default_factory=lambda: np.ones(JOINTS))
    coulomb: np.ndarray = field(default_factory=lambda: np.ones(JOINTS))
    growth: float = 0.04
    coupling: np.ndarray = field(default_factory=lambda: np.eye(JOINTS))


def friction(m, dm, load, truth: Truth) -> np.ndarray:
    """Return Dahl's friction whose level falls with speed and grows with the load, (n, J)."""
    level = COULOMB * truth.coulomb * (1 + 0.25 * np.exp(-((np.abs(dm) / 0.08) ** 1.4)))
    level = level + truth.growth * np.abs(load)
    reach = 4e-4  # rad: 10 N.m by 25 kN.m/rad
    out = np.empty_like(m)
    z = np.zeros(JOINTS)
    dx = np.diff(m, axis=0, prepend=m[:1])
    sign, decay = np.sign(dx), np.exp(-np.abs(dx) / reach)
    for i in range(len(m)):
        z = level[i] * sign[i] + (z - level[i] * sign[i]) * decay[i]
        out[i] = z
    speed = np.abs(dm)
    return out + VISCOUS * np.sign(dm) * speed**0.85


def record(
    seconds: float,
    seed: int,
    *,
    load: Load | None = None,
    truth: Truth | None = None,
    way: int | None = None,
    still: tuple[int, ...] = (),
    side: str = "joint",
    noise: float = 1.0,
):
    """Return time, position and torque as a log would hold them.

    Args:
        seconds: of motion.
        seed: of the noise, and of the motion unless `way` is given.
        load: at the tool.
        truth: of the arm.
        way: seed of the motion.
        still: joints that do not move.
        side: of a coupling that the log is of, `joint` or `motor`.
        noise: by how much the noise is larger.
    """
    truth = truth or Truth()
    random = np.random.default_rng([seed, 7])
    t, q, dq, ddq = motion(seconds, seed if way is None else way, still)
    C = truth.coupling
    D = np.linalg.inv(C)
    m, dm, ddm = q @ D.T, dq @ D.T, ddq @ D.T
    rigid = bodies(q, dq, ddq, load) @ C
    tau = rigid + MOTORS * ddm + friction(m, dm, rigid, truth) + 0.1 * COULOMB
    slow = np.zeros(JOINTS)
    wander = np.empty_like(tau)
    keep = np.exp(-1 / (0.5 * RATE))
    steps = random.standard_normal(tau.shape) * np.sqrt(1 - keep**2)
    for i in range(len(t)):
        slow = keep * slow + steps[i]
        wander[i] = slow
    tau = tau * truth.gains + noise * NOISE * (random.standard_normal(tau.shape) + 0.5 * wander)
    count = 2e-5
    m = count * np.round(m / count)
    return (t, m, tau) if side == "motor" else (t, m @ C.T, tau @ D)
