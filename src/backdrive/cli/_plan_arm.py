"""`backdrive plan arm`: a motion of all joints at once, optimized for small standard errors, which it predicts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from backdrive.cli._joint_options import numbers_by_name
from backdrive.cli._plan_arm_words import FRICTION, NOISE, ArmOutcome, notes_of
from backdrive.cli._plan_request import Request, check_options
from backdrive.errors import InvalidInput, MissingExtra
from backdrive.identification.arm_forecast import forecast_errors, signals_of
from backdrive.plans.arm_bounds import ArmBounds
from backdrive.plans.arm_collision import Clearance
from backdrive.plans.arm_information import Information
from backdrive.plans.arm_search import Search
from backdrive.plans.arm_shapes import capsules, floor_at, read_shapes
from backdrive.plans.base import phrase
from backdrive.plans.limits import JointLimits, read_limits
from backdrive.robot import Robot, load_robot

USUAL = ("friction", "inertia", "gravity")
SIGN = 0.05  # in the search, friction changes sign smoothly below this share of the speed limit [-]
_WHAT = ("lower", "upper", "velocity", "acceleration", "torque")


def plan_arm(request: Request, progress: Any) -> ArmOutcome:
    """Return the best motion that the search found.

    Args:
        request: the options.
        progress: called with a sentence at each step.

    Raises:
        BackdriveError: an option is missing, unknown or out of range, or no motion keeps the limits.
    """
    check_options(request)
    if request.urdf is None:
        raise InvalidInput(
            "A plan of the kind arm needs the robot's description.", remedy="Give --urdf FILE."
        )
    progress("Reading the description")
    robot = load_robot(request.urdf)
    known = read_limits(request.urdf)
    if request.joint:
        for name in request.joint:
            _check_joint(name, robot.joints, "--joint")
        robot = robot.without_tools(request.joint)
        if set(robot.joints) != set(request.joint):
            raise InvalidInput(
                f"--joint {', '.join(request.joint)}: a joint that is left out lies before one of them in the chain.",
                remedy="Leave out joints beyond the last one only.",
            )
    limits = _limits(request, robot, known)
    effort = np.array([limit.effort for limit in limits])
    noise = _each(request.noise, "--noise", NOISE * effort, robot.joints)
    friction = np.full(effort.size, request.friction) if request.friction is not None else FRICTION * effort
    notes = []
    clearance = _clearance(request, robot, limits, notes)
    bounds = ArmBounds.of(
        robot, limits, friction=friction, margin=_or(request.reserve, 0.05), clearance=clearance
    )
    purpose = tuple(word.strip() for word in request.purpose.split(",")) if request.purpose else USUAL
    information = Information(
        robot=robot,
        noise=noise,
        transition=SIGN * bounds.velocity,
        purpose=purpose,
        frame=request.frame,
    )
    search = Search(
        information=information,
        bounds=bounds,
        duration=_or(request.duration, 60.0),
        center=_center(request, robot),
        seed=_or(request.seed, 0),
        progress=progress,
    )
    plan = search.run()
    progress("Computing the standard errors to be expected")
    signals = signals_of(plan, robot)
    errors = forecast_errors([signals], robot, noise, friction)
    torque = robot.inverse_dynamics(signals.position, signals.velocity, signals.acceleration)
    shares = bounds.shares(signals.position, signals.velocity, signals.acceleration, torque)
    path = plan.series(np.linspace(0.0, plan.period, 1000, endpoint=False), 0)
    notes += notes_of(request, errors)
    return ArmOutcome(
        plan=plan,
        limits={limit.name: limit for limit in limits},
        errors=errors,
        peaks=shares.max(axis=1),
        nearest=None if clearance is None else clearance.narrowest(path),
        notes=notes,
    )


def _or(value: Any, usual: Any) -> Any:
    return usual if value is None else value


def _check_joint(name: str, joints: Sequence[str], option: str) -> None:
    if name not in joints:
        raise InvalidInput(
            f"{option}: the description has no joint '{name}'.", remedy=f"Joints are {', '.join(joints)}."
        )


def _each(words: Any, option: str, usual: np.ndarray, joints: Sequence[str]) -> np.ndarray:
    """Return one positive number for every joint: a number for all, or NAME=NUMBER for some."""
    values = usual.copy()
    if words is None:
        return values
    if "=" not in words:
        try:
            values[:] = float(words)
        except ValueError as error:
            raise InvalidInput(
                f"{option} {words}: not a number.", remedy=f"For example {option} 0.5."
            ) from error
    else:
        for name, value in numbers_by_name(
            [words], option, "JOINT=NUMBER", f"{option} {joints[0]}=0.5"
        ).items():
            _check_joint(name, joints, option)
            values[list(joints).index(name)] = value
    if not (np.all(np.isfinite(values)) and np.all(values > 0)):
        raise InvalidInput(f"{option} {words}: not above zero.", remedy="Give positive numbers [N.m or N].")
    return values


def _limits(request: Request, robot: Robot, known: dict[str, JointLimits]) -> list[JointLimits]:
    """Return the limits of the joints, all of them finite.

    Raises:
        InvalidInput: names every limit that is missing, with the option that gives it.
    """
    given: dict[str, dict[str, float]] = {name: {} for name in robot.joints}
    example = f"--limit {robot.joints[0]}.acceleration=8"
    for key, value in numbers_by_name(request.limit or [], "--limit", "JOINT.WHAT=NUMBER", example).items():
        name, _, what = key.rpartition(".")
        _check_joint(name, robot.joints, "--limit")
        if what not in _WHAT:
            raise InvalidInput(
                f"--limit {key}: no limit '{what}'.", remedy=f"Give one of {', '.join(_WHAT)}: {example}."
            )
        given[name]["effort" if what == "torque" else what] = value
    for key, ends in _intervals(request.box or [], robot.joints).items():
        given[key] |= {"lower": ends[0], "upper": ends[1]}
    result = [
        known.get(name, JointLimits(name=name, unit=unit))
        .overridden(
            velocity=request.velocity_limit,
            acceleration=request.acceleration_limit,
            effort=request.torque_limit,
        )
        .overridden(**given[name])
        for name, unit in zip(robot.joints, robot.units, strict=False)
    ]
    for limit in result:
        own = known.get(limit.name)
        if own is not None and (limit.lower < own.lower or limit.upper > own.upper) and not request.limit:
            raise InvalidInput(
                f"--box: joint '{limit.name}' would leave its range from {phrase(own.lower, own.unit)} to "
                f"{phrase(own.upper, own.unit)}.",
                remedy="Give a box within it.",
            )
    missing = []
    for what, option in (
        ("lower", "--limit JOINT.lower="),
        ("upper", "--limit JOINT.upper="),
        ("velocity", "--velocity-limit"),
        ("acceleration", "--acceleration-limit"),
        ("effort", "--torque-limit"),
    ):
        names = [limit.name for limit in result if what not in limit.finite_limits]
        if names:
            word = "torque" if what == "effort" else what
            missing.append(f"{word} of {', '.join(names)} ({option})")
    if missing:
        raise InvalidInput(
            f"Limits are missing: {'; '.join(missing)}.",
            remedy=f"Give them by these options, or one by one: {example}.",
        )
    return result


def _intervals(words: Sequence[str], joints: Sequence[str]) -> dict[str, tuple[float, float]]:
    found = {}
    for word in filter(None, (part.strip() for text in words for part in text.split(","))):
        name, _, ends = word.rpartition("=")
        low, _, high = ends.partition(":")
        try:
            found[name] = (float(low), float(high))
        except ValueError as error:
            raise InvalidInput(
                f"--box {word}: not JOINT=LOW:HIGH.", remedy=f"For example --box {joints[0]}=-1:1 [rad or m]."
            ) from error
        _check_joint(name, joints, "--box")
    return found


def _center(request: Request, robot: Robot) -> np.ndarray | None:
    if not request.around:
        return None
    values = numbers_by_name(request.around, "--around", "JOINT=POSITION", f"--around {robot.joints[0]}=0.5")
    for name in values:
        _check_joint(name, robot.joints, "--around")
    missing = [name for name in robot.joints if name not in values]
    if missing:
        raise InvalidInput(
            f"--around gives no position for {', '.join(missing)}.", remedy="Give a position for every joint."
        )
    return np.array([values[name] for name in robot.joints])


def _who(links: Sequence[str]) -> str:
    return ", ".join(links) if len(links) < 4 else f"{len(links)} links"


def _clearance(
    request: Request, robot: Robot, limits: Sequence[JointLimits], notes: list[str]
) -> Clearance | None:
    """Return the collision check of the links; None, with a note, if no shapes of the description could be read."""
    try:
        shapes, without = read_shapes(request.urdf, robot, request.packages)
    except MissingExtra as error:
        notes.append(f"Self-collision was not checked: {error.message} {error.remedy}")
        return None
    if without:
        rods, bare = capsules(robot, without)
        shapes = [*shapes, *rods]
        way = ": give the folder that holds the packages with --packages" if request.packages is None else ""
        if rods:
            notes.append(
                f"Meshes of {_who(without)} were not read{way}. Capsules from joint to joint replace them, as thick as "
                f"the inertia suggests. Check the motion in a simulator before you run it."
            )
        if bare:
            notes.append(
                f"Self-collision of {_who(bare)} was not checked: its shape is known neither from a mesh nor from "
                f"its inertia{way}."
            )
    if request.floor is not None:
        shapes = [*shapes, floor_at(request.floor)]
    clearance = _or(request.clearance, 0.02)
    if not (math.isfinite(clearance) and clearance >= 0.0):
        raise InvalidInput(f"--clearance {clearance}: not a distance.", remedy="Give 0 or more metres.")
    lower, upper = (np.array([getattr(limit, end) for limit in limits]) for end in ("lower", "upper"))
    found = Clearance.of(robot, shapes, lower, upper, clearance)
    if not len(found.pairs):
        if not without:
            notes.append("Self-collision was not checked: the description has no shapes for collisions.")
        return None
    if found.touching:
        pairs = "; ".join(f"{a} and {b}" for a, b in found.touching)
        notes.append(
            f"Links that touch in nearly every posture were left out of the collision check: {pairs}."
        )
    return found
