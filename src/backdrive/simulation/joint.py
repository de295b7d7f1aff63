"""A simulated joint to try things on: an axis of `backdrive.engine.axis` with an encoder, a servo and noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput
from backdrive.laws import Law
from backdrive.logs.log import Joint


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
        """Return the parameters as the row that `engine.axis.advance` reads, (10,)."""
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
                0.0,
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
