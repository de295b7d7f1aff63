"""The progress of a search in sentences."""

from __future__ import annotations

from collections.abc import Callable

PARTS = 10  # number of parts in which the progress of a fit is reported
EVERY = 5  # number of steps from one sentence to the next


def ticker(say: Callable[[str], None], joint: str, steps: int = 0) -> Callable[[str, int, float], None]:
    """Return the callback of a search, which reports every fifth step.

    Args:
        say: takes the sentence.
        joint: name.
        steps: largest number of steps; 0: unknown.
    """

    def tick(stage: str, i: int, cost: float) -> None:
        if i % EVERY == 0:
            part = f", part {min(1 + PARTS * i // steps, PARTS)} of {PARTS}" if steps else ""
            say(f"{joint}: fitting {stage}, step {i}{part}")

    return tick
