"""What was chosen for a joint, why, and how far it is from breaking. `tuning_file` keeps it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from backdrive.compensate import Compensator, Dither, alg_fc, alg_fc2, nothing
from backdrive.control import Admittance, JointLoop
from backdrive.errors import InvalidInput
from backdrive.estimate.external import ExternalForce
from backdrive.estimate.friction import alg_fe
from backdrive.estimate.sliding_mode import MotionFilter
from backdrive.laws.base import Rate
from backdrive.tune.facts import shared

CONTACT = ("stiffness", "decay_rate")
FILTER = ("filter_gain", "second_filter_gain", "filter_ratio")
SWITCH = ("fast_decay", "switch_rate", "threshold")
DITHER = ("dither_share", "dither_frequency")
ADMITTANCE = ("admittance_inertia", "admittance_viscosity", "position_gain", "velocity_gain")
LOOP = ("share", *CONTACT, *SWITCH, *DITHER, *FILTER, *ADMITTANCE)
#: Which numbers the tuning for a goal has.
NAMES = {
    "backdrive": LOOP,
    "track": LOOP,
    "estimate": (*CONTACT, *FILTER),
    "admit": ("share", *CONTACT, *FILTER, *ADMITTANCE),
}


@dataclass(frozen=True, kw_only=True)
class Number:
    """A parameter, and what speaks for it.

    Attributes:
        symbol: as the thesis prints it.
        value: SI.
        unit: of it.
        reason: one sentence.
        bound: what it respects, one sentence.
        limit: that bound as a number [unit]; NaN where it is none.
    """

    symbol: str
    value: float
    unit: str
    reason: str
    bound: str = ""
    limit: float = math.nan


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """The parameters of one joint.

    Attributes:
        joint: its name.
        unit: `rad` or `m`.
        goal: what they were chosen for.
        rate: rate law of the model, all of it: compensator and, for `admit`, estimator take `share` of it.
        top_speed: fastest that the model has seen [rad/s or m/s].
        inertia: of the joint [kg.m^2 or kg].
        interval: sampling time that they are for [s].
        numbers: by name.
        scores: what the proposal, no compensation, the fixed rule and the thesis' numbers achieve, and whether each is safe.
        margins: how far the proposal is from breaking, by name with unit.
        region: the safe region for the figure; empty where it was not asked for.
        notes: what was assumed, in sentences.
        seed: of the search.
    """

    joint: str
    unit: str
    goal: str
    rate: Rate
    top_speed: float
    inertia: float
    interval: float
    numbers: Mapping[str, Number]
    scores: Mapping[str, Any]
    margins: Mapping[str, Any]
    region: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    seed: int = 0

    def __getitem__(self, name: str) -> float:
        if name not in self.numbers:
            raise InvalidInput(
                f"Joint '{self.joint}' was tuned for '{self.goal}', which has no '{name}'.",
                remedy=f"It has {', '.join(self.numbers)}.",
            )
        return self.numbers[name].value

    def compensator(self, *, dither: bool = True, switching: bool = False) -> Compensator:
        """Return the friction compensator; one that gives nothing where the goal is an estimate.

        Args:
            dither: with the proposed dither at rest, where there is any.
            switching: algFC2, whose decay rate goes up in motion, instead of algFC.
        """
        if self.goal in ("estimate", "admit"):
            return nothing()
        sine = None
        if dither and self["dither_share"] > 0.0:
            sine = Dither(share=self["dither_share"], frequency=self["dither_frequency"], mode="reset")
        if not switching:
            return alg_fc(self.rate, self["stiffness"], self["decay_rate"], sine, self["share"])
        return alg_fc2(
            self.rate,
            self["stiffness"],
            self["threshold"],
            self["decay_rate"],
            self["fast_decay"],
            self["switch_rate"],
            sine,
            self["share"],
        )

    def external(self) -> ExternalForce:
        """Return the estimator of the external force; for `admit` it takes `share` of the friction."""
        share = self["share"] if self.goal == "admit" else 1.0
        return ExternalForce(
            inertia=self.inertia,
            friction=alg_fe(shared(self.rate, share, self.top_speed), self["stiffness"], self["decay_rate"]),
            filter=MotionFilter(
                gain=self["filter_gain"],
                ratio=self["filter_ratio"],
                second_gain=self["second_filter_gain"],
                second_ratio=self["filter_ratio"],
            ),
        )

    def admittance(self) -> Admittance:
        """Return the admittance controller; a tuning for `estimate` has none."""
        return Admittance(
            inertia=self["admittance_inertia"],
            viscosity=self["admittance_viscosity"],
            proportional=self["position_gain"],
            derivative=self["velocity_gain"],
        )

    def loop(self) -> JointLoop:
        """Return what runs on the joint in a torque loop."""
        return JointLoop(compensator=self.compensator(), external=self.external())
