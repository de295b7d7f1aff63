"""Dahl's bristle: the torque nears the Coulomb torque exponentially with distance.

    z' = v - |v| z / z_s,   z_s = F/K,   tau_f = K z + viscous(v)

K: presliding stiffness [N.m/rad or N/m], z: stretch of the bristle, F: the bound of the rate law in the direction of motion.
Rate independent: only the path counts. One step is exact for a constant velocity. P. R. Dahl, The Aerospace Corporation,
TOR-0158(3107-18)-1, 1968; AIAA J. 14(12), 1976.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.elementary import exp
from backdrive.laws.base import Element, Parameter


@leaf
def relax(z: float, lo: float, hi: float, dp: float):
    """Torque z (of unit stiffness) carried towards the bound of the direction of motion over a path dp, exactly."""
    bound = hi if dp > 0.0 else lo
    if dp == 0.0:
        return z
    if bound == 0.0:
        return 0.0
    return bound + (z - bound) * exp(-dp / bound)


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """State and torque after one tick; the state is the torque."""
    after = relax(z, lo, hi, p[e] * dp)
    return after, after


STIFFNESS = Parameter(
    symbol="K",
    unit="force/length",
    lower=1e-9,
    typical=5e4,
    source="Iwatani 2017, Sec. 3.5.2: joints of a 6-joint arm with harmonic drives",
    log=True,
    start=lambda d: d.stiffness,
)


@dataclass(frozen=True, kw_only=True)
class Dahl(Element):
    """Dahl's bristle.

    Attributes:
        stiffness: K, presliding stiffness at zero torque [N.m/rad or N/m].
    """

    NAME: ClassVar[str] = "dahl"
    KIND: ClassVar[int] = 2
    DRIFTS: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = {"stiffness": STIFFNESS}
    EXAMPLE: ClassVar[dict[str, Any]] = dict(stiffness=1e4)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "The torque depends on the path alone, not on the speed at which it is run through.",
        "Vibration below break-away drifts.",
        "No motion from rest gets work out of it.",
    )

    stiffness: float

    def states(self) -> int:
        """Return 1: the torque."""
        return 1
