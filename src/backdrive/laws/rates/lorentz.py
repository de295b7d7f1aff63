"""Stribeck friction with a Lorentz curve, as Hess and Soom measured it on lubricated line contacts.

    s(v) = F_c + (F_s - F_c) / (1 + (v/v_s)^2),      tau_f in s(v) sgn(v) + sigma_2 v

F_c: Coulomb torque, F_s: torque at the slowest motion [N.m or N]. v_s: speed at which half of the difference is left
[rad/s or m/s]. sigma_2: viscous coefficient [N.m.s/rad or N.s/m]. D. P. Hess, A. Soom, ASME J. Tribology 112(1), 1990.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.laws.base import Parameter, Rate
from backdrive.laws.rates.stribeck import COMMON


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: -s(v), s(v) and sigma_2 v."""
    F_c, F_s, v_s, sigma_2 = p[1], p[2], p[3], p[4]
    r = v / v_s
    s = F_c + (F_s - F_c) / (1.0 + r * r)
    return -s, s, sigma_2 * v


@dataclass(frozen=True, kw_only=True)
class StribeckLorentz(Rate):
    """Coulomb, viscous and Stribeck friction with a Lorentz curve.

    Attributes:
        coulomb: F_c, friction once the joint slides [N.m or N].
        breakaway: F_s, friction at the slowest motion [N.m or N].
        stribeck_velocity: v_s, speed at which half of the difference is left [rad/s or m/s].
        viscous: sigma_2 [N.m.s/rad or N.s/m].
    """

    NAME: ClassVar[str] = "stribeck-lorentz"
    KIND: ClassVar[int] = 4
    RESISTS: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = COMMON
    EXAMPLE: ClassVar[dict[str, Any]] = dict(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0)

    coulomb: float
    breakaway: float
    stribeck_velocity: float
    viscous: float = 0.0
