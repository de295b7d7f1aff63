"""Line sections through sampled velocity-torque pairs: Iwatani 2017, (2.8)-(2.9), by direction (3.1).

    tau_f in gsgn(-F_n, v, F_p) + Phi(v),   Phi(0) = 0

The curve of each direction is linear between the knots V_1 < ... < V_N. The first and the last section extend beyond V_1 and
V_N. If the first section has a negative intercept at zero velocity, a line from the origin to its first knot replaces it
below V_1. F_p and F_n are the intercepts of the two curves at zero velocity. For equal directions this is the symmetric
phi(v) of (2.8), with |v| in (2.9g).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.errors import InvalidInput
from backdrive.laws.base import MOST, Parameter, Rate


@leaf
def section(p: Array, N: int, speed: float):
    """Number of knots at or below a speed. All knots are compared, so that a compiler can process several velocities at once."""
    i = 0
    for k in range(6):  # fixed lengths, which a compiler unrolls
        i += 1 if speed >= p[4 + k] else 0
    if N > 6:
        for k in range(6, 12):
            i += 1 if speed >= p[4 + k] else 0
    for k in range(12, N):
        i += 1 if speed >= p[4 + k] else 0
    return i


@leaf
def section_of_one(p: Array, N: int, speed: float):
    """Number of knots at or below a speed, for one velocity at a time. The search ends early, since the knots increase."""
    i = N
    while i > 0 and not speed >= p[3 + i]:
        i -= 1
    return i


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: the intercepts -F_n and F_p, and Phi(v)."""
    N, F_p, F_n = int(p[1]), p[2], p[3]
    speed = abs(v)
    i = section(p, N, speed)
    at = 4 + N + 3 * (i if v > 0.0 else i + N + 1)
    F = p[at + 1] + p[at + 2] * (speed - p[at])
    phi = F - F_p if v > 0.0 else F_n - F
    return -F_n, F_p, 0.0 * v if v == 0.0 else phi


@leaf
def limits_of_one(p: Array, v: float, load: Pair, temp: float):
    """Rate law: the same numbers as `limits`, by branches, which are faster for one velocity at a time."""
    N, F_p, F_n = int(p[1]) & MOST, p[2], p[3]
    speed, phi = abs(v), 0.0 * v
    i = 0
    while i < N and speed >= p[5 + i]:  # two knots at a time, their number is even
        i += 2
    if i < N and speed >= p[4 + i]:
        i += 1
    at = 4 + N + 3 * (i & MOST)  # the masks tell the compiler that no index is negative
    if v > 0.0:
        phi = p[at + 1] + p[at + 2] * (speed - p[at]) - F_p
    elif v < 0.0:
        at += 3 * (N + 1)
        phi = F_n - (p[at + 1] + p[at + 2] * (speed - p[at]))
    return -F_n, F_p, phi


AT_ONCE = 6  # the number of knots is padded to a multiple of this, so that curves share compiled loops


def lines(V: np.ndarray, F: np.ndarray, count: int) -> tuple[float, np.ndarray]:
    """Return the intercept of a curve and its lines: where each begins, its torque there, its slope, (count + 1, 3).

    The first line lies below V_1. It extends the second, or starts at the origin if the second has a negative intercept.
    """
    slope = np.diff(F) / np.diff(V) if F.size > 1 else np.zeros(1)
    intercept = max(float(F[0] + slope[0] * (0.0 - V[0])), 0.0)
    table = np.column_stack([V[: slope.size], F[: slope.size], slope])
    first = table[:1] if intercept > 0.0 or V[0] == 0.0 else np.array([[0.0, 0.0, F[0] / V[0]]])
    table = np.concatenate([first, table])
    return intercept, np.concatenate([table, np.repeat(table[-1:], count + 1 - len(table), axis=0)])


@dataclass(frozen=True, kw_only=True)
class Polyline(Rate):
    """Line sections through velocity-torque pairs, by direction.

    Attributes:
        velocity: knots V_n, strictly increasing and positive [rad/s or m/s], (N,).
        positive: friction at V_n for motion along +q [N.m or N], (N,).
        negative: its magnitude for motion along -q [N.m or N], (N,).
    """

    NAME: ClassVar[str] = "polyline"
    WORDS: ClassVar[str] = "line sections, by direction"
    KIND: ClassVar[int] = 1
    SYMMETRIC: ClassVar[bool] = False
    TIES: ClassVar[dict[str, str]] = {"negative[0]": "positive[0]"}
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "velocity": Parameter(symbol="V_n", unit="length/s", lower=0.0, many=True),
        "positive": Parameter(symbol="F_n+", unit="force", many=True, start=lambda d: d.coulomb),
        "negative": Parameter(symbol="F_n-", unit="force", many=True, start=lambda d: d.coulomb),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(
        velocity=(0.05, 0.2, 1.0), positive=(5.0, 4.5, 5.5), negative=(4.5, 4.0, 5.5)
    )

    velocity: tuple[float, ...]
    positive: tuple[float, ...]
    negative: tuple[float, ...]

    def __post_init__(self):
        super().__post_init__()
        sizes = {len(self.velocity), len(self.positive), len(self.negative)}
        if sizes == {0} or len(sizes) != 1:
            raise InvalidInput(
                f"polyline: {len(self.velocity)} velocities, {len(self.positive)} positive and "
                f"{len(self.negative)} negative torques.",
                remedy="Give the same number of each, at least one.",
            )
        if np.any(np.diff(self.velocity) <= 0):
            raise InvalidInput(
                f"polyline: the velocities {self.velocity} do not strictly increase.",
                remedy="Sort and merge them.",
            )

    def sections(self) -> int:
        """Return the number of knots at which the line changes, padded to a multiple of AT_ONCE."""
        return -(-max(len(self.velocity) - 1, 1) // AT_ONCE) * AT_ONCE

    def row(self) -> np.ndarray:
        """Return [N, F_p, F_n, V_1..V_N, lines along +q, lines along -q], the last knots at infinity, (9 + 7 N,)."""
        return _row(self.sections(), self.velocity, self.positive, self.negative).copy()


@lru_cache(maxsize=64)
def _row(
    count: int, velocity: tuple[float, ...], positive: tuple[float, ...], negative: tuple[float, ...]
) -> np.ndarray:
    """Return the row of a curve, computed once: it takes longer than to evaluate the curve."""
    V, knots = np.array(velocity), np.full(count, np.inf)
    knots[: max(V.size - 1, 1)] = V[: max(V.size - 1, 1)]
    (F_p, forward), (F_n, backward) = (lines(V, np.array(F), count) for F in (positive, negative))
    return np.concatenate([[count, F_p, F_n], knots, forward.ravel(), backward.ravel()])
