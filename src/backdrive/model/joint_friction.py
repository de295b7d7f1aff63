"""`JointFriction`: the identified friction of one joint, with its errors and its range of validity."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.laws import Law
from backdrive.logs.log import Joint
from backdrive.model.covariance import Covariance
from backdrive.model.hardware import Actuator, TorqueChannel
from backdrive.model.prior_comparison import PriorComparison
from backdrive.model.quality import Bands, Quality, Verdict
from backdrive.parameters import NOT_NEGATIVE, Bounds, WithBounds

EDGE = 1e-9  # relative tolerance of the validity range's ends, for rounding errors [-]
ALIKE = 0.05  # largest difference of the top speeds by direction that are stated as one, relative to the larger [-]
ARM_LOW = 0.05  # "low speed" of an arm as a share of the top speed [-]


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A number with its unit and standard error.

    Attributes:
        value: the estimate [unit].
        unit: SI.
        standard_error: one standard deviation [unit]; NaN when unknown.
    """

    value: float
    unit: str
    standard_error: float = float("nan")


@dataclass(frozen=True, kw_only=True)
class Validity(WithBounds):
    """The range that the data covered; outside it the model extrapolates.

    Attributes:
        velocity: smallest and largest velocity seen [rad/s or m/s].
        load: smallest and largest transmitted torque seen [N.m or N], if known.
        temperature: smallest and largest temperature seen [degC], if known.
        lowest_speed: speed below which the data contain no sustained motion, so that the curve is extrapolated [rad/s or
            m/s], if known.
        nominal_load: mean size of the load under which the curve was identified and is valid [N.m or N], if known.
    """

    BOUNDS: ClassVar[Bounds] = dict.fromkeys(("lowest_speed", "nominal_load"), NOT_NEGATIVE)
    LOW: ClassVar[float] = (
        0.02  # "low speed" as a share of the top speed, unless the data end at a higher speed [-]
    )

    velocity: tuple[float, float]
    load: tuple[float, float] | None = None
    temperature: tuple[float, float] | None = None
    lowest_speed: float | None = None
    nominal_load: float | None = None

    def __post_init__(self):
        super().__post_init__()
        for name in ("velocity", "load", "temperature"):
            ends = getattr(self, name)
            if ends is not None and not (-math.inf < ends[0] <= ends[1] < math.inf):
                raise InvalidInput(
                    f"validity.{name} goes from {ends[0]:g} to {ends[1]:g}.",
                    remedy="Give two finite numbers, the smaller one first.",
                )

    @property
    def speeds(self) -> tuple[float, float]:
        """Low and top speed at which friction is reported in texts and tables [rad/s or m/s]."""
        top = max(abs(v) for v in self.velocity)
        return min(max(self.LOW * top, self.lowest_speed or 0.0), top), top


@dataclass(frozen=True, kw_only=True)
class JointFriction:
    """The friction of one joint.

    Attributes:
        joint: whose friction it is.
        law: rate law and presliding element with their values.
        standard_errors: by parameter of the law (rate law, element, growth), one number or one a knot [its unit].
        at_bound: names of parameters that ended at a bound of their range.
        dynamics: the rest of the inverse dynamics found beside the friction, by term (see
            `identification.dynamics`): inertia, offset, gravity_sin, gravity_cos, ...
        validity: the range that the data covered.
        fitted: quality on the data of the fit.
        held_out: quality on data that the fit did not see; None when nothing was held out.
        method: which identification found it.
        warnings: what makes the result suspect, in sentences.
        covariance: of law and dynamics; its diagonal holds the squares of the standard errors, and rows of numbers that the joint
            does not have are left out.
        torque_channel: delay and noise of the torque that was measured.
        actuator: limits, gain and inertia of the actuator.
        friction_side: of the gear that the numbers refer to, `joint` or `motor`.
        verdict: grade of the result, and its summary in words.
        bands: how far measured torque lay from the predicted one, by state of motion.
        prior: the comparison with what was known before the log; None without a prior.
    """

    joint: Joint
    law: Law
    validity: Validity
    standard_errors: Mapping[str, Any] = field(default_factory=dict[str, Any])
    at_bound: tuple[str, ...] = ()
    dynamics: Mapping[str, Estimate] = field(default_factory=dict[str, Estimate])
    fitted: Quality | None = None
    held_out: Quality | None = None
    method: str = ""
    warnings: tuple[str, ...] = ()
    covariance: Covariance | None = None
    torque_channel: TorqueChannel | None = None
    actuator: Actuator | None = None
    friction_side: Literal["joint", "motor"] | None = None
    verdict: Verdict | None = None
    bands: Bands | None = None
    prior: PriorComparison | None = None

    def __post_init__(self):
        if self.friction_side not in (None, "joint", "motor"):
            raise InvalidInput(
                f"Joint '{self.joint.name}': the friction refers to the unknown side '{self.friction_side}'.",
                remedy="It is joint or motor.",
            )
        if self.covariance is not None:
            object.__setattr__(self, "covariance", self.covariance.of_numbers(self._errors()))

    def _errors(self) -> dict[str, Any]:
        """Return the standard error of every number, one for each of its values; NaN means unknown."""
        errors: dict[str, Any] = {name: e.standard_error for name, e in self.dynamics.items()}
        for rows in self.law.parts:
            for name, parameter in rows.PARAMETERS.items():
                unknown = (math.nan,) * len(getattr(rows, name)) if parameter.many else math.nan
                errors[name] = self.standard_errors.get(name, unknown)
        return errors

    @property
    def delay(self) -> float:
        """By which torque was recorded later than motion [s]: identified, or else that of the torque's channel; 0 if unknown."""
        known = [self.dynamics[t].value for t in ("delay", "time_slip") if t in self.dynamics]
        if known:
            return float(sum(known))
        channel = self.torque_channel
        return 0.0 if channel is None or channel.delay is None else float(channel.delay)

    @property
    def speeds(self) -> tuple[float, float]:
        """Low and top speed at which texts and tables report friction [rad/s or m/s].

        In a log of a whole arm, reversals and not sliding determine the curve below a twentieth of the top speed.
        """
        low, top = self.validity.speeds
        return max(low, ARM_LOW * top) if self.method == "arm" else low, top

    @property
    def speeds_by_way(self) -> dict[float, tuple[float, float]]:
        """The same of each direction that was seen, 1 and -1 [rad/s or m/s].

        None is stated beyond the speed that it reached, unless both are one curve.
        """
        low, top = self.speeds
        reach = {1.0: self.validity.velocity[1], -1.0: -self.validity.velocity[0]}
        one = np.isclose(*np.abs(self.law.torque(np.array([top, -top]))), rtol=1e-9, atol=0.0)
        least = 0.0 if one else (1.0 - ALIKE) * top
        seen = {way: top if speed > least else speed for way, speed in reach.items() if speed > 0.0}
        return {way: (min(low, speed), speed) for way, speed in seen.items()}

    def driving(self, above: float = 0.0) -> tuple[float, float] | None:
        """Return the part of the validity range in which friction is negative and so drives the motion.

        Friction resists motion where tau_f v >= 0. This is checked at 201 velocities and at the knots, between which line
        sections are straight.

        Args:
            above: slower velocities are not checked [rad/s or m/s].

        Returns:
            Lowest and highest such velocity [rad/s or m/s]; None where there is none.
        """
        low, high = self.validity.velocity
        knots = np.asarray(getattr(self.law.rate, "velocity", ()), dtype=np.float64)
        velocity = np.concatenate([np.linspace(low, high, 201), knots, -knots])
        velocity = velocity[(velocity >= low) & (velocity <= high) & (np.abs(velocity) >= above)]
        wrong = velocity[self.law.torque(velocity) * velocity < 0.0]
        return (float(wrong.min()), float(wrong.max())) if wrong.size else None

    def outside(self, velocity: np.ndarray) -> np.ndarray:
        """Return at which velocities [rad/s or m/s] the model extrapolates, of the shape of `velocity`.

        These are velocities beyond the validity range, and those that are slower than the slowest sustained motion of the data.
        """
        return self.beyond(velocity) | self.too_slow(velocity)

    def beyond(self, velocity: np.ndarray) -> np.ndarray:
        """Return which velocities [rad/s or m/s] are beyond the ends of the validity range, of the shape of `velocity`."""
        low, high = self.validity.velocity
        return (velocity < low - EDGE * abs(low)) | (velocity > high + EDGE * abs(high))

    def too_slow(self, velocity: np.ndarray) -> np.ndarray:
        """Return which velocities [rad/s or m/s] are below the lowest speed of the data, but not zero, of their shape."""
        speed = np.abs(velocity)
        return (speed > 0.0) & (speed < (1.0 - EDGE) * (self.validity.lowest_speed or 0.0))

    def lowest_speed_remark(self) -> str:
        """Return a sentence on speeds below the lowest one of the data; empty if it is not known."""
        if not self.validity.lowest_speed:
            return ""
        return (
            f"Below {self.validity.lowest_speed:.3g} {self.joint.unit}/s, the lowest speed of sustained motion in the data, "
            "friction is unknown; there the model extrapolates."
        )

    def extrapolation(self, velocity: np.ndarray) -> str:
        """Return a sentence on velocities [rad/s or m/s] beyond the validity range; empty if there are none.

        Velocities below the lowest speed of the data are not mentioned, since every motion from rest passes through them.
        """
        outside = self.beyond(velocity)
        if not np.any(outside):
            return ""
        low, high, unit = *self.validity.velocity, f"{self.joint.unit}/s"
        beyond = velocity[outside]
        furthest = float(beyond[np.argmax(np.maximum(low - beyond, beyond - high))])
        share = f", with {100.0 * np.mean(outside):.3g} % of the velocities" if velocity.size > 1 else ""
        return (
            f"Joint '{self.joint.name}': {furthest:.4g} {unit} is outside the validity range, {low:.4g} to {high:.4g} {unit}"
            f"{share}; there the model extrapolates."
        )

    def remarks(self) -> tuple[str, ...]:
        """Return warnings that follow from the parameters alone."""
        ends, unit = self.driving(), f"{self.joint.unit}/s"
        if ends is None:
            return ()
        where = f"at {ends[0]:.4g}" if ends[0] == ends[1] else f"between {ends[0]:.4g} and {ends[1]:.4g}"
        return (f"Friction is negative {where} {unit}: there the model drives the motion.",)
