"""Runs at constant velocity, both directions, inside a stroke."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.parameters import POSITIVE
from backdrive.plans._pieces import Pieces
from backdrive.plans.base import MotionPlan, Options, phrase, round_digits, settle

#: Least share of the stroke that a run must have at constant speed.
STEADY = 0.2
MOST_SPEEDS = 1000


@dataclass(frozen=True)
class ConstantVelocity(MotionPlan):
    """For each speed one run up and one run down the stroke, with a stretch of constant velocity in the middle.

    The classical method for a friction curve, with which Iwatani 2017, 2.2 compares. The speed rises and falls along a cubic,
    so the acceleration is continuous and at most `ramp_acceleration`. The faster the run, the smaller the part of the stroke
    at constant speed, so a sweep needs less range.

    Attributes:
        stroke: full stroke, peak to peak [rad or m].
        speeds: of the runs, each driven in both directions [rad/s or m/s].
        ramp_acceleration: greatest acceleration [rad/s^2 or m/s^2]; by default 4 V^2 / A, with the highest speed V.
        pause: rest between runs [s].
        lead_in: duration of the ways from the center to the end of the stroke and back [s]; by default gentle.
    """

    stroke: float
    speeds: tuple[float, ...]
    _: KW_ONLY
    ramp_acceleration: float | None = None
    pause: float = 0.2

    kind: ClassVar[str] = "constant-velocity"
    options: ClassVar[tuple[str, ...]] = (
        *("stroke", "top_speed", "top_speed_deg", "cycles"),
        *("speeds", "ramp_acceleration", "pause"),
    )

    @classmethod
    def build(cls, options: Options, **common: Any) -> ConstantVelocity:
        """Return the runs of options of the command line: speeds, or a top speed and how many."""
        stroke, speeds = options.need("stroke"), options.subset("speeds").get("speeds")
        if speeds is None:
            count = options.subset("cycles").get("cycles", 10)
            if count < 1:
                raise InvalidInput(f"--cycles is {count}.", remedy="Give a whole number from 1 on.")
            top = options.need("top_speed")
            speeds = [top * n / count for n in range(1, count + 1)]
        elif options.subset("cycles", "top_speed", "top_speed_deg"):
            raise InvalidInput(
                "--speeds cannot be combined with --top-speed or --cycles.", remedy="Give one or the other."
            )
        return cls(stroke, tuple(speeds), **options.subset("ramp_acceleration", "pause"), **common)

    def __post_init__(self):
        settle(self, positive=("stroke",), not_negative=("pause",), finite=("center", "start"))
        try:
            speeds = tuple(float(v) for v in self.speeds)
        except (TypeError, ValueError):
            speeds = ()
        if not 1 <= len(speeds) <= MOST_SPEEDS or not all(POSITIVE.holds(v) for v in speeds):
            raise InvalidInput(
                f"ConstantVelocity.speeds is {str(self.speeds)[:60]}.",
                remedy="Give at least one speed above zero; each is driven in both directions.",
            )
        object.__setattr__(self, "speeds", speeds)
        if self.ramp_acceleration is None:
            object.__setattr__(self, "ramp_acceleration", 4.0 * max(speeds) ** 2 / self.stroke)
        settle(self, positive=("ramp_acceleration",))
        fastest = max(speeds)
        least = 1.5 * fastest**2 / self.peak_acceleration / (1.0 - STEADY)
        if self.stroke < least * (1.0 - 1e-12):
            raise InvalidInput(
                f"At {phrase(fastest, self.unit + '/s')} the stroke of {phrase(self.stroke, self.unit)} leaves too little "
                "at constant speed.",
                remedy=f"Give a stroke of at least {phrase(least, self.unit, 1)}, a higher ramp acceleration, or a lower speed.",
            )
        way = (
            0.5 * self.stroke
        )  # the quickest way there, of fifth order: 1.875 d/T fast, 5.774 d/T^2 accelerated
        gentle = max(1.875 * way / fastest, math.sqrt(10.0 / math.sqrt(3.0) * way / self.peak_acceleration))
        if self.lead_in is None:
            object.__setattr__(self, "lead_in", gentle)
        settle(self, positive=("lead_in",))
        if self._lead < gentle * (1.0 - 1e-12):
            raise InvalidInput(
                f"ConstantVelocity.lead_in is {self._lead:g} s, too short to reach the end of the stroke gently.",
                remedy=f"Give at least {round_digits(gentle, 1):.4g} s, or nothing.",
            )

    @cached_property
    def _plan(self) -> tuple[Pieces, np.ndarray]:
        low, high = self.position_range
        t, ends = self.start + self._lead, (low, high)
        knots = [(self.start, self.center, 0.0, 0.0), (t, low, 0.0, 0.0)]
        windows = []
        for i in range(2 * len(self.speeds)):
            v = self.velocities[i]
            begin, end = ends[i % 2], ends[1 - i % 2]
            ramp = 1.5 * abs(v) / self.peak_acceleration
            steady = self.stroke / abs(v) - ramp
            knots += [
                (t + self.pause, begin, 0.0, 0.0),
                (t + self.pause + ramp, begin + 0.5 * v * ramp, v, 0.0),
                (t + self.pause + ramp + steady, end - 0.5 * v * ramp, v, 0.0),
                (t + self.pause + 2 * ramp + steady, end, 0.0, 0.0),
            ]
            windows.append((t + self.pause + ramp, t + self.pause + ramp + steady))
            t = knots[-1][0]
        knots += [(t + self.pause, low, 0.0, 0.0), (t + self.pause + self._lead, self.center, 0.0, 0.0)]
        return Pieces.through(knots), np.array(windows)

    def _motion(self, t: np.ndarray, order: int) -> np.ndarray:
        return self._plan[0](t, order)

    @property
    def velocities(self) -> np.ndarray:
        """Signed velocity of each run, in the order of `windows` [rad/s or m/s], (2 k,)."""
        return np.repeat(self.speeds, 2) * np.tile([1.0, -1.0], len(self.speeds))

    def windows(self) -> np.ndarray:
        """Return the start and end of the constant velocity of each run, on the log's clock [s], (2 k, 2)."""
        return self._plan[1].copy()

    @property
    def duration(self) -> float:
        """From rest to rest [s]."""
        return float(self._plan[0].edges[-1] - self.start)

    @property
    def peak_velocity(self) -> float:
        """Highest speed [rad/s or m/s]."""
        return max(self.speeds)

    @property
    def peak_acceleration(self) -> float:
        """Greatest acceleration [rad/s^2 or m/s^2]; the ways in and out stay below it."""
        return float(self.ramp_acceleration or 0.0)
