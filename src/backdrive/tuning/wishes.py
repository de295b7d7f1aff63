"""The feel of a compensated joint: its parts, and their weights for each wish.

The feel consists of four relative numbers. Three are relative to the bare joint: the hand's peak force over its strokes, the
touch that moves the joint again after a stop, and the distance that it coasts after a knock. The fourth is the compensator's
torque that remains after a stop, relative to F. A search minimises their weighted sum. Every wish includes the force of the
hand, since otherwise no compensation at all would be the best.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.simulation.closed_loop import Record, Scene
from backdrive.tuning import scenes
from backdrive.tuning.members import Member
from backdrive.tuning.scenes import Stroke

FEELINGS = {
    "force": "mean peak force of the hand, relative to the bare joint's",
    "standing": "remaining torque after a stop, relative to F",
    "touch": "light touch against the last stroke that moves the joint again after a stop, relative to the bare joint's",
    "coast": "distance after a knock, relative to the bare joint's",
}
#: Wish -> weight of each feeling.
WISHES: dict[str, dict[str, float]] = {
    "even": {"force": 1.0, "standing": 0.3, "touch": 0.2, "coast": 0.01},
    "light": {"force": 1.0, "standing": 0.02, "touch": 0.0, "coast": 0.0},
    "touch": {"force": 0.1, "standing": 0.05, "touch": 3.0, "coast": 0.0},
    "calm": {"force": 1.0, "standing": 0.3, "touch": 0.0, "coast": 0.5},
}
#: The main part of each wish other than `even`.
OWN = {"light": "force", "touch": "touch", "calm": "coast"}
AFTER = 0.1  # time after the end of a stroke from which a torque counts as remaining [s]


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of a score.

    Attributes:
        name: of it.
        scene: from numbers and a joint to what is played.
        value: of what was played, smaller is better.
        weight: in the score [-].
        unit: value that counts as 1, by which the value is divided; computed on demand.
    """

    name: str
    scene: Callable[[Mapping[str, float], Member], Scene]
    value: Callable[[Record], float]
    weight: float = 1.0
    unit: Callable[[], float] = lambda: 1.0


def check_wish(wish: str) -> None:
    """Refuse an unknown wish.

    Raises:
        InvalidInput: the message lists the known wishes.
    """
    if wish not in WISHES:
        raise InvalidInput(f"There is no wish '{wish}'.", remedy=f"Wishes are {', '.join(WISHES)}.")


def standing(record: Record, stroke: Stroke, coulomb: float) -> float:
    """Return the mean torque of the compensator after a stop and before the next touch, in `scenes.release`, relative to F
    [-].
    """
    T = record.scene.period
    part = slice(round((0.1 + stroke.duration + AFTER) / T), round(scenes.pull_time(stroke) / T))
    return float(np.mean(np.abs(record.compensation[part]))) / coulomb


def coasting(record: Record) -> float:
    """Return how far the load goes after the push of `scenes.knock` has ended [rad or m]."""
    end = round((0.05 + scenes.PUSHED) / record.scene.period)
    way = np.abs(record.load[end:] - record.load[end])
    return float(way.max()) if np.all(np.isfinite(way)) else np.inf
