"""Many scenes played within a bounded memory: of each record only one value is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from backdrive.simulation.closed_loop import Record, Scene, play

AT_ONCE = 1_000_000  # ticks of records that are held in memory together
Value = TypeVar("Value")


def evaluate(made: Iterable[Scene], value: Callable[[Record], Value]) -> list[Value]:
    """Play scenes, few enough at a time for the memory, and return a value of each.

    Args:
        made: scenes, made one by one, as they are needed.
        value: of a record.
    """
    values: list[Value] = []
    batch: list[Scene] = []
    for scene in made:
        batch.append(scene)
        if sum(len(s.motion.position) for s in batch) >= AT_ONCE:
            values += map(value, play(batch))
            batch = []
    return [*values, *map(value, play(batch))]
