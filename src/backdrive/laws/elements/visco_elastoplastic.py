"""Visco-elastoplastic contact: a damped spring in series with a Coulomb slider.

    f = clip(K a + B v, -F_n, F_p),   a' = (f - K a)/B,   tau_f = f + viscous(v)

K: stiffness [N.m/rad or N/m], B: damping [N.m.s/rad or N.s/m], a: stretch. F_p, F_n: bounds of the rate law. It solves the
inclusion f = K a + B a' in F sgn(v - a'). The equations above need no set, because y in F sgn(x - y) means y = clip(x, -F, F).
The backward Euler step is f = clip(K (a + dp) + B dp/dt), then a = (a B + f dt)/(B + K dt). R. Kikuuwe, N. Takesue, A. Sano,
H. Mochiyama, H. Fujimoto, IEEE TRO 22(6), 2006.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.laws.base import Element, Parameter
from backdrive.laws.elements.dahl import STIFFNESS
from backdrive.laws.elements.hayward_armstrong import clip_torque

ROBOT = "a 7-joint robot simulated with one such element per joint: K = 5000 N.m/rad, B/K = 10 ms"


@leaf
def section(f: float, k: float, w: float, beta: float, lo: float, hi: float, dp: float, dt: float):
    """Spring torque and torque of one element after a tick."""
    pull, left = k * dp, beta / (beta + dt)  # both quotients are at hand before the motion is
    total = clip_torque(f + pull + (beta / dt) * pull, w * lo, w * hi)
    return left * f + (1.0 - left) * total, total


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """State and torque after one tick; the state is the spring's torque K a."""
    return section(z, p[e], 1.0, p[e + 1], lo, hi, dp, dt)


DAMPING = Parameter(
    symbol="B",
    unit="force.s/length",
    lower=0.0,
    typical=50.0,
    source=ROBOT,
    log=True,
    start=lambda d: 0.2 * d.stiffness * d.lag,
)


@dataclass(frozen=True, kw_only=True)
class ViscoElastoplastic(Element):
    """A damped spring in series with a Coulomb slider.

    Attributes:
        stiffness: K [N.m/rad or N/m].
        damping: B [N.m.s/rad or N.s/m].
    """

    NAME: ClassVar[str] = "visco-elastoplastic"
    KIND: ClassVar[int] = 8
    PARAMETERS: ClassVar[dict[str, Parameter]] = {"stiffness": STIFFNESS, "damping": DAMPING}
    EXAMPLE: ClassVar[dict[str, Any]] = dict(stiffness=1e4, damping=20.0)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "Vibration below break-away does not drift.",
        "No motion from rest gets work out of it.",
    )

    stiffness: float
    damping: float = 0.0

    def row(self) -> np.ndarray:
        """Return [K, B/K]."""
        return np.array([self.stiffness, self.damping / self.stiffness])

    def states(self) -> int:
        """Return 1: the spring's torque."""
        return 1
