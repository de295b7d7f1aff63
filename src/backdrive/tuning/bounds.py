"""Within what every number has to lie that is known of a joint or asked for, and the refusal that names the one that does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from backdrive.errors import InvalidInput

BIG = 1e12


class Bound(NamedTuple):
    """Where a number may lie, in SI; `open_low`, `open_high`: that end is not in it."""

    low: float
    high: float
    unit: str = ""
    open_low: bool = False
    open_high: bool = False

    def holds(self, value: float) -> bool:
        """Return whether a number lies within."""
        above = value > self.low if self.open_low else value >= self.low
        return above and (value < self.high if self.open_high else value <= self.high)

    def __str__(self) -> str:
        low = f"above {self.low:g}" if self.open_low else f"{self.low:g} or more"
        if self.high >= BIG:
            return f"{low}, and finite"
        return f"{low} and {f'below {self.high:g}' if self.open_high else f'at most {self.high:g}'}"


POSITIVE = Bound(1.0 / BIG, BIG)
BOUNDS = {
    "coulomb": POSITIVE,
    "stiffness": POSITIVE,
    "inertia": POSITIVE,
    "top_speed": POSITIVE,
    "count": POSITIVE,
    "counts": POSITIVE,
    "friction": POSITIVE,
    "damping": POSITIVE,
    "contact": POSITIVE,
    "motor_share": Bound(0.0, 1.0, open_low=True, open_high=True),
    "noise": Bound(0.0, 1e3, "counts", open_high=True),
    "delay": Bound(0.0, 0.1, "s", open_high=True),
    "interval": Bound(1e-5, 0.05, "s"),
    "friction_error": Bound(0.0, 0.8, open_high=True),
    "temperature": Bound(-273.15, 1e3, "degC"),
    "stroke": POSITIVE,
    "trip_speed": POSITIVE,
    "limit": Bound(0.0, BIG),
    "duration": Bound(0.0, 30.0, "s", open_low=True),
    "joints": Bound(8, 2000),
    "seed": Bound(0, 2**53),
}


def fault(name: str, value: float | Sequence[float], bound: Bound) -> str | None:
    """Return what is wrong with a number or an interval, in words; None where nothing is."""
    ends: list[float] = list(value) if isinstance(value, Sequence) else [value]
    said = ":".join(str(x) if isinstance(x, int) else f"{x:g}" for x in ends)
    words = f"{name} = {said}{f' {bound.unit}' if bound.unit else ''}"
    if not all(bound.holds(x) and math.isfinite(x) for x in ends):
        return f"{words}, it has to be {bound}"
    if ends != sorted(ends):
        return f"{words}, its lower end has to come first"
    return None


def check(where: str, **values: float | Sequence[float] | None) -> None:
    """Refuse numbers out of their bounds, each by its name and with its rule.

    Args:
        where: what the message begins with.
        values: numbers or intervals, by the names of `BOUNDS`; None: not given.

    Raises:
        InvalidInput: one or more are out of their bounds.
    """
    wrong = [
        words
        for name, value in values.items()
        if value is not None and (words := fault(name, value, BOUNDS[name]))
    ]
    if wrong:
        raise InvalidInput(f"{where}: {'; '.join(wrong)}.", remedy="Numbers are in SI units of the joint.")
