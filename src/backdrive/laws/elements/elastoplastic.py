"""The elastoplastic bristle of Dupont, Hayward, Armstrong and Altpeter: purely elastic up to a break-away distance.

    z' = v (1 - a(z, v) z/z_s),   z_s = sgn(v) s(v)/sigma_0,   tau_f = sigma_0 z + sigma_1(v) z' + viscous(v)
    a = 0                                              for |z| <= b |z_s|, or where z and v differ in sign
    a = 1/2 + 1/2 sin(pi (|z/z_s| - (1 + b)/2)/(1 - b))  between
    a = 1                                              for |z| >= |z_s|

sigma_0: stiffness [N.m/rad or N/m]. sigma_1: damping of the bristle, fading beyond the speed v_d as in LuGre. b: share of the bound
s(v) up to which the bristle is elastic [-]; LuGre is b = 0 with a = 1 throughout. The step is implicit in z. P. Dupont,
V. Hayward, B. Armstrong, F. Altpeter, IEEE TAC 47(5), 2002.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import jit, leaf
from backdrive._types import Array
from backdrive.elementary import sin
from backdrive.laws.base import Parameter
from backdrive.laws.elements.lugre import LuGre, damping

SECANTS, STEPS = 40, 100


@leaf
def plastic(w: float):
    """a: sliding share of the motion, at the fraction w of the range from the elastic limit to full sliding."""
    return 0.5 + 0.5 * sin(np.pi * (w - 0.5))


@jit
def yield_torque(g: float, R: float, S: float, b: float):
    """Bristle torque after it was pulled by R >= 0 along its motion: the root u of u = g + R (1 - a(u) u/S)."""
    if g + R <= b * S:
        return g + R
    if g >= S:
        return S if R > 1e16 * S else (g + R) / (1.0 + R / S)
    low, high = 0.0, 1.0  # two values of w = (u/S - b)/(1 - b), with a residual < 0 and > 0
    below, above = ((b * S - g) - R) / (S + R), (S - g) / (S + R)
    w, side = 0.0, 0
    for k in range(STEPS):  # regula falsi, half the residual at an end that stays (Illinois), then bisection
        w = high - above * (high - low) / (above - below) if k < SECANTS else 0.5 * (low + high)
        if not low < w < high:
            break
        ratio = b + w * (1.0 - b)
        value = ((ratio * S - g) - R * (1.0 - plastic(w) * ratio)) / (S + R)
        if value > 0.0:
            high, above = w, value
            if side > 0:
                below *= 0.5
            side = 1
        else:
            low, below = w, value
            if side < 0:
                above *= 0.5
            side = -1
        if not abs(value) > 1e-15:
            break
    return S * (b + w * (1.0 - b))


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """State and torque after one tick; the state is sigma_0 z."""
    sigma_0, sigma_1, v_d, b = p[e], p[e + 1], p[e + 2], p[e + 3]
    if dp > 0.0:
        after = yield_torque(z, sigma_0 * dp, hi, b) if hi > 0.0 else 0.0
    elif dp < 0.0:
        after = -yield_torque(-z, -sigma_0 * dp, -lo, b) if lo < 0.0 else 0.0
    else:
        after = z + dp
    if sigma_1 == 0.0:
        return after, after
    return after, after + damping(sigma_1, v_d, dp / dt) / sigma_0 * ((after - z) / dt)


@dataclass(frozen=True, kw_only=True)
class Elastoplastic(LuGre):
    """A damped bristle that is elastic below break-away.

    Attributes:
        stiffness: sigma_0 [N.m/rad or N/m].
        damping: sigma_1 [N.m.s/rad or N.s/m].
        fading: v_d, speed beyond which the damping fades [rad/s or m/s]; 0 for never.
        elastic: b, share of the bound up to which the bristle is elastic [-].
    """

    NAME: ClassVar[str] = "elastoplastic"
    KIND: ClassVar[int] = 6
    DRIFTS: ClassVar[bool] = False
    PARAMETERS: ClassVar[dict[str, Parameter]] = LuGre.PARAMETERS | {
        "elastic": Parameter(
            symbol="b",
            unit="1",
            lower=0.0,
            upper=0.99,
            typical=0.7,
            source="Dupont et al., IEEE TAC 47(5), 2002: z_ba = 0.7169 z_ss in their example",
            start=0.6,
        )
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(**LuGre.EXAMPLE, elastic=0.7)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "Vibration below the elastic share of break-away does not drift.",
        "The torque lags behind the velocity.",
        "No motion from rest gets work out of it, where `advice` is empty.",
    )

    elastic: float = 0.7
