"""Check of a plan against the limits of its joint; the error names the limit, the excess and a remedy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.plans.base import phrase, torque_unit
from backdrive.plans.constant_velocity import STEADY, ConstantVelocity
from backdrive.plans.in_turn import InTurn
from backdrive.plans.limits import JointLimits
from backdrive.plans.multisine import Multisine
from backdrive.plans.stroke import smallest_stroke

_ROUNDING = 1e-9


def check_limits(
    plan: Any,
    limits: JointLimits | Mapping[str, JointLimits],
    *,
    inertia: float | None = None,
    gravity: float = 0.0,
    friction: float = 0.0,
) -> None:
    """Refuse a plan that its joint cannot follow.

    Args:
        plan: of one joint, or of several in turn.
        limits: of the joint, or by joint name.
        inertia: about the joint [kg.m^2 or kg]; without it the torque of a plan of positions is not checked.
        gravity: largest gravity torque on the stroke [N.m or N].
        friction: friction torque at the top speed [N.m or N].

    Raises:
        InvalidInput: names every limit that is exceeded, the excess and a remedy.
        UnknownName: there are limits by name, and none for a joint of the plan.
    """
    single = plan.plans if isinstance(plan, InTurn) else (plan,)
    found: list[str] = []
    for one in single:
        bound = _of(limits, one.joint)
        if bound.unit != one.unit:
            raise InvalidInput(
                f"The plan of joint '{one.joint}' is in {one.unit}, its limits are in {bound.unit}.",
                remedy="Give the plan the unit of the joint.",
            )
        own = (
            _torque(one, bound)
            if one.commands == "torque"
            else _motion(one, bound, inertia, gravity, friction)
        )
        found += [f"Joint '{one.joint}': {sentence}" for sentence in own]
    for one in plan.held if isinstance(plan, InTurn) and not isinstance(limits, JointLimits) else ():
        bound = _of(limits, one.joint)
        if not bound.lower - _ROUNDING <= one.position <= bound.upper + _ROUNDING:
            found.append(
                f"Joint '{one.joint}' would be held at {phrase(one.position, one.unit)}. This is outside its range from "
                f"{phrase(bound.lower, one.unit)} to {phrase(bound.upper, one.unit)}."
            )
    if found:
        raise InvalidInput(" ".join(found), violations=found)


def _of(limits: JointLimits | Mapping[str, JointLimits], joint: str) -> JointLimits:
    return limits if isinstance(limits, JointLimits) else lookup(joint, limits, "joint with limits")


def _torque(plan: Any, limits: JointLimits) -> Iterator[str]:
    unit = torque_unit(plan.unit)
    if plan.largest_torque > limits.effort * (1 + _ROUNDING):
        yield (
            f"the torque reaches {plan.largest_torque:.4g} {unit}, above the limit of {limits.effort:.4g} {unit}. "
            "Give a smaller amplitude or offset."
        )


def _motion(
    plan: Any, limits: JointLimits, inertia: float | None, gravity: float, friction: float
) -> Iterator[str]:
    unit = plan.unit
    low, high = plan.position_range
    below, above = limits.lower - low, high - limits.upper
    if max(below, above) > _ROUNDING * max(1.0, abs(low), abs(high)):
        side = f"{phrase(low, unit)}, below the lower limit of {phrase(limits.lower, unit)}"
        if above > below:
            side = f"{phrase(high, unit)}, above the upper limit of {phrase(limits.upper, unit)}"
        room = limits.upper - limits.lower
        if plan.stroke <= room:
            center = min(max(plan.center, limits.lower + 0.5 * plan.stroke), limits.upper - 0.5 * plan.stroke)
            toward = 1.0 if below > above else -1.0
            hint = f"The nearest center that would do is {phrase(center, unit, toward)}."
        else:
            hint = f"The largest stroke that would do is {phrase(room, unit, -1)}."
        yield f"the position reaches {side}. {hint}"
    if plan.peak_velocity > limits.velocity * (1 + _ROUNDING):
        way = f"a top speed of at most {phrase(limits.velocity, unit + '/s', -1)}"
        if isinstance(plan, Multisine):
            way = f"a stroke of at most {phrase(plan.stroke * limits.velocity / plan.peak_velocity, unit, -1)}, or a lower band"
        yield (
            f"the velocity reaches {phrase(plan.peak_velocity, unit + '/s')}, above the limit of "
            f"{phrase(limits.velocity, unit + '/s')}. Give {way}."
        )
    if plan.peak_acceleration > limits.acceleration * (1 + _ROUNDING):
        yield (
            f"the acceleration reaches {phrase(plan.peak_acceleration, unit + '/s^2')}, above the limit of "
            f"{phrase(limits.acceleration, unit + '/s^2')}. {_stroke_for(plan, limits.acceleration)}"
        )
    if inertia is None:
        return
    torque, newton = plan.peak_torque(inertia, gravity, friction), torque_unit(unit)
    if torque > limits.effort * (1 + _ROUNDING):
        try:
            smallest_stroke(plan.peak_velocity, inertia, limits.effort, friction, gravity)
            way = _stroke_for(plan, (limits.effort - abs(friction) - abs(gravity)) / inertia)
        except InvalidInput as error:
            way = str(error)
        yield f"the torque may reach {torque:.4g} {newton}, above the limit of {limits.effort:.4g} {newton}. {way}"


def _stroke_for(plan: Any, acceleration: float) -> str:
    """Return a sentence on the stroke that keeps the acceleration at a limit [rad/s^2 or m/s^2]."""
    if isinstance(plan, Multisine):
        largest = plan.stroke * acceleration / plan.peak_acceleration
        return f"The largest stroke that would do is {phrase(largest, plan.unit, -1)}; so would a lower band."
    if isinstance(plan, ConstantVelocity):
        smallest = 1.5 * plan.peak_velocity**2 / acceleration / (1.0 - STEADY)
        return (
            f"Give a ramp acceleration of at most {phrase(acceleration, plan.unit + '/s^2', -1)}; "
            f"the smallest stroke that leaves room for it is {phrase(smallest, plan.unit, 1)}."
        )
    smallest = 2.0 * plan.peak_velocity**2 / acceleration
    return f"The smallest stroke that would do is {phrase(smallest, plan.unit, 1)}."
