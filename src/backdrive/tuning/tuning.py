"""The parameters chosen for a joint, with reasons and stability margins. `tuning_file` stores them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from backdrive._upper import Display, upper
from backdrive.control import Admittance, JointLoop, torque_limit
from backdrive.control.compensators import Compensator, Dither, alg_fc, alg_fc2, nothing
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.errors import InvalidInput
from backdrive.laws import Growth, Law
from backdrive.laws.base import Rate
from backdrive.tuning.facts import Facts, scale_rate

LEADING = 20.0  # torque of the position controller under an admittance, by F [-]
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
    """A parameter, with its reason and its bound.

    Attributes:
        symbol: as the thesis prints it.
        value: SI.
        unit: of it.
        reason: one sentence.
        bound: its bound, one sentence.
        limit: that bound as a number [unit]; NaN where it is none.
    """

    symbol: str
    value: float
    unit: str
    reason: str
    bound: str = ""
    limit: float = math.nan


@dataclass(frozen=True, kw_only=True)
class Tuning(Display):
    """The parameters of one joint.

    Attributes:
        joint: its name.
        unit: `rad` or `m`.
        goal: goal of the tuning.
        rate: rate law of the model, unscaled: compensator and, for `admit`, estimator use `share` of it.
        growth: growth of friction with the load, used with the same share; None if the model does not contain it.
        top_speed: largest speed in the model's data, not a limit of the joint [rad/s or m/s].
        inertia: of the joint [kg.m^2 or kg].
        interval: sampling time that they are for [s].
        trip_speed: speed above which the loop switches off, from the robot's description or the user [rad/s or m/s]; None:
            not given, so `loop` requires it.
        limit: of the compensating torque [N.m or N]; None where there is no trip speed.
        encoder_count: step of the encoder [rad or m].
        numbers: by name.
        scores: scores of the proposal, no compensation, the fixed rule and the thesis' numbers, and whether each is safe.
        margins: stability margins of the proposal, by name with unit.
        region: the safe region for the figure; empty unless it was made with `draw=True`; `plot` then computes it.
        notes: what was assumed, in sentences.
        seed: of the search.
        facts: data of the joint, from which `plot` computes the region; None of a tuning that was read from a file.
        stroke: of the hand, an object of `tuning.scenes`, or None likewise.
    """

    joint: str
    unit: str
    goal: str
    rate: Rate
    top_speed: float
    inertia: float
    interval: float
    growth: Growth | None = None
    encoder_count: float | None = None
    trip_speed: float | None = None
    limit: float | None = None
    numbers: Mapping[str, Number]
    scores: Mapping[str, Any]
    margins: Mapping[str, Any]
    region: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    seed: int = 0
    facts: Facts | None = field(default=None, repr=False, compare=False)
    stroke: Any = field(default=None, repr=False, compare=False)

    def __getitem__(self, name: str) -> float:
        if name not in self.numbers:
            raise InvalidInput(
                f"Joint '{self.joint}' was tuned for '{self.goal}', which has no '{name}'.",
                remedy=f"It has {', '.join(self.numbers)}.",
            )
        return self.numbers[name].value

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as the tuning file holds them."""
        return upper("tuning.tuning_file", "plain")(self)

    def plot(self) -> Any:
        """Return a picture of the safe region as a matplotlib figure; the region is computed once, which takes some seconds.

        Raises:
            InvalidInput: the goal is `estimate` or `admit`, or the tuning was read from a file without its region.
            MissingExtra: matplotlib is not installed.
        """
        return upper("report.show", "picture")(self if self.region else self._with_region)

    @cached_property
    def _with_region(self) -> Tuning:
        return replace(self, region=upper("tuning.region", "region_of")(self))

    def compensator(self, *, dither: bool = True, switching: bool = False) -> Compensator:
        """Return the friction compensator; it gives no torque if the goal is an estimate.

        Args:
            dither: with the proposed dither at rest, where there is any.
            switching: algFC2, whose decay rate goes up in motion, instead of algFC.
        """
        if self.goal in ("estimate", "admit"):
            return nothing()
        law, sine = Law(rate=self.rate, growth=self.growth), None
        if dither and self["dither_share"] > 0.0:
            sine = Dither(share=self["dither_share"], frequency=self["dither_frequency"], mode="reset")
        if not switching:
            return alg_fc(law, self["stiffness"], self["decay_rate"], sine, self["share"])
        return alg_fc2(
            law,
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
        growth = None if self.growth is None else self.growth.scale(share)
        law = Law(rate=scale_rate(self.rate, share, self.top_speed), growth=growth)
        return ExternalForce(
            inertia=self.inertia,
            friction=alg_fe(law, self["stiffness"], self["decay_rate"]),
            filter=MotionFilter(
                gain=self["filter_gain"],
                ratio=self["filter_ratio"],
                second_gain=self["second_filter_gain"],
                second_ratio=self["filter_ratio"],
            ),
        )

    def admittance(self, limit: float | None = None) -> Admittance:
        """Return the admittance controller; a tuning for `estimate` has none.

        Args:
            limit: of its torque [N.m or N]; None: 20 times the friction of the joint.
        """
        friction = float(np.mean(Law(rate=self.rate).coulomb()))
        return Admittance(
            inertia=self["admittance_inertia"],
            viscosity=self["admittance_viscosity"],
            proportional=self["position_gain"],
            derivative=self["velocity_gain"],
            limit=LEADING * friction if limit is None else limit,
        )

    def loop(
        self,
        *,
        top_speed: float | None = None,
        limit: float | None = None,
        encoder_count: float | None = None,
    ) -> JointLoop:
        """Return the joint's settings for a torque loop, with its limits.

        Args:
            top_speed: above which the joint is a runaway [rad/s or m/s]; None: the tuning's `trip_speed`.
            limit: of the compensating torque [N.m or N]; None: the tuning's, or that of `torque_limit`.
            encoder_count: step of the encoder [rad or m]; None: the tuning's.

        Raises:
            InvalidInput: neither the tuning nor the call has a top speed or an encoder count, or they lie outside the envelope.
        """
        top = self.trip_speed if top_speed is None else top_speed
        count = self.encoder_count if encoder_count is None else encoder_count
        for name, value, option in (
            ("top speed", top, "--top-speed or --urdf"),
            ("encoder count", count, "--counts"),
        ):
            if value is None:
                raise InvalidInput(
                    f"Joint '{self.joint}': the tuning has no {name}, and the largest speed of a log cannot replace it.",
                    remedy=f"Say `tuning.loop({name.replace(' ', '_')}=...)`, or run `backdrive tune` with {option}.",
                )
        assert top is not None
        assert count is not None
        compensator = self.compensator()
        if limit is None:
            stored = self.limit if top_speed is None else None
            limit = torque_limit(compensator, top) if stored is None else stored
        return JointLoop(
            compensator=compensator,
            external=self.external(),
            top_speed=top,
            limit=limit,
            encoder_count=count,
        )
