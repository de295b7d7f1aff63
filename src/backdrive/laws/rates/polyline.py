"""Line sections through sampled velocity-torque pairs: Iwatani 2017, (2.8)-(2.9), by direction (3.1).

    tau_f in gsgn(-F_n, v, F_p) + Phi(v),   Phi(0) = 0

Between the knots V_1 < ... < V_N the curve of each direction is linear; below V_1 and above V_N the first and last
section go on; a first section that would start below 0 starts at 0. F_p and F_n are the intercepts of the two curves at zero
velocity. Where the two directions are equal this is the symmetric phi(v) of (2.8), with |v| in (2.9g).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive.errors import InvalidInput
from backdrive.laws.base import Parameter, Rate


@leaf
def branch(p, n, start, speed):
    """Curve of one direction at speed >= 0: knots p[2:2+n], torques p[start:start+n]."""
    if n == 1:
        return p[start]
    i = 0
    while i < n - 2 and speed >= p[3 + i]:
        i += 1
    V_0, V_1 = p[2 + i], p[3 + i]
    F_0, F_1 = p[start + i], p[start + i + 1]
    return F_0 + (F_1 - F_0) / (V_1 - V_0) * (speed - V_0)


@leaf
def limits(p, v, load, temp):
    """Rate law: the intercepts -F_n and F_p, and Phi(v)."""
    n = int(p[1])
    F_p = max(branch(p, n, 2 + n, 0.0), 0.0)
    F_n = max(branch(p, n, 2 + 2 * n, 0.0), 0.0)
    if (
        abs(v) < p[2] and (F_p if v > 0.0 else F_n) == 0.0
    ):  # a first section that would start below 0 starts at 0
        phi = p[2 + n if v > 0.0 else 2 + 2 * n] / p[2] * v
    elif v > 0.0:
        phi = branch(p, n, 2 + n, v) - F_p
    elif v < 0.0:
        phi = F_n - branch(p, n, 2 + 2 * n, -v)
    else:
        phi = 0.0 * v  # keeps a NaN
    return -F_n, F_p, phi


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

    def row(self) -> np.ndarray:
        """Return [N, V_1..V_N, F+_1..F+_N, F-_1..F-_N], (1 + 3 N,)."""
        return np.array(
            [len(self.velocity), *self.velocity, *self.positive, *self.negative], dtype=np.float64
        )
