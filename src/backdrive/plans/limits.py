"""Limits of a joint: range, speed, acceleration and torque, from arguments or from a robot description (URDF)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from backdrive._files import read_whole
from backdrive.errors import InvalidInput, ReadError, UnknownFormat
from backdrive.robot import load_robot
from backdrive.robot.xml import parse

MAX_BYTES = 20_000_000
_KINDS: dict[str, Literal["rad", "m"]] = {"revolute": "rad", "continuous": "rad", "prismatic": "m"}


SMALLEST = 1e-12  # largest plausible limit [SI]


@dataclass(frozen=True, kw_only=True)
class JointLimits:
    """Limits of one joint; infinite if unknown.

    Attributes:
        name: of the joint.
        unit: `rad` or `m`.
        lower: lowest position [rad or m].
        upper: highest position [rad or m].
        velocity: greatest speed [rad/s or m/s].
        acceleration: greatest acceleration [rad/s^2 or m/s^2].
        effort: greatest actuator torque on the joint side [N.m or N].
    """

    name: str = "joint"
    unit: Literal["rad", "m"] = "rad"
    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    effort: float = math.inf

    def __post_init__(self):
        for name in ("velocity", "acceleration", "effort"):
            if not getattr(self, name) >= SMALLEST:
                raise InvalidInput(
                    f"The {name} limit of joint '{self.name}' is {getattr(self, name)}.",
                    remedy="Give a positive number, or leave it out where it is not known.",
                )
        if not self.lower < self.upper:
            raise InvalidInput(
                f"The range of joint '{self.name}' goes from {self.lower} to {self.upper} {self.unit}.",
                remedy="Give a lower limit below the upper one.",
            )

    def overridden(self, **given: float | None) -> JointLimits:
        """Return the limits, with given ones replaced; None keeps the old one."""
        return replace(self, **{name: value for name, value in given.items() if value is not None})

    def narrow(self, margin: float) -> JointLimits:
        """Return the limits with a range that keeps a distance from either end.

        Args:
            margin: distance [rad or m].

        Raises:
            InvalidInput: it is negative or not finite, no end is known, or nothing of the range is left.
        """
        if not (math.isfinite(margin) and margin >= 0.0):
            raise InvalidInput(f"A margin of {margin:g} {self.unit}.", remedy="Give a distance from zero on.")
        if not {"lower", "upper"} & set(self.finite_limits):
            raise InvalidInput(
                f"A margin of {margin:g} {self.unit}, and no end of the range of joint '{self.name}' is known.",
                remedy="Give --urdf, or --lower and --upper.",
            )
        if not self.lower + margin < self.upper - margin:
            raise InvalidInput(
                f"A margin of {margin:g} {self.unit} at both ends leaves nothing of the range of joint '{self.name}', from "
                f"{self.lower:g} to {self.upper:g} {self.unit}.",
                remedy="Give a smaller one.",
            )
        return replace(self, lower=self.lower + margin, upper=self.upper - margin)

    @property
    def finite_limits(self) -> tuple[str, ...]:
        """Names of the limits that are finite."""
        return tuple(f.name for f in fields(self)[2:] if math.isfinite(getattr(self, f.name)))


def read_limits(path: str | Path) -> dict[str, JointLimits]:
    """Read the limits of every joint that moves from a URDF or MJCF file.

    Follows the URDF specification: `lower`, `upper`, `velocity`, `effort` and (newer) `acceleration` of `<limit>`, and
    the tighter range of `<safety_controller>`. Fixed, floating, planar and mimicking joints are left out. A range or a limit
    of zero counts as unknown: many exporters write it for unknown limits, and such a joint could not move.

    Args:
        path: of the file.

    Returns:
        Joint name to limits, in the file's order.

    Raises:
        ReadError: there is no such file, it is not well-formed, or a limit is not a number.
        FileTooLarge: no robot needs that many bytes.
        ForbiddenContent: it has a DOCTYPE, which no robot description needs.
        UnknownFormat: it is XML, but neither.
        MissingExtra: defusedxml is not installed.
    """
    root = _parse(Path(path))
    if root.tag == "mujoco":
        robot = load_robot(path)
        rows = zip(robot.joints, robot.units, robot.ranges, strict=True)
        return {name: JointLimits(name=name, unit=unit, **asdict(limits)) for name, unit, limits in rows}
    if root.tag != "robot":
        raise UnknownFormat(
            f"{path} is XML whose root is <{root.tag}>, not <robot>.", remedy="Name a URDF or MJCF file."
        )
    found: dict[str, JointLimits] = {}
    for node in root.findall("joint"):
        name, kind = node.get("name", ""), node.get("type", "")
        if kind not in _KINDS or node.find("mimic") is not None:
            continue
        if not name or name in found:
            raise ReadError(
                f"{path}: joint name '{name}' is empty or stands there twice.",
                remedy="Name every joint differently.",
            )
        found[name] = _joint(node, name, kind, path)
    if not found:
        raise ReadError(
            f"{path} holds no joint that moves.",
            remedy="If it is a xacro file, expand it first: xacro FILE > robot.urdf.",
        )
    return found


def _parse(path: Path) -> Any:
    return parse(read_whole(path, MAX_BYTES, remedy="A URDF without meshes is small."), str(path))


def _joint(node: Any, name: str, kind: str, path: str | Path) -> JointLimits:
    limit, safety = node.find("limit"), node.find("safety_controller")

    def value(element: Any, key: str) -> float | None:
        text = element.get(key) if element is not None else None
        if text is None:
            return None
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if math.isnan(number):
            hint = "Expand xacro first." if "${" in text else "Write a plain number."
            raise ReadError(f"{path}: joint '{name}': {key}=\"{text[:40]}\" is not a number.", remedy=hint)
        return number

    lower, upper = -math.inf, math.inf
    if kind != "continuous":
        lower, upper = value(limit, "lower") or 0.0, value(limit, "upper") or 0.0
        if lower > upper:
            raise ReadError(
                f"{path}: joint '{name}' has lower={lower} above upper={upper}.",
                remedy="Correct the description.",
            )
        if lower == upper:
            lower, upper = -math.inf, math.inf
        soft_lower, soft_upper = value(safety, "soft_lower_limit"), value(safety, "soft_upper_limit")
        if soft_lower is not None and soft_upper is not None and soft_lower < soft_upper:
            tight = max(lower, soft_lower), min(upper, soft_upper)
            lower, upper = tight if tight[0] < tight[1] else (lower, upper)
    rest = {key: value(limit, key) or math.inf for key in ("velocity", "acceleration", "effort")}
    negative = [key for key, number in rest.items() if number < 0]
    if negative:
        raise ReadError(
            f"{path}: joint '{name}' has a negative {negative[0]} limit.", remedy="Correct the description."
        )
    return JointLimits(name=name, unit=_KINDS[kind], lower=lower, upper=upper, **rest)
