"""A dead zone: below a threshold the velocity counts as zero; Karnopp (ASME JDSMC 107(1), 1985), Iwatani 2017, (4.17).

    tau_f = gsgn(lo, v, hi) + viscous(v)   for |v| > V,   else 0

V: half width of the zone [rad/s or m/s]. As a law of given motion it is (4.17): no friction inside the zone, so that a
noisy velocity does not make the torque jump between the two directions. A mass under it (`solve`) needs no zone: an implicit
step holds it exactly at rest, which is what Karnopp's zone was for, and lets it slide under the rate law at any other
velocity. A velocity counted in encoder steps can fall on the threshold exactly: put V half a step off
(`threshold + 0.5 count / dt`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.laws.base import Element, Parameter


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """State, which there is none of, torque, and motion of the viscous part after one tick: both 0 inside the zone."""
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
