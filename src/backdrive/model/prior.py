"""Knowledge of a joint's friction before its log, from its siblings or a former model.

A prior states a few numbers y of the friction curve, such as its constant and its viscous part:

    y = W f,   f_i = tau_f(v_i),   y ~ N(m, S)

`identification.conjugate` combines it with the estimate of a log.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput

DIGITS = 16  # of a log's SHA-256 that tell it from all others
POINTS = 20  # speeds at which the line through a curve is taken
SLOWEST = 0.05  # lowest of these, as a share of the top speed [-]
OVERLAP = 0.5  # least top speed of a log, as a share of the prior's, at which lines are compared [-]


def line_weights(speeds: np.ndarray) -> np.ndarray:
    """Return weights of friction at speeds, (n,), for constant and slope of the line through it by least squares, (2, n)."""
    return np.linalg.pinv(np.column_stack([np.ones_like(speeds), speeds]))


def line_of(law: Any, top: float) -> tuple[float, float]:
    """Return constant [N.m or N] and viscous part [N.m.s/rad or N.s/m] of a law: the line through the mean of both directions.

    Args:
        law: with `torque(velocity)`.
        top: speed up to which the line is taken, from a twentieth of it on [rad/s or m/s].
    """
    velocity, weights = both_ways(top)
    constant, viscous = (weights @ law.torque(velocity)).tolist()
    return constant, viscous


def both_ways(top: float) -> tuple[np.ndarray, np.ndarray]:
    """Return velocities, (n,), and weights, (2, n), of constant and viscous part of the mean of both directions."""
    speeds = np.linspace(SLOWEST, 1.0, POINTS) * top
    line = line_weights(speeds)
    return np.concatenate([speeds, -speeds]), 0.5 * np.hstack([line, -line])


def each_way(top: float) -> tuple[np.ndarray, np.ndarray]:
    """Return velocities, (n,), and weights, (4, n), of constant and viscous part along +q, then along -q."""
    velocity, weights = both_ways(top)
    half = velocity.size // 2
    forward, backward = 2.0 * weights, 2.0 * weights
    forward[:, half:], backward[:, :half] = 0.0, 0.0
    return velocity, np.vstack([forward, backward])


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """What is known of a joint's friction before its log.

    Attributes:
        joint: its name.
        unit: `rad` or `m`.
        source: of the knowledge, in words.
        names: of the numbers y, k of them.
        units: of these.
        velocity: at which friction is taken [rad/s or m/s], (n,).
        weights: of friction for y, (k, n).
        mean: of y, (k,).
        covariance: of y for a further log, (k, k).
        robots: number of robots from which the covariance was estimated; None: it is exact.
        slopes: which of y are slopes and which constants of lines, (k,); lines can be taken over a smaller range of speeds.
            Empty: y are single torques.
        temperature: at which the mean holds [degC]; None: unknown.
        warmth: relative change of y with temperature [1/degC], (k,).
        logs: SHA-256 of the log files that it is from, as far as known; the first `DIGITS` digits suffice.
    """

    joint: str
    unit: str
    source: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    velocity: np.ndarray
    weights: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    robots: int | None = None
    slopes: tuple[bool, ...] = ()
    temperature: float | None = None
    warmth: tuple[float, ...] = ()
    logs: tuple[str, ...] = ()

    def __post_init__(self):
        k = len(self.names)
        S = np.asarray(self.covariance, dtype=float)
        if S.shape != (k, k) or np.shape(self.mean) != (k,) or not np.all(np.isfinite(S)):
            raise InvalidInput(
                f"A prior of {k} numbers has a covariance {S.tolist()} and the mean {np.asarray(self.mean).tolist()}.",
                remedy="Give finite ones of the same size.",
            )
        if np.linalg.eigvalsh(S).min() < -1e-9 * max(np.abs(S).max(), 1e-300):
            raise InvalidInput(
                f"The covariance {S.tolist()} of a prior is not positive semidefinite.",
                remedy="Take that of `merge`, or of an identified model.",
            )

    def within(self, low: float, high: float) -> Prior | None:
        """Return the prior of what a log from velocity `low` to `high` [rad/s or m/s] shows; None if that is nothing."""
        if self.slopes:
            top, own = min(high, -low), float(np.abs(self.velocity).max())
            if top < OVERLAP * own:
                return None
            scale = min(top / own, 1.0)
            slope = np.array(self.slopes)[:, None]
            weights = np.where(slope, self.weights / scale, self.weights)
            return replace(self, velocity=scale * self.velocity, weights=weights)
        inside = (self.velocity >= low * (1.0 + 1e-9)) & (self.velocity <= high * (1.0 + 1e-9))
        kept = np.flatnonzero(np.all(inside | (self.weights == 0.0), axis=1))
        if not kept.size:
            return None
        return replace(
            self,
            names=tuple(self.names[i] for i in kept),
            units=tuple(self.units[i] for i in kept),
            weights=self.weights[kept],
            mean=self.mean[kept],
            covariance=self.covariance[np.ix_(kept, kept)],
            warmth=tuple(self.warmth[i] for i in kept) if self.warmth else (),
        )

    def at(self, temperature: float | None) -> Prior:
        """Return the prior at the temperature of a log [degC]; the same if either is unknown."""
        if temperature is None or self.temperature is None or not self.warmth:
            return self
        factor = np.exp(np.array(self.warmth) * (temperature - self.temperature))
        return replace(
            self,
            mean=self.mean * factor,
            covariance=self.covariance * np.outer(factor, factor),
            temperature=temperature,
        )
