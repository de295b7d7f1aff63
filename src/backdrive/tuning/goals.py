"""The goals of a tuning: for each, the parameters with their ranges, the score, and the safety test.

The goals `backdrive` and `track` choose R, K and alpha of algFC. The score is what a person feels (`wishes`), or the error of a
soft position controller. The goal `estimate` chooses K and alpha of algFE and the gains of the filter; the score is the error
of the external force. The goal `admit` chooses m and b; the score is the hand's mean peak force. Each goal has a safety test
over the ends of the intervals, which is the same for all proposals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from backdrive._catalog import did_you_mean
from backdrive.control import Admittance, BareLoop, JointLoop
from backdrive.control.compensators import Compensator, Dither, alg_fc, nothing
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.errors import InvalidInput
from backdrive.simulation.closed_loop import Record, Scene
from backdrive.tuning import members as members_
from backdrive.tuning import rules, scenes
from backdrive.tuning.evaluation import evaluate
from backdrive.tuning.facts import SOFTEST, Facts, scale_rate
from backdrive.tuning.members import Member
from backdrive.tuning.scenes import SUBSTEP, Stroke
from backdrive.tuning.tuning import LEADING
from backdrive.tuning.wishes import WISHES, Part, check_wish, coasting, standing

Numbers = Mapping[str, float]
Ranges = Mapping[str, tuple[float, float]]

AT_REST = 2.0  # half-amplitude up to which a joint counts as resting: the flicker caused by one count of feedback [count]
LEFT_OVER = 0.1  # allowed remainder of an estimate after the hand has let go, relative to F [-]
RESTLESS = 0.01  # allowed oscillation of a joint under admittance control, relative to the stroke [-]
POSITION = 60.0  # largest bandwidth of the position controller under an admittance [rad/s]
DERIVATIVE = 0.4  # largest K_d (T + T_d)/M of this controller, for a stable loop around the motor alone [-]
DECAYS = (1.0, 500.0)  # limits of alpha [1/s]: torque gone 3 s after a stop, and half of it in one tick
BACK_OFF = 0.96  # factor on R, or on another calming parameter, if a joint does not come to rest
SOFTER = 0.85  # factor on K as well, if R alone is not sufficient
AT_ONCE = 4  # joints that are tested together where the first failure ends the test
GOALS = ("backdrive", "track", "estimate", "admit")


def check_goal(name: Any) -> None:
    """Refuse what is no goal; the message names those that there are."""
    if not isinstance(name, str) or name not in GOALS:
        raise InvalidInput(
            f"There is no goal {name!r}.",
            remedy=f"{did_you_mean(str(name), GOALS)}Goals are {', '.join(GOALS)}.",
        )


def compensator(facts: Facts, z: Numbers, dither: Dither | None = None) -> Compensator:
    """Return algFC with numbers: share R [-], stiffness K by K_c [-], decay alpha [1/s]."""
    return alg_fc(facts.rate, z["stiffness"] * facts.stiffness, z["decay"], dither, z["share"])


def estimator(facts: Facts, z: Numbers, share: float = 1.0) -> ExternalForce:
    """Return algFE with a cascade of filters.

    Args:
        facts: of the joint.
        z: stiffness K by K_c [-], decay [1/s], gain and second_gain of the filters.
        share: R of the friction that is subtracted: under an admittance, subtracting too much would drive the joint [-].
    """
    return ExternalForce(
        inertia=facts.inertia,
        friction=alg_fe(
            scale_rate(facts.rate, share, facts.top_speed), z["stiffness"] * facts.stiffness, z["decay"]
        ),
        filter=MotionFilter(gain=z["gain"], second_gain=z["second_gain"]),
    )


def admittance(facts: Facts, z: Numbers) -> Admittance:
    """Return the admittance: mass m by the joint's inertia [-], viscosity b by m [1/s]."""
    motor = facts.motor_share * facts.inertia_interval[0]
    fastest = DERIVATIVE * motor / (facts.interval + facts.delay) / (1.4 * facts.inertia)
    bandwidth = min(POSITION, fastest)
    m = z["mass"] * facts.inertia
    return Admittance(
        inertia=m,
        viscosity=z["viscosity"] * m,
        proportional=facts.inertia * bandwidth**2,
        derivative=1.4 * facts.inertia * bandwidth,
        limit=LEADING * facts.coulomb,
    )


def filter_gains(stroke: Stroke) -> dict[str, float]:
    """Return G of both filters by the stroke: from its largest acceleration and jerk, times a factor that keeps the lag small.

    The largest acceleration of a minimum-jerk stroke is 5.77 A/D^2, its largest jerk 60 A/D^3.
    """
    A, D = stroke.length, stroke.duration
    return {"gain": 35.0 * 5.77 * A / D**2, "second_gain": 2.0 * 60.0 * A / D**3}


@dataclass(frozen=True, kw_only=True)
class Goal:
    """A goal of the tuning.

    Attributes:
        name: one of `GOALS`.
        facts: of the joint.
        stroke: of the hand.
        ranges: of the numbers that are sought; those that span a factor of five or more in the logarithm.
        parts: of the score: the scene to simulate and the value to read from it; smaller is better.
        score_on: joints on which they are averaged.
        trial: function from numbers, a joint and the longest integration step to the scene of the safety test.
        unrest: motion in that scene relative to the allowed one: above 1 the test fails.
        test_on: joints of the safety test.
        words: description of the score.
        unit: of the score.
        calming: factors on numbers that calm a restless joint; the ways are tried one after the other.
        played: results of the safety test by numbers, joint and step (`safety.play_trials`).
    """

    name: str
    facts: Facts
    stroke: Stroke
    ranges: Ranges
    parts: Sequence[Part]
    score_on: Sequence[Member]
    trial: Callable[[Numbers, Member, float], Scene]
    unrest: Callable[[Record], float]
    test_on: Sequence[Member]
    words: str
    unit: str
    calming: Sequence[Numbers]
    played: dict[Any, tuple[float, float]] = field(default_factory=dict, init=False, repr=False)

    def scores(self, many: Sequence[Numbers]) -> np.ndarray:
        """Return the score of each set of numbers, (n,)."""
        weighed = [part for part in self.parts if part.weight > 0.0]
        values = self.values(weighed, many)
        return np.sum([part.weight * values[part.name] for part in weighed], axis=0)

    def values(self, parts: Sequence[Part], many: Sequence[Numbers]) -> dict[str, np.ndarray]:
        """Return parts of the score of each set of numbers by name, without their weights, (n,) each.

        Parts that are read from the same scene share its simulation.
        """
        found: dict[str, np.ndarray] = {}
        for scene in dict.fromkeys(part.scene for part in parts):
            alike = [part for part in parts if part.scene is scene]
            made = (scene(z, m) for z in many for m in self.score_on)
            each = evaluate(made, lambda record, alike=alike: [part.value(record) for part in alike])
            for part, read in zip(alike, np.array(each).reshape(-1, len(alike)).T, strict=True):
                one = read.reshape(len(many), -1) / part.unit()
                found[part.name] = np.where(np.isfinite(one), one, np.inf).mean(axis=1)
        return {part.name: found[part.name] for part in parts}

    def part_scores(self, many: Sequence[Numbers]) -> dict[str, np.ndarray]:
        """Return all parts of the score of each set of numbers by name, without their weights, (n,) each."""
        return self.values(self.parts, many)

    def worst(
        self,
        many: Sequence[Numbers],
        members: Sequence[Member] | None = None,
        longest: float = SUBSTEP,
    ) -> np.ndarray:
        """Return the largest motion at rest over the joints for each set of numbers, relative to the limit, (n,); up to 1 is
        safe.
        """
        return self.unrests(many, self.test_on if members is None else members, longest).max(axis=1)

    def rests(self, z: Numbers, members: Sequence[Member] | None = None, longest: float = SUBSTEP) -> bool:
        """Return whether numbers are safe on all joints; the first few joints of which one is not end the test."""
        every = self.test_on if members is None else members
        pieces = (every[first : first + AT_ONCE] for first in range(0, len(every), AT_ONCE))
        return all(self.worst([z], piece, longest)[0] <= 1.0 for piece in pieces)

    def unrests(
        self, many: Sequence[Numbers], members: Sequence[Member], longest: float = SUBSTEP
    ) -> np.ndarray:
        """Return the same for each set of numbers and each joint, (n, m); `longest`: integration step [s]."""
        made = (self.trial(z, m, longest) for z in many for m in members)
        found = np.array(evaluate(made, self.unrest)).reshape(len(many), -1)
        return np.where(np.isfinite(found), found, np.inf)


def goal_of(name: str, facts: Facts, stroke: Stroke, base: Numbers | None = None, wish: str = "even") -> Goal:
    """Return a goal for a joint.

    Args:
        name: one of `GOALS`.
        facts: of the joint.
        stroke: of the hand.
        base: for `admit`, numbers of the estimator.
        wish: for `backdrive`, one of `wishes.WISHES`.

    Raises:
        InvalidInput: there is no such goal or wish.
    """
    check_wish(wish)
    check_goal(name)
    K_low, K_c = facts.stiffness_interval[0], facts.stiffness
    spring = {"stiffness": (SOFTEST * K_low / K_c, facts.stiffest / K_c), "decay": DECAYS}
    corners, middle = members_.corners(facts), members_.nominal(facts)
    force = "N.m" if facts.unit == "rad" else "N"
    if name in ("backdrive", "track"):

        def loop(z: Numbers) -> JointLoop:
            return BareLoop(compensator=compensator(facts, z))

        most = rules.largest_share(1.0 - facts.friction[0])
        share = (min(0.3, 0.5 * most), most)
        guides = name == "backdrive"

        def tracking_scene(z: Numbers, member: Member) -> Scene:
            return scenes.tracking(facts, member, loop(z), stroke)

        parts = (
            _feelings(facts, stroke, middle, WISHES[wish])
            if guides
            else [Part(name="error", scene=tracking_scene, value=tracking_error)]
        )
        return Goal(
            name=name,
            facts=facts,
            stroke=stroke,
            ranges={"share": share} | spring,
            parts=parts,
            score_on=[middle],
            trial=lambda z, member, longest: scenes.knock(facts, member, loop(z), longest),
            unrest=lambda r: scenes.amplitude(r) / (AT_REST * facts.count),
            test_on=corners,
            words=f"the feel of the joint, weighted by the wish '{wish}'"
            if guides
            else "error of tracking, root mean square",
            unit="-" if guides else facts.unit,
            calming=[{"share": BACK_OFF}, {"share": BACK_OFF, "stiffness": SOFTER}],
        )
    if name == "estimate":
        first = filter_gains(stroke)
        gains = {k: (0.2 * g, 8.0 * g) for k, g in first.items()}

        def watch(z: Numbers) -> JointLoop:
            return BareLoop(compensator=nothing(), external=estimator(facts, z))

        quiet = slice(-round(1.0 / facts.interval), -round(0.6 / facts.interval))
        return Goal(
            name=name,
            facts=facts,
            stroke=stroke,
            ranges=spring | gains,
            parts=[
                Part(
                    name="error",
                    scene=lambda z, member: scenes.guidance(facts, member, watch(z), stroke),
                    value=lambda r: float(np.sqrt(np.mean((r.estimate - r.force) ** 2))),
                )
            ],
            score_on=corners[::2],
            trial=lambda z, member, longest: scenes.release(facts, member, watch(z), stroke, longest),
            unrest=lambda r: float(np.abs(np.mean(r.estimate[quiet]))) / (LEFT_OVER * facts.coulomb),
            test_on=corners,
            words="error of the external force, root mean square",
            unit=force,
            calming=[{"decay": 1.0 / BACK_OFF}],
        )
    base = dict(base or {"stiffness": 0.5, "decay": 20.0} | filter_gains(stroke))
    controller = admittance(facts, {"mass": 1.0, "viscosity": 1.0})
    lightest = 2.0 * facts.interval * controller.derivative / facts.inertia

    def square_run(z: Numbers) -> dict:
        return {"controller": admittance(facts, z)}

    share = rules.largest_share(1.0 - facts.friction[0])

    def estimating(z: Numbers) -> JointLoop:
        return BareLoop(compensator=nothing(), external=estimator(facts, {**base, **z}, share))

    gains = {
        k: (g, 100.0 * g) for k, g in filter_gains(stroke).items()
    }  # a slow filter makes the loop unstable
    return Goal(
        name=name,
        facts=facts,
        stroke=stroke,
        ranges={"mass": (lightest, 5.0 * max(lightest, 1.0)), "viscosity": (2.0, 60.0)} | gains,
        parts=[
            Part(
                name="force",
                scene=lambda z, member: scenes.guidance(
                    facts, member, estimating(z), stroke, **square_run(z)
                ),
                value=lambda r: scenes.peak_force(r, stroke),
            )
        ],
        score_on=corners[::2],
        trial=lambda z, member, longest: scenes.knock(facts, member, estimating(z), longest, **square_run(z)),
        unrest=lambda r: scenes.amplitude(r) / (RESTLESS * stroke.length),
        test_on=corners,
        words="mean peak force of the hand",
        unit=force,
        calming=[{"mass": 1.0 / BACK_OFF, "viscosity": 1.0 / BACK_OFF}],
    )


def _feelings(facts: Facts, stroke: Stroke, middle: Member, weights: Numbers) -> list[Part]:
    """Return the parts of a person's impression of a compensated joint, with their weights."""

    def loop(z: Numbers) -> JointLoop:
        return BareLoop(compensator=compensator(facts, z))

    def guiding_scene(z: Numbers, member: Member) -> Scene:
        return scenes.guidance(facts, member, loop(z), stroke)

    def release_scene(z: Numbers, member: Member) -> Scene:
        return scenes.release(facts, member, loop(z), stroke, SUBSTEP)

    def knock_scene(z: Numbers, member: Member) -> Scene:
        return scenes.knock(facts, member, loop(z))

    bare = {"share": 0.0, "stiffness": facts.stiffest / facts.stiffness, "decay": 20.0}
    played = {
        "force": (guiding_scene, lambda r: scenes.peak_force(r, stroke)),
        "standing": (release_scene, lambda r: standing(r, stroke, facts.coulomb)),
        "touch": (release_scene, lambda r: scenes.breakaway(r, stroke, facts.coulomb)),
        "coast": (knock_scene, coasting),
    }

    def of_bare(name: str) -> Callable[[], float]:
        scene, value = played[name]
        return cache(lambda: 1.0 if name == "standing" else evaluate([scene(bare, middle)], value)[0])

    return [
        Part(name=name, scene=scene, value=value, weight=weights[name], unit=of_bare(name))
        for name, (scene, value) in played.items()
    ]


def tracking_error(record: Record) -> float:
    """Return the RMS tracking error of a soft position controller, without the first half second [rad or m]."""
    begin = round(0.5 / record.scene.period)
    return float(np.sqrt(np.mean((record.wanted - record.load)[begin:] ** 2)))
