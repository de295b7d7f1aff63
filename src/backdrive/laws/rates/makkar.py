"""A continuously differentiable friction curve: Makkar, Dixon, Sawyer, Hu (IEEE/ASME AIM 2005).

    tau_f(v) = g_1 (tanh(g_2 v) - tanh(g_3 v)) + g_4 tanh(g_5 v) + g_6 v

g_1: height that the Stribeck peak would have without its fall, g_4: Coulomb torque [N.m or N]. g_2 > g_3: steepness of the
rise and of the fall, g_5: steepness of the Coulomb part [s/rad or s/m]. g_6: viscous coefficient [N.m.s/rad or N.s/m].
Friction is 0 at rest and rises steeply. Nothing holds a joint for good, and a presliding element finds no Coulomb torque to
carry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.elementary import tanh
from backdrive.laws.base import Parameter, Rate

MAKKAR = "example of this law in the MathWorks System Identification Toolbox (idnlgreydemo5)"


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: no set-valued part; the whole curve is in the last number."""
    rise, fall, coulomb = tanh(p[2] * v), tanh(p[3] * v), tanh(p[5] * v)
    return 0.0, 0.0, p[1] * (rise - fall) + p[4] * coulomb + p[6] * v


@dataclass(frozen=True, kw_only=True)
class Makkar(Rate):
    """Smooth friction from three hyperbolic tangents.

    Attributes:
        stribeck: g_1, height of the Stribeck peak [N.m or N].
        rise: g_2, steepness of its rise [s/rad or s/m].
        fall: g_3, steepness of its fall [s/rad or s/m].
        coulomb: g_4, Coulomb torque [N.m or N].
        steepness: g_5, of the Coulomb torque's rise [s/rad or s/m].
        viscous: g_6 [N.m.s/rad or N.s/m].
    """

    NAME: ClassVar[str] = "makkar"
    KIND: ClassVar[int] = 5
    SMOOTH: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "stribeck": Parameter(
            symbol="g_1",
            unit="force",
            lower=0.0,
            typical=0.25,
            source=MAKKAR,
            log=True,
            start=lambda d: max(d.breakaway - d.coulomb, 0.05 * d.coulomb),
        ),
        "rise": Parameter(
            symbol="g_2",
            unit="s/length",
            lower=1e-6,
            upper=1e9,
            typical=100.0,
            source=MAKKAR,
            log=True,
            start=lambda d: 10.0 / d.slow,
        ),
        "fall": Parameter(
            symbol="g_3",
            unit="s/length",
            lower=1e-6,
            upper=1e9,
            typical=10.0,
            source=MAKKAR,
            log=True,
            start=lambda d: 0.7 / d.slow,
        ),
        "coulomb": Parameter(
            symbol="g_4",
            unit="force",
            lower=0.0,
            typical=0.1,
            source=MAKKAR,
            log=True,
            start=lambda d: d.coulomb,
        ),
        "steepness": Parameter(
            symbol="g_5",
            unit="s/length",
            lower=1e-6,
            upper=1e9,
            typical=100.0,
            source=MAKKAR,
            log=True,
            start=lambda d: 3.0 / d.slow,
        ),
        "viscous": Parameter(
            symbol="g_6",
            unit="force.s/length",
            lower=0.0,
            typical=0.01,
            source=MAKKAR,
            start=lambda d: d.viscous,
        ),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(
        stribeck=2.0, rise=100.0, fall=20.0, coulomb=4.0, steepness=100.0, viscous=1.0
    )

    stribeck: float
    rise: float
    fall: float
    coulomb: float
    steepness: float
    viscous: float = 0.0
