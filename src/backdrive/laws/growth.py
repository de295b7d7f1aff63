"""Growth of friction with the load, for any rate law: the torque that gears transmit presses their teeth together.

    hi += mu (|l| - l_0),   lo -= mu (|l| - l_0),   mu = mu_d where l v > 0,   mu_b elsewhere

l: load of the joint, its torque of gravity and inertia [N.m or N]. It is the negative of the external torque in the pair `load`.
mu_d, mu_b: growth if the motor drives the load, and if the load drives the motor back [-]. l_0: load under which the curve was
identified [N.m or N]. An unknown load (NaN) causes no growth. A smaller load narrows the bounds, but never so far that friction
would drive the joint. Friction in proportion to the transmitted torque: Dohring, Lee, Newman, ICRA 1993; two directions of
power: Wang, Kim, ICRA 2015.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.laws.base import Parameter, Rows

ROW = 3  # numbers of the growth in a row, behind those of the rate law
MARK = 0.5  # added to p[0], the number of parameters before the element, if the last of them are the growth's


@leaf
def beyond(carried: float, load: Pair):
    """The joint's load minus the load `carried`; 0 if the load is unknown."""
    excess = abs(load[1]) - carried
    return 0.0 if np.isnan(excess) else excess


@leaf
def widen(bound: float, by: float, weakening: float):
    """A bound >= 0 plus `by` (of any sign). A decrease ends at `weakening`, the part of the viscous torque that drives."""
    least = min(bound, weakening)
    after = bound + by
    return least if after < least else after


@leaf
def grow_bounds(p: Array, i: int, v: float, load: Pair, lo: float, hi: float, viscous: float):
    """Bounds of a rate law under a load; p[i:]: mu_d, mu_b, l_0."""
    by = beyond(p[i + 2], load)
    if by == 0.0:
        return lo, hi
    forwards = p[i] if load[1] < 0.0 else p[i + 1]
    backwards = p[i] if load[1] > 0.0 else p[i + 1]
    hi = widen(hi, forwards * by, max(-viscous, 0.0) if v > 0.0 else 0.0)
    lo = -widen(-lo, backwards * by, max(viscous, 0.0) if v < 0.0 else 0.0)
    return lo, hi


@dataclass(frozen=True, kw_only=True)
class Growth(Rows):
    """How the Coulomb torque of a law grows with the load that the joint carries.

    Attributes:
        load_driving: mu_d, where the motor drives the load [-].
        load_driven: mu_b, where the load drives the motor back [-].
        load_carried: l_0, load under which the curve of the law holds [N.m or N].
    """

    NAME: ClassVar[str] = "growth"
    KIND: ClassVar[int] = 0
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "load_driving": Parameter(symbol="mu_d", unit="1", lower=-10.0, upper=10.0),
        "load_driven": Parameter(symbol="mu_b", unit="1", lower=-10.0, upper=10.0),
        "load_carried": Parameter(symbol="l_0", unit="force", lower=0.0),
    }

    load_driving: float
    load_driven: float
    load_carried: float = 0.0

    @property
    def mean(self) -> float:
        """Mean of both directions of power [-]."""
        return 0.5 * (self.load_driving + self.load_driven)

    def scale(self, factor: float) -> Growth:
        """Return the growth of `factor` times the friction."""
        up, down = factor * self.load_driving, factor * self.load_driven
        return replace(self, load_driving=up, load_driven=down)


def pairs(load: np.ndarray | float | None, shape: tuple[int, ...]) -> np.ndarray | None:
    """Return loads as pairs of motor-side and external torque, of the shape of the velocities and a last axis of two.

    Args:
        load: load of the joint [N.m or N]: one number, an array of this shape, or pairs with a last axis of two; None: unknown.
        shape: shape of the velocities.

    Raises:
        ValueError: the shapes do not match.
    """
    if load is None:
        return None
    load = np.asarray(load, dtype=np.float64)
    if load.shape == (*shape, 2):
        return load
    carried = np.broadcast_to(load, shape)
    return np.stack([carried, -carried], axis=-1)
