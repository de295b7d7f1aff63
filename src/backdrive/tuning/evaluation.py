"""Simulation of many scenes with bounded memory: only one value of each record is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from backdrive.simulation.closed_loop import Record, Scene, play

AT_ONCE = 1_000_000  # ticks of records that are held in memory together
Value = TypeVar("Value")


def evaluate(made: Iterable[Scene], value: Callable[[Record], Value]) -> list[Value]:
    """Simulate scenes in batches that fit the memory, and return one value of each.

    Args:
        made: scenes, created one by one when needed.
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
