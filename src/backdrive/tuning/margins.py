"""Stability margins of the chosen numbers, and the safe region."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.control import BareLoop
from backdrive.control.compensators import Compensator, Dither
from backdrive.tuning import members as members_
from backdrive.tuning import rules, scenes
from backdrive.tuning.evaluation import evaluate
from backdrive.tuning.facts import Facts
from backdrive.tuning.goals import AT_REST, Goal, Numbers, compensator
from backdrive.tuning.members import Member
from backdrive.tuning.safety import ends, play_trials
from backdrive.tuning.scenes import Stroke

SHARES = (0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05)
SPRINGS = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0, 1.2, 1.4)
DECAYS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
DELAYS = (0.0, 0.125, 0.25, 0.375, 0.5, 0.75, 1.0)  # of the longest shown
SHOWN = (
    4.0,
    1.6,
)  # longest delay shown: this many ticks, or this many times the joint's longest delay, whichever is longer
LARGEST = 1.3  # largest R in the search for instability [-]
FEW = 64  # number of joints for the break-away
MOST = 1e6  # largest value in the picture


def least_breaking(
    breaks: Callable[[float], bool], low: float, high: float, looks: int = 8, steps: int = 5
) -> float:
    """Return the smallest value in an interval that fails, or infinity if none fails, by equal steps and then bisection.

    Args:
        breaks: function that returns whether a value fails.
        low: a value that does not fail.
        high: upper end of the search.
        looks: steps of equal length.
        steps: steps of the bisection within the first failing step.
    """
    for place in np.linspace(low, high, looks + 1)[1:]:
        if breaks(float(place)):
            high = float(place)
            break
        low = float(place)
    else:
        return np.inf
    for _ in range(steps):
        middle = 0.5 * (low + high)
        if breaks(middle):
            high = middle
        else:
            low = middle
    return high


def margins(facts: Facts, z: Numbers, members: Sequence[Member], goal: Goal) -> dict[str, Any]:
    """Return the stability margins of a compensator without dither, over joints within the model's uncertainty.

    Args:
        facts: of the joint.
        z: share, stiffness by K_c, decay.
        members: joints, some hundred.
        goal: the goal, whose safety test defines a failure.
    """
    unrests, energies = play_trials(goal, z, [(m, 1.0) for m in members]).T
    cycles = unrests * AT_REST * facts.count
    bounds = np.array([scenes.bound_of(facts, m, z["share"]) for m in members])
    at_the_ends = ends(goal)

    def share_breaks(share: float) -> bool:
        return not goal.rests({**z, "share": share}, at_the_ends, scenes.FINE)

    def delay_breaks(delay: float) -> bool:
        late = [replace(m, delay=delay) for m in goal.test_on]
        return not goal.rests(z, late, scenes.FINE)

    longest = max(12.0 * facts.interval, 4.0 * facts.delay)
    return {
        "joints": len(members),
        "cycle": float(cycles.max()),
        "cycle_counts": float(cycles.max() / facts.count),
        "cycle_by_bound": float((cycles / bounds).max()),
        "at_rest": float(np.mean(cycles <= AT_REST * facts.count)),
        "energy": float(energies.max()),
        "share_breaks": least_breaking(share_breaks, z["share"], LARGEST),
        "share_searched": LARGEST,
        "delay_breaks": least_breaking(delay_breaks, facts.delay, longest, 16),
        "delay_searched": longest,
    }


def residual_break_away(
    facts: Facts, z: Numbers, members: Sequence[Member], stroke: Stroke, dither: Dither | None
) -> dict[str, float]:
    """Return the remaining break-away torque with compensation and dither, and that of the bare joint [N.m or N].

    Args:
        facts: of the joint.
        z: share, stiffness by K_c, decay.
        members: joints within the model's uncertainty.
        stroke: of the hand.
        dither: at rest.
    """

    def release_torque(what: Compensator, some: Sequence[Member]) -> np.ndarray:
        made = (scenes.release(facts, m, BareLoop(compensator=what), stroke, scenes.SUBSTEP) for m in some)
        return np.array(evaluate(made, lambda r: scenes.breakaway(r, stroke, facts.coulomb)))

    left = release_torque(compensator(facts, z, dither), members[:FEW])
    bare = release_torque(compensator(facts, {**z, "share": 0.0}), [members_.nominal(facts)])
    return {
        "breakaway": float(left.mean()),
        "breakaway_worst": float(left.max()),
        "breakaway_bare": float(bare[0]),
    }


def with_value(grid: Sequence[float], value: float) -> list[float]:
    """Return a grid that contains a given value: the nearest value is replaced, or the grid is extended to it."""
    if not grid[0] <= value <= grid[-1]:
        return np.linspace(min(grid[0], value), max(grid[-1], value), len(grid)).tolist()
    nearest = int(np.argmin(np.abs(np.array(grid) - value)))
    return [value if i == nearest else x for i, x in enumerate(grid)]


def region(facts: Facts, z: Numbers, goal: Goal, thesis: Numbers) -> dict[str, Any]:
    """Return the motion at rest over R and K/K_c, and over alpha and delay, relative to the allowed one; above 1 is unsafe.

    Args:
        facts: of the joint.
        z: the chosen numbers.
        goal: whose safety test is played.
        thesis: the thesis' numbers, for the picture.
    """
    longest = max(SHOWN[0] * facts.interval, SHOWN[1] * facts.delay)
    delays = with_value([longest * x for x in DELAYS], facts.delay)
    shares, springs, decays = (
        with_value(grid, z[name])
        for grid, name in ((SHARES, "share"), (SPRINGS, "stiffness"), (DECAYS, "decay"))
    )
    first = [{**z, "share": R, "stiffness": K} for R in shares for K in springs]
    by_share = goal.worst(first, ends(goal)).reshape(len(shares), -1)
    by_delay = np.array(
        [
            goal.worst(
                [{**z, "decay": a} for a in decays], [replace(m, delay=float(d)) for m in goal.test_on]
            )
            for d in delays
        ]
    )
    return {
        "shares": shares,
        "springs": springs,
        "by_share": np.minimum(by_share, MOST).tolist(),
        "decays": decays,
        "delays": delays,
        "by_delay": np.minimum(by_delay, MOST).tolist(),
        "stiffness_interval": [K / facts.stiffness for K in facts.stiffness_interval],
        "largest_share": rules.largest_share(1.0 - facts.friction[0]),
        "chosen": [z["share"], z["stiffness"], z["decay"], facts.delay],
        "thesis": [thesis["share"], thesis["stiffness"], thesis["decay"], facts.delay],
    }
