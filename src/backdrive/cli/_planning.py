"""From the options of `backdrive plan` to a checked plan."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from backdrive._catalog import lookup
from backdrive.cli._joint_options import numbers_by_name
from backdrive.cli._logs import numbers
from backdrive.cli._plan_request import Request, check_options
from backdrive.errors import InvalidInput
from backdrive.plans import Hold, InTurn, check_limits
from backdrive.plans.base import KINDS, phrase
from backdrive.plans.limits import JointLimits, read_limits
from backdrive.plans.margins import refuse_touch

_DEGREES = ("stroke", "top_speed", "center")  # may be given in degrees
_SEVERAL = ("band", "speeds")  # hold numbers
MOST_STROKE = {"rad": 2.0 * math.pi, "m": 5.0}  # beyond, somebody has probably taken a wrong unit
MOST_SPEED = {"rad": 30.0, "m": 10.0}


def build(request: Request, *, check: bool = True) -> tuple[Any, dict[str, JointLimits]]:
    """Return the plan that was asked for, checked against the limits, and those limits by joint.

    Args:
        request: the options.
        check: against the limits; its size is checked in any case.

    Raises:
        BackdriveError: an option is missing, out of range, without meaning for the kind, or beyond a limit.
    """
    check_options(request)
    limits, names = _joints(request)
    holds = holds_of(request)
    units = {limits[name].unit for name in names}
    if len(units) > 1:
        raise InvalidInput(
            "Rotary and linear joints cannot share one stroke or torque.",
            remedy="Plan them separately, naming each joint with --joint.",
        )
    plans = [_plan(request, limits[name], holds.get(name)) for name in names]
    others = [name for name in holds if name not in names]
    held = tuple(Hold(joint=name, position=holds[name], unit=limits[name].unit) for name in others)
    plan = plans[0] if len(plans) == 1 and not held else InTurn(tuple(plans), held=held)
    for one in plans:
        _refuse_wrong_unit(one, limits[one.joint])
    if check:
        refuse_beyond(plan, limits, request)
    return plan, {name: limits[name] for name in (*names, *others)}


def refuse_beyond(
    plan: Any, limits: JointLimits | dict[str, JointLimits], request: Request, *, alternative: bool = False
) -> None:
    """Refuse a plan that passes a limit, or reaches an end of the range without a --margin.

    Args:
        plan: of one joint, or in turn.
        limits: of its joints.
        request: the options, for inertia, gravity and friction.
        alternative: the plan is one of several sweeps; where the range forbids it, the message says how to change the plan.

    Raises:
        InvalidInput: names the limits that are passed.
    """
    torque = {
        "inertia": request.inertia,
        "gravity": request.gravity or 0.0,
        "friction": request.friction or 0.0,
    }
    try:
        check_limits(plan, limits, **torque)
        if request.margin is None:
            for one in single_plans(plan):
                refuse_touch(one, limits if isinstance(limits, JointLimits) else limits[one.joint])
    except InvalidInput as error:
        one = single_plans(plan)[0]
        own = limits if isinstance(limits, JointLimits) else limits[one.joint]
        if not alternative or own.lower <= one.position_range[0] <= one.position_range[1] <= own.upper:
            raise
        from backdrive.plans.centres import WHAT_ELSE

        raise InvalidInput(
            f"The sweep about {math.degrees(one.center):.4g} deg cannot be driven. {error.message}",
            remedy=f"{error.remedy} {WHAT_ELSE}".strip(),
        ) from error


def single_plans(plan: Any) -> tuple[Any, ...]:
    """Return the plans of single joints that a plan is made of."""
    return plan.plans if isinstance(plan, InTurn) else (plan,)


def _joints(request: Request) -> tuple[dict[str, JointLimits], list[str]]:
    """Return limits by joint, options put over the description, and the joints that are to move."""
    wanted = list(dict.fromkeys(request.joint or []))
    if request.unit not in (None, "rad", "m"):
        raise InvalidInput(f"--unit {request.unit} is no unit of a joint.", remedy="Give rad or m.")
    if request.urdf is not None:
        known = read_limits(request.urdf)
        if request.all_joints:
            wanted = wanted or list(known)
        elif not wanted:
            if len(known) > 1:
                raise InvalidInput(
                    f"{request.urdf} has {len(known)} joints that move: {', '.join(known)}.",
                    remedy="Name one with --joint, or all with --all-joints.",
                )
            wanted = list(known)
        for name in wanted:
            lookup(name, known, f"joint of {request.urdf}")
            if request.unit not in (None, known[name].unit):
                raise InvalidInput(
                    f"--unit {request.unit}, but joint '{name}' is in {known[name].unit} by its description.",
                    remedy="Leave --unit out.",
                )
    else:
        if request.all_joints:
            raise InvalidInput(
                "--all-joints needs a robot description.",
                remedy="Give --urdf FILE, or name each with --joint.",
            )
        wanted = wanted or ["joint"]
        names = dict.fromkeys([*wanted, *holds_of(request)])
        known = {name: JointLimits(name=name, unit="m" if request.unit == "m" else "rad") for name in names}
    for name in wanted:
        known[name] = known[name].overridden(
            lower=request.lower,
            upper=request.upper,
            velocity=request.velocity_limit,
            acceleration=request.acceleration_limit,
            effort=request.torque_limit,
        )
        if request.margin is not None:
            known[name] = known[name].narrow(request.margin)
    for name in holds_of(request):
        lookup(name, known, "known joint")
    return known, wanted


def holds_of(request: Request) -> dict[str, float]:
    """Return where --hold puts joints, by name [rad or m]."""
    words, example = request.hold or [], "--hold elbow=1.57 [rad or m]"
    return numbers_by_name(words, "--hold", "NAME=POSITION", example)


def _plan(request: Request, limits: JointLimits, hold: float | None) -> Any:
    cls, options = KINDS[request.kind], _Options(request, limits)
    common: dict[str, Any] = {"joint": limits.name, "unit": limits.unit}
    if cls.commands == "position":
        center = center_of(request, limits)
        if center is not None and hold is not None:
            raise InvalidInput(
                f"--center and --hold both place joint '{limits.name}'.", remedy="Give one of them."
            )
        middle = hold if center is None else center
        common |= options.subset("lead_in") | ({} if middle is None else {"center": middle})
    return cls.build(options, **common)


@dataclass(frozen=True)
class _Options:
    """Options in SI units, as a plan asks for them."""

    request: Request
    limits: JointLimits

    def need(self, name: str) -> Any:
        if name in _DEGREES:
            return _one_of(self.request, name, self.limits)
        if name in self.subset(name):
            return self.subset(name)[name]

        option = "--" + name.replace("_", "-") + (" LOW,HIGH" if name == "band" else "")
        raise InvalidInput(
            f"A plan of the kind {self.request.kind} needs {option}.", remedy="See backdrive plan --help."
        )

    def subset(self, *names: str) -> dict[str, Any]:
        values = {name: getattr(self.request, name) for name in names}
        return {
            name: numbers(value, f"--{name}") if name in _SEVERAL else value
            for name, value in values.items()
            if value is not None and value is not False
        }


def center_of(request: Request, limits: JointLimits) -> float | None:
    """Return the center of the stroke as given [rad or m]; None where it was not given."""
    if request.center is None and request.center_deg is None:
        return None
    return _one_of(request, "center", limits)


def _one_of(request: Request, name: str, limits: JointLimits) -> float:
    """Return a quantity given in SI or, for a rotary joint, in degrees."""
    option, plain, degrees = (
        "--" + name.replace("_", "-"),
        getattr(request, name),
        getattr(request, f"{name}_deg"),
    )
    if plain is not None and degrees is not None:
        raise InvalidInput(f"{option} and {option}-deg are both given.", remedy="Give one of them.")
    if degrees is not None:
        if limits.unit == "m":
            raise InvalidInput(
                f"Joint '{limits.name}' is linear, and {option}-deg is in degrees.",
                remedy=f"Give {option} in metres.",
            )
        return math.radians(degrees)
    if plain is None:
        si = f"{limits.unit}/s" if name == "top_speed" else limits.unit
        way = f"{option} in {si}" if limits.unit == "m" else f"{option}-deg, or {option} in {si}"
        raise InvalidInput(f"A plan of the kind {request.kind} needs {option}.", remedy=f"Give {way}.")
    return plain


def _refuse_wrong_unit(plan: Any, limits: JointLimits) -> None:
    """Refuse sizes that suggest a mistaken unit, unless the given limits allow them."""
    if plan.commands != "position":
        return
    unit = plan.unit
    if plan.stroke > MOST_STROKE[unit] and not math.isfinite(limits.upper - limits.lower):
        other = f"--stroke-deg {plan.stroke:g}" if unit == "rad" else "it in metres"
        raise InvalidInput(
            f"A stroke of {phrase(plan.stroke, unit)} is more than a joint usually has.",
            remedy=f"If the unit was mistaken, give {other}; if it is meant, give the range with --lower and --upper.",
        )
    if plan.peak_velocity > MOST_SPEED[unit] and not math.isfinite(limits.velocity):
        other = f"--top-speed-deg {plan.peak_velocity:g}" if unit == "rad" else "it in metres per second"
        raise InvalidInput(
            f"A speed of {phrase(plan.peak_velocity, unit + '/s')} is more than a joint usually has.",
            remedy=f"If the unit was mistaken, give {other}; if it is meant, say so with --velocity-limit.",
        )
