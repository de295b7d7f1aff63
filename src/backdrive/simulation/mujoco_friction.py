"""Any friction law on the joints of a MuJoCo model.

    q'' = M^-1 (... - tau_f),     tau_f: of the law, by the way from q(t - h) to q(t), held until t + h

While the joint sticks, friction held for a step acts on it like a spring and a damper. The joint comes to rest if

    K h^2 + D h <= I,     I = 1/(M^-1)_jj with the posture qpos0 of the model,

K and D: stiffness and damping of the law for small motion from rest [N.m/rad, N.m.s/rad]. A longer step h is divided. No
explicit step can hold a law without presliding at rest. Such a law gets a damped spring in series with its slider, as stiff as
the step permits: K h^2 = I/16, D h = I/2 (`with_spring`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive._jit import jit
from backdrive.errors import InvalidInput, require
from backdrive.laws import REFERENCE, Law, ViscoElastoplastic, kernels, with_element

if TYPE_CHECKING:
    from backdrive.model import FrictionModel

MOST_STEPS = 50  # that a step is divided into
SPRING, DAMPING = 1.0 / 16.0, 0.5  # K h^2/I and D h/I of what carries a law without presliding
LITTLE = 1e-12  # displacement that shows stiffness and damping at rest [rad or m]
LONG, SHORT = 1e-2, 1e-4  # durations of this displacement [s]
PURPOSE = "Friction in a simulation by MuJoCo needs"


def at_rest(law: Law) -> tuple[float, float]:
    """Return stiffness K and damping D against the first motion [N.m/rad, N.m.s/rad]; K is infinite without presliding."""
    step = kernels.of_kinds(kernels.step, law.rate.KIND, law.element.KIND)

    def torque(way: float, time: float) -> float:
        loads = law.usual_load
        return float(
            step(law.rate.KIND, law.element.KIND, law.row(), law.state(), way, time, loads, REFERENCE)
        )

    slow, fast = torque(LITTLE, LONG), torque(LITTLE, SHORT)
    if slow > 0.0 and torque(0.5 * LITTLE, LONG) > 0.9 * slow:  # it jumps
        return math.inf, 0.0
    D = max(fast - slow, 0.0) / LITTLE / (1.0 / SHORT - 1.0 / LONG)
    return max(slow / LITTLE - D / LONG, 0.0), D


def longest_step(law: Law, inertia: float) -> float:
    """Return the longest step with which a joint comes to rest under a law with held torque [s]; 0 without presliding.

    Args:
        law: of its friction.
        inertia: I that the joint moves [kg.m^2 or kg].
    """
    K, D = at_rest(law)
    if not math.isfinite(K):
        return 0.0
    if K == 0.0:
        return inertia / D if D > 0.0 else math.inf
    return (math.sqrt(D * D + 4.0 * K * inertia) - D) / (2.0 * K)


def with_spring(law: Law, inertia: float, step: float) -> Law:
    """Return a law that rests under a torque that is held: itself, or one without presliding behind a damped spring.

    Args:
        law: of its friction.
        inertia: I that the joint moves [kg.m^2 or kg].
        step: that the torque is held for [s].
    """
    if math.isfinite(at_rest(law)[0]):
        return law
    element = ViscoElastoplastic(stiffness=SPRING * inertia / step**2, damping=DAMPING * inertia / step)
    return with_element(law, element)


@dataclass(frozen=True, kw_only=True)
class Dof:
    """A joint of a MuJoCo model that has friction.

    Attributes:
        name: of the joint.
        q: its place in `qpos`.
        v: its place in `qvel`.
        law: of its friction, as it runs.
        steps: number of parts that a step must be divided into for this joint.
    """

    name: str
    q: int
    v: int
    law: Law
    steps: int


def dofs(model: FrictionModel, simulated: Any, joints: Sequence[str] | None = None) -> list[Dof]:
    """Return the joints of a friction model in a MuJoCo model, with their laws.

    Args:
        model: of friction.
        simulated: `mujoco.MjModel`.
        joints: names; None: all of the friction model.

    Raises:
        InvalidInput: a joint is not there, neither turns nor slides, has friction of MuJoCo already, or its friction is too
            stiff for the step.
        MissingExtra: MuJoCo is not installed.
    """
    mujoco = require("mujoco", PURPOSE, "sim")
    known = [mujoco.mj_id2name(simulated, mujoco.mjtObj.mjOBJ_JOINT, i) for i in range(simulated.njnt)]
    single = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    step = float(simulated.opt.timestep)
    result = []
    for name in joints or model.names:
        law = model.joint(name).law
        if name not in known:
            named = ", ".join(n for n in known if n) or "none with a name"
            raise InvalidInput(f"The MuJoCo model has no joint '{name}'.", remedy=f"It has {named}.")
        at = known.index(name)
        if int(simulated.jnt_type[at]) not in single:
            raise InvalidInput(
                f"Joint '{name}' is a ball or a free joint.", remedy="Leave it out of `joints`."
            )
        v = int(simulated.jnt_dofadr[at])
        if simulated.dof_frictionloss[v] > 0.0:
            raise InvalidInput(
                f"Joint '{name}' has a frictionloss of {simulated.dof_frictionloss[v]:g} beside the law.",
                remedy="Set frictionloss (and damping, where the law has it) to 0 in the MJCF.",
            )
        weight = float(np.ravel(simulated.dof_invweight0)[v])
        inertia = 1.0 / weight if weight > 0.0 else math.inf
        law = with_spring(law, inertia, step)
        steps = max(math.ceil(step / longest_step(law, inertia) - 1e-9), 1)
        if steps > MOST_STEPS:
            K, D = at_rest(law)
            raise InvalidInput(
                f"Joint '{name}' does not come to rest with a step of {step:g} s, even if it is divided into "
                f"{MOST_STEPS}: its law has K = {K:.3g} and D = {D:.3g}, its inertia is {inertia:.3g}.",
                remedy=f"Set a timestep of at most {MOST_STEPS * longest_step(law, inertia):.2g} s, or a softer element.",
            )
        result.append(Dof(name=name, q=int(simulated.jnt_qposadr[at]), v=v, law=law, steps=steps))
    return result


@jit
def torques(kinds, sizes, P, X, dp, dt, loads, temp, out):
    """Friction torque of all joints after a step, and their states."""
    for j in range(out.size):
        out[j] = kernels.step(
            kinds[0, j],
            kinds[1, j],
            P[j, : sizes[0, j]],
            X[j, : sizes[1, j]],
            dp[j],
            dt,
            (loads[j, 0], loads[j, 1]),
            temp,
        )


class MujocoFriction:
    """Steps a MuJoCo simulation with friction of any law on its joints.

        friction = MujocoFriction(load_model("model.json"), simulated, data)
        data.ctrl[:] = ...
        friction.step()

    The load of a law is that of the previous step: the actuators' torque, and all other torque on the joint.

    Args:
        model: of friction; joints are matched by name.
        simulated: `mujoco.MjModel`, without friction of its own on these joints.
        data: `mujoco.MjData` of it.
        joints: names; None: all of the friction model.
        temperature: of the joints [degC].

    Attributes:
        joints: `Dof` of each joint.
        steps: that a step of the model is divided into.
        torque: friction torque that acts [N.m or N], (J,).

    Raises:
        InvalidInput: as `dofs`, or the integrator is Runge and Kutta's.
        MissingExtra: MuJoCo is not installed.
    """

    def __init__(
        self,
        model: FrictionModel,
        simulated: Any,
        data: Any,
        *,
        joints: Sequence[str] | None = None,
        temperature: float = REFERENCE,
    ):
        self._mujoco = require("mujoco", PURPOSE, "sim")
        self.joints = tuple(dofs(model, simulated, joints))
        self.steps = max(d.steps for d in self.joints)
        self._simulated, self._data, self._temperature = simulated, data, temperature
        laws = [d.law for d in self.joints]
        self._q, self._v = np.array([d.q for d in self.joints]), np.array([d.v for d in self.joints])
        self._kinds = np.array([[law.rate.KIND for law in laws], [law.element.KIND for law in laws]])
        self._torques = kernels.of_kinds(torques, *self._kinds)
        self._sizes = np.array([[law.row().size for law in laws], [law.state().size for law in laws]])
        self._rows = np.zeros((len(laws), self._sizes[0].max()))
        for row, law in zip(self._rows, laws, strict=True):
            row[: law.row().size] = law.row()
        self._states = np.zeros((len(laws), self._sizes[1].max()))
        self.torque = np.zeros(len(laws))
        self.reset()

    def reset(self) -> None:
        """Reset all friction to the relaxed state at the positions of the data."""
        self._states[:], self.torque[:] = 0.0, 0.0
        self._before = self._data.qpos[self._q].copy()

    def step(self, n: int = 1) -> None:
        """Advance the simulation by some steps of its model.

        Args:
            n: how many.
        """
        data, option = self._data, self._simulated.opt
        whole, own = float(option.timestep), data.qfrc_applied[self._v].copy()
        option.timestep = whole / self.steps
        try:
            for _ in range(n * self.steps):
                self._advance(option.timestep)
                data.qfrc_applied[self._v] = own - self.torque
                self._mujoco.mj_step(self._simulated, data)
        finally:
            option.timestep = whole
            data.qfrc_applied[self._v] = own

    def _advance(self, dt: float) -> None:
        """Compute the torque that acts during the next step."""
        data, v = self._data, self._v
        motor = data.qfrc_actuator[v]
        external = data.qfrc_smooth[v] + data.qfrc_constraint[v] + self.torque - motor
        q = data.qpos[self._q]
        self._torques(
            self._kinds, self._sizes, self._rows, self._states, q - self._before, dt,
            np.stack([motor, external], axis=1), self._temperature, self.torque,
        )  # fmt: skip
        self._before = q
