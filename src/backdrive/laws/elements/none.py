"""No presliding: the set-valued friction of a rigid contact.

    tau_f in gsgn(lo, v, hi) + viscous(v)

At v = 0 the torque may have any value in [lo, hi]. `step` knows only the motion and returns 0 there. `solve` returns the
velocity of a mass that this friction holds or lets slide: true stiction without chatter. The viscous part uses the joint's
velocity. gsgn is Iwatani 2017, (3.2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.laws.base import Element, Parameter


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """Unused state and torque after one tick, from the bounds at its velocity and the increment dp."""
    if dp > 0.0:
        return z, hi
    if dp < 0.0:
        return z, lo
    return z, 0.0


@dataclass(frozen=True, kw_only=True)
class Rigid(Element):
    """No presliding; there is nothing to set."""

    NAME: ClassVar[str] = "none"
    KIND: ClassVar[int] = 0
    SET_VALUED: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = {}
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "A held mass rests exactly.",
        "No motion from rest gets work out of it.",
    )
