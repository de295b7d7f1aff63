"""LuGre: a damped bristle under a rate law that may be lower in motion than at rest.

    z' = v - sigma_0 |v| z / s(v),   tau_f = sigma_0 z + sigma_1(v) z' + viscous(v),   sigma_1(v) = sigma_1 exp(-(v/v_d)^2)

sigma_0: stiffness [N.m/rad or N/m]. sigma_1: damping of the bristle [N.m.s/rad or N.s/m]. s(v): the bound of the rate law.
v_d: speed beyond which the damping fades [rad/s or m/s]; 0 for a constant sigma_1. Without fading a reversal at high speed
gives a spike of up to 2 sigma_1 s/(sigma_0 dt). The step is implicit in z, so that |z| <= s/sigma_0 always. C. Canudas de Wit,
H. Olsson, K. J. Astrom, P. Lischinsky, IEEE TAC 40(3), 1995.

LuGre friction does not create energy if sigma_2 >= sigma_1 (F_s - F_c)/F_c (N. Barabanov, R. Ortega, IEEE TAC 45(4), 2000).
With fading damping, v_d <= 4 sqrt(2 e) F_c/sigma_1 suffices for any sigma_2. Proof: let V = sigma_0 z^2/2 and F the torque
without its viscous part. F v - V' is quadratic in z, and not negative if sigma_1(v) |v| <= 4 s(v). The largest value of
|v| exp(-(v/v_d)^2) is v_d/sqrt(2 e). The parameters of the 1995 paper satisfy neither condition.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.elementary import decay
from backdrive.laws.base import Element, Parameter, Rate

FAR = 1e250  # largest torque of a bristle's own, so that nothing overflows [N.m or N]
TINY = 1e-300  # keeps a denominator above 0 without changing any other value
CANUDAS = "Canudas de Wit et al., IEEE TAC 40(3), 1995, Table I"


@leaf
def damping(sigma_1: float, v_d: float, v: float):
    """Damping of the bristle at velocity v."""
    if v_d <= 0.0 or sigma_1 == 0.0:
        return sigma_1
    r = v * (1.0 / v_d)  # in a loop over ticks the division is done once
    return sigma_1 * decay(-(r * r))


@leaf
def weight(p: Array, e: int, v: float):
    """Damping of the bristle at velocity v, from the row."""
    return damping(p[e + 1], p[e + 2], v)


@leaf
def ahead(p: Array, e: int, lo: float, hi: float, dp: float):
    """Numbers of a tick that do not depend on the state and give the next one: reach and part."""
    reach = min(max(p[e] * dp, -FAR), FAR)
    s = hi if dp > 0.0 else lo
    return reach, s / (s + (reach + TINY))


@leaf
def follow(z: float, reach: float, part: float):
    """State after one tick, from that before; the state is sigma_0 z."""
    return (z + reach) * part


@leaf
def torque(p: Array, e: int, z: float, after: float, damping: float, dt: float):
    """Torque after one tick, from the states before and after."""
    return after + damping * (after - z) * (1.0 / (p[e] * dt))


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """State and torque after one tick; the state is sigma_0 z."""
    reach, part = ahead(p, e, lo, hi, dp)
    after = follow(z, reach, part)
    return after, torque(p, e, z, after, weight(p, e, dp / dt), dt)


@dataclass(frozen=True, kw_only=True)
class LuGre(Element):
    """A damped bristle.

    Attributes:
        stiffness: sigma_0 [N.m/rad or N/m].
        damping: sigma_1 [N.m.s/rad or N.s/m].
        fading: v_d, speed beyond which the damping fades [rad/s or m/s]; 0 for never.
    """

    NAME: ClassVar[str] = "lugre"
    KIND: ClassVar[int] = 5
    DRIFTS: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "stiffness": Parameter(
            symbol="sigma_0",
            unit="force/length",
            lower=1e-9,
            typical=1e5,
            source=CANUDAS,
            log=True,
            start=lambda d: d.stiffness,
        ),
        "damping": Parameter(
            symbol="sigma_1",
            unit="force.s/length",
            lower=0.0,
            typical=316.0,
            source=CANUDAS,
            log=True,
            start=lambda d: 0.2 * d.stiffness * d.lag,
        ),
        "fading": Parameter(
            symbol="v_d", unit="length/s", lower=0.0, upper=1e6, log=True, start=lambda d: d.speed
        ),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(stiffness=1e4, damping=20.0, fading=0.05)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "Vibration below break-away drifts.",
        "The torque lags behind the velocity.",
        "No motion from rest gets work out of it, where `advice` is empty.",
    )

    stiffness: float
    damping: float = 0.0
    fading: float = 0.0

    def states(self) -> int:
        """Return 1: the bristle's torque."""
        return 1

    def advice(self, rate: Rate, load: tuple[float, float] = (0.0, 0.0), temperature: float = 20.0) -> str:
        """Return a warning if sigma_1 may create energy under a rate law that changes with speed; otherwise an empty string."""
        if self.damping == 0.0:
            return ""
        for weakest, strongest, viscous in rate.span(load, temperature):
            if strongest <= weakest * (1.0 + 1e-12):
                continue
            needed = np.inf if weakest == 0.0 else self.damping * (strongest - weakest) / weakest
            fades = 4.0 * np.sqrt(2.0 * np.e) * weakest / self.damping
            if viscous < needed and not 0.0 < self.fading <= fades:
                return (
                    f"'{self.NAME}' with damping = {self.damping:g} needs viscous >= {needed:g} or "
                    f"0 < fading <= {fades:g} so as not to create energy."
                )
        return ""
