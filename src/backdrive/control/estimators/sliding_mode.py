"""A noise-reducing sliding-mode filter: position to velocity, velocity to acceleration, with little lag and no overshoot.

    u1' = u2,   u2' in -(H+1) G/2 sgn(sigma) - (H-1) G/2 sgn(u2),   sigma = 2 G (u1 - x) + |u2| u2

x: input. u1: output, u2: its rate. G: normal rate of u2 [input/s^2]. H > 1: factor on this rate if the filter is too fast to
stop at x otherwise. Backward Euler with the period T has the closed form

    e = u1 - x,   s = G T,   w = -2 G e/(s + sqrt(s^2 + 2 G |e|))
    u2 <- u2 - clip(u2 - w, clip(u2, -H s, -s), clip(u2, s, H s)),   u1 <- u1 + T u2

where clip(x, a, b) limits x. A step X settles in 2 sqrt(X/G) without overshoot; the output lags a ramp v by v^2/(2 G).
S. Jin, R. Kikuuwe, M. Yamamoto, Advanced Robotics 26(8-9), 2012; the thesis cites a relative of it with the same two parameters
(Iwatani 2017, Sec. 4.3.1).

`motion` computes the acceleration in one of three ways. P filters the position and differences u2. V filters the differenced
position, so that u2 is the acceleration. C puts the two filters in series. With the thesis' G = 10 and H = 2, only P keeps an
admittance loop stable. C with 100 m/s^2 and 300 m/s^3 is the better choice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from backdrive._jit import jit, leaf
from backdrive.parameters import BIG, POSITIVE, Bound, WithBounds

WAYS = ("position", "velocity", "cascade")
ROW = 5  # way, G_1, H_1, G_2, H_2
STATES = 5  # u1, u2 of the first filter, of the second, and one unused


@leaf
def clip(a, x, b):
    """Return x within [a, b]; a NaN stays a NaN."""
    x = b if x > b else x
    return a if x < a else x


@leaf
def advance(u, i, x, G, H, T):
    """Advance the filter whose u1, u2 are u[i], u[i + 1] by one sample x."""
    e = u[i] - x
    s = G * T
    w = -2.0 * G * e / (s + np.sqrt(s * s + 2.0 * G * abs(e)))
    u2 = u[i + 1]
    u2 -= clip(clip(-H * s, u2, -s), u2 - w, clip(s, u2, H * s))
    u[i + 1] = u2
    u[i] += T * u2


@jit
def motion(c, i, u, j, q, dp, T):
    """Return velocity and acceleration of a joint at position q that moved by dp; `c[i:]`: row, `u[j:]`: state."""
    way = c[i]
    if way == 0.0:
        before = u[j + 1]
        advance(u, j, q, c[i + 1], c[i + 2], T)
        return u[j + 1], (u[j + 1] - before) / T
    if way == 1.0:
        advance(u, j + 2, dp / T, c[i + 3], c[i + 4], T)
        return u[j + 2], u[j + 3]
    advance(u, j, q, c[i + 1], c[i + 2], T)
    advance(u, j + 2, u[j + 1], c[i + 3], c[i + 4], T)
    return u[j + 2], u[j + 3]


@dataclass(frozen=True, kw_only=True)
class MotionFilter(WithBounds):
    """From an encoder to velocity and acceleration.

    Attributes:
        way: `position`, `velocity` or `cascade`.
        gain: G of the filter on the position [rad/s^2 or m/s^2].
        ratio: H of the same [-].
        second_gain: G of the filter on the velocity [rad/s^3 or m/s^3].
        second_ratio: H of the same [-].
    """

    BOUNDS: ClassVar = {
        "gain": POSITIVE,
        "second_gain": POSITIVE,
        "ratio": Bound(1.0, BIG, open_low=True),
        "second_ratio": Bound(1.0, BIG, open_low=True),
    }
    CHOICES: ClassVar = {"way": WAYS}

    way: Literal["position", "velocity", "cascade"] = "cascade"
    gain: float = 100.0
    ratio: float = 2.0
    second_gain: float = 300.0
    second_ratio: float = 2.0

    @classmethod
    def literal(cls) -> MotionFilter:
        """Return the filter with the numbers of Iwatani 2017, Sec. 4.6.1: G = 10, H = 2, on the position."""
        return cls(way="position", gain=10.0, ratio=2.0)

    @classmethod
    def of_bandwidth(cls, bandwidth: float, acceleration: float) -> MotionFilter:
        """Return a filter of the differenced position whose acceleration lags by at most 1/L.

        A steadily growing acceleration lags by a/G at the value a. Here G is L times `acceleration`.

        Args:
            bandwidth: L [1/s].
            acceleration: largest acceleration with this lag [rad/s^2 or m/s^2].
        """
        return cls(way="velocity", second_gain=bandwidth * acceleration)

    def row(self) -> np.ndarray:
        """Return the row that `motion` reads, (5,)."""
        return np.array(
            [WAYS.index(self.way), self.gain, self.ratio, self.second_gain, self.second_ratio], dtype=float
        )

    def run(self, position: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return velocity and acceleration along sampled positions.

        Args:
            position: uniform samples [rad or m], (n,).
            dt: sampling time [s].

        Returns:
            Velocity [rad/s or m/s] and acceleration [rad/s^2 or m/s^2], (n,) each.
        """
        q = np.ascontiguousarray(position, dtype=np.float64)
        out = np.empty((q.size, 2))
        along(self.row(), np.array([q[0], 0.0, 0.0, 0.0, 0.0]) if q.size else np.zeros(STATES), q, dt, out)
        velocity, acceleration = out.T
        return velocity, acceleration


@jit
def along(c, u, q, T, out):
    """Fill `out` with velocity and acceleration along positions."""
    for k in range(q.size):
        out[k, 0], out[k, 1] = motion(c, 0, u, 0, q[k], q[k] - q[k - 1] if k else 0.0, T)
