"""Friction through its crossing of zero, in the equation of motion as a second difference of positions averages it.

A second difference is the mean acceleration, weighted by a triangle over two sampling intervals h. The same mean of all terms gives

    <tau> = inertia (q_(k+1) - 2 q_k + q_(k-1))/h^2 + coulomb <g> + viscous <dq> + gravity <sin q, cos q> + offset

which holds where friction jumps between two samples. Of smooth terms the mean is (x_(k-1) + 10 x_k + x_(k+1))/12 (Numerov). g is
the course of friction by its level, -1 to 1, at several instants an interval: tanh(v/w) of the speed, or the elastoplastic bristle
of the displacement (`laws.elements.elastoplastic_path`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from backdrive.identification.delay import cubic, earlier
from backdrive.identification.signals import Signals, spans
from backdrive.identification.terms import GRAVITY
from backdrive.laws.elements.elastoplastic_path import elastoplastic_level

FINE = 8  # instants an interval at which friction is followed
BEFORE, AFTER = np.arange(FINE) / FINE**2, (FINE - np.arange(FINE)) / FINE**2  # weights of the triangle
NUMEROV = np.array([1.0, 10.0, 1.0]) / 12.0
EDGE = 8  # samples at the ends of a stretch that do not count
LONGEST = 4.0  # largest delay [sample]
REACH = 12  # samples about one that `stencil` covers
CORNER = (
    0.7  # error of Numerov's mean where the torque has a corner, relative to its second difference [1/12]
)
JUMP = 0.2  # error of an interpolated acceleration between two samples, relative to a jump of it; times f (1 - f) [-]
FASTER, FARTHER = (
    0.05,
    0.01,
)  # error of a speed and of a position between two samples, relative to a jump of the acceleration
NOISY = 1.2  # noise of the velocity between two samples [noise of a position by the sampling interval]
SLID = 0.99  # level from which on a bristle is surely bent
UNTOLD = 1e4  # standard deviation of a torque that tells nothing, relative to Coulomb friction [-]
KEPT = 6  # motions at so many delays are kept
Kind = Literal["speed", "bristle"]
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True, kw_only=True)
class Course:
    """How friction crosses zero.

    Attributes:
        kind: tanh of the speed, or an elastoplastic bristle.
        width: w [rad/s or m/s], or the displacement to full sliding [rad or m].
        elastic: share of it up to which a bristle is elastic [-].
    """

    kind: Kind
    width: float
    elastic: float = 0.7

    def level(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return friction by its level along a motion, (n,) each."""
        if self.kind == "speed":
            return np.tanh(velocity / self.width)
        return elastoplastic_level(position, self.width, self.elastic)


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A stretch's motion, later by a delay.

    Attributes:
        position: at the samples [rad or m], (n,).
        velocity: there [rad/s or m/s], (n,).
        acceleration: their second difference [rad/s^2 or m/s^2], (n,).
        path: position at `FINE` instants an interval [rad or m], (n FINE,).
        speed: velocity there [rad/s or m/s], (n FINE,).
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    path: np.ndarray
    speed: np.ndarray


#: Term -> its series along a motion, (n,): of friction by speed, of one curve or one each way, gravity, and a constant.
TERMS: dict[str, Callable[[Motion], np.ndarray]] = {
    "viscous": lambda motion: motion.velocity,
    "viscous_positive": lambda motion: np.maximum(motion.velocity, 0.0),
    "viscous_negative": lambda motion: np.minimum(motion.velocity, 0.0),
    GRAVITY[0]: lambda motion: np.sin(motion.position),
    GRAVITY[1]: lambda motion: np.cos(motion.position),
    "offset": lambda motion: np.ones(motion.position.size),
}


@dataclass(kw_only=True, eq=False)
class Passage:
    """A stretch of a log, for a fit through zero crossings.

    Attributes:
        measured: position as the encoder gave it [rad or m], (n,).
        torque: mean over the triangle [N.m or N], (n,).
        corner: about the error of that mean [N.m or N], (n,).
        moving: False in long rests, and about lost samples, (n,).
        rate: sampling frequency [Hz].
        terms: of `TERMS`, as far as they are fitted.
        noise: standard deviation of a position [rad or m].
    """

    measured: np.ndarray
    torque: np.ndarray
    corner: np.ndarray
    moving: np.ndarray
    rate: float
    terms: Sequence[str]
    noise: float
    _motions: dict[float, Motion] = field(default_factory=dict)

    @property
    def rows(self) -> slice:
        """The samples of the fit."""
        return slice(EDGE, self.measured.size - EDGE)

    def motion(self, delay: float) -> Motion:
        """Return the motion to which a torque that is late by a delay [s] belongs."""
        if (kept := self._motions.get(delay)) is not None:
            return kept
        h, late = 1.0 / self.rate, delay * self.rate
        position = earlier(self.measured, late)
        acceleration = np.zeros(position.size)
        acceleration[1:-1] = (position[2:] - 2.0 * position[1:-1] + position[:-2]) / h**2
        path = np.stack([earlier(self.measured, late - j / FINE) for j in range(FINE)], axis=1).ravel()
        made = Motion(
            position=position,
            velocity=np.gradient(position, h),
            acceleration=acceleration,
            path=path,
            speed=np.gradient(path, h / FINE),
        )
        if len(self._motions) >= KEPT:
            self._motions.clear()
        self._motions[delay] = made
        return made

    def level(self, motion: Motion, course: Course) -> np.ndarray:
        """Return the triangle's mean of friction by its level, (n,)."""
        return triangle(course.level(motion.path, motion.speed))

    def columns(self, delay: float, course: Course) -> np.ndarray:
        """Return the means of Coulomb friction's level, all terms, and the acceleration in the rows that count, (m, 2 + t)."""
        motion = self.motion(delay)
        smooth = [numerov(TERMS[term](motion)) for term in self.terms]
        return np.column_stack([self.level(motion, course), *smooth, motion.acceleration])[self.rows]

    def unsure(self, delay: float, course: Course, coulomb: float, inertia: float) -> np.ndarray:
        """Return the variance of what sampling leaves open, beside all noise [(N.m)^2 or N^2], (m,).

        Args:
            delay: of the torque [s].
            course: of friction.
            coulomb: friction [N.m or N].
            inertia: [kg.m^2 or kg].
        """
        motion, level = self.motion(delay), self.level(self.motion(delay), course)
        jump = np.zeros(level.size)
        jump[1:-1] = np.abs(motion.acceleration[2:] - motion.acceleration[:-2])
        jump[1:-1] = np.maximum(jump[1:-1], np.maximum(jump[2:], jump[:-2]))
        if course.kind == "speed":
            off = np.repeat(NOISY * self.noise * self.rate + FASTER * jump / self.rate, FINE)
            ends = [np.tanh((motion.speed + way * off) / course.width) for way in (1.0, -1.0)]
            bend = 0.5 * triangle(ends[0] - ends[1])
        else:
            bend = (1.0 - level**2) * (self.noise + FARTHER * jump / self.rate**2) / course.width
        part = delay * self.rate % 1.0
        variance = (
            (coulomb * bend) ** 2
            + self.corner**2
            + (inertia * JUMP * part * (1.0 - part) * jump) ** 2
            + np.where(self.moving, 0.0, (UNTOLD * coulomb) ** 2)
        )
        if course.kind == "bristle":  # how it was bent at first is unknown
            slid = np.abs(level) > SLID
            variance[: int(np.argmax(slid)) if slid.any() else level.size] = (UNTOLD * coulomb) ** 2
        return variance[self.rows]


def passages_of(
    stretches: Sequence[Signals], terms: Sequence[str], noise: float, every: int = 1
) -> list[Passage]:
    """Return stretches for a fit through zero crossings; none if one has no position of its own.

    Args:
        stretches: of one joint.
        terms: of `TERMS`, that are fitted.
        noise: standard deviation of a position [rad or m].
        every: use one sample of so many.
    """
    made = []
    for s in stretches:
        if s.measured is None:
            return []
        if s.time.size <= 4 * EDGE * every:
            continue
        torque = (s.torque if s.model_torque is None else s.torque - s.model_torque)[::every]
        corner = np.zeros(torque.size)
        corner[1:-1] = CORNER / 12.0 * np.abs(torque[2:] - 2.0 * torque[1:-1] + torque[:-2])
        moves = (s.moving if s.lost is None else s.moving & ~s.lost)[::every]
        moving = moves.copy()
        for first, last in spans(~moves):
            moving[max(first - EDGE, 0) : last + EDGE] = False
        made.append(
            Passage(
                measured=s.measured[::every],
                torque=numerov(torque),
                corner=corner,
                moving=moving,
                rate=s.rate / every,
                terms=tuple(terms),
                noise=noise,
            )
        )
    return made


def numerov(x: np.ndarray) -> np.ndarray:
    """Return the triangle's mean of a smooth series, (n,); the first and last value stay."""
    mean = x.astype(float)
    mean[1:-1] = NUMEROV[0] * (x[:-2] + x[2:]) + NUMEROV[1] * x[1:-1]
    return mean


def triangle(fine: np.ndarray) -> np.ndarray:
    """Return the triangle's means about the samples of a series at `FINE` instants an interval, (n,)."""
    table = fine.reshape(-1, FINE)
    mean = table @ AFTER
    mean[1:] += table[:-1] @ BEFORE
    return mean


def stencil(samples: float) -> np.ndarray:
    """Return the weights of samples within REACH of k in a second difference at k less a delay [sample], (2 REACH + 1,)."""
    whole, weights = cubic(samples)
    bend = np.convolve(weights, [1.0, -2.0, 1.0])
    made = np.zeros(2 * REACH + 1)
    first = REACH - whole - 3
    made[first : first + bend.size] = bend
    return made
