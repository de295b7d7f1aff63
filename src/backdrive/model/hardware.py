"""What a model knows of the channel that measured its torque, and of the actuator behind it; None where nobody knows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from backdrive.parameters import FINITE, NOT_NEGATIVE, POSITIVE, Bounds, WithBounds


@dataclass(frozen=True, kw_only=True)
class TorqueChannel(WithBounds):
    """How the torque was measured.

    Attributes:
        delay: by which torque was recorded later than motion [s]; negative for a command that acts after its sample.
        delay_error: standard error of it [s].
        noise: standard deviation of the noise from sample to sample [N.m or N].
        long_run: standard deviation of the mean, over one second, of what the model leaves of the torque [N.m or N]; over many
            seconds T it is this by the root of T.
    """

    BOUNDS: ClassVar[Bounds] = {
        "delay": FINITE,
        "delay_error": NOT_NEGATIVE,
        "noise": NOT_NEGATIVE,
        "long_run": NOT_NEGATIVE,
    }

    delay: float | None = None
    delay_error: float | None = None
    noise: float | None = None
    long_run: float | None = None


@dataclass(frozen=True, kw_only=True)
class Actuator(WithBounds):
    """What drives the joint, all on the joint side.

    Attributes:
        torque_limit: largest torque of the actuator [N.m or N].
        trip_speed: above which the robot's own protection stops it [rad/s or m/s].
        gain: of the drive, torque at rest by its input [N.m or N per unit of the input]; negative where the signs differ.
        motor_inertia: of the motor with its gear's input side [kg.m^2 or kg].
    """

    BOUNDS: ClassVar[Bounds] = {
        "torque_limit": POSITIVE,
        "trip_speed": POSITIVE,
        "gain": FINITE,
        "motor_inertia": NOT_NEGATIVE,
    }

    torque_limit: float | None = None
    trip_speed: float | None = None
    gain: float | None = None
    motor_inertia: float | None = None
