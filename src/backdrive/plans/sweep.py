"""The sweep: sines of equal stroke and growing speed, for identifying friction inside a small range (Iwatani 2017, 2.3)."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.plans._pieces import Pieces
from backdrive.plans.base import MotionPlan, Options, between, round_digits, settle, settle_count

#: Share of a cycle's top speed above which the motion is the sine of (2.4) itself. At 0.5 the glides between the cycles
#: stay below the peak acceleration of the last cycle, and windows from 0.8 on have room for a lagging joint.
PURE = 0.5
#: Largest number of slow cycles: the slowest of eight takes 256 times as long as the first regular cycle.
MOST_SLOW = 8
#: Mean of a cubic step's first half, as a share of the whole step, which divides a glide at the turning point.
_HALF = 3.0 / 16.0


@dataclass(frozen=True)
class Sweep(MotionPlan):
    """N cycles between the same two turning points, the n-th with top speed n V / N, and slower ones before.

    With the phase phi(t), which grows by 2 pi a cycle at the rate omega_n = 2 n V / (A N),

        q = center - A/2 cos(phi),   dq = A/2 sin(phi) phi',   ddq = A/2 (cos(phi) phi'^2 + sin(phi) phi'').

    In the printed sweep (Iwatani 2017, (2.2)-(2.4)) the rate jumps at the end of each cycle, and from rest. The acceleration
    then jumps from 2 n^2 V^2 / (A N^2) to its value for n + 1. Here the rate changes smoothly instead. It does so around each
    turning point, where the speed is below half of the cycle's top speed, and at start and end, from and to zero. Position,
    velocity and acceleration are continuous, the stroke is never exceeded, and no acceleration is above 2 V^2 / A. The motion
    begins and ends at rest at the center. `smooth=False` is the printed one.

    Attributes:
        stroke: A, full stroke, peak to peak [rad or m].
        top_speed: V, speed that the last cycle reaches [rad/s or m/s].
        cycles: N, number of cycles, one a speed.
        lead_in: from `start` to the first cycle [s]: the way from the center to the lower turning point (literal: rest
            there). By default 1 s, or longer if the motion would be too fast; literal: 0.
        smooth: False for the motion as printed.
        slow: number of cycles before the first, each half as fast as the next, for friction below V / N, such as a Stribeck
            peak.
    """

    stroke: float
    top_speed: float
    cycles: int
    _: KW_ONLY
    smooth: bool = True
    slow: int = 0

    kind: ClassVar[str] = "sweep"
    options: ClassVar[tuple[str, ...]] = (
        *("stroke", "top_speed", "top_speed_deg", "cycles"),
        *("slow", "literal", "bias", "time_slip", "centres"),
    )

    @classmethod
    def build(cls, options: Options, **common: Any) -> Sweep:
        """Return the sweep of options of the command line, of ten cycles where nothing else is asked."""
        stroke, top = options.need("stroke"), options.need("top_speed")
        smooth, slow = not options.subset("literal"), options.subset("slow")
        return cls(stroke, top, options.subset("cycles").get("cycles", 10), smooth=smooth, **slow, **common)

    def __post_init__(self):
        settle(self, positive=("stroke", "top_speed"), finite=("center", "start"))
        settle_count(self, "cycles")
        settle_count(self, "slow", MOST_SLOW, least=0)
        if self.lead_in is None:
            gentle = min(self._gentlest, max(1.0, 2.0 * self.stroke / self.top_speed))
            object.__setattr__(self, "lead_in", gentle if self.smooth else 0.0)
        settle(self, not_negative=("lead_in",))
        least = min(self._gentlest, 1.5 * self.stroke / self.top_speed)
        if self.smooth and self._lead < least:
            raise InvalidInput(
                f"Sweep.lead_in is {self.lead_in:g} s, too short to reach the first turning point gently.",
                remedy=f"Give at least {round_digits(least, 1):.4g} s, or nothing.",
            )

    @property
    def _gentlest(self) -> float:
        """Duration of a glide from rest at the center to the first cycle's rate that never overshoots it [s]."""
        return math.pi / self.frequencies[0]

    @property
    def speeds(self) -> np.ndarray:
        """Top speed of each cycle, slow ones first, then n V / N [rad/s or m/s], (slow + N,)."""
        steps = np.r_[0.5 ** np.arange(self.slow, 0, -1), np.arange(1, self.cycles + 1)]
        return steps * (self.top_speed / self.cycles)

    @property
    def frequencies(self) -> np.ndarray:
        """Angular frequency of each cycle, 2 n V / (A N) [rad/s], (slow + N,)."""
        return 2.0 * self.speeds / self.stroke

    @property
    def _glides(self) -> tuple[np.ndarray, np.ndarray]:
        """Durations of the glide to the next rate before and after each inner turning point [s], (N - 1,) each."""
        w, b = self.frequencies, math.asin(PURE)
        step = _HALF * np.diff(w)
        return b / (w[:-1] + step), b / (w[1:] - step)

    @cached_property
    def _turns(self) -> np.ndarray:
        """T_1 .. T_{N+1} of (2.3a), stretched by the glides, on the log's clock [s], (N + 1,)."""
        w = self.frequencies
        durations = 2.0 * np.pi / w
        if self.smooth:
            before, after = self._glides
            durations[:-1] += before - math.asin(PURE) / w[:-1]
            durations[1:] += after - math.asin(PURE) / w[1:]
        return self.start + self._lead + np.concatenate([[0.0], np.cumsum(durations)])

    @cached_property
    def _phase(self) -> Pieces:
        turns, w, b = self._turns, self.frequencies, math.asin(PURE)
        if not self.smooth:
            return Pieces.linear(turns, 2.0 * np.pi * np.arange(turns.size))
        first, last = float(w[0]), float(w[-1])
        glide = min(self._lead, self._gentlest)
        knots = [(turns[0] - glide, -0.5 * np.pi, 0.0, 0.0), (turns[0], 0.0, first, 0.0)]
        for n, (before, after) in enumerate(zip(*self._glides, strict=True), start=1):
            turn, middle = 2.0 * np.pi * n, 0.5 * (w[n - 1] + w[n])
            slope = 1.5 * (w[n] - w[n - 1]) / (before + after)
            knots += [
                (turns[n] - before, turn - b, w[n - 1], 0.0),
                (turns[n], turn, middle, slope),
                (turns[n] + after, turn + b, w[n], 0.0),
            ]
        end = 2.0 * np.pi * w.size
        knots += [(turns[-1], end, last, 0.0), (turns[-1] + np.pi / last, end + 0.5 * np.pi, 0.0, 0.0)]
        return Pieces.through(knots)

    def _motion(self, t: np.ndarray, order: int) -> np.ndarray:
        """Return (2.2), (2.4) or their derivative at instants t [s]."""
        phase, half = self._phase(t), 0.5 * self.stroke
        if order == 0:
            return self.center - half * np.cos(phase)
        if order == 1:
            return half * np.sin(phase) * self._phase(t, 1)
        return half * (np.cos(phase) * self._phase(t, 1) ** 2 + np.sin(phase) * self._phase(t, 2))

    def windows(self) -> np.ndarray:
        """Return the start and end of each cycle on the log's clock [s], (slow + N, 2); (2.3)."""
        return between(self._turns)

    @property
    def duration(self) -> float:
        """From rest to rest [s]; literal, without lead-in: pi A N / V sum(1/j), (2.15)."""
        out = np.pi / self.frequencies[-1] if self.smooth else 0.0
        return float(self._turns[-1] - self.start + out)

    @property
    def home(self) -> float:
        """Position at which it begins and ends at rest [rad or m]."""
        return self.center if self.smooth else self.center - 0.5 * self.stroke

    @property
    def peak_velocity(self) -> float:
        """Greatest speed, V [rad/s or m/s]."""
        return self.top_speed

    @property
    def peak_acceleration(self) -> float:
        """Greatest acceleration, 2 V^2 / A, at the turning points of the last cycle [rad/s^2 or m/s^2]."""
        return 2.0 * self.top_speed**2 / self.stroke
