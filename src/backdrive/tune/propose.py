"""From what is known of a joint to the numbers that run on it: search, rules, check over the model's uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from backdrive.closed_loop import play
from backdrive.compensate import Dither
from backdrive.control import JointLoop
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.tune import rules, scenes
from backdrive.tune.facts import Facts
from backdrive.tune.goals import (
    GOALS,
    LEFT_OVER,
    RESTLESS,
    Goal,
    Numbers,
    compensator,
    filter_gains,
    goal_of,
    shared,
)
from backdrive.tune.margins import margins, region
from backdrive.tune.reasons import dither_bound, dither_frequency, numbers_of
from backdrive.tune.scenes import Member, Stroke
from backdrive.tune.search import search
from backdrive.tune.tuning import Tuning

#: The thesis' own numbers, Iwatani 2017, Sec. 3.5.1: K by unit of the joint, alpha, and no share R.
THESIS_STIFFNESS = {"rad": 5e4, "m": 1.2e6}
THESIS_DECAY = 20.0
DITHER_SHARE = 0.3  # Sec. 3.5.1
SLACK = 0.8  # of the bound of dither
BACK_OFF = 0.96  # of R, where a drawn joint does not rest
NUDGE = 1.03  # on R and K, with which the ends of the intervals have to rest too
TIMES = 8  # it may be taken back

Say = Callable[[str], None]


def thesis_numbers(facts: Facts) -> dict[str, float]:
    """Return R = 1, K as printed by K_c, alpha = 20."""
    return {
        "share": 1.0,
        "stiffness": THESIS_STIFFNESS[facts.unit] / facts.stiffness,
        "decay": THESIS_DECAY,
    }


def fixed_rule(facts: Facts) -> dict[str, float]:
    """Return R = 0.8, K = 0.72 K_c, alpha = 20, within what is allowed: the rule to begin with."""
    return {"share": 0.8, "stiffness": min(0.72, facts.stiffest / facts.stiffness), "decay": THESIS_DECAY}


def tune(
    facts: Facts,
    goal: str = "backdrive",
    *,
    stroke: Stroke | None = None,
    joints: int = 200,
    seed: int = 0,
    draw: bool = False,
    dither: bool = True,
    say: Say = lambda sentence: None,
) -> Tuning:
    """Choose the parameters of a joint and check them over joints that the model may stand for.

    Args:
        facts: what is known of the joint.
        goal: `backdrive`, `track`, `estimate` or `admit`.
        stroke: of the hand; None: the stated one.
        joints: drawn from the intervals for the check; all of them have to rest.
        seed: of search and check.
        draw: work out the safe region too.
        dither: propose one where it is safe.
        say: told what is going on.

    Raises:
        InvalidInput: there is no such goal, or too few joints.
        NotIdentifiable: no numbers are safe over the intervals.
    """
    if goal not in GOALS:
        raise InvalidInput(f"There is no goal '{goal}'.", remedy=f"Goals are {', '.join(GOALS)}.")
    if joints < 8:
        raise InvalidInput(f"{joints} joints are too few for a check.", remedy="Give 8 or more; 200 is good.")
    stroke = stroke or scenes.stated(facts)
    notes = list(facts.notes)
    if facts.stiffest < facts.stiffness_interval[0] / (1.0 + facts.friction_error) * 0.999:
        notes.append(
            "The encoder is coarse: K is held so low that one count moves the torque by at most half of F; a compensator of the "
            "full stiffness would be a relay of one count."
        )
    z = (
        _chosen(facts, "backdrive" if goal == "track" else goal, stroke, seed, say)
        if goal in GOALS[2:]
        else {}
    )
    if goal in ("backdrive", "track"):
        z = _chosen(facts, goal, stroke, seed, say)
    guiding = goal_of(goal if goal == "track" else "backdrive", facts, stroke)
    members = scenes.drawn(facts, joints, seed)
    sine: Dither | None = None
    found: dict[str, Any] = {}
    if goal in ("backdrive", "track"):
        say("Checking over joints that the model may stand for")
        z = calmed(guiding, z, members, notes)
        sine = _dither(facts, z, members, notes, say) if dither else None
        say("Measuring the margins")
        found = margins(facts, z, members, stroke, guiding, sine)
    else:
        z = {"share": rules.largest_share(1.0 - facts.friction[0])} | z
        sought = goal_of(goal, facts, stroke, z)
        say("Checking over joints that the model may stand for")
        few = members[: max(8, joints // 4)]
        found = {"joints": len(few), "left_over": float(sought.worst([z], few)[0])}
    scores = _scores(facts, goal, goal_of(goal, facts, stroke, z), z)
    picture: dict[str, Any] = {}
    if draw and goal in ("backdrive", "track"):
        say("Mapping the safe region")
        picture = region(facts, z, guiding, thesis_numbers(facts))
    return Tuning(
        joint=facts.name,
        unit=facts.unit,
        goal=goal,
        rate=shared(facts, z["share"]) if goal == "admit" else facts.rate,
        inertia=facts.inertia,
        interval=facts.interval,
        numbers=numbers_of(facts, z, sine, stroke, goal),
        scores=scores,
        margins=found,
        region=picture,
        notes=tuple(notes),
        seed=seed,
    )


def _chosen(facts: Facts, name: str, stroke: Stroke, seed: int, say: Say) -> dict[str, float]:
    """Return the best safe numbers for a goal."""
    base: dict[str, float] = {}
    if name == "admit":  # the estimator first
        base = _chosen(facts, "estimate", stroke, seed, say)
    goal = goal_of(name, facts, stroke, base)
    starts = []
    if name == "estimate":
        starts = [{"stiffness": 0.5, "decay": THESIS_DECAY} | filter_gains(stroke)]
    elif name == "admit":
        starts = [{"mass": 1.0, "viscosity": 10.0} | {k: 25.0 * g for k, g in filter_gains(stroke).items()}]
    else:
        starts = [fixed_rule(facts)]
    light = name in ("estimate", "admit")
    found = search(goal, seed=seed, starts=starts, width=16 if light else 32, say=say)
    if found.numbers is None:
        what = {
            "estimate": f"an estimate within {LEFT_OVER:g} F of zero after the hand has let go",
            "admit": f"a joint that rests within {100 * RESTLESS:g} % of the stroke after a knock",
        }.get(name, "a joint that rests within 2 counts after a knock")
        raise NotIdentifiable(
            f"Joint '{facts.name}': none of {found.tried} sets of numbers gives {what} at the ends of all intervals.",
            remedy="Narrow the intervals (--stiffness, --friction-error), shorten the delay, or use a finer encoder.",
        )
    return base | found.numbers


def calmed(
    goal: Goal, z: dict[str, float], members: Sequence[Member], notes: list[str] | None = None
) -> dict[str, float]:
    """Take R back until every drawn joint rests, and the ends of the intervals with R and K a little larger too.

    A search ends at the border of what passes its test; this keeps the proposal off it.

    Args:
        goal: whose safety test.
        z: share, stiffness by K_c, decay.
        members: drawn joints.
        notes: to which it is added what was taken back.
    """
    begun, left, off = z["share"], list(members), False
    for _ in range(TIMES):
        nudged = {**z, "share": NUDGE * z["share"], "stiffness": NUDGE * z["stiffness"]}
        off = bool(goal.worst([nudged])[0] <= 1.0)
        left = [m for m, u in zip(left, goal.unrests([z], left)[0]) if u > 1.0] if left else []
        if not left and off:
            break
        z = {**z, "share": BACK_OFF * z["share"]}
    said = [] if notes is None else notes
    if left or not off:
        said.append(f"Even R = {z['share']:.2f} leaves joints of the intervals in motion: see the margins.")
    if z["share"] < begun:
        said.append(
            f"R was taken back from {begun:.3f} to {z['share']:.3f}, to keep off the border of what comes to rest."
        )
    return z


def _dither(facts: Facts, z: Numbers, members: list[Member], notes: list[str], say: Say) -> Dither | None:
    """Return the largest dither that moves no joint beyond its bound."""
    say("Trying dither")
    bound = rules.stuck_dither(z["share"], z["stiffness"] * facts.stiffness, facts.stiffness_interval[0])
    share = min(DITHER_SHARE, SLACK * bound * facts.friction[0])
    few = members[: max(8, len(members) // 4)]
    for _ in range(3):
        sine = Dither(share=share, frequency=dither_frequency(facts, z), mode="reset")
        loop = JointLoop(compensator=compensator(facts, z, sine))
        records = play([scenes.knock(facts, m, loop) for m in few])
        if all(
            scenes.amplitude(r) <= dither_bound(facts, m, z, sine)
            and np.ptp(r.load[-round(0.5 / facts.interval) :]) <= 2.0 * dither_bound(facts, m, z, sine)
            for r, m in zip(records, few)
        ):
            return sine
        share *= 0.5
    notes.append("No dither was found that leaves every drawn joint in place: none is proposed.")
    return None


def _scores(facts: Facts, name: str, goal: Goal, z: dict[str, float]) -> dict[str, Any]:
    """Return the scores of the proposal beside those of no compensation, the fixed rule and the thesis."""
    rows: dict[str, dict[str, float]] = {"chosen": z}
    if name in ("backdrive", "track"):
        rows |= {
            "none": {**z, "share": 0.0},
            "fixed rule": fixed_rule(facts),
            "thesis": thesis_numbers(facts),
        }
    values, worst = goal.scores(list(rows.values())), goal.worst(list(rows.values()))
    return {
        "words": goal.words,
        "rows": {
            row: {"score": float(s), "safe": bool(w <= 1.0), "numbers": numbers}
            for (row, numbers), s, w in zip(rows.items(), values, worst)
        },
    }
