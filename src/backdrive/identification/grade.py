"""A joint's result in one word: the only home of what counts as good."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from backdrive.model import JointFriction

GOOD, FAIR = 15.0, 35.0  # residual up to which a result is called good, or usable with care [%]


@dataclass(frozen=True, kw_only=True)
class Grade:
    """A joint's result in one word.

    Attributes:
        level: for programs and colours.
        word: for people.
    """

    level: Literal["good", "care", "poor", "unknown"]
    word: str


def credible(friction: JointFriction) -> bool:
    """Say whether friction opposes motion everywhere in its range, and the inertia is positive."""
    inertia = friction.dynamics.get("inertia")
    dissipates = friction.driving() is None
    if inertia is None:
        return dissipates
    slack = 2 * inertia.standard_error if math.isfinite(inertia.standard_error) else 0.0
    return dissipates and inertia.value >= -slack


def grade(friction: JointFriction) -> Grade:
    """Return the grade of a joint, by its residual on held-out data where there is some."""
    quality = friction.held_out or friction.fitted
    if quality is None or not math.isfinite(quality.residual):
        return Grade(level="unknown", word="not judged")
    if not credible(friction):
        return Grade(level="poor", word="not credible")
    if quality.residual <= GOOD:
        return Grade(level="good", word="good, with a remark" if friction.warnings else "good")
    if quality.residual <= FAIR:
        return Grade(level="care", word="usable with care")
    return Grade(level="poor", word="poor")
