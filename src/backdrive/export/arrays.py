"""Friction laws as pure functions on arrays, for batches, `jit`, `vmap` and gradients.

    f = law(model, "elbow", xp=jax.numpy)
    x = f.init((4096,))
    torque, x = f.step(x, dp, dt)

The operations are those of the kernels, in the same order (`graph`): on doubles the numbers agree to rounding.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.export.array_functions import exponential, power, sine
from backdrive.export.graph import Graph, Node, Row
from backdrive.export.walk import Walk
from backdrive.laws import REFERENCE, Law, kernels
from backdrive.laws.base import Rows

if TYPE_CHECKING:
    from backdrive.model import FrictionModel

SIGNS = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "truediv": "/",
    "lt": "<",
    "le": "<=",
    "gt": ">",
    "ge": ">=",
    "eq": "==",
    "ne": "!=",
}


def one_step(rate, element, p, x, dp, dt, load, temp):
    """Return the friction torque of one tick; x is advanced in place.

    As `kernels.step`, but the increment itself is limited to FASTEST, which limits all that follows. So a compiler of arrays
    keeps nothing between the loop of the state and that of the torque.
    """
    reach = kernels.FASTEST * dt
    dp = reach if dp > reach else (-reach if dp < -reach else dp)
    return kernels.step_at(rate, element, False, p, x, x, dp / dt, dp, dt, load, temp)


class ArrayLaw:
    """The friction torque of a law on arrays: `init` and `step`, without side effects.

    Attributes:
        law: friction law.
        xp: array library: `numpy`, `jax.numpy` or `torch`.
        row: the law's parameters as the kernels read them, (P,); numbers of knots or elements must not be changed.
        states: number of state variables of a joint.
    """

    def __init__(self, law: Law, xp: ModuleType | Any = np):
        self.law, self.xp = law, xp
        self.row = law.row()
        self.states = max(law.element.states(), 1)
        graph = Graph()
        graph.positive = not_negative(law)
        self._program(graph)

    def _program(self, graph: Graph) -> None:
        """Walk through the kernel once."""
        law, row = self.law, self.row.tolist()
        # numbers of knots, elements or parameters determine the program; the other parameters may vary
        fixed = set(counts(law))
        memory = {
            "p": [value if i in fixed else graph.node("parameter", "p", i) for i, value in enumerate(row)],
            "x": [graph.node("state", i) for i in range(2 * self.states)],
        }
        load = (graph.node("input", "motor"), graph.node("input", "external"))
        arguments = [
            law.rate.KIND, law.element.KIND, Row("p"), Row("x"), graph.node("input", "dp"), graph.node("input", "dt"), load,
            graph.node("input", "temperature"),
        ]  # fmt: skip
        walk = Walk(graph, {"p": row})
        self._torque = walk.call(one_step, arguments, memory, True)
        self._after = memory["x"][: self.states]
        self._results = [self._torque, *self._after]
        self._needed = graph.live_nodes(self._results)
        self._operations = [(i, *graph.operations[i]) for i in self._needed]

    def init(self, shape: Sequence[int] | int = ()) -> tuple[Any, ...]:
        """Return the state of joints at rest and relaxed: a tuple with one array for each state variable.

        Args:
            shape: of the batch.
        """
        shape = (shape,) if isinstance(shape, int) else tuple(shape)
        xp = self.xp
        return tuple(xp.zeros(shape, dtype=getattr(xp, "float64", float)) for _ in range(self.states))

    def step(
        self,
        x: Sequence[Any],
        dp: Any,
        dt: Any,
        load: Any = None,
        temperature: Any = REFERENCE,
        row: Any = None,
    ) -> tuple[Any, tuple[Any, ...]]:
        """Return torque and state after one tick; nothing is changed in place.

        Args:
            x: state, a tuple of arrays (...).
            dp: increments of the positions [rad or m], (...).
            dt: time since the previous tick [s], a number or (...), above 0.
            load: motor-side and external torque [N.m or N], (..., 2); None: the law's usual one.
            temperature: [degC], a number or (...).
            row: parameters, (..., P), as `sample` draws them; None: the law's.

        Returns:
            tau_f [N.m or N], (...), and the state, a tuple of arrays (...).

        Raises:
            InvalidInput: the state does not have one array for each state variable.
        """
        if not isinstance(x, (tuple, list)) or len(x) != self.states:
            raise InvalidInput(
                f"The state of '{self.law.name}' is a tuple of {self.states} arrays.",
                remedy="Begin with init(shape), and pass on the state that step returns.",
            )
        motor, external = self.law.usual_load if load is None else (load[..., 0], load[..., 1])
        inputs = {"dp": dp, "dt": dt, "motor": motor, "external": external, "temperature": temperature}
        parameters = self.row.tolist() if row is None else row
        values: dict[int, Any] = {}
        with np.errstate(all="ignore") if self.xp is np else nullcontext():
            self._run(values, x, inputs, parameters)
        results = [values[r.index] if isinstance(r, Node) else r for r in self._results]
        like = dp + 0.0 * x[0]
        torque, *after = (
            r if hasattr(r, "shape") and r.shape == like.shape else r + 0.0 * like for r in results
        )
        return torque, tuple(after)

    def _run(self, values: dict[int, Any], x: Any, inputs: Mapping[str, Any], parameters: Any) -> None:
        xp = self.xp
        for i, name, arguments in self._operations:
            if name == "parameter":
                at = arguments[1]
                values[i] = parameters[at] if isinstance(parameters, list) else parameters[..., at]
                continue
            if name == "state":
                values[i] = x[arguments[0]] if arguments[0] < self.states else 0.0
                continue
            if name == "input":
                values[i] = inputs[arguments[0]]
                continue
            given = [values[a.index] if isinstance(a, Node) else a for a in arguments]
            if name == "search":
                search, n, *operands = given
                outside = {a.index: g for a, g in zip(search.inputs(), operands[n:], strict=True)}
                values[i] = search.run(xp, operands[:n], outside, partial(_operation, xp))
                continue
            values[i] = given[0][given[1]] if name == "end" else _operation(xp, name, given)


def _operation(xp: Any, name: str, given: list[Any]) -> Any:
    """Return one operation on arrays or numbers."""
    if name in _PLAIN:
        return _PLAIN[name](*given)
    if name == "pick":
        return _pick(xp, *given)
    if all(isinstance(g, (int, float, bool, np.generic)) for g in given):
        return _numbers(name, given)
    if name == "where":
        return _where(xp, *given)
    if name in ("and", "or"):
        a, b = given
        return a & b if name == "and" else a | b
    if name == "not":
        return ~given[0] if hasattr(given[0], "shape") else not given[0]
    if name in ("exp", "sin"):
        return (exponential if name == "exp" else sine)(xp, given[0])
    if name == "pow":
        return power(xp, *given)
    if name == "abs":
        return abs(given[0])
    if name == "copysign":
        return xp.where(given[1] < 0.0, -abs(given[0]), abs(given[0]))
    return getattr(xp, name)(given[0])


def _where(xp: Any, condition: Any, one: Any, other: Any) -> Any:
    """Return one of two numbers, selected by a condition."""
    if not hasattr(condition, "shape"):
        return one if condition else other
    if isinstance(one, float) and isinstance(other, float):  # torch would make float32 of them
        one = _constant(xp, one, condition)
    return xp.where(condition, one, other)


def _constant(xp: Any, value: Any, like: Any) -> Any:
    """Return float64 numbers as an array on the device of another array."""
    device = {"device": like.device} if xp.__name__ == "torch" else {}
    return xp.asarray(value, dtype=xp.float64, **device)


def _pick(xp: Any, index: Any, places: tuple[int, ...], *numbers: Any) -> Any:
    """Return one of several numbers, selected by an index."""
    if not hasattr(index, "shape"):
        return numbers[places.index(index)]
    if all(isinstance(n, float) for n in numbers):
        table = np.zeros(places[-1] - places[0] + 1)
        table[np.array(places) - places[0]] = numbers
        return _constant(xp, table, index)[index - places[0]]
    result = numbers[-1]
    for place, number in zip(places[-2::-1], numbers[-2::-1], strict=False):
        result = xp.where(index == place, number, result)
    return result


def _numbers(name: str, given: list[Any]) -> Any:
    """Return one operation on plain numbers."""
    if name == "where":
        return given[1] if given[0] else given[2]
    if name in ("and", "or", "not"):
        return (
            (given[0] and given[1])
            if name == "and"
            else (given[0] or given[1])
            if name == "or"
            else not given[0]
        )
    if name == "pow":
        return float(given[0]) ** given[1]
    if name == "abs":
        return abs(given[0])
    return getattr(np, name)(*given).item()


_PLAIN = {name: getattr(operator, name) for name in (*SIGNS, "neg")}


def counts(law: Law) -> list[int]:
    """Return the places in a law's row that count knots, elements or parameters."""
    places = [0]
    begin = 1
    for part in (law.rate, law.element):
        row = part.row()
        many = any(p.many for p in part.PARAMETERS.values())
        if many and row.size:
            places.append(begin)
        if part is law.rate:
            begin = 1 + int(law.row()[0])
    return places


def not_negative(law: Law) -> set[int]:
    """Return the places of numbers in a law's row that are never negative, if the row holds the parameters themselves."""
    places: set[int] = set()
    begins = (1, 1 + int(law.row()[0]))
    for part, begin in zip((law.rate, law.element), begins, strict=True):
        if type(part).row is Rows.row:
            places |= {begin + i for i, p in enumerate(part.PARAMETERS.values()) if p.lower >= 0.0}
    return places


def law(model: FrictionModel | Law, joint: str | int | None = None, xp: Any = np) -> ArrayLaw:
    """Return the friction of a joint as a pure function on arrays.

    Args:
        model: of friction, or a law.
        joint: name or number, for a model of several.
        xp: array library: `numpy`, `jax.numpy` or `torch`.

    Raises:
        InvalidInput: the model has several joints and none is named.
    """
    if isinstance(model, Law):
        return ArrayLaw(model, xp)
    if joint is None:
        if len(model.joints) != 1:
            raise InvalidInput(
                f"The model has {len(model.joints)} joints.", remedy=f"Name one of {', '.join(model.names)}."
            )
        joint = 0
    return ArrayLaw(model.joint(joint).law, xp)
