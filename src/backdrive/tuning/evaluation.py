"""Simulation of many scenes with bounded memory: only one value of each record is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TypeVar

from backdrive.control.compensators import Dither, alg_fc, alg_fc2
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
            values += map(value, play(batch, like=_whole(batch[0])))
            batch = []
    return [*values, *map(value, play(batch, like=_whole(batch[0]) if batch else ()))]


def _whole(scene: Scene) -> list[Scene]:
    """Return scenes with all that a tuning of a compensator tries, dither and a switched decay: one kernel serves all of it."""
    loop = scene.loop
    if loop is None or not loop.compensator.friction.law.element.states():
        return []
    law = loop.compensator.friction.law
    dither = Dither(share=0.1, frequency=10.0)
    all_of_it = alg_fc(law.rate, 1.0, dither=dither), alg_fc2(law.rate, 1.0, threshold=1.0, dither=dither)
    return [replace(scene, loop=replace(loop, compensator=compensator)) for compensator in all_of_it]
