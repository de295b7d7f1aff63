"""Stribeck friction: the torque falls from break-away to Coulomb as the joint begins to slide, then grows.

    s(v) = F_c + (F_s - F_c) exp(-(v/v_s)^2),      tau_f in s(v) sgn(v) + sigma_2 v

F_c: Coulomb torque, F_s: torque at the slowest motion [N.m or N]. v_s: Stribeck velocity [rad/s or m/s]. sigma_2: viscous
coefficient [N.m.s/rad or N.s/m]. B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica 30(7), 1994.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.elementary import decay
from backdrive.laws.base import Parameter, Rate
from backdrive.laws.rates.stribeck import COMMON


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: -s(v), s(v) and sigma_2 v. One instruction evaluates the exponential of several velocities."""
    F_c, F_s, v_s, sigma_2 = p[1], p[2], p[3], p[4]
    r = v * (1.0 / v_s)  # in a loop over ticks the division is done once
    s = F_c + (F_s - F_c) * decay(-(r * r))
    return -s, s, sigma_2 * v


@dataclass(frozen=True, kw_only=True)
class StribeckGauss(Rate):
    """Coulomb, viscous and Stribeck friction with a Gauss curve.

    Attributes:
        coulomb: F_c, friction once the joint slides [N.m or N].
        breakaway: F_s, friction at the slowest motion [N.m or N].
        stribeck_velocity: v_s, speed at which 1/e of the difference is left [rad/s or m/s].
        viscous: sigma_2 [N.m.s/rad or N.s/m].
    """

    NAME: ClassVar[str] = "stribeck-gauss"
    KIND: ClassVar[int] = 2
    RESISTS: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = COMMON
    EXAMPLE: ClassVar[dict[str, Any]] = dict(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0)

    coulomb: float
    breakaway: float
    stribeck_velocity: float
    viscous: float = 0.0
