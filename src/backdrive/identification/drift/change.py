"""Test whether a joint's friction has changed: the distance of two identified curves, and whether noise explains it.

Let d be the difference of the two curves at some speeds, and C the sum of their covariances there. If nothing changed,
d' C^-1 d follows a chi-square distribution with one degree of freedom per speed. The curves are compared at no more speeds
than either has parameters, and at none below the lowest speed of either's data (`curve_errors`).

If only one of the models has a curve for each direction, the other one does not separate the directions. Then d is the
difference of (|F(v)| + |F(-v)|) / 2.

Standard errors are themselves estimates from a single log, which widens the tail of the test. On 200 pairs of simulated sweeps
without a change, the rate of false alarms was 2.5 % instead of 1 %, and 7.5 % instead of 5 %. Standard errors are therefore
multiplied by `curve_errors.REPEAT`, a factor chosen after that result (`benchmarks/evidence/drift.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.drift.curve_errors import (
    difference,
    errors_of,
    lowest_of,
    mahalanobis,
    middle,
    places,
    variance_of_mean,
)
from backdrive.identification.dynamics import growth_with_load
from backdrive.identification.metrics import curve_distance, relative_curve_distance
from backdrive.laws import Polyline
from backdrive.model import JointFriction
from backdrive.plans.base import phrase

ALARM = 0.01  # probability of a false alarm [-]
REACH = 1.96  # standard errors of a 95 % interval
LEFT = 0.05  # least part of a difference without a standard error that is remarked [-]
SLOWEST = 0.02  # lowest speed for the mean change, relative to the top speed, since curves jump at rest [-]
MEANS = 60  # number of speeds for the mean change


@dataclass(frozen=True, kw_only=True)
class Change:
    """What differs between two identifications of one joint.

    Attributes:
        joint: its name, in the second identification.
        before: its name in the first.
        unit: of torques, N.m or N.
        lowest_speed: smallest compared speed [rad/s or m/s].
        top_speed: largest one.
        distance: E of Iwatani 2017, (2.16), from the lowest speed on, along +q and -q [N.m or N].
        relative: E_p of (2.17), of the second to the first, along +q and -q [-].
        shape: size of the change of shape in the verdict: the larger of `relative`, or E_p of the mean of both directions [-].
        mean: mean of the second curve minus the first, divided by the mean of the first [-].
        mean_error: its standard error, `curve_errors.REPEAT` included [-]; NaN where a model has none.
        chi_square: of the test; NaN where a model has no standard errors.
        degrees: of freedom.
        probability: of a chi-square at least as large by chance [-].
        alarm: probability below which the difference counts as a change [-].
        remarks: what weakens the comparison, in sentences.
    """

    joint: str
    unit: str
    top_speed: float
    distance: tuple[float, float]
    relative: tuple[float, float]
    shape: float
    mean: float
    mean_error: float
    chi_square: float
    degrees: int
    probability: float
    alarm: float = ALARM
    remarks: tuple[str, ...] = ()
    before: str = ""
    lowest_speed: float = 0.0

    @property
    def is_testable(self) -> bool:
        """Whether both models have standard errors, which the test needs."""
        return bool(np.isfinite(self.probability))

    @property
    def is_significant(self) -> bool:
        """Whether the difference is more than chance."""
        return self.is_testable and self.probability < self.alarm

    @property
    def verdict(self) -> str:
        """The answer in words."""
        size = 100.0 * self.shape
        if not self.is_testable:
            return f"differs by up to {size:.3g} %; without standard errors it cannot be tested whether that is noise"
        reach = 100.0 * REACH * self.mean_error
        digits = int(np.clip(-np.floor(np.log10(max(reach, 1e-6))), 0, 6))
        amount = f"{100.0 * self.mean:+.{digits}f} +- {reach:.{digits}f} %"
        if not self.is_significant:
            return f"not changed beyond chance ({amount})"
        if abs(self.mean) > REACH * self.mean_error:
            return f"changed by {amount}, more than chance"
        return f"its curve changed shape by {size:.3g} % (on average {amount}), more than chance"


def change_of(
    first: JointFriction,
    second: JointFriction,
    *,
    top_speed: float | None = None,
    alarm: float = ALARM,
    covariances: tuple[np.ndarray | None, np.ndarray | None] = (None, None),
) -> Change:
    """Compare two identifications of one joint.

    Args:
        first: the earlier one, to which the change is relative.
        second: the later one.
        top_speed: largest compared speed, within the validity of both [rad/s or m/s]; None: as far as both are valid.
        alarm: probability of a false alarm [-].
        covariances: of the knots of each curve of line sections, along +q first [(N.m)^2 or N^2], (2 m, 2 m); None: that of the
            model, or its standard errors.

    Raises:
        InvalidInput: the units of the joints differ, the models have no common speed or `top_speed` exceeds it, a curve is
            zero or too large, or a covariance has the wrong size.
    """
    a, b = first.joint, second.joint
    if a.unit != b.unit:
        raise InvalidInput(
            f"Joint '{a.name}' is in {a.unit} in one model and '{b.name}' in {b.unit} in the other.",
            remedy="Compare models of the same joint.",
        )
    if not 0.0 < alarm < 1.0:
        raise InvalidInput(f"alarm = {alarm}.", remedy="Give a probability between 0 and 1, such as 0.01.")
    if top_speed is not None and not 0.0 < top_speed < np.inf:
        raise InvalidInput(
            f"top_speed = {top_speed} is no speed to compare up to.", remedy="Give a positive, finite number."
        )
    ends = [min(-f.validity.velocity[0], f.validity.velocity[1]) for f in (first, second)]
    top = min(ends) if top_speed is None else top_speed
    if not (min(ends) > 0 and np.isfinite(top)):
        raise InvalidInput(
            f"Joint '{a.name}': there is no speed at which both models hold in both directions.",
            remedy="Identify both from motion along +q and -q.",
        )
    if top > min(ends) * (1.0 + 1e-9):
        raise InvalidInput(
            f"Joint '{a.name}': both models hold up to {phrase(min(ends), a.unit + '/s', -1)}, not up to "
            f"{phrase(top, a.unit + '/s')}; beyond, one of them extrapolates.",
            remedy="Compare up to a lower speed, or leave it out.",
        )
    low = max(lowest_of(f, top) for f in (first, second))
    if not low < top:
        raise InvalidInput(
            f"Joint '{a.name}': one model holds from {phrase(low, a.unit + '/s', 1)} on, and the comparison ends at "
            f"{phrase(top, a.unit + '/s', -1)}.",
            remedy="Compare up to a higher speed, or identify both from motion at the same speeds.",
        )
    second, remarks = _under_the_same_load(first, second)
    needs = sorted({n for f in (first, second) for n in f.law.rate.NEEDS})
    if needs:
        remarks.append(
            f"The curves are those without load and at 20 degC, though the law depends on {' and '.join(needs)}."
        )
    with np.errstate(all="ignore"):
        distance = [curve_distance(second.law, first.law, top, direction=way, lowest=low) for way in (1, -1)]
        relative = [
            relative_curve_distance(second.law, first.law, top, direction=way, lowest=low) for way in (1, -1)
        ]
        speeds = np.linspace(max(SLOWEST * top, low), top, MEANS)
        before, after = (middle(f.law.torque, speeds) for f in (first, second))
        base = float(np.mean(before))
        mean = float(np.mean(after - before)) / base if base else float("nan")
    if not np.isfinite([*distance, *relative, mean]).all():
        raise InvalidInput(
            f"Joint '{a.name}': its curves are zero, or too large for their distance.",
            remedy="Look at both models with `backdrive show`.",
        )
    parts = [errors_of(f, c) for f, c in zip((first, second), covariances, strict=True)]
    error, chi_square, degrees, probability = float("nan"), float("nan"), 0, float("nan")
    shape = max(relative)
    if parts[0] is not None and parts[1] is not None:
        one_way = parts[0].tied or parts[1].tied
        if one_way and not (parts[0].tied and parts[1].tied):
            shape = float(np.sqrt(np.mean((after - before) ** 2) / np.mean(before**2)))
            which = "first" if parts[0].tied else "second"
            remarks.append(
                f"The mean of both directions was compared, since the {which} model has one curve for both; the "
                f"difference between the directions was not tested."
            )
        both = (first, parts[0]), (second, parts[1])
        at = places(both, low, top, one_way)
        d, C = difference(both, at, one_way)
        error = float(np.sqrt(sum(variance_of_mean(*one, speeds) for one in both))) / base
        chi_square, degrees, untested = mahalanobis(d, C)
        probability = chance(chi_square, degrees)
        if not degrees:
            remarks.append(
                "The standard errors are of numbers that do not act at these speeds, so no test is possible."
            )
        elif untested > LEFT:
            remarks.append(
                f"{100.0 * untested:.0f} % of the difference has no standard error and was not tested."
            )
            probability = probability if probability < alarm else float("nan")
    else:
        without = [n for n, p in zip(("first", "second"), parts, strict=True) if p is None]
        who = "Neither model has" if len(without) == 2 else f"The {without[0]} model has no"
        why = "the warnings of the model say why; what was identified with --literal has none"
        remarks.append(f"{who} standard errors, so no test is possible: {why}.")
    return Change(
        joint=b.name,
        before=a.name,
        unit=a.torque_unit,
        lowest_speed=float(low),
        top_speed=float(top),
        distance=(distance[0], distance[1]),
        relative=(relative[0], relative[1]),
        shape=shape,
        mean=mean,
        mean_error=error,
        chi_square=chi_square,
        degrees=degrees,
        probability=probability,
        alarm=alarm,
        remarks=tuple(remarks),
    )


def _under_the_same_load(first: JointFriction, second: JointFriction) -> tuple[JointFriction, list[str]]:
    """Return the second model's friction under the load of the first model's curve, and remarks on the conversion."""
    before, after = growth_with_load(first), growth_with_load(second)
    if before is None and after is None:
        return second, []
    if before is None or after is None:
        says, other = ("second", "first") if before is None else ("first", "second")
        return second, [
            f"Only the {says} model contains the growth of friction with the load. The load at which the {other} "
            f"one was identified is unknown and may explain the difference."
        ]
    growth = second.law.growth
    assert growth is not None
    moved, rate = after[0] * (before[1] - after[1]), second.law.rate
    if abs(moved) <= 1e-9 * max(before[1], after[1], 1.0) or not isinstance(rate, Polyline):
        return second, []
    up, down = (tuple(max(f + moved, 0.0) for f in side) for side in (rate.positive, rate.negative))
    said = f"The second curve, which holds under {after[1]:.3g} {first.joint.torque_unit}, was brought to the first one's load, "
    growth = replace(growth, load_carried=before[1])
    law = replace(second.law, rate=replace(rate, positive=up, negative=down), growth=growth)
    return replace(second, law=law), [f"{said}{before[1]:.3g} {first.joint.torque_unit}."]


def chance(chi_square: float, degrees: int) -> float:
    """Return the probability of a chi-square at least as large [-].

    Args:
        chi_square: the sum of squares [-].
        degrees: of freedom.
    """
    from scipy.special import gammaincc

    return float(gammaincc(0.5 * degrees, 0.5 * chi_square)) if degrees else float("nan")


def kind_of(change: Change) -> Literal["changed", "not changed", "not judged"]:
    """Return the outcome as a word for programs."""
    if not change.is_testable:
        return "not judged"
    return "changed" if change.is_significant else "not changed"
