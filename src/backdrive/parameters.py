"""A number with unit and bounds, and the refusal that names the one that lies outside.

Whoever takes a number from a person or a file checks it here, so that all refuse alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any, NamedTuple

from backdrive.errors import InvalidInput

BIG = 1e12  # beyond, no number is meant [SI]


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
        low = "above zero" if 0.0 < self.low <= 1.0 / BIG else low
        if self.low <= -BIG and self.high >= BIG:
            return "that is finite"
        if self.high >= BIG:
            return f"{low}, and finite"
        return f"{low} and {f'below {self.high:g}' if self.open_high else f'at most {self.high:g}'}"


FINITE = Bound(-BIG, BIG)
NOT_NEGATIVE = Bound(0.0, BIG)
POSITIVE = Bound(1.0 / BIG, BIG)


def number(where: str, value: Any, bound: Bound = POSITIVE) -> float:
    """Return a number that lies within its bound.

    Args:
        where: what the number is, for the message.
        value: what is given for it.
        bound: where it may lie.

    Raises:
        InvalidInput: it is no number, not finite, or outside.
    """
    try:
        real = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        real = math.nan
    if not (math.isfinite(real) and bound.holds(real)):
        raise InvalidInput(f"{where} is {value!r}.", remedy=f"Give a number {bound}.", value=value)
    return real


def whole(where: str, value: Any, least: int = 1, most: float = math.inf) -> int:
    """Return a whole number between two others, these included.

    Args:
        where: what the number is, for the message.
        value: what is given for it.
        least: smallest.
        most: largest.

    Raises:
        InvalidInput: it is none, or outside.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or not least <= int(value) <= most:
        end = f" to {most:g}" if math.isfinite(most) else " on"
        raise InvalidInput(f"{where} is {value!r}.", remedy=f"Give a whole number from {least}{end}.")
    return int(value)


def check_fields(owner: object, bounds: Mapping[str, Bound]) -> None:
    """Refuse numbers of a frozen dataclass out of their bounds, and make them floats; None stays.

    Args:
        owner: the dataclass.
        bounds: by field.

    Raises:
        InvalidInput: names the field.
    """
    for name, bound in bounds.items():
        value = getattr(owner, name)
        if value is not None:
            object.__setattr__(owner, name, number(name, value, bound))


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
