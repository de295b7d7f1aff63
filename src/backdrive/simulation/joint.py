"""A simulated joint for tests: an axis of `backdrive.engine.axis` with an encoder, a servo and noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from backdrive.engine.axis import gravity
from backdrive.engine.forward import Axis
from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput
from backdrive.laws import Law
from backdrive.logs.log import Joint
from backdrive.parameters import ABOVE_ZERO, NOT_NEGATIVE, WithBounds

#: Names common to joint and axis.
MECHANICS = (
    "load_inertia", "stiffness", "damping", "gravity_sin", "gravity_cos", "friction_side", "load_dependence",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class JointSimulation(WithBounds):
    """A simulated joint with known parameters.

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
        torque_noise: standard deviation of the actuator's torque noise, drawn anew every tick [N.m or N].
        torque_limit: of the actuator [N.m or N].
        delay: time from the command to the torque [s].
        unit: `rad` or `m`.
    """

    BOUNDS: ClassVar = {
        "encoder_count": NOT_NEGATIVE,
        "torque_noise": NOT_NEGATIVE,
        "torque_limit": ABOVE_ZERO,
        "delay": NOT_NEGATIVE,
    }
    CHOICES: ClassVar = {"unit": ("rad", "m")}

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
        super().__post_init__()
        try:
            _ = self.axis
        except InvalidInput as error:
            raise InvalidInput(
                f"JointSimulation '{self.name}': {error.message}", remedy=error.remedy
            ) from error

    @property
    def rigid(self) -> bool:
        """Whether motor and load are one mass."""
        return bool(np.isinf(self.stiffness))

    @property
    def inertia(self) -> float:
        """Motor and load together [kg.m^2 or kg]."""
        return self.motor_inertia + self.load_inertia

    @cached_property
    def axis(self) -> Axis:
        """The joint without servo, encoder and noise."""
        return Axis(
            law=self.law, inertia=self.motor_inertia, **{name: getattr(self, name) for name in MECHANICS}
        )

    def weight(self, position: np.ndarray | float) -> np.ndarray:
        """Return the torque of gravity at positions of the load [rad or m] -> [N.m or N]."""
        return np.vectorize(gravity, otypes=[float], excluded=[0])(self.row(), position)

    def row(self) -> np.ndarray:
        """Return the parameters as the row that `engine.axis.advance` reads, (10,)."""
        return self.axis.row()

    def at_rest(self, position: float) -> np.ndarray:
        """Return the state of a joint whose motor rests at a position, the transmission bearing gravity, (5,)."""
        return self.axis.at(position)

    def as_joint(self) -> Joint:
        """Return what a log says of this joint."""
        counts = 1.0 / self.encoder_count if self.encoder_count > 0 else None
        return Joint(name=self.name, unit=self.unit, encoder_counts=counts)
