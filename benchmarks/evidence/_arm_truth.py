"""What the independent six-axis arm is made of: bodies, motors, transmissions, friction, descriptions."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from _arm_bodies import CENTER, INERTIA, MASS, WIDTH

J = 6
TICK = 1e-3  # of the loop [s]
NAMES = tuple(f"axis_{i}" for i in range(1, J + 1))
(
    MOTOR,
    STIFF,
    DAMP,
    FORTH,
    BACK,
    VISCOUS,
    PEAK,
    PEAK_SPEED,
    BEND,
    STUCK,
    GROWTH,
    RIPPLE,
    WAVES,
    COUNT,
    NOISE,
) = range(15)
#: Name, place of the hinge [m], axis, mass [kg], center [m], principal inertias [kg.m^2].
LINKS = (
    ("column", (0.0, 0.0, 0.16), (0, 0, 1), 7.2, (0.015, -0.02, 0.11), (0.060, 0.055, 0.034)),
    ("upper", (0.03, 0.0, 0.17), (0, 1, 0), 8.1, (0.01, 0.03, 0.17), (0.130, 0.125, 0.024)),
    ("fore", (0.0, 0.0, 0.36), (0, 1, 0), 4.6, (0.05, -0.01, 0.03), (0.021, 0.040, 0.038)),
    ("roll", (0.16, 0.0, 0.03), (1, 0, 0), 1.9, (0.11, 0.0, 0.005), (0.0035, 0.0120, 0.0118)),
    ("bend", (0.19, 0.0, 0.0), (0, 1, 0), 1.1, (0.02, 0.005, 0.0), (0.0016, 0.0021, 0.0020)),
    ("flange", (0.07, 0.0, 0.0), (1, 0, 0), 0.5, (0.025, 0.004, -0.003), (0.0007, 0.0005, 0.0005)),
)
TOOL = (0.09, 0.0, 0.0)  # in the flange [m]
#: Columns as above, one row a joint.
JOINTS = np.array(
    [
        # motor stiff   damp  forth back visc. peak  v_s   bend  stuck grow. ripple waves count  noise
        [1.30, 6.0e4, 60.0, 9.0, 9.9, 11.0, 2.2, 0.05, 6e-4, 0.7, 0.05, 0.03, 40.0, 6.4e-6, 0.12],
        [1.90, 7.0e4, 80.0, 11.0, 10.2, 13.0, 2.6, 0.06, 6e-4, 0.7, 0.06, 0.03, 40.0, 6.4e-6, 0.15],
        [0.90, 4.0e4, 40.0, 7.0, 7.5, 8.0, 1.5, 0.05, 6e-4, 0.7, 0.06, 0.03, 40.0, 6.4e-6, 0.10],
        [0.11, 1.2e4, 7.0, 1.6, 1.5, 1.3, 0.35, 0.08, 8e-4, 0.7, 0.08, 0.03, 30.0, 8e-6, 0.025],
        [0.09, 1.0e4, 6.0, 1.3, 1.4, 1.1, 0.30, 0.08, 8e-4, 0.7, 0.08, 0.03, 30.0, 8e-6, 0.02],
        [0.05, 7.0e3, 4.0, 0.9, 0.85, 0.7, 0.20, 0.08, 8e-4, 0.7, 0.06, 0.03, 30.0, 8e-6, 0.015],
    ]
)
#: Around which the arm moves, how far, and how fast [rad, rad, rad/s].
POSTURE = np.array([0.0, 0.35, 0.4, 0.2, 0.7, 0.1])
REACH = np.array([1.4, 0.7, 0.8, 1.2, 0.9, 1.5])
SPEED = np.array([1.3, 1.1, 1.4, 2.0, 2.0, 2.4])


@dataclass(frozen=True, kw_only=True, eq=False)
class Arm:
    """The truth.

    Attributes:
        joints: table as `JOINTS`, (6, 15).
        payload: mass [kg] and center in the flange [m].
        coupling: C, from motors to joints, (6, 6).
        late: torque acts so much later than it is commanded and logged [s].
        scale: on masses and inertias of the links, (6,).
    """

    joints: np.ndarray = field(default_factory=JOINTS.copy)
    payload: tuple[float, tuple[float, float, float]] = (0.0, (0.0, 0.0, 0.0))
    coupling: np.ndarray = field(default_factory=lambda: np.eye(J))
    late: float = 1.5e-3
    scale: np.ndarray = field(default_factory=lambda: np.ones(J))

    def bodies(self, payload: bool = True) -> np.ndarray:
        """Return the table of the rigid bodies, with the payload or without, (6, 19)."""
        rows = np.zeros((J, WIDTH))
        for i, (_, place, axis, mass, center, inertia) in enumerate(LINKS):
            rows[i, :6] = (*place, *axis)
            rows[i, MASS], rows[i, CENTER:INERTIA] = self.scale[i] * mass, center
            rows[i, INERTIA:] = self.scale[i] * np.diag(inertia).ravel()
        carried, at = self.payload
        if payload and carried > 0.0:
            own, total = rows[-1, MASS], rows[-1, MASS] + carried
            d = np.array(at) - rows[-1, CENTER:INERTIA]
            more = own * carried / total * (d @ d * np.eye(3) - np.outer(d, d))
            rows[-1, INERTIA:] += more.ravel()
            rows[-1, CENTER:INERTIA] += carried / total * d
            rows[-1, MASS] = total
        return rows

    def mjcf(self, payload: bool = False) -> str:
        """Return the rigid bodies as MJCF, with a site `tool`."""
        opening = []
        for (name, place, axis, *_), row, joint in zip(LINKS, self.bodies(payload), NAMES, strict=False):
            I = row[INERTIA:].reshape(3, 3)  # noqa: E741
            full = _words((I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]))
            opening.append(
                f'<body name="{name}" pos="{_words(place)}"><joint name="{joint}" axis="{_words(axis)}"/>'
                f'<inertial pos="{_words(row[CENTER:INERTIA])}" mass="{row[MASS]!r}" fullinertia="{full}"/>'
            )
        tool = f'<site name="tool" pos="{_words(TOOL)}"/>'
        return (
            (
                '<mujoco model="bench_arm"><option gravity="0 0 -9.81"/><worldbody>'
                f"{''.join(opening)}{tool}{'</body>' * J}</worldbody></mujoco>"
            )
            .replace("np.float64(", "")
            .replace(")", "")
        )

    def urdf(self, payload: bool = False) -> str:
        """Return the rigid bodies as URDF, with a fixed link `tool`, limits by reach and speed."""
        parts, before = ['<link name="base"/>'], "base"
        for i, ((name, place, axis, *_), row) in enumerate(zip(LINKS, self.bodies(payload), strict=False)):
            I = row[INERTIA:].reshape(3, 3)  # noqa: E741
            tensor = {
                "ixx": I[0, 0],
                "iyy": I[1, 1],
                "izz": I[2, 2],
                "ixy": I[0, 1],
                "ixz": I[0, 2],
                "iyz": I[1, 2],
            }
            stated = " ".join(f'{k}="{float(x)!r}"' for k, x in tensor.items())
            low, high = POSTURE[i] - 1.2 * REACH[i], POSTURE[i] + 1.2 * REACH[i]
            parts.append(
                f'<link name="{name}"><inertial><origin xyz="{_words(row[CENTER:INERTIA])}"/><mass value="{float(row[MASS])!r}"/>'
                f'<inertia {stated}/></inertial></link><joint name="{NAMES[i]}" type="revolute"><parent link="{before}"/>'
                f'<child link="{name}"/><origin xyz="{_words(place)}"/><axis xyz="{_words(axis)}"/>'
                f'<limit lower="{float(low)!r}" upper="{float(high)!r}" velocity="{float(1.5 * SPEED[i])!r}" effort="300"/></joint>'
            )
            before = name
        parts.append(
            f'<link name="tool"/><joint name="mount" type="fixed"><parent link="{before}"/><child link="tool"/>'
            f'<origin xyz="{_words(TOOL)}"/></joint>'
        )
        return f'<robot name="bench_arm">{"".join(parts)}</robot>'


def _words(numbers) -> str:
    return " ".join(repr(float(x)) for x in numbers)


def drawn(rng: np.random.Generator, spread: float = 0.2, **more) -> Arm:
    """Return an arm whose frictions, stiffnesses and masses are drawn around the nominal ones."""
    table = JOINTS.copy()
    table[:, :GROWTH] *= np.exp(spread * rng.uniform(-1.0, 1.0, (J, GROWTH)))
    table[:, STUCK] = JOINTS[:, STUCK]
    return Arm(joints=table, scale=np.exp(0.5 * spread * rng.uniform(-1.0, 1.0, J)), **more)
