"""Maxwell slip (Iwan): parallel springs, each in series with a Coulomb slider. Presliding remembers its reversals.

    f_i' = k_i v  within  [-w_i F_n, w_i F_p],   tau_f = sum f_i + viscous(v),   sum w_i = 1

k_i: stiffness of element i [N.m/rad or N/m]. w_i: its share of the bound of the rate law [-]. The virgin curve is a polyline
with a bend where each element begins to slip, and every reversal repeats it at twice the size (Masing's rule). The step is
exact. W. D. Iwan, J. Appl. Mech. 33(4), 1966; F. Al-Bender, V. Lampaert, J. Swevers, Tribology Letters 16, 2004.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.errors import InvalidInput
from backdrive.laws.base import Element, Parameter
from backdrive.laws.elements.hayward_armstrong import clip_torque

MOST = 32  # elements


@leaf
def step(p: Array, e: int, x: Array, y: Array, lo: float, hi: float, dp: float, dt: float):
    """Torque of one tick from the states x to y, the elements' torques."""
    n = int(p[e])
    total = 0.0
    if e < 0 or n < 0 or n > MOST:  # tells the compiler that no index is negative
        return np.nan
    for i in range(n):
        w = p[e + 1 + n + i]
        y[i] = clip_torque(x[i] + p[e + 1 + i] * dp, w * lo, w * hi)
    for i in range(n):  # a loop of its own, so that the one above processes several elements at once
        total += y[i]
    return total


MANY: dict[str, Parameter] = {
    "stiffness": Parameter(
        symbol="k_i", unit="force/length", lower=1e-9, many=True, log=True, start=lambda d: d.stiffness
    ),
    "share": Parameter(symbol="w_i", unit="1", lower=0.0, upper=1.0, many=True),
}


@dataclass(frozen=True, kw_only=True)
class Parallel(Element):
    """Base of parallel elements: each has a stiffness and a share, and the shares add up to 1.

    Attributes:
        stiffness: k_i [N.m/rad or N/m], (N,).
        share: w_i of the bound of the rate law [-], (N,).
    """

    STATE_ROW: ClassVar[bool] = True
    EXAMPLE: ClassVar[dict[str, Any]] = dict(stiffness=(1.2e4, 5e3, 2e3), share=(0.5, 0.3, 0.2))

    stiffness: tuple[float, ...]
    share: tuple[float, ...]

    def __post_init__(self):
        super().__post_init__()
        n = len(self.stiffness)
        if n != len(self.share) or not 1 <= n <= MOST:
            raise InvalidInput(
                f"{self.NAME}: {n} stiffnesses and {len(self.share)} shares.",
                remedy=f"Give the same number of each, 1 to {MOST}.",
            )
        if abs(sum(self.share) - 1.0) > 1e-6:
            raise InvalidInput(
                f"{self.NAME}: the shares {self.share} add up to {sum(self.share):g}.",
                remedy="Divide them by their sum: the rate law says how much they carry together.",
            )

    def sections(self) -> int:
        """Return N."""
        return len(self.stiffness)

    def many(self) -> list[float]:
        """Return [N, k_1..k_N, w_1..w_N]."""
        return [float(len(self.stiffness)), *self.stiffness, *self.share]

    def row(self) -> np.ndarray:
        """Return [N, k_1..k_N, w_1..w_N], followed by an element's further parameters in their order."""
        rest = [getattr(self, name) for name in self.PARAMETERS if name not in MANY]
        return np.array(self.many() + rest, dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class MaxwellSlip(Parallel):
    """Elastoplastic elements side by side.

    Attributes:
        stiffness: k_i [N.m/rad or N/m], (N,).
        share: w_i of the bound of the rate law [-], (N,).
    """

    NAME: ClassVar[str] = "maxwell-slip"
    KIND: ClassVar[int] = 10
    PARAMETERS: ClassVar[dict[str, Parameter]] = MANY
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "Vibration below break-away does not drift.",
        "A reversal repeats the virgin curve at twice the size.",
        "No motion from rest gets work out of it.",
    )

    def states(self) -> int:
        """Return N: the elements' torques."""
        return len(self.stiffness)
