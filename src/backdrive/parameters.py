"""Numbers with unit and bounds, and the error that names a number out of bounds.

All numbers from users and files are checked here, so that errors are uniform.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Integral, Real
from typing import Any, ClassVar, NamedTuple, Self, cast

from backdrive._documents import is_several
from backdrive.errors import InvalidInput

BIG = 1e12  # larger numbers are implausible [SI]
MOST = "1e12"  # in words


class Bound(NamedTuple):
    """The range of a number, in SI; `open_low`, `open_high`: that end is excluded."""

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
            return f"between -{MOST} and {MOST}"
        if self.high >= BIG:
            return low if math.isinf(self.high) else f"{low}, and at most {MOST}"
        return f"{low} and {f'below {self.high:g}' if self.open_high else f'at most {self.high:g}'}"


Bounds = Mapping[str, Bound]
FINITE = Bound(-BIG, BIG)
NOT_NEGATIVE = Bound(0.0, BIG)
POSITIVE = Bound(1.0 / BIG, BIG)
ABOVE_ZERO = Bound(0.0, math.inf, open_low=True)  # infinite where there is no such limit


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
    if not bound.holds(real):
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


def fault(name: str, value: Any, bound: Bound) -> str | None:
    """Return what is wrong with a number or an interval, a sentence's part; None where nothing is."""
    if type(value) is float and bound.holds(value):  # nearly always, and in every scene
        return None
    ends: Sequence[Any] = value if is_several(value) else (value,)
    if not all(not isinstance(x, bool) and isinstance(x, Real) for x in ends):
        return f"{name} = {value!r}, it has to be a number {bound}"
    inside = all(bound.holds(x) for x in ends)
    if inside and (len(ends) == 1 or list(ends) == sorted(ends)):
        return None
    given = ":".join(str(x) if isinstance(x, int) else f"{x:g}" for x in ends)
    rule = "its lower end has to come first" if inside else f"it has to be {bound}"
    return f"{name} = {given}{f' {bound.unit}' if bound.unit else ''}, {rule}"


def check(where: str, bounds: Bounds, values: Mapping[str, Any]) -> None:
    """Refuse numbers and intervals outside their bounds, each by its name and with its rule.

    Args:
        where: what the message begins with.
        bounds: by name.
        values: by some of these names.

    Raises:
        InvalidInput: one or more are outside, or no numbers.
    """
    wrong = [words for name, value in values.items() if (words := fault(name, value, bounds[name]))]
    if wrong:
        raise InvalidInput(f"{where}: {'; '.join(wrong)}.", remedy="Numbers are in SI units of the joint.")


def numbers(where: str, value: Any) -> Any:
    """Return numbers as an array, (...).

    Args:
        where: what the numbers are, for the message.
        value: what is given for them.

    Raises:
        InvalidInput: something is no number, or rows have different lengths.
    """
    import numpy as np

    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{where} holds what is no number.", remedy="Give plain numbers.") from error


def array(where: str, value: Any, *shapes: tuple[int, ...], bound: Bound = FINITE) -> Any:
    """Return numbers within a bound as an array of one of some shapes.

    Args:
        where: what the numbers are, for the message.
        value: what is given for them.
        shapes: that they may have.
        bound: where they may lie.

    Raises:
        InvalidInput: another shape, or a number is NaN or outside.
    """
    given = numbers(where, value)
    if given.shape not in shapes:
        ways = " or ".join("one number" if shape == () else str(shape) for shape in shapes)
        raise InvalidInput(f"{where} has the shape {given.shape}.", remedy=f"Give {ways}.")
    if not (bound.holds(given.min()) and bound.holds(given.max())):
        raise InvalidInput(
            f"{where} reaches from {given.min():g} to {given.max():g}.", remedy=f"Give numbers, each {bound}."
        )
    return given


class WithBounds:
    """Base of frozen dataclasses whose numbers have bounds and whose words are some of a few.

    Attributes:
        BOUNDS: of fields that hold a number, by name; one whose default is None may be None.
        CHOICES: what a field may be that holds a word, by name.
    """

    BOUNDS: ClassVar[Bounds] = {}
    CHOICES: ClassVar[Mapping[str, Sequence[str]]] = {}

    def __post_init__(self) -> None:
        """Check all fields against the declaration.

        Raises:
            InvalidInput: names each number outside its bounds, or a word that is none of the choices.
        """
        declared: dict[str, Any] = cast("Any", type(self)).__dataclass_fields__
        # not `vars`: a decoder leaves out what has its default
        own: dict[str, Any] = {k: getattr(self, k) for k in declared}
        where = f"{type(self).__name__} '{own['name']}'" if "name" in own else type(self).__name__
        given = {k: own[k] for k in self.BOUNDS if own[k] is not None or declared[k].default is not None}
        check(where, self.BOUNDS, given)
        for name, value in given.items():
            if type(value) is not float:
                object.__setattr__(self, name, number(f"{where}: {name}", value, self.BOUNDS[name]))
        for name, choices in self.CHOICES.items():
            if own[name] not in choices:
                raise InvalidInput(
                    f"{where}: {name} = {own[name]!r}.", remedy=f"It is one of {', '.join(choices)}."
                )

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed."""
        return replace(self, **changes)  # type: ignore[type-var]
