"""The reset integrator of Haessig and Friedland: a bristle that stretches, gives, and is carried along.

    z' = 0  if (v > 0 and z >= z_p) or (v < 0 and z <= -z_n),   else v
    tau_f = (1 + a) K z + D z'  while the bristle holds,  K z  while it slides;   + viscous(v)

K: stiffness [N.m/rad or N/m]. F_p, F_n: bounds of the rate law; z_p = F_p/K, z_n = F_n/K: break-away distances. a: excess of
the break-away torque, relative to the sliding torque [-]. D: damping while the bristle holds [N.m.s/rad or N.s/m]. At
break-away the torque falls by a F. In that tick, excess and damping count only for the share of the tick before break-away.
So a vibration at break-away gains no energy. If K dp is below 1e-4 F, the excess counts for the whole tick. D. A. Haessig,
B. Friedland, ASME JDSMC 113(3), 1991.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.laws.base import Element, Parameter
from backdrive.laws.elements.dahl import STIFFNESS

SLIGHT = 1e-4  # a tick that stretches the bristle by less counts as held, relative to the bound [-]


@leaf
def break_away_share(held: float, stretch: float, bound: float, jump: float, damped: float):
    """Torque above sliding in the tick of break-away: jump and damping, times the share of the tick before break-away.

    It never exceeds the jump. If a tick hardly stretches the bristle, rounding would falsify this share, so it counts as 1.
    """
    if abs(stretch) < SLIGHT * abs(bound):
        return jump
    added = held / stretch * (jump + damped)
    return jump if abs(added) > abs(jump) else added


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """State and torque after one tick; the state is K z."""
    stiffness, excess, damping = p[e], p[e + 1], p[e + 2]
    stretch, damped = stiffness * dp, damping * (dp / dt)
    trial = z + stretch
    if trial >= hi and dp >= 0.0:
        return hi, hi if z >= hi else hi + break_away_share(hi - z, stretch, hi, excess * hi, damped)
    if trial <= lo and dp <= 0.0:
        return lo, lo if z <= lo else lo + break_away_share(lo - z, stretch, lo, excess * lo, damped)
    if trial > hi:  # the bound has fallen below the torque of a bristle that unloads
        trial = hi
    elif trial < lo:
        trial = lo
    held = (1.0 + excess) * trial + damped
    if held > (1.0 + excess) * hi:
        return trial, (1.0 + excess) * hi
    if held < (1.0 + excess) * lo:
        return trial, (1.0 + excess) * lo
    return trial, held


@dataclass(frozen=True, kw_only=True)
class ResetIntegrator(Element):
    """A bristle that breaks away with a jump.

    Attributes:
        stiffness: K [N.m/rad or N/m].
        excess: a, excess of the break-away torque, relative to the sliding torque [-].
        damping: D, while the bristle holds [N.m.s/rad or N.s/m]; it never raises the torque above break-away.
    """

    NAME: ClassVar[str] = "reset-integrator"
    KIND: ClassVar[int] = 4
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "stiffness": STIFFNESS,
        "excess": Parameter(symbol="a", unit="1", lower=0.0, upper=10.0, start=0.1),
        "damping": Parameter(
            symbol="D", unit="force.s/length", lower=0.0, start=lambda d: 0.2 * d.stiffness * d.lag
        ),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(stiffness=1e4, excess=0.2, damping=5.0)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "Vibration below break-away does not drift.",
        "No motion from rest gets work out of it.",
    )

    stiffness: float
    excess: float = 0.0
    damping: float = 0.0

    def states(self) -> int:
        """Return 1: the bristle's torque."""
        return 1
