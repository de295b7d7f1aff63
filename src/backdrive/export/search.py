"""A search for a root on arrays: one round as a program, run until every number has reached its end.

Written out round by round a search is thousands of operations, which a compiler of arrays computes again for each of its results.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.export.graph import Graph, Node

Operation = tuple[int, str, tuple[Any, ...]]


@dataclass(frozen=True, eq=False)
class Search:
    """One round of a search.

    Attributes:
        rounds: at most.
        carried: places of the numbers that a round is given; the last says whether the search goes on.
        body: operations of a round, those that do not depend on these numbers apart.
        results: of a round, in the same order.
    """

    rounds: int
    carried: tuple[int, ...]
    body: tuple[Operation, ...]
    results: tuple[Any, ...]

    @classmethod
    def of(cls, graph: Graph, rounds: int, carried: Sequence[Node], results: Sequence[Any]) -> Search:
        """Return the search whose round leads from some numbers to results."""
        within = {node.index for node in carried}
        body: list[Operation] = []
        for i in graph.live_nodes(results):
            name, arguments = graph.operations[i]
            if any(isinstance(a, Node) and a.index in within for a in arguments):
                within.add(i)
                body.append((i, name, arguments))
        return cls(rounds, tuple(node.index for node in carried), tuple(body), tuple(results))

    def inputs(self) -> tuple[Node, ...]:
        """Return what a round takes from outside of the search."""
        own = {*self.carried, *(i for i, _, _ in self.body)}
        used = [*self.results, *(a for _, _, arguments in self.body for a in arguments)]
        return tuple({a.index: a for a in used if isinstance(a, Node) and a.index not in own}.values())

    def run(self, xp: Any, begin: Sequence[Any], given: dict[int, Any], operation: Callable) -> list[Any]:
        """Return the numbers at the end of the search.

        Args:
            xp: array library.
            begin: numbers before the first round, in the order of `carried`.
            given: what a round takes from outside, by place.
            operation: computes one operation, of its name and operands.
        """
        arrays = [a for a in (*begin, *given.values()) if hasattr(a, "shape")]
        shape = np.broadcast_shapes(*(tuple(a.shape) for a in arrays))
        now = [_full(xp, value, shape, arrays[0]) for value in begin]

        def step(now: Sequence[Any]) -> list[Any]:
            values = given | dict(zip(self.carried, now, strict=True))
            for i, name, arguments in self.body:
                values[i] = operation(
                    name, [values[a.index] if isinstance(a, Node) else a for a in arguments]
                )
            results = [values[r.index] if isinstance(r, Node) else r for r in self.results]
            *numbers, goes_on = now  # what has ended stands still, lest it grow beyond all numbers
            after = [xp.where(goes_on, r, n) for r, n in zip(results, numbers, strict=False)]
            return [*after, goes_on & results[-1]]

        if xp.__name__ == "jax.numpy":
            from jax import lax

            return lax.fori_loop(
                0, self.rounds, lambda _, now: lax.cond(now[-1].any(), step, lambda now: now, now), now
            )
        for _ in range(self.rounds):
            if not bool(now[-1].any()):
                break
            now = step(now)
        return now


def _full(xp: Any, value: Any, shape: tuple[int, ...], like: Any) -> Any:
    """Return a number or an array as an array of a shape, on the device of another."""
    if hasattr(value, "shape"):
        return xp.broadcast_to(value, shape)
    kind = (
        xp.bool
        if isinstance(value, bool) and xp.__name__ == "torch"
        else bool
        if isinstance(value, bool)
        else xp.float64
    )
    device = {"device": like.device} if xp.__name__ == "torch" else {}
    return xp.full(shape, value, dtype=kind, **device)
