"""A hand that guides a joint: minimum-jerk strokes to a metronome, holding, letting go, pushing.

    tau_h = grip (K_h (x_h - q) + B_h (x_h' - q')) + push

x_h: position that the hand aims at. A stroke from x_0 to x_1 in the time D is x_0 + (x_1 - x_0)(10 s^3 - 15 s^4 + 6 s^5), s =
t/D (T. Flash, N. Hogan, J. Neuroscience 5(7), 1985). Since people vary, length, duration and start differ from stroke to
stroke. Human arms have 100 to 1000 N/m and 5 to 60 N.s/m; a hand of large stiffness gives a prescribed motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.parameters import NOT_NEGATIVE, WithBounds


@dataclass(frozen=True, kw_only=True)
class Hand(WithBounds):
    """Impedance of a hand on the joint.

    Attributes:
        stiffness: K_h [N.m/rad or N/m].
        damping: B_h [N.m.s/rad or N.s/m].
        noise: of the force sensor between hand and joint, standard deviation [N.m or N].
    """

    BOUNDS: ClassVar = dict.fromkeys(("stiffness", "damping", "noise"), NOT_NEGATIVE)

    stiffness: float
    damping: float
    noise: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class HandMotion:
    """The motion of a hand, sampled at the ticks.

    Attributes:
        position: x_h [rad or m], (n,).
        velocity: x_h' [rad/s or m/s], (n,).
        grip: 1 where the hand holds the joint, 0 where it has let go, (n,).
        push: force besides [N.m or N], (n,).
        marks: times at which strokes begin [s].
    """

    position: np.ndarray
    velocity: np.ndarray
    grip: np.ndarray
    push: np.ndarray
    marks: tuple[float, ...] = ()

    def replace(self, **changes: Any) -> HandMotion:
        """Return a copy with some fields changed."""
        return replace(self, **changes)

    def release(self, after: float, dt: float) -> HandMotion:
        """Return the motion of a hand that lets go at a time [s]."""
        grip = self.grip.copy()
        grip[round(after / dt) :] = 0.0
        return replace(self, grip=grip)


def along(position: np.ndarray, velocity: np.ndarray, marks: tuple[float, ...] = ()) -> HandMotion:
    """Return a hand that follows a motion [rad or m, rad/s or m/s], (n,) each, and never lets go."""
    n = len(position)
    return HandMotion(
        position=np.ascontiguousarray(position, dtype=np.float64),
        velocity=np.ascontiguousarray(velocity, dtype=np.float64),
        grip=np.ones(n),
        push=np.zeros(n),
        marks=marks,
    )


def still(n: int, position: float = 0.0) -> HandMotion:
    """Return the motion of an absent hand: n ticks without grip, at a position [rad or m]."""
    return replace(along(np.full(n, position), np.zeros(n)), grip=np.zeros(n))


def pushes(push: np.ndarray, position: float = 0.0) -> HandMotion:
    """Return a given force on the joint [N.m or N], (n,)."""
    return replace(still(len(push), position), push=np.ascontiguousarray(push, dtype=np.float64))


def minimum_jerk(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the share of a stroke that is done after a share s of its time, and its rate by s."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) ** 2


def strokes(
    dt: float,
    *,
    stroke: float,
    duration: float,
    interval: float = 0.75,
    count: int = 60,
    start: float = 0.5,
    variation: float = 0.05,
    seed: int = 0,
) -> HandMotion:
    """Return strokes back and forth to a metronome.

    Args:
        dt: sampling time [s].
        stroke: from end to end [rad or m].
        duration: of a stroke [s].
        interval: between the beginnings of strokes [s]; the thesis' metronome has 0.75 s (0.667 Hz a stroke pair).
        count: of strokes; two are a cycle.
        start: time before the first [s].
        variation: standard deviation of length, duration and (in intervals) of the beginning, from stroke to stroke [-].
        seed: of the variation.

    Raises:
        InvalidInput: a stroke takes longer than its interval.
    """
    if not 0.0 < duration <= interval or count < 1 or not 0.0 <= variation < 0.3:
        raise InvalidInput(
            f"duration = {duration} s, interval = {interval} s, count = {count}, variation = {variation}.",
            remedy="A stroke ends before the next one begins; variation is below 0.3.",
        )
    rng = np.random.default_rng(seed)
    n = round((start + count * interval + 0.5) / dt)
    t = dt * np.arange(n)
    position, velocity, at = np.zeros(n), np.zeros(n), 0.0
    marks = []
    for i in range(count):
        z = np.clip(rng.standard_normal(3), -2.5, 2.5) * variation
        goal = stroke * (1.0 + z[0]) if i % 2 == 0 else stroke * z[0]
        D = min(duration * (1.0 + z[1]), interval * (1.0 - abs(z[2])))
        begin = start + interval * (i + max(z[2], 0.0))
        marks.append(begin)
        share, rate = minimum_jerk((t - begin) / D)
        position += (goal - at) * share
        velocity += (goal - at) * rate / D
        at = goal
    return along(position, velocity, tuple(marks))


def sine(dt: float, *, amplitude: float, frequency: float, cycles: int) -> HandMotion:
    """Return cosine strokes from rest at one end: x = A (1 - cos(2 pi f t))/2 about the middle [rad or m]."""
    n = round(cycles / frequency / dt)
    w = 2.0 * np.pi * frequency
    t = dt * np.arange(n)
    return along(amplitude * (1.0 - np.cos(w * t)), amplitude * w * np.sin(w * t))
