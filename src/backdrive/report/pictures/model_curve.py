"""The curve that a model alone describes: its knots, and its values with the widest band that its errors allow."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.evidence import curve
from backdrive.identification.result import Curve
from backdrive.laws import Law, Polyline
from backdrive.model import JointFriction


def knots_of(friction: JointFriction) -> np.ndarray:
    """Return the points that define a joint's curve, velocity and torque, (k, 2); empty where there are none."""
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

    A model file keeps standard errors, not their correlations, so the band is the widest possible; see `largest_error`.

    Args:
        friction: of the joint.
        points: velocities a direction.
    """
    return curve(friction, partial(largest_error, friction), points)


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
            continue  # nothing was estimated: the speeds of knots are chosen, not found
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
