"""A six-axis arm with realistic joints: rigid bodies by MuJoCo; motors, elastic transmissions, and friction by the laws.

    link side:    M(q) q'' + h(q, q') + g(q) + tau_f = c + tau_e
    motor side:   M_m p'' = u - c,      c = K_c (p - q) + D_c (p' - q')

The rigid bodies change little within a tick, so MuJoCo computes their mass matrix, h + g and the hand's torques once per
tick. In between, all motors, transmissions and frictions are integrated together in compiled steps of 20 us. Friction is
implicit: one joint after another is solved by the law's own `solve`, with the effective inertia 1/(M^-1)_jj. Its impulse is
then applied to the other joints (Gauss-Seidel order).

The kinematics are those of a small arm like the HP3J, of 27 kg. Base to shoulder is 290 mm, the upper arm 260 mm, elbow to
wrist 270 mm, and wrist to flange 90 mm. Masses of the links, wrist frictions and stiffnesses are assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive._jit import jit
from backdrive.engine.axis import implicit_velocity
from backdrive.engine.series import stack_rows
from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput, require
from backdrive.laws import kernels
from backdrive.simulation.joint import JointSimulation
from backdrive.simulation.machines import COUNTS, bent_curve, joint_0, joint_1, joint_2

SUBSTEP = 2e-5  # longest integration step [s]
TEMPERATURE = 20.0  # degC
RATIOS = (100.0, 224.0, 120.0, 120.0, 100.0, 81.5)  # Iwatani 2017, Table 2.1
LIMITS = (95.1, 213.1, 114.1, 34.2, 28.5, 23.3)  # largest torque [N.m], the same table
M_M, K_C, D_C = range(3)  # rows of the table of joints

#: Rigid bodies: name, joint axis, place of the joint in the body before [m], mass [kg], half sizes [m] and centre [m] of a box.
LINKS = (
    ("swivel", "0 0 1", "0 0 0.145", 6.0, "0.09 0.09 0.07", "0 0 0.075"),
    ("upper_arm", "0 -1 0", "0 0 0.145", 5.5, "0.13 0.06 0.06", "0.13 0 0"),
    ("forearm", "0 -1 0", "0.26 0 0", 4.5, "0.10 0.05 0.05", "0.08 0 0"),
    ("roll", "1 0 0", "0.135 0 0", 1.3, "0.0675 0.035 0.035", "0.0675 0 0"),
    ("bend", "0 -1 0", "0.135 0 0", 0.6, "0.03 0.03 0.03", "0.02 0 0"),
    ("flange", "1 0 0", "0.05 0 0", 0.4, "0.02 0.03 0.03", "0.02 0 0"),
)
GRIP = (0.04, 1.0)  # place of grip and force sensor in the flange [m], their mass [kg]


@jit
def spread_impulse(Minv, v, j, impulse):
    """Add the effect of an impulse on joint j to all velocities."""
    for i in range(v.size):
        v[i] += Minv[i, j] * impulse


@jit
def advance(table, kinds, P, X, p, w, q, v, Minv, bias, u, h, steps):  # noqa: PLR0913  (a kernel's row)
    """Advance all joints by some steps h.

    p, w: position and velocity of the motors; q, v: those of the links; u: motor torque; bias: h + g, minus the torque of a hand.
    """
    J = q.size
    for _ in range(steps):
        for i in range(J):
            p[i] += 0.5 * h * w[i]
            q[i] += 0.5 * h * v[i]
        for i in range(J):
            c = table[K_C, i] * (p[i] - q[i]) + table[D_C, i] * (w[i] - v[i])
            w[i] += h / table[M_M, i] * (u[i] - c)
            X[i, X.shape[1] - 1] = c - bias[i]  # the torque on the link
        for i in range(J):
            spread_impulse(Minv, v, i, h * X[i, X.shape[1] - 1])
        for j in range(J):
            before = v[j]
            after = implicit_velocity(
                kinds[0, j], kinds[1, j], P[j], X[j], before, h, h * Minv[j, j], 0.0, (u[j], 0.0), 20.0
            )
            spread_impulse(Minv, v, j, (after - before) / Minv[j, j])
        for i in range(J):
            p[i] += 0.5 * h * w[i]
            q[i] += 0.5 * h * v[i]


def hp3j() -> tuple[JointSimulation, ...]:
    """Return the joints of the thesis' arm: 0 to 2 as in `plants.thesis`, 3 to 5 assumed in proportion to their torque."""
    joints = [
        make(compliant=True).replace(gravity_cos=0.0, torque_noise=0.0)
        for make in (joint_0, joint_1, joint_2)
    ]
    rotor = 1.66e-6  # of the 30 W class [kg.m^2]
    for i, (coulomb, growth, stiffness) in enumerate(
        ((1.6, 1.2, 2.5e4), (1.4, 1.0, 2.0e4), (1.0, 0.8, 1.5e4)), 3
    ):
        motor = rotor * RATIOS[i] ** 2 + 0.008
        joints.append(
            JointSimulation(
                name=f"joint_{i}",
                law=bent_curve(coulomb, growth),
                motor_inertia=motor,
                load_inertia=0.03,
                stiffness=stiffness,
                damping=0.1 * np.sqrt(stiffness * motor),
                encoder_count=2 * np.pi / COUNTS / RATIOS[i],
                torque_limit=LIMITS[i],
            )
        )
    return tuple(j.replace(friction_side="load") for j in joints)


def mjcf() -> str:
    """Return the arm's rigid bodies as MJCF."""
    opening, closing = [], []
    for i, (name, axis, place, mass, size, centre) in enumerate(LINKS):
        opening.append(
            f'<body name="{name}" pos="{place}"><joint name="joint_{i}" type="hinge" axis="{axis}"/>'
            f'<geom type="box" size="{size}" pos="{centre}" mass="{mass}"/>'
        )
        closing.append("</body>")
    grip = f'<site name="grip" pos="{GRIP[0]} 0 0"/><geom type="sphere" size="0.02" pos="{GRIP[0]} 0 0" mass="{GRIP[1]}"/>'
    return (
        '<mujoco model="arm"><compiler angle="radian" inertiafromgeom="true"/><option gravity="0 0 -9.81"><flag contact="disable"/>'
        f"</option><worldbody>{''.join(opening)}{grip}{''.join(closing)}</worldbody></mujoco>"
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmRecord:
    """The record of a simulation: arrays (n, J), SI.

    Attributes:
        time: of the ticks [s], (n,).
        reading: of the encoders.
        command: torque of the motors.
        compensation: of friction, a part of it.
        estimate: of the external torque.
        hand: true torque of the hand on every joint.
        force: of the hand on the grip, true [N], (n, 3).
        load: true positions of the links.
        moment: of the hand on the grip, true [N.m], (n, 3); None where the hand gives none.
        codes: `Status` of every motor; None where they were not kept.
        grip: true place of the grip [m], (n, 3); None where it was not kept.
    """

    time: np.ndarray
    reading: np.ndarray
    command: np.ndarray
    compensation: np.ndarray
    estimate: np.ndarray
    hand: np.ndarray
    force: np.ndarray
    load: np.ndarray
    moment: np.ndarray | None = None
    codes: np.ndarray | None = None
    grip: np.ndarray | None = None


class Arm:
    """A simulated arm, stepped tick by tick.

    Attributes:
        joints: motors, transmissions, friction.
        motor: positions on the motor's side [rad], (J,).
        motor_velocity: [rad/s], (J,).
        load: positions of the links [rad], (J,).
        load_velocity: [rad/s], (J,).
    """

    def __init__(
        self,
        joints: Sequence[JointSimulation] | None = None,
        *,
        posture: Sequence[float] = (0.0, 0.5, -1.0, 0.0, 0.5, 0.0),
        model: str | None = None,
    ):
        """Build the rigid bodies with all joints at rest, each transmission loaded by its weight.

        Args:
            joints: one a hinge of the model; None: those of the thesis.
            posture: where the links rest [rad], (J,).
            model: rigid bodies as MJCF; None: `mjcf()`.

        Raises:
            MissingExtra: mujoco is not installed.
            InvalidInput: joints or posture do not match the model, or a transmission is rigid.
        """
        mujoco = require("mujoco", "A simulated arm needs", "sim")
        self._mujoco = mujoco
        self.joints = tuple(joints or hp3j())
        self.model = mujoco.MjModel.from_xml_string(model or mjcf())
        self.data = mujoco.MjData(self.model)
        J = self.model.nv
        if len(self.joints) != J or len(posture) != J:
            raise InvalidInput(
                f"{len(self.joints)} joints and a posture of {len(posture)} for a model with {J} hinges.",
                remedy="Give one of each a hinge.",
            )
        if any(j.rigid for j in self.joints):
            raise InvalidInput(
                "A joint of an arm has a transmission that yields.",
                remedy="Give each `stiffness` and `damping`.",
            )
        laws = [j.law for j in self.joints]
        self._table = np.array(
            [
                [j.motor_inertia for j in self.joints],
                [j.stiffness for j in self.joints],
                [j.damping for j in self.joints],
            ]
        )
        self._kinds = np.array([[law.rate.KIND for law in laws], [law.element.KIND for law in laws]])
        self._advance = kernels.of_kinds(advance, *self._kinds)
        self._P = stack_rows([law.row() for law in laws])
        self._X = np.zeros((J, max(law.state().size for law in laws) + 1))
        self.load, self.load_velocity = np.array(posture, dtype=np.float64), np.zeros(J)
        weight = self.rigid(np.zeros(J))[1]
        self.motor = self.load + weight / self._table[K_C]
        self.motor_velocity = np.zeros(J)
        self.weight = weight

    def rigid(self, pushed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the inverse mass matrix [1/(kg.m^2)] and h + g less what pushes the links [N.m], where the links are now.

        Args:
            pushed: torque of a hand on every joint [N.m], (J,).
        """
        self.data.qpos[:], self.data.qvel[:] = self.load, self.load_velocity
        self._mujoco.mj_forward(self.model, self.data)
        M = np.zeros((self.model.nv, self.model.nv))
        self._mujoco.mj_fullM(self.model, self.data, M)
        return np.ascontiguousarray(np.linalg.inv(M)), self.data.qfrc_bias - pushed

    def step(
        self, command: np.ndarray, pushed: np.ndarray, period: float = 1e-3, substep: float = SUBSTEP
    ) -> None:
        """Advance the arm by one tick.

        Args:
            command: torque of the motors [N.m], (J,).
            pushed: torque of a hand on every joint [N.m], (J,).
            period: of the tick [s].
            substep: longest integration step [s].
        """
        Minv, bias = self.rigid(pushed)
        steps = int(np.ceil(period / substep - 1e-9))
        u = np.clip(command, [-j.torque_limit for j in self.joints], [j.torque_limit for j in self.joints])
        self._advance(
            self._table,
            self._kinds,
            self._P,
            self._X,
            self.motor,
            self.motor_velocity,
            self.load,
            self.load_velocity,
            Minv,
            np.ascontiguousarray(bias),
            u,
            period / steps,
            steps,
        )

    def reading(self) -> np.ndarray:
        """Return what the encoders read [rad], (J,)."""
        counts = np.array([j.encoder_count for j in self.joints])
        return counts * np.floor(self.motor / counts + 0.5)

    def turn(self) -> tuple[np.ndarray, np.ndarray]:
        """Return orientation, (3, 3), and Jacobian of the turn [1], (3, J), of the grip."""
        jacobian = np.zeros((3, self.model.nv))
        self._mujoco.mj_jacSite(self.model, self.data, None, jacobian, 0)
        return self.data.site_xmat[0].reshape(3, 3).copy(), jacobian

    def grip(self) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m], (3,), and Jacobian [m/rad], (3, J), of the grip."""
        jacobian = np.zeros((3, self.model.nv))
        self._mujoco.mj_jacSite(self.model, self.data, jacobian, None, 0)
        return self.data.site_xpos[0].copy(), jacobian


def local_servos(joints: Sequence[JointSimulation], bandwidth: float = 60.0) -> list[Servo]:
    """Return position controllers that hold joints, as the thesis does for joints that it does not examine.

    Args:
        joints: to hold.
        bandwidth: [rad/s].
    """
    return [Servo.from_bandwidth(j.inertia, bandwidth, filter_time=2e-3) for j in joints]


__all__ = ["Arm", "ArmRecord", "hp3j", "local_servos", "mjcf"]
