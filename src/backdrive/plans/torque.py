"""Torque commands that swing: a sine and a saw-tooth. They show friction at many speeds, but do not bound the motion."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.plans._pieces import Pieces
from backdrive.plans.base import instants, settle, settle_count


@dataclass(frozen=True)
class SineTorque:
    """A sinusoidal torque, tau = offset + amplitude sin(2 pi f (t - start)).

    How far the joint moves is left to its inertia and friction, so the amplitude must be chosen with care (Iwatani 2017,
    2.2): begin small.

    Attributes:
        amplitude: of the torque [N.m or N].
        frequency: f [Hz].
        cycles: number of periods.
        offset: torque about which it swings, such as gravity's; also held before and after [N.m or N].
        start: instant at which the plan begins, on the log's clock [s].
        joint: its name.
        unit: `rad` or `m`.
    """

    amplitude: float
    frequency: float
    cycles: int
    _: KW_ONLY
    offset: float = 0.0
    start: float = 0.0
    joint: str = "joint"
    unit: Literal["rad", "m"] = "rad"

    kind: ClassVar[str] = "sine-torque"
    commands: ClassVar[str] = "torque"

    def __post_init__(self):
        settle(self, positive=("amplitude", "frequency"), finite=("offset", "start"))
        settle_count(self, "cycles")

    def torque(self, t: Any) -> np.ndarray:
        """Return the commanded torque [N.m or N] at instants t [s], any shape."""
        x = np.clip(instants(t) - self.start, 0.0, self.duration)
        return (self.offset + self.amplitude * np.sin(2.0 * np.pi * np.mod(self.frequency * x, 1.0)))[()]

    def windows(self) -> np.ndarray:
        """Return begin and end of each period on the log's clock [s], (cycles, 2)."""
        return _periods(self.start, 1.0 / self.frequency, self.cycles)

    @property
    def duration(self) -> float:
        """From the first to the last instant at which the torque changes [s]."""
        return self.cycles / self.frequency

    @property
    def largest_torque(self) -> float:
        """Largest magnitude of the command [N.m or N]."""
        return self.amplitude + abs(self.offset)

    def free_travel(self, inertia: float) -> float:
        """Return how far a joint without friction would travel in one period from rest [rad or m].

        Friction shortens it: it is a bound for the first swing.

        Args:
            inertia: about the joint [kg.m^2 or kg].
        """
        return self.amplitude / (2.0 * math.pi * inertia * self.frequency**2)


@dataclass(frozen=True)
class SawtoothTorque:
    """A torque that goes up and down along straight lines, starting and ending at the offset.

    Attributes:
        amplitude: of the torque [N.m or N].
        frequency: [Hz].
        cycles: number of periods.
        rise: share of a period in which it rises [-]; 0.5 is a triangle.
        offset: torque about which it swings, also held before and after [N.m or N].
        start: instant at which the plan begins, on the log's clock [s].
        joint: its name.
        unit: `rad` or `m`.
    """

    amplitude: float
    frequency: float
    cycles: int
    _: KW_ONLY
    rise: float = 0.5
    offset: float = 0.0
    start: float = 0.0
    joint: str = "joint"
    unit: Literal["rad", "m"] = "rad"

    kind: ClassVar[str] = "sawtooth-torque"
    commands: ClassVar[str] = "torque"

    def __post_init__(self):
        settle(self, positive=("amplitude", "frequency", "rise"), finite=("offset", "start"))
        settle_count(self, "cycles")
        if not 0.01 <= self.rise <= 0.99:
            raise InvalidInput(
                f"SawtoothTorque.rise is {self.rise:g}.",
                remedy="Give a share from 0.01 to 0.99: a torque that jumps shakes the joint.",
            )

    @cached_property
    def _torque(self) -> Pieces:
        shape = np.array([0.0, 0.5 * self.rise, 1.0 - 0.5 * self.rise])
        times = np.append((np.arange(self.cycles)[:, None] + shape).ravel(), self.cycles) / self.frequency
        values = np.append(np.tile([0.0, 1.0, -1.0], self.cycles), 0.0)
        return Pieces.linear(self.start + times, self.offset + self.amplitude * values)

    def torque(self, t: Any) -> np.ndarray:
        """Return the commanded torque [N.m or N] at instants t [s], any shape."""
        return self._torque(instants(t))[()]

    def windows(self) -> np.ndarray:
        """Return begin and end of each period on the log's clock [s], (cycles, 2)."""
        return _periods(self.start, 1.0 / self.frequency, self.cycles)

    @property
    def duration(self) -> float:
        """From the first to the last instant at which the torque changes [s]."""
        return self.cycles / self.frequency

    @property
    def largest_torque(self) -> float:
        """Largest magnitude of the command [N.m or N]."""
        return self.amplitude + abs(self.offset)

    def free_travel(self, inertia: float) -> float:
        """Return how far a joint without friction would travel in one period from rest [rad or m].

        Args:
            inertia: about the joint [kg.m^2 or kg].
        """
        half = 0.5 / self.frequency
        return self.amplitude * half**2 * (2.0 - self.rise) / (3.0 * inertia)


@dataclass(frozen=True)
class TorqueRamp:
    """A torque that rises and falls at one rate, up, down through zero, and back: for presliding and break-away.

    Below break-away the joint creeps by micrometres or millidegrees along a hysteresis loop whose slope is the presliding
    stiffness (Iwatani 2017, 3.2.2, Fig. 3.3); the first rise is the virgin curve, the following cycles close the loop.

    Attributes:
        peak: largest torque, above the break-away torque if that is to be seen [N.m or N].
        rate: of change; slow, so that inertia plays no part [N.m/s or N/s].
        cycles: times up and down.
        offset: torque about which it swings, such as gravity's [N.m or N].
        start: instant at which the plan begins, on the log's clock [s].
        lead_in: time at the offset before the first rise, to see the noise [s].
        joint: its name.
        unit: `rad` or `m`.
    """

    peak: float
    rate: float
    cycles: int = 2
    _: KW_ONLY
    offset: float = 0.0
    start: float = 0.0
    lead_in: float = 1.0
    joint: str = "joint"
    unit: Literal["rad", "m"] = "rad"

    kind: ClassVar[str] = "ramp"
    commands: ClassVar[str] = "torque"

    def __post_init__(self):
        settle(self, positive=("peak", "rate"), not_negative=("lead_in",), finite=("offset", "start"))
        settle_count(self, "cycles")

    @cached_property
    def _turns(self) -> np.ndarray:
        quarter = self.peak / self.rate
        peaks = (2.0 * np.arange(2 * self.cycles) + 1.0) * quarter
        return self.start + self.lead_in + np.concatenate([[0.0], peaks, [4.0 * self.cycles * quarter]])

    @cached_property
    def _torque(self) -> Pieces:
        values = np.concatenate([[0.0], np.tile([self.peak, -self.peak], self.cycles), [0.0]])
        return Pieces.linear(self._turns, self.offset + values)

    def torque(self, t: Any) -> np.ndarray:
        """Return the commanded torque [N.m or N] at instants t [s], any shape."""
        return self._torque(instants(t))[()]

    def windows(self) -> np.ndarray:
        """Return begin and end of each rise and fall on the log's clock [s], (2 cycles + 1, 2); the first is virgin."""
        return np.column_stack([self._turns[:-1], self._turns[1:]])

    @property
    def duration(self) -> float:
        """From `start` to the last instant at which the torque changes [s]."""
        return float(self._turns[-1] - self.start)

    @property
    def largest_torque(self) -> float:
        """Largest magnitude of the command [N.m or N]."""
        return self.peak + abs(self.offset)


def _periods(start: float, period: float, cycles: int) -> np.ndarray:
    edges = start + period * np.arange(cycles + 1)
    return np.column_stack([edges[:-1], edges[1:]])
