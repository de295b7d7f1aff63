"""The distance that a motion leaves to the ends of its joint's range: a servo overshoots, so that a plan must not touch them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from backdrive.errors import InvalidInput
from backdrive.plans.base import phrase
from backdrive.plans.limits import JointLimits

USUAL = (
    0.02  # distance to either end below which a servo's overshoot may reach it, relative to the stroke [-]
)
_ROUNDING = 1e-9


def margins(plan: Any, limits: JointLimits) -> tuple[float, float]:
    """Return the distances of a plan of positions to the lower and the upper end of the range [rad or m]; infinite if unknown."""
    low, high = plan.position_range
    return low - limits.lower, limits.upper - high


def refuse_touch(plan: Any, limits: JointLimits) -> None:
    """Refuse a plan of positions that reaches an end of the range.

    Args:
        plan: of one joint; a plan of torque passes.
        limits: of the joint.

    Raises:
        InvalidInput: names the ends, and the largest stroke about the same center that keeps the usual margin.
    """
    if plan.commands != "position":
        return
    ends = _near(plan, limits, _ROUNDING * max(1.0, *map(abs, plan.position_range)))
    if not ends:
        return
    room = min(plan.center - limits.lower, limits.upper - plan.center)
    stroke = phrase(2.0 * room / (1.0 + 2.0 * USUAL), plan.unit, -1)
    raise InvalidInput(
        f"Joint '{plan.joint}': the motion reaches {' and '.join(ends)}, and a servo that overshoots passes it.",
        remedy=f"Give a stroke of at most {stroke}, another center, or --margin 0 if the range already keeps a distance.",
    )


def note(plan: Any, limits: JointLimits) -> str:
    """Return a sentence on the ends of the range that a plan of positions nearly reaches; empty if there are none."""
    if plan.commands != "position":
        return ""
    ends = _near(plan, limits, USUAL * plan.stroke)
    if not ends:
        return ""
    left = phrase(max(min(margins(plan, limits)), 0.0), plan.unit)
    return (
        f"The motion of joint '{plan.joint}' leaves a margin of {left} only to {' and '.join(ends)}: a servo that overshoots more "
        "passes it. --margin keeps a distance."
    )


def inside(limits: JointLimits, stroke: float) -> JointLimits:
    """Return limits whose known ends keep the usual margin for a stroke [rad or m]; the same if nothing would be left."""
    margin = USUAL * stroke
    if not limits.lower + margin < limits.upper - margin:
        return limits
    return replace(limits, lower=limits.lower + margin, upper=limits.upper - margin)


def _near(plan: Any, limits: JointLimits, distance: float) -> list[str]:
    """Return the ends of the range that a plan approaches to within a distance [rad or m], in words."""
    ends = zip(margins(plan, limits), ("lower", "upper"), (limits.lower, limits.upper), strict=True)
    return [
        f"the {side} limit of {phrase(end, plan.unit)}"
        for left, side, end in ends
        if left <= distance and math.isfinite(end)
    ]
