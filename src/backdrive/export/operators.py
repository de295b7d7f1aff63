"""Operators and functions on a translator's values: known numbers are computed, the rest is written in C."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.export.code import Assign, Statement
from backdrive.export.values import (
    AND,
    BITS,
    BOOL,
    EQUAL,
    INT,
    LONG,
    OR,
    OR_BITS,
    ORDER,
    PLACE,
    PLUS,
    PRIMARY,
    REAL,
    SHIFT,
    TERNARY,
    TIMES,
    WIDE,
    Const,
    Scalar,
    Spelling,
    Untranslatable,
    Value,
    wider,
)

BINARY: dict[type, tuple[str, int, Callable]] = {
    ast.Add: ("+", PLUS, operator.add),
    ast.Sub: ("-", PLUS, operator.sub),
    ast.Mult: ("*", TIMES, operator.mul),
    ast.Div: ("/", TIMES, operator.truediv),
    ast.RShift: (">>", SHIFT, operator.rshift),
    ast.LShift: ("<<", SHIFT, operator.lshift),
    ast.BitAnd: ("&", BITS, operator.and_),
    ast.BitOr: ("|", OR_BITS, operator.or_),
    ast.FloorDiv: ("//", TIMES, operator.floordiv),
    ast.Mod: ("%", TIMES, operator.mod),
}
COMPARE: dict[type, tuple[str, int, Callable]] = {
    ast.Lt: ("<", ORDER, operator.lt),
    ast.LtE: ("<=", ORDER, operator.le),
    ast.Gt: (">", ORDER, operator.gt),
    ast.GtE: (">=", ORDER, operator.ge),
    ast.Eq: ("==", EQUAL, operator.eq),
    ast.NotEq: ("!=", EQUAL, operator.ne),
}
LARGEST = float(np.finfo(np.float32).max)
ZERO = re.compile(r" \+ 0\.0f?$")  # an added zero, which does not change whether a number is finite
DEAD = "dead"  # text of a number that is never read
MATH = {abs: "fabs", np.sqrt: "sqrt", np.copysign: "copysign"}


def number_of(value: Value) -> Any:
    """Return the number of a value where it is known, else None."""
    return value.value if isinstance(value, Const) else value.known if isinstance(value, Scalar) else None


def beside(value: Value, other: Value) -> Value:
    """Return a whole number as an integer where it meets one."""
    if (
        isinstance(value, Const)
        and isinstance(value.value, float)
        and getattr(other, "kind", REAL) in (INT, LONG)
    ):
        return Const(int(value.value)) if value.value.is_integer() else value
    return value


class Operators:
    """Operators on values; what is computed goes into the present block."""

    def __init__(self, spelling: Spelling, names: dict[str, Any]):
        self.spelling, self.globals = spelling, names
        self.env: dict[str, Value] = {}
        self.block: list[Statement] = []
        self.conditional = 0  # within what C may not evaluate
        self.temporaries = 0
        self.angle = 0  # within the argument of a sine, where a long time needs full precision

    def temporary(self, value: Scalar, name: str = "") -> Scalar:
        """Put a value into a variable of its own."""
        if not name:
            self.temporaries += 1
            name = f"t{self.temporaries}"
        self.block.append(Assign(name, self.spelling.type_name(value.kind), value))
        return Scalar(name, value.kind, names=frozenset({name}), known=value.known)

    def binary(self, op: type, left: Value, right: Value) -> Value:
        """Return two values with an operator between them."""
        sign, level, function = BINARY[op]
        a, b = number_of(left), number_of(right)
        both = None
        if a is not None and b is not None:
            with np.errstate(all="ignore"):
                both = function(np.float64(a), b).item() if op is ast.Div else function(a, b)
            if isinstance(left, Const) and isinstance(right, Const):
                return Const(both)
        if op in (ast.FloorDiv, ast.Mod):
            if both is None:
                raise Untranslatable("// and % of what is not known")
            return Const(both)
        kind = wider(*(v.kind for v in (left, right) if isinstance(v, (Const, Scalar))))
        if op is ast.Div and kind not in (REAL, WIDE, PLACE):
            kind = REAL
        if kind == BOOL:
            kind = INT
        kinds = {v.kind for v in (left, right) if isinstance(v, Scalar)}
        if (
            op in (ast.Mult, ast.Div) and kinds == {REAL, PLACE} and not self.angle
        ):  # the result is no longer a position or a time
            kind = REAL
        x, y = self.spelling.scalar(left), self.spelling.scalar(right)
        way = op is ast.Sub and x.kind == y.kind == PLACE
        x, y = self.spelling.scalar(left, kind), self.spelling.scalar(right, kind)
        if op in (ast.RShift, ast.LShift):
            y = self.spelling.scalar(right, INT)
        inner = PRIMARY if level in (SHIFT, BITS, OR_BITS) else level
        text = f"{x.within(inner)} {sign} {y.within(max(inner, level + 1))}"
        result = self.spelling.join(text, kind, level, [x, y], both)
        return replace(self.spelling.scalar(result, REAL), exact=result) if way else result

    def compare(self, op: type, left: Value, right: Value) -> Value:
        """Return the comparison of two values."""
        sign, level, function = COMPARE[op]
        a, b = number_of(left), number_of(right)
        if a is not None and b is not None:
            return Const(bool(function(a, b)))
        if self.spelling.single and op in (ast.Gt, ast.Lt) and self._beyond(right if op is ast.Gt else left):
            return Const(False)
        left, right = beside(left, right), beside(right, left)
        kind = wider(*(v.kind for v in (left, right) if isinstance(v, (Const, Scalar))))
        x, y = self.spelling.scalar(left, kind), self.spelling.scalar(right, kind)
        return self.spelling.join(f"{x.within(PLUS)} {sign} {y.within(PLUS)}", BOOL, level, [x, y])

    def _beyond(self, value: Value) -> bool:
        """Return whether a number is larger than every float."""
        return isinstance(value, Const) and isinstance(value.value, float) and value.value > LARGEST

    def all_of(self, parts: list[Value]) -> Value:
        """Return whether all hold."""
        return self._logic(parts, "&&", AND, False)

    def any_of(self, parts: list[Value]) -> Value:
        """Return whether one holds."""
        return self._logic(parts, "||", OR, True)

    def _logic(self, parts: list[Value], sign: str, level: int, decides: bool) -> Value:
        left: list[Scalar] = []
        for part in parts:
            number = number_of(part)
            if number is None:
                left.append(self.spelling.scalar(part))
            elif bool(number) == decides:
                if not left:
                    return Const(decides)
                left.append(self.spelling.scalar(Const(decides)))
                break
        if not left:
            return Const(not decides)
        if len(left) == 1:
            return left[0]
        inner = AND + 1 if level == AND else EQUAL  # && within || in brackets, as compilers like it
        return self.spelling.join(f" {sign} ".join(p.within(inner) for p in left), BOOL, level, left)

    def either(self, test: Scalar, a: Value, b: Value) -> Value:
        """Return one of two values."""
        if a == b:
            return a
        kind = wider(*(v.kind for v in (a, b) if isinstance(v, (Const, Scalar))))
        x, y = self.spelling.scalar(a, kind), self.spelling.scalar(b, kind)
        text = f"{test.within(TERNARY + 1)} ? {x.within(TERNARY + 1)} : {y.within(TERNARY)}"
        return self.spelling.join(text, kind, TERNARY, [test, x, y])

    def helper(self, name: str, kind: str, parts: list[Scalar]) -> Scalar:
        """Return a call of one of the few functions that a header brings along."""
        raise NotImplementedError

    def _least(self, least: bool, arguments: list[Value]) -> Value:
        result = arguments[0]
        for other in arguments[1:]:
            a, b = number_of(result), number_of(other)
            if isinstance(result, Const) and isinstance(other, Const):
                result = Const(min(a, b) if least else max(a, b))
                continue
            kind = wider(*(v.kind for v in (result, other) if isinstance(v, (Const, Scalar))))
            x, y = self.spelling.scalar(result, kind), self.spelling.scalar(other, kind)
            both = None if a is None or b is None else (min(a, b) if least else max(a, b))
            result = self.helper(
                ("least" if least else "most") + ("_wide" if kind in (WIDE, PLACE) else ""), kind, [x, y]
            )
            result = Scalar(**{**vars(result), "known": both})
        return result

    def _class_of(self, function: Any, argument: Value) -> Value:
        number = number_of(argument)
        if number is not None:
            return Const(bool(function(number)))
        x = self.spelling.scalar(argument)
        if function is np.isnan:
            if x.level < PRIMARY:
                x = self.temporary(x)
            return self.spelling.join(f"{x.text} != {x.text}", BOOL, EQUAL, [x])
        while x.level == PLUS and ZERO.search(x.text):
            x = replace(x, text=ZERO.sub("", x.text))
        return self.helper("finite" + ("_wide" if x.kind in (WIDE, PLACE) else ""), BOOL, [x])

    def _math(self, function: Any, arguments: list[Value]) -> Value:
        numbers = [number_of(a) for a in arguments]
        kind = wider(*(a.kind for a in arguments if isinstance(a, (Const, Scalar))))
        both = None if None in numbers else float(function(*numbers))
        if all(isinstance(a, Const) for a in arguments):
            return Const(both)
        if kind not in (REAL, WIDE, PLACE) or (kind == PLACE and function is abs):  # a size is no position
            kind = REAL
        parts = [self.spelling.scalar(a, kind) for a in arguments]
        suffix = "f" if self.spelling.type_name(kind) == "float" else ""
        return self.spelling.join(
            f"{MATH[function]}{suffix}({', '.join(p.text for p in parts)})", kind, PRIMARY, parts, both
        )
