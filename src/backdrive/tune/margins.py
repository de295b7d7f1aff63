"""How far numbers are from breaking, and the region in which they do not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.closed_loop import play
from backdrive.compensate import Dither, nothing
from backdrive.control import JointLoop
from backdrive.tune import rules, scenes
from backdrive.tune.facts import Facts
from backdrive.tune.goals import AT_REST, Goal, Numbers, compensator
from backdrive.tune.scenes import Member, Stroke

SHARES = (0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05)
SPRINGS = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0, 1.2, 1.4)
DECAYS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
DELAYS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)  # of ticks
FEW = 64  # joints whose break-away is looked at
MOST = 1e6  # a picture needs no more


def least_breaking(breaks: Callable[[float], bool], low: float, high: float, steps: int = 6) -> float:
    """Return the smallest value between two that breaks, by bisection; infinite where the upper one does not.

    Args:
        breaks: whether a value does.
        low: a value that does not.
        high: where it is looked for.
        steps: of the bisection.
    """
    if not breaks(high):
        return np.inf
    for _ in range(steps):
        middle = 0.5 * (low + high)
        if breaks(middle):
            high = middle
        else:
            low = middle
    return high


def margins(
    facts: Facts, z: Numbers, members: Sequence[Member], stroke: Stroke, goal: Goal, dither: Dither | None
) -> dict[str, Any]:
    """Return how far a compensator is from breaking, over joints that the model may stand for.

    Args:
        facts: of the joint.
        z: share, stiffness by K_c, decay.
        members: joints, some hundred.
        stroke: of the hand.
        goal: whose safety test says what breaks.
        dither: at rest.
    """
    loop = JointLoop(compensator=compensator(facts, z))
    dithering = JointLoop(compensator=compensator(facts, z, dither))
    knocked = play([scenes.knock(facts, m, loop, scenes.FINE) for m in members])
    cycles = np.array([scenes.amplitude(r) for r in knocked])
    bounds = np.array([scenes.bound_of(facts, m, z["share"]) for m in members])
    freed = play([scenes.released(facts, m, dithering, stroke, scenes.SUBSTEP) for m in members[:FEW]])
    left = np.array([scenes.breakaway(r, stroke, facts.coulomb) for r in freed])
    bare = play([scenes.released(facts, goal.test_on[0], JointLoop(compensator=nothing()), stroke)])[0]

    def share_breaks(share: float) -> bool:
        return bool(goal.worst([{**z, "share": share}])[0] > 1.0)

    def delay_breaks(delay: float) -> bool:
        return bool(goal.worst([z], [replace(m, delay=delay) for m in goal.test_on])[0] > 1.0)

    return {
        "joints": len(members),
        "cycle": float(cycles.max()),
        "cycle_counts": float(cycles.max() / facts.count),
        "cycle_by_bound": float((cycles / bounds).max()),
        "at_rest": float(np.mean(cycles <= AT_REST * facts.count)),
        "energy": float(max(scenes.energy(r) for r in knocked)),
        "share_breaks": least_breaking(share_breaks, z["share"], 1.3),
        "delay_breaks": least_breaking(delay_breaks, facts.delay, 12.0 * facts.interval),
        "breakaway": float(left.mean()),
        "breakaway_worst": float(left.max()),
        "breakaway_bare": scenes.breakaway(bare, stroke, facts.coulomb),
    }


def region(facts: Facts, z: Numbers, goal: Goal, thesis: Numbers) -> dict[str, Any]:
    """Return what moves at rest over R and K/K_c, and over alpha and delay, by what is allowed; above 1 is unsafe.

    Args:
        facts: of the joint.
        z: the chosen numbers.
        goal: whose safety test is played.
        thesis: the thesis' numbers, for the picture.
    """
    ends = goal.test_on[1:]
    first = [{**z, "share": R, "stiffness": K} for R in SHARES for K in SPRINGS]
    by_share = goal.worst(first, ends).reshape(len(SHARES), -1)
    by_delay = np.array(
        [
            goal.worst(
                [{**z, "decay": a} for a in DECAYS], [replace(m, delay=n * facts.interval) for m in ends]
            )
            for n in DELAYS
        ]
    )
    return {
        "shares": SHARES,
        "springs": SPRINGS,
        "by_share": np.minimum(by_share, MOST).tolist(),
        "decays": DECAYS,
        "delays": [n * facts.interval for n in DELAYS],
        "by_delay": np.minimum(by_delay, MOST).tolist(),
        "stiffness_interval": [K / facts.stiffness for K in facts.stiffness_interval],
        "largest_share": rules.largest_share(1.0 - facts.friction[0]),
        "chosen": [z["share"], z["stiffness"], z["decay"], facts.delay],
        "thesis": [thesis["share"], thesis["stiffness"], thesis["decay"], facts.delay],
    }
