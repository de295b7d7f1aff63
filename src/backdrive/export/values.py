"""Values of the translator: a number, the text of an expression in C, or several of them.

A `Scalar` is an expression. If its number is known at translation time (`known`), branches on it are decided then, while its
text is used in the code. So a table of parameters stays a table, and code for other values of the parameters is removed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

#: Kinds of scalars, a later one holding the values of an earlier. Where `real` is a float, `wide` stays a double, and so does
#: `place`: positions and time, whose differences are real.
BOOL, INT, LONG, REAL, WIDE, PLACE = KINDS = ("bool", "int", "long", "real", "wide", "place")
PRIMARY, UNARY, TIMES, PLUS, SHIFT, ORDER, EQUAL, BITS, OR_BITS, AND, OR, TERNARY = (
    15, 14, 13, 12, 11, 10, 9, 8, 6, 5, 4, 3,
)  # fmt: skip
SHORT = 9  # digits up to which a number that is exact in decimals is written so


class Untranslatable(Exception):
    """A kernel uses what the translator does not know."""


class Mixture(Untranslatable):
    """An unknown index into an array with elements of different types."""


@dataclass(frozen=True)
class Const:
    """A number that is part of the code.

    Attributes:
        value: the number.
        name: of a constant that has one, which stands for a status or explains a number that is hard to read.
    """

    value: Any
    name: str = field(default="", compare=False)

    @property
    def kind(self) -> str:
        """Kind of the number."""
        return (
            BOOL
            if isinstance(self.value, bool)
            else REAL
            if isinstance(self.value, float)
            else LONG
            if abs(self.value) > 2**31 - 1
            else INT
        )


@dataclass(frozen=True)
class Scalar:
    """An expression in C.

    Attributes:
        text: in C.
        kind: one of KINDS.
        level: precedence of its outermost operator.
        names: of variables, parameters and arrays that it reads.
        memory: memory that it reads and that a call may change: `array[index]`, `array[]` with an unknown index, or fields.
        known: its number where that is known.
        exact: the difference of two places before it is rounded to a real.
        origin: of a number of a constant table, its place there.
    """

    text: str
    kind: str
    level: int = PRIMARY
    names: frozenset[str] = frozenset()
    memory: frozenset[str] = frozenset()
    known: Any = None
    exact: Scalar | None = field(default=None, compare=False)
    origin: str = field(default="", compare=False)

    def within(self, level: int) -> str:
        """Return the text as an operand of an operator of some precedence."""
        return self.text if self.level >= level else f"({self.text})"


@dataclass(frozen=True)
class Several:
    """A tuple."""

    items: tuple[Any, ...]


@dataclass(frozen=True)
class Array:
    """A pointer into numbers.

    Attributes:
        name: in C.
        size: how many there are behind the pointer.
        begin: index at which the kernel's array begins.
        content: its numbers; None: they change.
        own: index of a number that changes and is stored separately, or -1.
        dead: indices of numbers that are never read, so that they need not be written.
        places: indices of positions, counted from the pointer.
        names: that its own text reads.
        rows: length of a row, where the array has two dimensions.
        writeable: a kernel may write to it.
        kind: of its elements.
    """

    name: str
    size: int
    begin: int = 0
    content: tuple[Any, ...] | None = None
    own: int = -1
    dead: frozenset[int] = frozenset()
    places: frozenset[int] = frozenset()
    names: frozenset[str] = frozenset()
    rows: int = 0
    writeable: bool = True
    kind: str = REAL


@dataclass(frozen=True)
class Table:
    """The table of a loop: a structure of what changes and one of what stays.

    Attributes:
        fields: row -> (name, kind, number where it stays).
        dead: fields that nothing reads, so that nothing has to be written.
        used: names of the fields that a kernel has read or written, filled as it is translated.
    """

    fields: tuple[tuple[str, str, Any], ...]
    dead: frozenset[str] = frozenset()
    used: set[str] = field(default_factory=set, compare=False, hash=False)


Value = Const | Scalar | Several | Array | Table


def number(value: float, kind: str, single: bool = False) -> str:
    """Return a number as C reads it: exactly.

    Args:
        value: the number.
        kind: one of KINDS.
        single: reals are floats.
    """
    if kind in (BOOL, INT):
        return str(int(value))
    if kind == LONG:
        return f"INT64_C({int(value)})"
    suffix, cast = ("f", "") if single and kind == REAL else ("", "(double)")
    value = float(value)
    if suffix:
        with np.errstate(over="ignore"):
            value = float(np.float32(value))
    if math.isnan(value):
        return f"{cast}NAN"
    if math.isinf(value):
        return f"{cast}INFINITY" if value > 0 else f"-{cast}INFINITY"
    text = repr(value)
    if len(text) <= SHORT and "e" not in text and value == int(value * 2**10) / 2**10:
        return text + suffix
    mantissa, exponent = value.hex().split("p")
    if "." in mantissa:
        mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}p{exponent}{suffix}"


def wider(*kinds: str) -> str:
    """Return the kind that holds the values of all."""
    return max(kinds, key=KINDS.index)


@dataclass(frozen=True)
class Spelling:
    """How expressions are written in C.

    Attributes:
        single: reals are floats, and what is wide a double.
    """

    single: bool = False

    def type_name(self, kind: str) -> str:
        """Return the type of a kind in C."""
        return {
            BOOL: "int",
            INT: "int",
            LONG: "int64_t",
            REAL: "float" if self.single else "double",
            WIDE: "double",
            PLACE: "double",
        }[kind]

    def scalar(self, value: Value, kind: str | None = None) -> Scalar:
        """Return a value as an expression, of a kind if one is given."""
        if isinstance(value, Const):
            kind = value.kind if kind is None else kind
            text = number(value.value, kind, self.single)
            if kind == INT and "_" in value.name and value.name.isupper():
                text = value.name
            elif "0x" in text:
                text += f" /* {value.name or repr(value.value)} */"
            level = UNARY if text[0] in "-(" else PRIMARY
            return Scalar(text, kind, level, known=value.value)
        if not isinstance(value, Scalar):
            raise Untranslatable(f"{value} is no number.")
        if kind is None or self.type_name(value.kind) == self.type_name(kind):
            return value if kind is None else replace(value, kind=kind)
        if {value.kind, kind} <= {BOOL, INT}:
            return replace(value, kind=kind)
        if (
            value.origin and value.known is not None and kind in (WIDE, PLACE)
        ):  # a constant, with all its digits
            return self.scalar(Const(float(value.known), value.origin), kind)
        text = f"({self.type_name(kind)}){value.within(UNARY)}"
        return replace(value, text=text, kind=kind, level=UNARY, origin="")

    def join(self, text: str, kind: str, level: int, parts: Sequence[Scalar], known: Any = None) -> Scalar:
        """Return an expression made of others."""
        names = frozenset().union(*(p.names for p in parts))
        memory = frozenset().union(*(p.memory for p in parts))
        return Scalar(text, kind, level, names, memory, known)
