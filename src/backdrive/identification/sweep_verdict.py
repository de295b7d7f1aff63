"""The result of a sweep in words, and the error of its curve."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from backdrive.identification.curves import hats
from backdrive.identification.evidence import amount_of, constant_beside, describe_fit
from backdrive.identification.sweep_fit import SweepFit
from backdrive.laws import Polyline
from backdrive.model import JointFriction

NAMED = 0.03  # least constant that the verdict mentions, relative to the friction [-]


def error_of_curve(friction: JointFriction) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function from velocities to the curve's standard error.

    The knots' errors are independent. Between and beyond the knots, the deviation of a bent curve from a straight section is
    added. It is f'' (v - V_n) (v - V_n+1) / 2, with the curvature of the neighbouring knots.
    """
    rate = friction.law.rate
    assert isinstance(rate, Polyline)
    errors, knots = friction.standard_errors, np.array(rate.velocity)

    def standard_error(velocity: np.ndarray) -> np.ndarray:
        if not errors:
            return np.full(velocity.shape, np.nan)
        speed, forwards = np.abs(velocity), velocity[:, None] > 0
        side = np.where(forwards, errors["positive"], errors["negative"])
        bend = np.where(forwards, *(_bend(knots, np.array(f)) for f in (rate.positive, rate.negative)))
        section = np.clip(np.searchsorted(knots, speed, side="right") - 1, 0, max(knots.size - 2, 0))
        following = np.minimum(section + 1, knots.size - 1)
        curvature = bend[np.arange(speed.size), section]
        missed = 0.5 * curvature * (speed - knots[section]) * (speed - knots[following])
        return np.sqrt(np.sum((hats(speed, knots) * side) ** 2, axis=1) + missed**2)

    return standard_error


def _bend(V: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Return the curvature of each section, the larger one at its two knots, (max(N - 1, 1),)."""
    if V.size < 3:
        return np.zeros(max(V.size - 1, 1))
    inner = np.abs(2.0 * np.diff(np.diff(F) / np.diff(V)) / (V[2:] - V[:-2]))
    return np.maximum(np.r_[inner[:1], inner], np.r_[inner, inner[-1:]])


def verdict(friction: JointFriction, found: SweepFit) -> str:
    """Return the result in a few sentences."""
    unit, speed, rate = friction.joint.torque_unit, f"{friction.joint.unit}/s", friction.law.rate
    assert isinstance(rate, Polyline)
    slowest, top = rate.velocity[0], friction.validity.speeds[1]  # as in the table of the report
    said = amount_of(friction, slowest, {1.0: top, -1.0: top})
    if friction.standard_errors:
        worst = np.max([found.error_pos, found.error_neg])
        said += f" Its {len(rate.velocity)} knots have standard errors up to {worst:.2g} {unit}."
        said += f" Below {slowest:.3g} {speed} friction is unknown"
        if np.isfinite(found.noise_gain) and not found.symmetric:
            (up, _), (down, _) = found.constants()
            said += f": a straight line from there meets rest at {up:.3g} and {down:.3g} {unit}, a Stribeck peak would lie above it"
        said += "."
    if found.symmetric and (constant := constant_beside(friction, NAMED)):
        said += f" {constant}"
    return " ".join([said, *found.notes, describe_fit(friction)])
