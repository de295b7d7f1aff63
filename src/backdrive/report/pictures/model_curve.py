"""The friction curve of a model without its evidence: knots, values, and the widest band that the standard errors permit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.curves import widen_below
from backdrive.identification.evidence import curve
from backdrive.identification.result import Curve
from backdrive.identification.sweep_verdict import error_of_curve
from backdrive.laws import Law, Polyline
from backdrive.model import JointFriction


def knots_of(friction: JointFriction) -> np.ndarray:
    """Return velocity and torque of the points that define a joint's curve, (k, 2), if there are any."""
    rate = friction.law.rate
    if not isinstance(rate, Polyline):
        return np.empty((0, 2))
    speed = np.asarray(rate.velocity)
    forward = np.column_stack([speed, rate.positive])
    backward = np.column_stack([-speed, -np.asarray(rate.negative)])
    low, high = friction.validity.velocity
    points = np.vstack([backward[::-1], forward])
    both = np.concatenate([np.full(speed.size, low < 0), np.full(speed.size, high > 0)])
    return points[both]


def model_curve(friction: JointFriction, points: int = 121) -> Curve:
    """Return a joint's curve over its validity range from the model alone.

    The band is the identification's own where the model holds the covariance; see `error_of`.

    Args:
        friction: of the joint.
        points: velocities a direction.
    """
    return curve(friction, error_of(friction), points)


def error_of(friction: JointFriction) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function from velocities [rad/s or m/s] to the curve's standard error [N.m or N], as the identification states it.

    With a covariance it is the root of J C J^T, wider below the lowest speed; without one, the largest possible.
    """
    law = friction.law
    if isinstance(law.rate, Polyline) and friction.method == "sweep":
        known = error_of_curve(friction)
        return widen_below(law, law.rate.velocity[0], known) if law.rate.velocity[0] > 0.0 else known
    if friction.covariance is None or not set(friction.covariance.names) & _rows_of(friction).keys():
        return partial(largest_error, friction)
    known, lowest = partial(_by_covariance, friction), friction.validity.lowest_speed
    if lowest and friction.method in ("motion", "constant-velocity"):
        return widen_below(law, lowest, known)
    return known


def _rows_of(friction: JointFriction) -> dict[str, tuple[str, int | None]]:
    """Return parameter and place in it by the name of a covariance's row, for the rate law."""
    rows: dict[str, tuple[str, int | None]] = {}
    for name, parameter in friction.law.rate.PARAMETERS.items():
        places = range(len(getattr(friction.law.rate, name))) if parameter.many else (None,)
        rows |= {name if i is None else f"{name}[{i}]": (name, i) for i in places}
    return rows


def _slope(
    friction: JointFriction, name: str, place: int | None, velocity: np.ndarray, h: float
) -> np.ndarray:
    """Return d tau_f / d p, (n,), by a finite difference of size h on that side where the law is defined."""
    rate, law = friction.law.rate, friction.law
    value = getattr(rate, name)
    for step in (h, -h):  # a parameter at its bound can move one way only
        new = value + step if place is None else (*value[:place], value[place] + step, *value[place + 1 :])
        try:
            shifted = Law(rate=replace(rate, **{name: new}), element=law.element)
        except InvalidInput:
            continue
        return (shifted.torque(velocity) - law.torque(velocity)) / step
    return np.zeros(velocity.shape)


def _by_covariance(friction: JointFriction, velocity: np.ndarray) -> np.ndarray:
    """Return sqrt(diag(J C J^T)) over the parameters of the rate law that the covariance holds, (n,)."""
    rows, covariance = _rows_of(friction), friction.covariance
    assert covariance is not None
    kept = [i for i, name in enumerate(covariance.names) if name in rows]
    matrix = covariance.array()[np.ix_(kept, kept)]
    slopes = [
        _slope(
            friction, *rows[covariance.names[i]], velocity, 1e-3 * max(float(np.sqrt(matrix[k, k])), 1e-12)
        )
        for k, i in enumerate(kept)
    ]
    J = np.array(slopes)
    return np.sqrt(np.maximum(np.einsum("in,ij,jn->n", J, matrix, J), 0.0))


def largest_error(friction: JointFriction, velocity: np.ndarray) -> np.ndarray:
    """Return the largest standard error of a joint's curve that its parameters' errors allow [N.m or N]; NaN if unknown.

    The sum of |d tau_f / d p| s_p over the parameters p of the rate law: no correlation gives more.

    Args:
        friction: of the joint.
        velocity: joint velocity [rad/s or m/s], (n,).
    """
    total, known = np.zeros(velocity.shape), False
    law = friction.law
    at = law.torque(velocity)
    for name, errors in friction.standard_errors.items():
        if name not in law.rate.PARAMETERS:
            continue
        value = getattr(law.rate, name)
        many = isinstance(value, tuple)
        if not many:
            errors = (errors,)
        elif not isinstance(errors, (tuple, list)):
            continue  # no error: the speeds of knots are chosen, not estimated
        for i, error in enumerate(errors):
            if error is None or not np.isfinite(error):
                return np.full(velocity.shape, np.nan)
            known = True
            if error == 0.0:
                continue
            number = value[i] if many else value
            step = max(1e-6 * abs(number), 1e-3 * error)
            for h in (step, -step):  # a parameter at its bound can move one way only
                try:
                    moved = (*value[:i], number + h, *value[i + 1 :]) if many else number + h
                    shifted = Law(rate=replace(law.rate, **{name: moved}), element=law.element)
                except InvalidInput:
                    continue
                total += np.abs(shifted.torque(velocity) - at) / step * error
                break
    return total if known else np.full(velocity.shape, np.nan)
