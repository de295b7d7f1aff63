"""Kernels as straight-line programs of array operations: both sides of every branch are computed, and one is selected.

A kernel's syntax tree is walked once with symbols for its arguments. Known values (kinds, sizes, numbers of loop rounds) are
evaluated on the way. The result is a list of operations that any array library can run on whole batches. On a path that is not
taken, denominators and arguments of functions with a pole are set to 1. So the gradients of unselected values are finite too.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive import elementary
from backdrive.export.values import Untranslatable

BINARY: dict[type, Callable] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.RShift: operator.rshift,
    ast.LShift: operator.lshift,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
}
COMPARE: dict[type, Callable] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
NAMED = {"add", "sub", "mul", "truediv", "lt", "le", "gt", "ge", "eq", "ne"}
ELEMENTARY = {getattr(elementary, n): n for n in ("exp", "log", "pow", "tanh", "sin", "cos")} | {
    elementary.decay: "exp"
}
NUMPY = {np.sqrt: "sqrt", np.copysign: "copysign", np.isfinite: "isfinite", np.isnan: "isnan", abs: "abs"}


@dataclass(frozen=True)
class Node:
    """The result of an operation: its place in the program."""

    index: int


@dataclass(frozen=True)
class Row:
    """An array of parameters or state: its name and where it begins."""

    name: str
    begin: int = 0


class Graph:
    """A program: operations in order, each with the places of its operands, or with numbers.

    Attributes:
        operations: name and arguments of each.
        positive: places of parameters that are never below 0.
        searches: number of searches for a root.
    """

    def __init__(self):
        self.positive: set[int] = set()
        self.searches = 0
        self.operations: list[tuple[str, tuple[Any, ...]]] = []
        self._same: dict[tuple, Node] = {}

    def node(self, name: str, *arguments: Any) -> Node:
        """Return the result of an operation; an existing node is reused."""
        key = (name, *((type(a), repr(a)) for a in arguments))
        if key not in self._same:
            self.operations.append((name, arguments))
            self._same[key] = Node(len(self.operations) - 1)
        return self._same[key]

    def select(self, condition: Any, a: Any, b: Any) -> Any:
        """Return `a` where a condition holds, else `b`."""
        if not isinstance(condition, Node):
            return a if condition else b
        if repr(a) == repr(b):
            return a
        if isinstance(a, tuple) and isinstance(b, tuple):
            return tuple(self.select(condition, x, y) for x, y in zip(a, b, strict=False))
        if isinstance(a, Row) or isinstance(b, Row):
            raise Untranslatable("one array or another")
        return self.node("where", condition, a, b)

    def both(self, a: Any, b: Any) -> Any:
        """Return whether two conditions hold."""
        if not isinstance(a, Node):
            return b if a else False
        if not isinstance(b, Node):
            return a if b else False
        return self.node("and", a, b)

    def either(self, a: Any, b: Any) -> Any:
        """Return whether one of two conditions holds."""
        if not isinstance(a, Node):
            return True if a else b
        if not isinstance(b, Node):
            return True if b else a
        return self.node("or", a, b)

    def no(self, a: Any) -> Any:
        """Return whether a condition does not hold."""
        return self.node("not", a) if isinstance(a, Node) else not a

    def binary(self, function: Callable, a: Any, b: Any, path: Any = True) -> Any:
        """Return an operation on two numbers; `path`: where its result is used."""
        if not isinstance(a, Node) and not isinstance(b, Node):
            with np.errstate(all="ignore"):
                return function(np.float64(a), b).item() if function is operator.truediv else function(a, b)
        if function.__name__ not in NAMED:
            raise Untranslatable(f"{function.__name__} of what is not known")
        if function is operator.eq and self._shortcut(a, b):
            return False
        if function is operator.lt and not isinstance(b, Node) and b == 0.0 and self._never_negative(a):
            return False
        if function is operator.truediv:
            b = self.select(path, b, 1.0) if isinstance(b, Node) else b
        return self.node(function.__name__, a, b)

    def _never_negative(self, a: Any) -> bool:
        """Return whether a number cannot be below 0, whatever the inputs: a square, times what is not."""
        odd: set[Node] = set()
        for factor in self._factors(a):
            if isinstance(factor, Node):
                name, arguments = self.operations[factor.index]
                if name not in ("abs", "exp") and not (name == "parameter" and arguments[1] in self.positive):
                    odd ^= {factor}
            elif factor < 0.0:
                return False
        return not odd

    def _factors(self, a: Any) -> list[Any]:
        """Return what a number is a product of."""
        if isinstance(a, Node) and self.operations[a.index][0] == "mul":
            return [factor for each in self.operations[a.index][1] for factor in self._factors(each)]
        return [a]

    def _shortcut(self, a: Any, b: Any) -> bool:
        """Return whether a parameter is compared with a number other than 0.

        Such a branch is only a faster form of the other one, for example a square root for the power 0.5. Using it would hide
        the parameter from gradients.
        """
        return (
            isinstance(a, Node)
            and self.operations[a.index][0] == "parameter"
            and not isinstance(b, Node)
            and b != 0.0
        )

    def function(self, name: str, arguments: Sequence[Any], path: Any) -> Any:
        """Return a function of numbers."""
        if not any(isinstance(a, Node) for a in arguments):
            return (
                float(getattr(elementary, name)(*arguments))
                if name in elementary.__dict__
                else getattr(np, name)(*arguments)
            )
        first, *rest = arguments
        if name in ("exp", "log", "pow", "sqrt"):
            first = self.select(path, first, 1.0) if isinstance(first, Node) else first
            rest = [self.select(path, r, 1.0) if isinstance(r, Node) else r for r in rest]
        if name in ("pow", "sqrt") and isinstance(first, Node):
            return self._root(name, first, *rest)
        return self.node(name, first, *rest)

    def _root(self, name: str, base: Node, exponent: Any = None) -> Any:
        """Return a power. Its gradient at 0 is 0, although exponents below 1 have a pole there."""
        at_zero = 0.0
        if name == "pow":
            is_zero = self.node("eq", exponent, 0.0) if isinstance(exponent, Node) else exponent == 0.0
            at_zero = self.select(is_zero, 1.0, np.inf)
            at_zero = self.select(self.binary(operator.gt, exponent, 0.0), 0.0, at_zero)
        zero = self.node("eq", base, 0.0)
        base = self.select(zero, 1.0, base)
        power = self.node(name, base) if exponent is None else self.node(name, base, exponent)
        return self.select(zero, at_zero, power)

    def live_nodes(self, results: Sequence[Any]) -> list[int]:
        """Return the operations that some results need, in order."""
        marked: set[int] = set()
        waiting = [r.index for r in results if isinstance(r, Node)]
        while waiting:
            i = waiting.pop()
            if i not in marked:
                marked.add(i)
                waiting += [a.index for a in self.operations[i][1] if isinstance(a, Node)]
        return sorted(marked)
