"""The progress of a search: sentences that carry the share of the work that is done, weighted by the size of each fit."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from backdrive.identification.dynamic.unknowns import LawShape

PARTS = 10  # number of parts in which the progress of a fit is reported
EVERY = 5  # number of steps from one sentence to the next
DYNAMICS = 4  # usual number of unknowns beside those of a law
WHOLE = 1.5  # size of the fit to all data, relative to the fit to two of three windows [-]
LEFT = (
    0.5  # share of a law's work that is left after each of its searches, whose number is not known before [-]
)


class Step(str):
    """A sentence on the progress.

    Attributes:
        share: of the work that is done, 0 to 1; None if it is not known.
    """

    share: float | None

    def __new__(cls, sentence: str, share: float | None = None) -> Step:
        """Return the sentence with its share."""
        step = super().__new__(cls, sentence)
        step.share = share
        return step


def size_of(law: str, samples: int) -> float:
    """Return the expected work of a law's fit: samples by unknowns, since a Jacobian takes one rollout for each unknown.

    Args:
        law: name.
        samples: that it is fitted to.
    """
    shape = LawShape.from_name(law)
    return float(samples * (len(shape.rate.PARAMETERS) + len(shape.element.PARAMETERS) + DYNAMICS))


class Work:
    """The share of a joint's work that is done: its fits in turn, by size, and by measured time once one has ended.

    Args:
        say: takes the sentences, each a `Step`.
        sizes: of the fits in their order [any].
        clock: gives the time [s].
    """

    def __init__(
        self,
        say: Callable[[str], None],
        sizes: Sequence[float],
        clock: Callable[[], float] = time.perf_counter,
    ):
        self._say, self._sizes, self._clock = say, list(sizes), clock
        self._ended: list[tuple[float, float]] = []  # size and time of each fit [s]
        self._begun: float | None = None
        self._rounds, self._last = 0, 0.0
        self.share = 0.0

    def begin(self, sentence: str, size: float | None = None) -> None:
        """Begin the next fit, which ends the present one, with a sentence; `size` is that of a fit that was not planned."""
        self.end()
        if size is not None:
            self._sizes.insert(len(self._ended), size)
        self._begun, self._rounds, self._last = self._clock(), 0, 0.0
        self.say(sentence)

    def end(self) -> None:
        """End the present fit, if there is one."""
        if self._begun is not None and len(self._ended) < len(self._sizes):
            self._ended.append((self._sizes[len(self._ended)], self._clock() - self._begun))
        self._begun = None

    def say(self, sentence: str) -> None:
        """Pass a sentence on with the share of all work; its own share is that of the present search."""
        inside = getattr(sentence, "share", None)
        if inside is not None:
            self._rounds += inside < self._last
            self._last = inside
        self.share = max(self.share, self._now())
        self._say(Step(sentence, self.share))

    def _now(self) -> float:
        """Return the share that is done by the present estimate of all work [-]."""
        done, spent = (sum(pair[i] for pair in self._ended) for i in (0, 1))
        rate = spent / done if done > 0.0 and spent > 0.0 else 1.0  # [s] per size, 1 while none is known
        before = spent if spent > 0.0 else done
        coming = [rate * size for size in self._sizes[len(self._ended) :]]
        part = (1.0 - LEFT**self._rounds * (1.0 - LEFT * self._last)) if self._begun is not None else 0.0
        whole = before + sum(coming)
        return (before + (part * coming[0] if coming else 0.0)) / whole if whole > 0.0 else 0.0


def part_of(say: Callable[[str], None], k: int, n: int) -> Callable[[str], None]:
    """Return a function for the sentences of the k-th of n pieces of work of equal size, whose shares are within the piece."""

    def tell(sentence: str) -> None:
        inside = getattr(sentence, "share", None)
        say(sentence if inside is None else Step(sentence, (k + inside) / n))

    return tell


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
            share = min(i / steps, 1.0) if steps else None
            say(Step(f"{joint}: fitting {stage}, step {i}{part}", share))

    return tick
