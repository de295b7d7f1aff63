"""A simulated joint: motor and load, a transmission that may yield, gravity, and friction that truly sticks.

    M w' = u - c - [friction]            c = K_c (p - q) + D_c (w - v)
    L v' = c - a sin q - b cos q - [friction]

p, w: position and velocity on the motor's side, where the encoder is; q, v: on the load's side. The friction acts on the
one side or on the other (Iwatani 2017, Fig. 3.2: on the load's). A rigid transmission makes the two one mass.
Gravity is (2.10), which has a = 0, b = M L g for a joint angle measured from the horizontal.

A step drifts half a step, kicks, and drifts half a step again; the kick is implicit in the friction
(`laws.kernels.solve`), so that a held mass rests exactly. Friction may grow with the load that the transmission carries:
its bounds are widened by mu |c|, which in an implicit step is a shrinkage of the free velocity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from backdrive._jit import jit
from backdrive.errors import InvalidInput
from backdrive.laws import Law, kernels
from backdrive.log import Joint
from backdrive.plants.servo import Servo

STATES = 5  # p, w, q, v, c
TEMPERATURE = 20.0  # degC


@jit
def gravity(j, q):
    """Torque of gravity at the load's position q."""
    a, b = j[4], j[5]
    if a == 0.0 and b == 0.0:
        return 0.0
    return a * np.sin(q) + b * np.cos(q)


@jit
def held(rate, element, p, x, v_free, h, dt_over_m, widening, load):
    """Velocity of a mass at the end of a step h under friction whose bounds are wider by `widening` >= 0."""
    shrinkage = dt_over_m * widening
    if abs(v_free) <= shrinkage:
        v_free = 0.0
    elif v_free > 0.0:
        v_free -= shrinkage
    else:
        v_free += shrinkage
    v = kernels.solve(rate, element, p, x, v_free, h, dt_over_m, load, TEMPERATURE)
    if element > 1:
        kernels.step(rate, element, p, x, v * h, h, load, TEMPERATURE)
    return v


@jit
def advance(j, s, rate, element, p, x, u, h, load):
    """Advance the state `s` of the joint `j` by one step h under the torque u, in place.

    `rate`, `element`, `p`, `x` are the friction law and its state; `load` is scratch for the pair of motor-side and
    external torque that load-dependent laws see.
    """
    M, L, K_c, D_c, rigid, on_load, mu = j[0], j[1], j[2], j[3], j[6], j[7], j[8]
    half = 0.5 * h
    load[0], load[1] = u, -s[4]
    widening = mu * abs(s[4])
    w = s[1]
    if rigid > 0.0:
        middle = s[0] + half * w
        g = gravity(j, middle)
        dt_over_m = h / (M + L)
        s[1] = held(rate, element, p, x, w + dt_over_m * (u - g), h, dt_over_m, widening, load)
        s[0] = middle + half * s[1]
        s[2], s[3] = s[0], s[1]
        s[4] = g + L * (s[1] - w) / h
        return
    v = s[3]
    middle_p, middle_q = s[0] + half * w, s[2] + half * v
    c = K_c * (middle_p - middle_q) + D_c * (w - v)
    s[1] = w + h / M * (u - c)
    s[3] = v + h / L * (c - gravity(j, middle_q))
    if on_load > 0.0:
        s[3] = held(rate, element, p, x, s[3], h, h / L, widening, load)
    else:
        s[1] = held(rate, element, p, x, s[1], h, h / M, widening, load)
    s[0] = middle_p + half * s[1]
    s[2] = middle_q + half * s[3]
    s[4] = c


@dataclass(frozen=True, kw_only=True)
class SimulatedJoint:
    """A joint to try things on, with everything that is true about it known.

    Attributes:
        name: of the joint.
        law: its friction.
        servo: its position loop; None for a joint that is only driven by torque.
        motor_inertia: of the motor's side, seen from the joint [kg.m^2 or kg].
        load_inertia: of the load's side [kg.m^2 or kg].
        stiffness: K_c of the transmission [N.m/rad or N/m]; infinite for a rigid one.
        damping: D_c of the transmission [N.m.s/rad or N.s/m].
        gravity_sin: a of gravity a sin q + b cos q [N.m or N].
        gravity_cos: b of the same [N.m or N].
        friction_side: which mass the friction acts on.
        load_dependence: mu, growth of the Coulomb bounds with the magnitude of the transmitted torque [-].
        encoder_count: smallest step of the motor-side encoder [rad or m]; 0 for a perfect one.
        torque_noise: standard deviation of what the actuator gives beyond its command, new every tick [N.m or N].
        torque_limit: of the actuator [N.m or N].
        delay: time from the command to the torque [s].
        unit: `rad` or `m`.
    """

    name: str
    law: Law
    servo: Servo | None = None
    motor_inertia: float
    load_inertia: float = 0.0
    stiffness: float = np.inf
    damping: float = 0.0
    gravity_sin: float = 0.0
    gravity_cos: float = 0.0
    friction_side: Literal["motor", "load"] = "motor"
    load_dependence: float = 0.0
    encoder_count: float = 0.0
    torque_noise: float = 0.0
    torque_limit: float = np.inf
    delay: float = 0.0
    unit: Literal["rad", "m"] = "rad"

    def __post_init__(self):
        self._require("motor_inertia", self.motor_inertia > 0, "it must be positive")
        for name in ("load_inertia", "damping", "load_dependence", "encoder_count", "torque_noise", "delay"):
            value = getattr(self, name)
            self._require(name, 0.0 <= value < np.inf, "it must be finite and not negative")
        for name in ("gravity_sin", "gravity_cos"):
            self._require(name, np.isfinite(getattr(self, name)), "it must be finite")
        for name in ("stiffness", "torque_limit"):
            self._require(name, getattr(self, name) > 0, "it must be positive")
        self._require("friction_side", self.friction_side in ("motor", "load"), "it is 'motor' or 'load'")
        self._require("unit", self.unit in ("rad", "m"), "it is 'rad' or 'm'")
        if not self.rigid:
            self._require("load_inertia", self.load_inertia > 0, "a compliant transmission carries a load")

    def _require(self, name: str, holds: bool, rule: str) -> None:
        if not holds:
            raise InvalidInput(
                f"Simulated joint '{self.name}': {name} = {getattr(self, name)!r}, but {rule}.",
                remedy="Give SI values.",
            )

    @property
    def rigid(self) -> bool:
        """Whether motor and load are one mass."""
        return bool(np.isinf(self.stiffness))

    @property
    def inertia(self) -> float:
        """Motor and load together [kg.m^2 or kg]."""
        return self.motor_inertia + self.load_inertia

    def replace(self, **changes: Any) -> SimulatedJoint:
        """Return a copy with some fields changed."""
        return replace(self, **changes)

    def gravity(self, position: np.ndarray | float) -> np.ndarray:
        """Return the torque of gravity at positions of the load [rad or m] -> [N.m or N]."""
        q = np.asarray(position, dtype=np.float64)
        return self.gravity_sin * np.sin(q) + self.gravity_cos * np.cos(q)

    def row(self) -> np.ndarray:
        """Return the parameters as the row that `advance` reads, (9,)."""
        return np.array(
            [
                self.motor_inertia,
                self.load_inertia,
                0.0 if self.rigid else self.stiffness,
                self.damping,
                self.gravity_sin,
                self.gravity_cos,
                float(self.rigid),
                float(self.friction_side == "load"),
                self.load_dependence,
            ]
        )

    def at_rest(self, position: float) -> np.ndarray:
        """Return the state of a joint whose motor rests at a position, the transmission bearing gravity, (5,)."""
        q = position
        if not self.rigid:
            for _ in range(50):  # K_c (p - q) = g(q) contracts by g'/K_c, far below 1
                q = position - float(self.gravity(q)) / self.stiffness
        return np.array([position, 0.0, q, 0.0, float(self.gravity(q))])

    def as_joint(self) -> Joint:
        """Return what a log says of this joint."""
        counts = 1.0 / self.encoder_count if self.encoder_count > 0 else None
        return Joint(name=self.name, unit=self.unit, encoder_counts=counts)
