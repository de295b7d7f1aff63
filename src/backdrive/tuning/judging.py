"""Many scenes played within a bounded memory: of each record only what is said of it is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from backdrive.simulation.closed_loop import Record, Scene, play

AT_ONCE = 1_000_000  # ticks of records that are held in memory together
Said = TypeVar("Said")


def judged(played: Iterable[Scene], judge: Callable[[Record], Said]) -> list[Said]:
    """Play scenes, few enough at a time for the memory, and return what is said of each.

    Args:
        played: made one by one, as they are needed.
        judge: from a record to what is kept of it.
    """
    found: list[Said] = []
    batch: list[Scene] = []
    for one in played:
        batch.append(one)
        if sum(len(s.motion.position) for s in batch) >= AT_ONCE:
            found += [judge(record) for record in play(batch)]
            batch = []
    return found + [judge(record) for record in play(batch)] if batch else found
