"""Errors of two friction curves at the speeds where they are compared.

The covariance is that of the model. A model file may contain standard errors without their correlations; then the parameters'
errors are taken as independent. This is nearly true for the knots of one sweep. The knots of several sweeps share the error of
gravity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.laws import Law, Polyline
from backdrive.model import JointFriction

REPEAT = 1.1  # scatter of repeated identifications, divided by the standard error from one log [-]
LEAST_EIGEN = 1e-6  # least variance of a tested combination of speeds, relative to the largest one [-]
SLOW = 0.05  # lowest speed where no knots tell one, relative to the top speed [-]

Number = tuple[str, int | None]  # a parameter, and the index of one of its values


@dataclass(frozen=True, kw_only=True, eq=False)
class Errors:
    """Free numbers of a law.

    Attributes:
        numbers: of each row, what changes together.
        covariance: of the rows, `REPEAT` included, (P, P).
        tied: the law has one curve for both directions.
    """

    numbers: list[list[Number]]
    covariance: np.ndarray
    tied: bool


def errors_of(friction: JointFriction, covariance: np.ndarray | None) -> Errors | None:
    """Return the free numbers of a joint's curve with their errors; None where a model has none.

    Args:
        friction: of the joint.
        covariance: of the knots of a curve of line sections, along +q first, (2 m, 2 m); None: that of the model, or its standard
            errors.

    Raises:
        InvalidInput: the covariance has the wrong size.
    """
    rate = friction.law.rate
    given = {
        name: np.ravel(np.asarray(friction.standard_errors.get(name, ()), dtype=float))
        for name in rate.PARAMETERS
    }
    several = {n for n, e in friction.standard_errors.items() if isinstance(e, (tuple, list))}
    mirrored = _both_ways(friction, given)
    if isinstance(rate, Polyline):
        m = len(rate.velocity)
        given = {name: given.get(name, np.zeros(0)) for name in ("positive", "negative")}
        several |= set(given)
        if covariance is None and any(
            given[name].size != m for name in given if name not in mirrored.values()
        ):
            return None
        if covariance is not None:
            if np.shape(covariance) != (2 * m, 2 * m) or not np.isfinite(covariance).all():
                raise InvalidInput(
                    f"A covariance of the shape {np.shape(covariance)} for {m} knots a direction.",
                    remedy=f"Give {(2 * m, 2 * m)}, as `fit_sweeps` does.",
                )
            given = {
                name: np.sqrt(np.abs(np.diag(covariance)[first : first + m]))
                for name, first in zip(given, (0, m), strict=True)
            }
    rows = [
        (name, i if name in several else None, e)
        for name, errors in given.items()
        if name not in mirrored.values()
        for i, e in enumerate(errors.tolist())
    ]
    if not isinstance(rate, Polyline):
        rows = [row for row in rows if np.isfinite(row[2]) and row[2] > 0.0]
    numbers: list[list[Number]] = [[(n, i) for n in (name, mirrored.get(name)) if n] for name, i, _ in rows]
    deviation = np.array([e for *_, e in rows])
    with np.errstate(all="ignore"):
        variance = deviation**2
    if not variance.size or not np.all(np.isfinite(variance) & (variance > 0)):
        return None
    if covariance is not None:
        matrix = np.asarray(covariance)[: len(rows), : len(rows)]
    else:
        matrix = _of_model(friction, [numbers_[0] for numbers_ in numbers], variance)
    tied = bool(mirrored) or type(rate).SYMMETRIC
    return Errors(numbers=numbers, covariance=REPEAT**2 * matrix, tied=tied)


def _both_ways(friction: JointFriction, errors: dict[str, np.ndarray]) -> dict[str, str]:
    """Return the parameters along +q with those along -q, where all of them and their errors are alike; empty otherwise."""
    rate = friction.law.rate
    values = rate.values()
    pairs = {name: name.replace("positive", "negative") for name in values if "positive" in name}
    alike = all(
        other in values
        and np.array_equal(np.asarray(values[name]), np.asarray(values[other]))
        and (
            not errors.get(other, np.zeros(0)).size
            or np.array_equal(errors.get(name, np.zeros(0)), errors[other], equal_nan=True)
        )
        for name, other in pairs.items()
    )
    return pairs if alike else {}


def _of_model(friction: JointFriction, numbers: Sequence[Number], variance: np.ndarray) -> np.ndarray:
    """Return the covariance of numbers: the model's where it has all of them, else their variances alone, (P, P)."""
    known = friction.covariance
    names = [name if i is None else f"{name}[{i}]" for name, i in numbers]
    if known is None or not set(names) <= set(known.names):
        return np.diag(variance)
    at = [known.names.index(name) for name in names]
    return known.array()[np.ix_(at, at)]


def middle(of: Callable[[np.ndarray], np.ndarray], speeds: np.ndarray) -> np.ndarray:
    """Return the mean over both directions of a quantity that changes sign with the motion."""
    return 0.5 * (of(speeds) - of(-speeds))


def slopes(law: Law, errors: Errors, velocity: np.ndarray) -> np.ndarray:
    """Return the derivative of the torque with respect to each free number, (n, P)."""
    columns = []
    for group, variance in zip(errors.numbers, np.diag(errors.covariance), strict=True):
        for way in (1.0, -1.0):  # a number at its bound can change in one direction only
            step = way * 1e-3 * np.sqrt(variance)
            try:
                moved = Law(rate=_step_numbers(law.rate, group, step), element=law.element)
            except InvalidInput:
                continue
            columns.append((moved.torque(velocity) - law.torque(velocity)) / step)
            break
        else:
            columns.append(np.zeros(velocity.size))
    return np.stack(columns, axis=1)


def _step_numbers(rate, group: list[Number], step: float):
    changes = {}
    for name, i in group:
        value = getattr(rate, name)
        changes[name] = value + step if i is None else (*value[:i], value[i] + step, *value[i + 1 :])
    return replace(rate, **changes)


def lowest_of(friction: JointFriction, top: float) -> float:
    """Return the speed from which on a curve holds by its data [rad/s or m/s]; line sections begin at a knot that does."""
    low = friction.validity.lowest_speed or 0.0
    if low == 0.0 or not isinstance(friction.law.rate, Polyline):
        return low
    knots = np.array(friction.law.rate.velocity)
    return float(min(knots[(knots >= low / 1.02) & (knots < top)], default=low))


def places(both: Sequence[tuple[JointFriction, Errors]], low: float, top: float, one_way: bool) -> np.ndarray:
    """Return the signed speeds to compare at, from low to top, no more than the free numbers of either law."""
    most = min(len(p.numbers) if p.tied else len(p.numbers) // 2 for _, p in both)
    knots = [np.array(f.law.rate.velocity) for f, _ in both if isinstance(f.law.rate, Polyline)]
    knots = [k[(k > 0) & (k >= low / 1.02) & (k <= top * 1.02)] for k in knots]
    few = min(knots, key=len) if knots else np.zeros(0)
    speeds = few if 0 < few.size <= most else np.linspace(max(SLOW * top, low), top, max(most, 1))
    return speeds if one_way else np.concatenate([speeds, -speeds])


def difference(
    both: Sequence[tuple[JointFriction, Errors]], at: np.ndarray, one_way: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return the second curve minus the first at signed speeds [N.m or N], (n,), and its covariance, (n, n)."""
    d, C = np.zeros(at.size), np.zeros((at.size, at.size))
    for sign, (friction, errors) in zip((-1.0, 1.0), both, strict=True):
        of_numbers = partial(slopes, friction.law, errors)
        d += sign * (middle(friction.law.torque, at) if one_way else friction.law.torque(at))
        J = middle(of_numbers, at) if one_way else of_numbers(at)
        C += J @ errors.covariance @ J.T
    return d, C


def variance_of_mean(friction: JointFriction, errors: Errors, speeds: np.ndarray) -> float:
    """Return the variance of a curve's mean over speeds and both directions [(N.m)^2 or N^2]."""
    row = np.mean(middle(partial(slopes, friction.law, errors), speeds), axis=0)
    return float(row @ errors.covariance @ row)


def mahalanobis(d: np.ndarray, C: np.ndarray) -> tuple[float, int, float]:
    """Return d' C^-1 d and its degrees of freedom, without combinations whose variance is none, and their part of d [-]."""
    size, way = np.linalg.eigh(C)
    kept = size > LEAST_EIGEN * size[-1]
    along = way.T @ d
    left = float(np.linalg.norm(along[~kept]) / max(np.linalg.norm(d), 1e-300))
    return float(np.sum(along[kept] ** 2 / size[kept])), int(kept.sum()), left
