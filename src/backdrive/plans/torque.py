"""Periodic torque commands: a sine and a saw-tooth. They excite many speeds, but do not bound the motion."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.plans._pieces import Pieces
from backdrive.plans.base import Options, Plan, between, instants, settle, settle_count


@dataclass(frozen=True, kw_only=True)
class TorquePlan(Plan):
    """A torque that swings about an offset; each subclass defines `_torque` and `_height`.

    Attributes:
        offset: torque about which it swings, such as gravity's; also held before and after [N.m or N].
    """

    offset: float = 0.0

    commands: ClassVar[str] = "torque"
    if TYPE_CHECKING:

        @property
        def _height(self) -> float: ...

        def _torque(self, t: np.ndarray) -> np.ndarray: ...

    def torque(self, t: Any) -> np.ndarray:
        """Return the commanded torque [N.m or N] at instants t [s], any shape."""
        return self._torque(instants(t))[()]

    @property
    def largest_torque(self) -> float:
        """Largest magnitude of the command [N.m or N]."""
        return self._height + abs(self.offset)


@dataclass(frozen=True)
class Swinging(TorquePlan):
    """A periodic torque.

    Attributes:
        amplitude: of the torque [N.m or N].
        frequency: f [Hz].
        cycles: number of periods.
    """

    amplitude: float
    frequency: float
    cycles: int = 5

    def __post_init__(self):
        settle(self, positive=("amplitude", "frequency"), finite=("offset", "start"))
        settle_count(self, "cycles")

    def windows(self) -> np.ndarray:
        """Return the start and end of each period on the log's clock [s], (cycles, 2)."""
        return between(self.start + 1.0 / self.frequency * np.arange(self.cycles + 1))

    @property
    def duration(self) -> float:
        """From the first to the last instant at which the torque changes [s]."""
        return self.cycles / self.frequency

    @property
    def _height(self) -> float:
        return self.amplitude


@dataclass(frozen=True)
class SineTorque(Swinging):
    """A sinusoidal torque, tau = offset + amplitude sin(2 pi f (t - start)).

    The travel of the joint depends on its inertia and friction, so begin with a small amplitude (Iwatani 2017, 2.2).
    """

    kind: ClassVar[str] = "sine-torque"
    options: ClassVar[tuple[str, ...]] = ("amplitude", "frequency", "cycles", "offset", "inertia")

    def _torque(self, t: np.ndarray) -> np.ndarray:
        x = np.clip(t - self.start, 0.0, self.duration)
        return self.offset + self.amplitude * np.sin(2.0 * np.pi * np.mod(self.frequency * x, 1.0))

    def free_travel(self, inertia: float) -> float:
        """Return how far a joint without friction would travel in one period from rest [rad or m].

        Friction shortens it: it is a bound for the first swing.

        Args:
            inertia: about the joint [kg.m^2 or kg].
        """
        return self.amplitude / (2.0 * math.pi * inertia * self.frequency**2)


@dataclass(frozen=True)
class SawtoothTorque(Swinging):
    """A torque that goes up and down along straight lines, starting and ending at the offset.

    Attributes:
        rise: share of a period in which it rises [-]; 0.5 is a triangle.
    """

    _: KW_ONLY
    rise: float = 0.5

    kind: ClassVar[str] = "sawtooth-torque"
    options: ClassVar[tuple[str, ...]] = ("amplitude", "frequency", "cycles", "offset", "rise", "inertia")

    def __post_init__(self):
        super().__post_init__()
        settle(self, positive=("rise",))
        if not 0.01 <= self.rise <= 0.99:
            raise InvalidInput(
                f"SawtoothTorque.rise is {self.rise:g}.",
                remedy="Give a share from 0.01 to 0.99, since a torque step would shake the joint.",
            )

    def _torque(self, t: np.ndarray) -> np.ndarray:
        return self._pieces(t)

    @cached_property
    def _pieces(self) -> Pieces:
        shape = np.array([0.0, 0.5 * self.rise, 1.0 - 0.5 * self.rise])
        times = np.append((np.arange(self.cycles)[:, None] + shape).ravel(), self.cycles) / self.frequency
        values = np.append(np.tile([0.0, 1.0, -1.0], self.cycles), 0.0)
        return Pieces.linear(self.start + times, self.offset + self.amplitude * values)

    def free_travel(self, inertia: float) -> float:
        """Return how far a joint without friction would travel in one period from rest [rad or m].

        Args:
            inertia: about the joint [kg.m^2 or kg].
        """
        half = 0.5 / self.frequency
        return self.amplitude * half**2 * (2.0 - self.rise) / (3.0 * inertia)


@dataclass(frozen=True)
class TorqueRamp(TorquePlan):
    """A torque that rises and falls at one rate, up, down through zero, and back: for presliding and break-away.

    Below break-away the joint creeps by micrometres or millidegrees along a hysteresis loop whose slope is the presliding
    stiffness (Iwatani 2017, 3.2.2, Fig. 3.3); the first rise is the virgin curve, the following cycles close the loop.

    Attributes:
        peak: largest torque; it must exceed the break-away torque to identify that [N.m or N].
        rate: rate of change; slow, so that inertia is negligible [N.m/s or N/s].
        cycles: times up and down.
        lead_in: time at the offset before the first rise, to see the noise [s].
    """

    peak: float
    rate: float
    cycles: int = 2
    _: KW_ONLY
    lead_in: float = 1.0

    kind: ClassVar[str] = "ramp"
    options: ClassVar[tuple[str, ...]] = ("amplitude", "torque_rate", "cycles", "offset", "lead_in")

    @classmethod
    def build(cls, options: Options, **common: Any) -> TorqueRamp:
        """Return the ramp of options of the command line."""
        peak, rate = options.need("amplitude"), options.need("torque_rate")
        return cls(peak, rate, **options.subset("cycles", "offset", "lead_in"), **common)

    def __post_init__(self):
        settle(self, positive=("peak", "rate"), not_negative=("lead_in",), finite=("offset", "start"))
        settle_count(self, "cycles")

    @cached_property
    def _turns(self) -> np.ndarray:
        quarter = self.peak / self.rate
        peaks = (2.0 * np.arange(2 * self.cycles) + 1.0) * quarter
        return self.start + self.lead_in + np.concatenate([[0.0], peaks, [4.0 * self.cycles * quarter]])

    def _torque(self, t: np.ndarray) -> np.ndarray:
        return self._pieces(t)

    @cached_property
    def _pieces(self) -> Pieces:
        values = np.concatenate([[0.0], np.tile([self.peak, -self.peak], self.cycles), [0.0]])
        return Pieces.linear(self._turns, self.offset + values)

    def windows(self) -> np.ndarray:
        """Return the start and end of each rise and fall on the log's clock [s], (2 cycles + 1, 2); the first is virgin."""
        return between(self._turns)

    @property
    def duration(self) -> float:
        """From `start` to the last instant at which the torque changes [s]."""
        return float(self._turns[-1] - self.start)

    @property
    def _height(self) -> float:
        return self.peak
