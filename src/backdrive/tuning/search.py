"""The search for the best numbers that pass the safety test, with few simulated scenes.

The test costs several times the score, so candidates are tested in the order of their scores until one passes. Around it the
search goes on with shrinking steps along the axes and across them. Only the oblique directions are random, and they depend on the
seed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.tuning.goals import Goal, Ranges

STEPS = (0.2, 0.1, 0.05, 0.025, 0.012)  # of the ranges


@dataclass(frozen=True, kw_only=True)
class SearchResult:
    """The result of a search.

    Attributes:
        numbers: the best that are safe; None where none is.
        score: of them.
        tried: sets of numbers that were scored.
        tested: of those, how many went through the safety test.
    """

    numbers: dict[str, float] | None
    score: float
    tried: int
    tested: int


def place(ranges: Ranges, u: np.ndarray) -> dict[str, float]:
    """Return the numbers at a place of the unit cube."""
    found = {}
    for (name, (low, high)), x in zip(ranges.items(), u, strict=True):
        wide = low > 0.0 and high >= 5.0 * low
        found[name] = float(low * (high / low) ** x if wide else low + (high - low) * x)
    return found


def inverse(ranges: Ranges, z: dict[str, float]) -> np.ndarray:
    """Return the place in the unit cube of numbers."""
    u = []
    for name, (low, high) in ranges.items():
        wide = low > 0.0 and high >= 5.0 * low
        u.append(np.log(z[name] / low) / np.log(high / low) if wide else (z[name] - low) / (high - low))
    return np.clip(np.array(u), 0.0, 1.0)


def best_safe(
    goal: Goal, many: Sequence[dict[str, float]], scores: np.ndarray, below: float = np.inf
) -> tuple[int, int]:
    """Return the index of the best safe set of numbers, or -1, and how many were tested.

    Args:
        goal: whose safety test.
        many: sets of numbers.
        scores: of them.
        below: sets without a better score than this are skipped.
    """
    order = [int(i) for i in np.argsort(scores, kind="stable") if scores[i] < below]
    for tested, i in enumerate(order, 1):
        if goal.rests(many[i]):
            return i, tested
    return -1, len(order)


def search(
    goal: Goal,
    *,
    seed: int = 0,
    starts: Sequence[dict[str, float]] = (),
    width: int = 32,
    say: Callable[[str], None] = lambda sentence: None,
) -> SearchResult:
    """Search for the best numbers that are safe.

    Args:
        goal: what they are for.
        seed: of the first candidates and of directions.
        starts: candidates besides, for example a fixed rule.
        width: of the first candidates, a power of two.
        say: called with sentences on the progress.
    """
    from scipy.stats import qmc

    ranges, n = goal.ranges, len(goal.ranges)
    rng = np.random.default_rng(seed)
    u = np.vstack([inverse(ranges, z) for z in starts] + [qmc.Sobol(n, rng=rng).random(width)])
    many = [place(ranges, row) for row in u]
    say(f"Trying {len(many)} sets of numbers")
    scores = goal.scores(many)
    tried, at = len(many), -1
    at, tested = best_safe(goal, many, scores)
    if at < 0:
        return SearchResult(numbers=None, score=np.inf, tried=tried, tested=tested)
    here, score, numbers = u[at], float(scores[at]), many[at]
    for step in STEPS:
        for _ in range(2):
            say(f"Closing in, steps of {100 * step:.0f} %, score {score:.4g}")
            across = rng.standard_normal((4, n))
            across /= np.linalg.norm(across, axis=1, keepdims=True)
            moves = np.vstack([np.eye(n), -np.eye(n), across])
            around = np.clip(here + step * moves, 0.0, 1.0)
            many = [place(ranges, row) for row in around]
            scores = goal.scores(many)
            at, more = best_safe(goal, many, scores, score * (1.0 - 2e-3))
            tried, tested = tried + len(many), tested + more
            if at < 0:
                break
            here, score, numbers = around[at], float(scores[at]), many[at]
    return SearchResult(numbers=numbers, score=score, tried=tried, tested=tested)
