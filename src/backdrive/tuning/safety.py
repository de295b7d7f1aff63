"""The safety test of all proposals, and the reduction of numbers until they pass it.

All drawn joints and the ends of the intervals have to come to rest, with delays from zero to the longest, since an
intermediate delay may be the worst. The ends of the intervals are also tested with slightly larger R and K, because a search
ends at the border of its own, shorter test. The integration step is the fine one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.tuning.evaluation import evaluate
from backdrive.tuning.goals import AT_REST, LEFT_OVER, RESTLESS, Goal, Numbers
from backdrive.tuning.members import Member
from backdrive.tuning.scenes import FINE, SUBSTEP, energy

NUDGE = 1.03  # factor on R and K with which the ends of the intervals have to come to rest too
HALVINGS = 2  # halvings of the last reduction after it passed
AT_ONCE = 16  # trials that are simulated together where the first failure ends them
MOST_DELAYS = 8  # steps of half an interval, or longer ones, between no delay and the longest
Trial = tuple[Member, float]  # a joint, and the factor on R and K

REQUIREMENTS = {
    "estimate": f"an estimate within {LEFT_OVER:g} F of zero after the hand has let go",
    "admit": f"a joint that rests within {100 * RESTLESS:g} % of the stroke after a knock",
}
WAYS_OUT = "Narrow the intervals (--stiffness, --friction-error), shorten the delay, or use a finer encoder."


def requirement(goal: str) -> str:
    """Return the requirement of a goal's safety test in words."""
    return REQUIREMENTS.get(goal, f"a joint that rests within {AT_REST:g} counts after a knock")


def ends(goal: Goal) -> list[Member]:
    """Return the joints at the ends of the intervals, each with delays from none to the longest."""
    facts = goal.facts
    steps = int(np.clip(np.ceil(2.0 * facts.delay / facts.interval), 1, MOST_DELAYS)) if facts.delay else 0
    delays = np.linspace(0.0, facts.delay, steps + 1)
    return [replace(m, delay=float(delay)) for m in goal.test_on for delay in delays]


def trials(goal: Goal, members: Sequence[Member]) -> list[Trial]:
    """Return the whole test: the ends of the intervals with R and K a little larger and as proposed, and drawn joints."""
    ended = ends(goal)
    return [(m, NUDGE) for m in ended] + [(m, 1.0) for m in (*ended, *members)]


def rests(goal: Goal, z: Numbers, tried: Sequence[Trial], longest: float = FINE) -> bool:
    """Return whether the joint comes to rest in all trials; the first that fails ends it. `longest`: integration step [s]."""
    pieces = (tried[first : first + AT_ONCE] for first in range(0, len(tried), AT_ONCE))
    return not any(restless(goal, z, piece, longest) for piece in pieces)


def restless(goal: Goal, z: Numbers, tried: Sequence[Trial], longest: float = FINE) -> list[Trial]:
    """Return the trials in which a joint does not come to rest; `longest`: integration step [s]."""
    unrests = play_trials(goal, z, tried, longest)[:, 0]
    return [trial for trial, unrest in zip(tried, unrests, strict=True) if not unrest <= 1.0]


def play_trials(goal: Goal, z: Numbers, tried: Sequence[Trial], longest: float = FINE) -> np.ndarray:
    """Return the motion at rest by the allowed one, and the energy that the compensation puts in [J], of each trial, (n, 2).

    A trial that was played before with the same numbers is not played again. `longest`: integration step [s].
    """

    def push(factor: float) -> dict[str, float]:
        return {k: factor * x if k in ("share", "stiffness") else x for k, x in z.items()}

    pushed = [(push(factor), member) for member, factor in tried]
    keys = [(tuple(sorted(numbers.items())), member, longest) for numbers, member in pushed]
    missing = {key: trial for key, trial in zip(keys, pushed, strict=True) if key not in goal.played}
    made = (goal.trial(numbers, member, longest) for numbers, member in missing.values())
    goal.played.update(zip(missing, evaluate(made, lambda r: (goal.unrest(r), energy(r))), strict=True))
    return np.array([goal.played[key] for key in keys]).reshape(-1, 2)


def safe(goal: Goal, z: Numbers, members: Sequence[Member]) -> bool:
    """Return whether numbers pass the test.

    Args:
        goal: what they are for.
        z: the numbers.
        members: drawn joints.
    """
    if z.get("share") == 0.0:  # nothing acts on the joint, and friction takes its energy
        return True
    return rests(goal, z, trials(goal, members))


def calm(goal: Goal, z: dict[str, float], members: Sequence[Member]) -> dict[str, float]:
    """Reduce R (or another calming parameter) until the numbers pass the test, to within a quarter of a step.

    Args:
        goal: whose test.
        z: the numbers.
        members: drawn joints.

    Raises:
        NotIdentifiable: they do not pass it at the end of their range either.
    """
    for way in goal.calming:
        found = _calm_by(goal, z, members, way)
        if found is not None:
            return found
    limits = "; ".join(
        f"{k} to {goal.ranges[k][0 if f < 1.0 else 1]:.3g}" for k, f in goal.calming[-1].items()
    )
    raise NotIdentifiable(
        f"Joint '{goal.facts.name}': no safe numbers were found. Even with the largest reduction ({limits}), they do not give "
        f"{requirement(goal.name)} at the ends of all intervals and on all {len(members)} joints drawn from them.",
        remedy=WAYS_OUT,
    )


def _calm_by(
    goal: Goal, z: dict[str, float], members: Sequence[Member], way: Numbers
) -> dict[str, float] | None:
    """Reduce numbers in one way until they pass; None if they fail even at the end of their range."""
    every = trials(goal, members)
    left = [trial for trial in every if trial[1] > 1.0]
    failed: Numbers | None = None
    while True:  # a few trials with the coarse step until they come to rest, then all with the fine step
        left = restless(goal, z, left, SUBSTEP) or restless(goal, z, every)
        if not left:
            return z if failed is None else _nearer(goal, z, failed, every, way)
        failed = z
        calmer = {k: float(np.clip(z[k] * factor, *goal.ranges[k])) for k, factor in way.items()}
        if all(calmer[k] == z[k] for k in calmer):
            return None
        z = {**z, **calmer}


def _nearer(
    goal: Goal, z: dict[str, float], failed: Numbers, every: Sequence[Trial], way: Numbers
) -> dict[str, float]:
    """Return numbers that pass, with the last reduction halved `HALVINGS` times, since excessive reduction makes the joint
    heavier.
    """
    for _ in range(HALVINGS):
        middle = {**z, **{k: float(np.sqrt(z[k] * failed[k])) for k in way}}
        if rests(goal, middle, every):
            z = middle
        else:
            failed = middle
    return z
