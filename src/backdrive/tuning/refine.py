"""From the result of a search to numbers that pass the whole test: the numbers are reduced, then improved in a further search.

The reduction moves along one line. Beside that line there is often a better point that passes too, for example a softer
spring or a faster decay at the same R. The joints that failed show the border, so further steps are tested on them first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.tuning.goals import Goal, Numbers
from backdrive.tuning.members import Member
from backdrive.tuning.safety import Trial, calm, restless, rests, trials
from backdrive.tuning.scenes import SUBSTEP
from backdrive.tuning.search import inverse, place

STEPS = (0.1, 0.05, 0.025)  # of the ranges
MOST = 24  # number of trials that a candidate has to pass during the search
ROUNDS = 2  # each beside more trials than the one before
ACROSS = 12  # directions beside the axes, since the border is oblique to the axes
GAIN = 2e-3  # relative gain of the score below which a step is not tested


def refine(goal: Goal, searched: Numbers, members: Sequence[Member], seed: int) -> dict[str, float]:
    """Return numbers that pass the whole test and score no worse than `calm` makes them.

    Args:
        goal: whose test and score.
        searched: numbers that passed a shorter test.
        members: drawn joints.
        seed: of the directions.

    Raises:
        NotIdentifiable: no numbers pass, as in `calm`.
    """
    best = calm(goal, dict(searched), members)
    if best == searched:
        return best
    every = trials(goal, members)
    hard = restless(goal, searched, every)
    rng = np.random.default_rng(seed)
    for _ in range(ROUNDS):
        z = _climb(goal, best, _thin(hard), rng)
        if z == best:
            break
        failed = restless(goal, z, every)
        if not failed:
            return z
        hard = failed + hard
    return best


def _thin(trials: Sequence[Trial]) -> list[Trial]:
    """Return at most `MOST` of many trials, evenly."""
    at = np.linspace(0, len(trials) - 1, min(MOST, len(trials))).round().astype(int)
    return [trials[i] for i in at]


def _climb(
    goal: Goal, begin: dict[str, float], hard: Sequence[Trial], rng: np.random.Generator
) -> dict[str, float]:
    """Return the best numbers around a point that rest in some trials, by shrinking steps along the axes and across."""
    here, score, numbers = inverse(goal.ranges, begin), float(goal.scores([begin])[0]), begin
    for step in STEPS:
        for _ in range(2):
            across = rng.standard_normal((ACROSS, here.size))
            across /= np.linalg.norm(across, axis=1, keepdims=True)
            moves = np.vstack([np.eye(here.size), -np.eye(here.size), across])
            around = np.clip(here + step * moves, 0.0, 1.0)
            many = [{**begin, **place(goal.ranges, row)} for row in around]
            scores = goal.scores(many)
            at = _best_at_rest(goal, many, np.where(scores < score * (1.0 - GAIN), scores, np.inf), hard)
            if at < 0:
                break
            here, score, numbers = around[at], float(scores[at]), many[at]
    return numbers


def _best_at_rest(
    goal: Goal, many: Sequence[dict[str, float]], scores: np.ndarray, hard: Sequence[Trial]
) -> int:
    """Return the index of the set of numbers with the best score that rests in all trials, or -1; infinite scores are left
    out.
    """
    for i in np.argsort(scores, kind="stable"):
        if not np.isfinite(scores[i]):
            break
        if rests(goal, many[i], hard, SUBSTEP):
            return int(i)
    return -1
