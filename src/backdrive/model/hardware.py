"""Data on the torque channel and on the actuator in a model; None where unknown."""

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
        long_run: standard deviation of the torque residual averaged over one second [N.m or N]; averaged over T seconds it is
            this divided by the root of T.
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
    """The actuator of the joint, with all values on the joint side.

    Attributes:
        torque_limit: largest torque of the actuator [N.m or N].
        trip_speed: speed above which the robot's own protection stops the joint [rad/s or m/s].
        gain: of the drive: torque at rest divided by the input [N.m or N per unit of the input]; negative if the signs differ.
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
