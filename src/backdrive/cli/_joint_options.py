"""Options with a number or an interval for each joint: VALUE where there is one joint, JOINT=VALUE where there are several."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from backdrive.errors import InvalidInput


def by_joint(
    words: Sequence[str] | None, option: str, example: str, names: Sequence[str], *, interval: bool = True
) -> dict[str, Any]:
    """Return an option's value by joint, from a plain VALUE where there is one joint, or from JOINT=VALUE."""
    found: dict[str, Any] = {}
    for word in words or ():
        name, equals, value = word.rpartition("=")
        name = name if equals or len(names) > 1 else names[0]
        if name not in names or name in found:
            wrong = (
                "is said twice"
                if name in found
                else f"no joint '{name}'"
                if equals
                else "the joint is missing"
            )
            raise InvalidInput(
                f"{option} {word}: {wrong}.",
                remedy=f"Joints are {', '.join(names)}; say {option} {names[0]}={example}, once for each joint.",
            )
        found[name] = ends(value, option, example, interval=interval)
    return found


def ends(words: str, option: str, example: str, *, interval: bool = True) -> tuple[float, float] | float:
    """Return LOW:HIGH, or one number."""
    try:
        ends = [float(w) for w in words.split(":")]
    except ValueError:
        ends = []
    if len(ends) == 1:
        return ends[0]
    if len(ends) != 2 or not interval:
        raise InvalidInput(
            f"{option} {words}: not {'LOW:HIGH' if interval else 'a number'}.",
            remedy=f"For example {option} {example}.",
        )
    return ends[0], ends[1]


def numbers_by_name(
    words: Iterable[str],
    option: str,
    what: str = "NAME=NUMBER",
    example: str = "inertia=0.5,gravity_sin=2",
) -> dict[str, float]:
    """Return the numbers that an option gives by name: NAME=NUMBER, commas between.

    Args:
        words: what was written, once for each time.
        option: its name.
        what: the form of a word, such as `NAME=NUMBER`.
        example: of a use, for the remedy.

    Raises:
        InvalidInput: a word is otherwise, or its number is not finite.
    """
    values: dict[str, float] = {}
    for word in filter(None, (part.strip() for text in words for part in text.split(","))):
        name, _, value = word.rpartition("=")
        try:
            values[name.strip()] = float(value)
        except ValueError:
            name = ""
        if not name.strip() or not math.isfinite(values[name.strip()]):
            raise InvalidInput(f"{option} {word}: not {what}.", remedy=f"For example {example}.")
    return values


def guards(
    speeds: dict[str, float], limits: dict[str, float], urdf: Path | None, names: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Return trip speed and torque limit by joint: the given values, or else those of the robot description."""
    described: dict[str, Any] = {}
    if urdf is not None:
        from backdrive.plans.limits import read_limits

        described = read_limits(urdf)
        absent = [name for name in names if name not in described]
        if absent:
            raise InvalidInput(
                f"{urdf} has no joint '{absent[0]}'.",
                remedy=f"It has {', '.join(described)}; the model {', '.join(names)}. Say --top-speed instead.",
            )
    bounds: dict[str, dict[str, Any]] = {}
    for name in names:
        bounds[name] = {"trip_speed": speeds.get(name), "limit": limits.get(name)}
        if name in described:
            known = described[name]
            bounds[name]["effort"] = known.effort
            if name not in speeds and math.isfinite(known.velocity):
                bounds[name]["trip_speed"] = known.velocity
    return bounds
