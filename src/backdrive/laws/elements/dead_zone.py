"""A dead zone: below a threshold the velocity counts as zero; Karnopp (ASME JDSMC 107(1), 1985), Iwatani 2017, (4.17).

    tau_f = gsgn(lo, v, hi) + viscous(v)   for |v| > V,   else 0

V: half width of the zone [rad/s or m/s]. For a given motion the law is (4.17): without friction inside the zone, a noisy
velocity does not switch the torque between the two directions. Karnopp used the zone to hold a mass at rest. `solve` needs no
zone for this, since its implicit step holds a mass exactly. At every other velocity, `solve` uses the rate law. A velocity in
whole encoder steps can equal the threshold exactly, so choose V half a step away (`threshold + 0.5 count / dt`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.laws.base import Element, Parameter


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """Unused state, torque, and motion for the viscous part after one tick. Torque and motion are 0 inside the zone."""
    width = p[e] * dt
    if dp > width:
        return z, hi, dp
    if dp < -width:
        return z, lo, dp
    return z, 0.0, 0.0 * dp  # keeps a NaN


@dataclass(frozen=True, kw_only=True)
class DeadZone(Element):
    """No friction inside a zone of low velocity.

    Attributes:
        threshold: V, half width of the zone [rad/s or m/s].
    """

    NAME: ClassVar[str] = "dead-zone"
    KIND: ClassVar[int] = 1
    ZONE: ClassVar[bool] = True
    SET_VALUED: ClassVar[bool] = True
    STEADY: ClassVar[bool] = False
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "threshold": Parameter(
            symbol="V",
            unit="length/s",
            lower=0.0,
            upper=1e6,
            typical=0.01,
            source="Iwatani 2017, Sec. 4.6.1: two counts of a 5 um encoder in 1 ms",
            log=True,
            start=lambda d: 0.01 * d.speed,
        )
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(threshold=0.01)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "The torque is 0 inside the zone and the rate law's outside.",
        "No motion from rest gets work out of it.",
    )

    threshold: float
