"""From the data of a joint to its parameters: search, rules, and check over the model's uncertainty."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive._arguments import FLAG, FUNCTION, NUMBER, SEED, WORD, check_arguments, instance, optional
from backdrive._blas import on_one_thread
from backdrive.control import BareLoop, JointLoop, torque_limit
from backdrive.control.compensators import Dither
from backdrive.errors import LimitWarning, NotIdentifiable
from backdrive.tuning import members as members_
from backdrive.tuning import rules, safety, scenes
from backdrive.tuning.bounds import check_numbers
from backdrive.tuning.evaluation import evaluate
from backdrive.tuning.facts import Facts
from backdrive.tuning.goals import AT_REST, Goal, Numbers, check_goal, compensator, filter_gains, goal_of
from backdrive.tuning.margins import margins, region, residual_break_away
from backdrive.tuning.members import Member
from backdrive.tuning.reasons import dither_bound, dither_frequency, edges, numbers_of
from backdrive.tuning.refine import refine
from backdrive.tuning.scenes import Stroke
from backdrive.tuning.search import search
from backdrive.tuning.tuning import Tuning

#: The thesis' own numbers, Iwatani 2017, Sec. 3.5.1 and 3.5.2: K by unit of the joint, alpha, and no share R.
THESIS_STIFFNESS = {"rad": 5e4, "m": 1.2e6}
THESIS_DECAY = 20.0
DITHER_SHARE = 0.3  # Sec. 3.5.2
HARDLY = 0.9  # share of the score without compensation above which a proposal is hardly useful [-]
SLACK = 0.8  # of the bound of dither

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
    share = min(0.8, rules.largest_share(1.0 - facts.friction[0]))
    return {"share": share, "stiffness": min(0.72, facts.stiffest / facts.stiffness), "decay": THESIS_DECAY}


def full_rule(facts: Facts) -> dict[str, float]:
    """Return nearly the full R, the full K and a slow decay, a start for light joints."""
    share = 0.95 * rules.largest_share(1.0 - facts.friction[0])
    return {"share": share, "stiffness": facts.stiffest / facts.stiffness, "decay": 5.0}


ARGUMENTS = {
    "goal": WORD,
    "wish": WORD,
    "stroke": optional(instance("a Stroke", Stroke)),
    "draw": FLAG,
    "dither": FLAG,
    "say": FUNCTION,
    "joints": NUMBER,
    "seed": SEED,
    "effort": NUMBER,
}


@on_one_thread
def tune(  # noqa: PLR0913  (its options are given by keyword)
    facts: Facts,
    goal: str = "backdrive",
    *,
    wish: str = "even",
    stroke: Stroke | None = None,
    joints: int = 200,
    seed: int = 0,
    draw: bool = False,
    dither: bool = True,
    trip_speed: float | None = None,
    limit: float | None = None,
    effort: float = np.inf,
    say: Say = lambda sentence: None,
) -> Tuning:
    """Choose the parameters of a joint and check them over joints within the model's uncertainty.

    Args:
        facts: data of the joint.
        goal: `backdrive`, `track`, `estimate` or `admit`.
        wish: preference of the person who moves the joint, for `backdrive`: `light` in the hand, moved by a light `touch`,
            `calm` when released, or `even`, some of each.
        stroke: of the hand; None: the stated one.
        joints: drawn from the intervals for the check; all of them have to rest.
        seed: of search and check.
        draw: compute the safe region too.
        dither: propose one where it is safe.
        trip_speed: speed above which the loop switches off, from the robot's description or the user, stored in the tuning
            [rad/s or m/s]; None: the model's. Without any, `Tuning.loop` requires it.
        limit: of the compensating torque [N.m or N]; None: that of `torque_limit`, at most `effort`.
        effort: greatest torque of the robot's description [N.m or N]; the model's counts too.
        say: called with sentences on the progress.

    Raises:
        InvalidInput: there is no such goal or wish, too few joints, or the encoder is too coarse to see the trip speed.
        NotIdentifiable: no numbers are safe over the intervals.
    """
    check_arguments(ARGUMENTS, locals())
    check_goal(goal)
    trip_speed = facts.trip_speed if trip_speed is None else trip_speed
    check_numbers(f"Joint '{facts.name}'", joints=joints, seed=seed, trip_speed=trip_speed, limit=limit)
    if trip_speed is not None:
        JointLoop(limit=0.0, top_speed=trip_speed, encoder_count=facts.count)
    stroke = stroke or scenes.usual_stroke(facts)
    members = members_.sample(facts, joints, seed)
    scenes.check_step(facts, [*members_.corners(facts), *members])
    notes = [*facts.notes, *_remarks(facts, stroke)]
    loops = goal in ("backdrive", "track")
    searched = _search_numbers(
        facts, goal, stroke, seed, lambda sentence: say(f"{sentence}, part 1 of 5"), wish
    )
    if goal == "admit":
        searched = {"share": rules.largest_share(1.0 - facts.friction[0])} | searched
    judge = goal_of(goal, facts, stroke, searched, wish)
    members = members if loops else members[: max(8, joints // 4)]
    say("Checking over joints within the model's uncertainty, part 2 of 5")
    rows = _rows(facts, goal, judge, searched, members, seed)
    z = rows["chosen"]["numbers"]
    notes += edges(judge, z)
    if "none" in rows and rows["chosen"]["score"] > HARDLY * rows["none"]["score"]:
        notes.append(
            "This is hardly useful: it improves the score by less than 10 % over no compensation. A shorter --delay or "
            "narrower intervals would allow more."
        )
    sine: Dither | None = None
    if loops:
        sine, sway = _dither(facts, z, members, notes, say) if dither else (None, {})
        say("Measuring the margins, part 4 of 5")
        found = (
            margins(facts, z, members, judge) | sway | residual_break_away(facts, z, members, stroke, sine)
        )
    else:
        found = {"joints": len(members), "left_over": float(judge.worst([z], members, scenes.FINE)[0])}
    picture: dict[str, Any] = {}
    if draw and loops:
        say("Mapping the safe region, part 5 of 5")
        picture = region(facts, z, judge, thesis_numbers(facts))
    tuning = Tuning(
        joint=facts.name,
        unit=facts.unit,
        goal=goal,
        rate=facts.rate,
        growth=facts.growth,
        top_speed=facts.top_speed,
        inertia=facts.inertia,
        interval=facts.interval,
        encoder_count=facts.count,
        numbers=numbers_of(facts, z, sine, stroke, goal, searched if rows["chosen"]["searched"] else None),
        scores={"words": judge.words, "unit": judge.unit, "wish": wish, "rows": rows},
        margins=found,
        region=picture,
        notes=tuple(notes),
        seed=seed,
        facts=facts,
        stroke=stroke,
    )
    if loops:
        say("Trying algFC2, part 5 of 5")
        tuning = replace(tuning, margins={**found, "switching_at_rest": _switching(facts, tuning, members)})
    return within(
        tuning, trip_speed, limit, min(effort, facts.effort), scenes.PEAK * stroke.length / stroke.duration
    )


def within(
    tuning: Tuning, trip_speed: float | None, limit: float | None, effort: float, fastest: float
) -> Tuning:
    """Return a tuning with its limits, and with a note on each limit that is missing or unusual.

    Args:
        tuning: with its numbers.
        trip_speed: trip speed [rad/s or m/s]; None: not given.
        limit: of the compensating torque [N.m or N]; None: that of `torque_limit`, at most `effort`.
        effort: largest permissible torque of the joint [N.m or N].
        fastest: speed of the stroke [rad/s or m/s].
    """
    notes = list(tuning.notes)
    if trip_speed is None:
        notes.append(
            "No trip speed was given, so this file alone is not sufficient for a loop: give --top-speed or --urdf, or "
            "`tuning.loop(top_speed=...)`."
        )
        return replace(tuning, notes=tuple(notes))
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always", LimitWarning)
        if limit is None:
            limit = min(torque_limit(tuning.compensator(), trip_speed), effort)
        loop = tuning.loop(top_speed=trip_speed, limit=limit)
    notes += [str(each.message) for each in warned]
    if fastest > 0.9 * trip_speed:
        notes.append(
            f"The stroke is as fast as {fastest:.3g} {tuning.unit}/s; above {trip_speed:.3g} the loop switches off."
        )
    own = loop.compensator.share * loop.friction[0]
    if loop.limit < own:
        notes.append(f"The limit of {loop.limit:.3g} clips the compensation of up to {own:.3g}.")
    return replace(tuning, trip_speed=trip_speed, limit=loop.limit, notes=tuple(notes))


def _remarks(facts: Facts, stroke: Stroke) -> list[str]:
    """Return remarks on a proposal."""
    notes = []
    if facts.stiffest < facts.stiffness_interval[0] / (1.0 + facts.friction_error) * 0.999:
        notes.append(
            "The encoder is coarse: K is limited so that one count changes the torque by at most F/2. With the full stiffness, "
            "the compensator would act like a relay."
        )
    speed = scenes.PEAK * stroke.length / stroke.duration
    if speed > facts.top_speed:
        notes.append(
            f"The stroke is as fast as {speed:.3g} {facts.unit}/s, above the model's range of up to {facts.top_speed:.3g}: "
            f"friction there is extrapolated (--stroke, --duration)."
        )
    return notes


def _rows(
    facts: Facts, name: str, goal: Goal, searched: dict[str, float], members: Sequence[Member], seed: int
) -> dict[str, dict[str, Any]]:
    """Return the proposal and its alternatives, each with its score and the result of the same safety test.

    The proposal is the result of the search, refined until it is safe, or the fixed rule if that is safe and scores better.
    """
    others: dict[str, dict[str, float]] = {}
    if name in ("backdrive", "track"):
        others = {
            "none": {**searched, "share": 0.0},
            "fixed rule": fixed_rule(facts),
            "thesis": thesis_numbers(facts),
        }
    rows = {
        row: {
            "score": float(score),
            "safe": safety.safe(goal, z, members),
            "numbers": z,
            **_hand_feel(goal, z),
        }
        for (row, z), score in zip(
            others.items(), goal.scores(list(others.values())) if others else (), strict=True
        )
    }
    rule = rows.get("fixed rule", {"safe": False})
    chosen: dict[str, Any] = {"score": np.inf}
    try:
        z = refine(goal, searched, members, seed)
        chosen = {
            "score": float(goal.scores([z])[0]),
            "safe": True,
            "numbers": z,
            "searched": True,
            **_hand_feel(goal, z),
        }
    except NotIdentifiable:
        if not rule["safe"]:
            raise
    if rule["safe"] and rule["score"] < chosen["score"]:
        chosen = {**rule, "searched": False}
    return {"chosen": chosen, **rows}


def _hand_feel(goal: Goal, z: Numbers) -> dict[str, Any]:
    """Return the parts of a person's impression for given numbers; empty for goals without a hand."""
    return {"felt": {k: float(v[0]) for k, v in goal.part_scores([z]).items()}} if len(goal.parts) > 1 else {}


def _search_numbers(
    facts: Facts, name: str, stroke: Stroke, seed: int, say: Say, wish: str = "even"
) -> dict[str, float]:
    """Return the best safe numbers for a goal."""
    base: dict[str, float] = {}
    if name == "admit":  # the estimator first
        base = _search_numbers(facts, "estimate", stroke, seed, say)
    goal = goal_of(name, facts, stroke, base, wish)
    starts = []
    if name == "estimate":
        starts = [{"stiffness": 0.5, "decay": THESIS_DECAY} | filter_gains(stroke)]
    elif name == "admit":
        starts = [{"mass": 1.0, "viscosity": 10.0} | {k: 25.0 * g for k, g in filter_gains(stroke).items()}]
    else:
        starts = [fixed_rule(facts), full_rule(facts)]
    light = name in ("estimate", "admit")
    found = search(goal, seed=seed, starts=starts, width=16 if light else 32, say=say)
    if found.numbers is None:
        raise NotIdentifiable(
            f"Joint '{facts.name}': none of {found.tried} sets of numbers gives {safety.requirement(name)} "
            "at the ends of all intervals.",
            remedy=safety.WAYS_OUT,
        )
    return base | found.numbers


def _switching(facts: Facts, tuning: Tuning, members: Sequence[Member]) -> float:
    """Return the share of joints that come to rest after a knock with algFC2, which the safety test does not include [-]."""
    loop = BareLoop(compensator=tuning.compensator(dither=False, switching=True))
    knocked = evaluate((scenes.knock(facts, m, loop, scenes.FINE) for m in members), scenes.amplitude)
    return float(np.mean(np.array(knocked) <= AT_REST * facts.count))


def _dither(
    facts: Facts, z: Numbers, members: Sequence[Member], notes: list[str], say: Say
) -> tuple[Dither | None, dict[str, float]]:
    """Return the largest dither that moves no drawn joint beyond its bound, and the resulting oscillation of motor and load
    at rest.
    """
    say("Trying dither, part 3 of 5")
    bound = rules.sticking_dither(z["share"], z["stiffness"] * facts.stiffness, facts.stiffness_interval[0])
    share = min(DITHER_SHARE, SLACK * bound * facts.friction[0])
    for _ in range(3 if share > 0.0 else 0):
        sine = Dither(share=share, frequency=dither_frequency(facts, z), mode="reset")
        loop = BareLoop(compensator=compensator(facts, z, sine))
        sways = _sways(facts, z, sine, loop, members)
        if sways is not None:
            motor, load = (float(x) for x in sways.max(axis=0))
            return sine, {"dither_motor": motor, "dither_load": load, "dither_counts": motor / facts.count}
        share *= 0.5
    notes.append("Every dither tried moves at least one of the drawn joints, so none is proposed.")
    return None, {}


def _sways(
    facts: Facts, z: Numbers, sine: Dither, loop: BareLoop, members: Sequence[Member]
) -> np.ndarray | None:
    """Return the oscillation of motor and load of each joint at rest [rad or m], (m, 2); None if one is beyond its bound."""
    found: list[tuple[float, float]] = []
    for first in range(0, len(members), safety.AT_ONCE):  # the first joint beyond its bound ends the trial
        some = members[first : first + safety.AT_ONCE]
        made = (scenes.knock(facts, m, loop, scenes.FINE) for m in some)
        sways = evaluate(made, lambda r: (scenes.amplitude(r), scenes.amplitude(r, of="load")))
        allowed = np.array([dither_bound(facts, m, z, sine) for m in some])
        if not np.all(allowed >= np.array(sways).T):
            return None
        found += sways
    return np.array(found)
