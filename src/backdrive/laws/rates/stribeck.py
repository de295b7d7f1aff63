"""Stribeck friction: the torque falls from break-away to Coulomb as the joint begins to slide, then grows.

    s(v) = F_c + (F_s - F_c) exp(-|v/v_s|^delta),      tau_f in s(v) sgn(v) + sigma_2 v

F_c: Coulomb torque, F_s: torque at the slowest motion [N.m or N]. v_s: Stribeck velocity [rad/s or m/s]. delta: exponent.
It is 1 in Tustin's curve (1947) and free in that of Bo and Pavelescu (Wear 82(3), 1982). With 2 the curve is the Gauss form
(`stribeck-gauss`). sigma_2: viscous coefficient [N.m.s/rad or N.s/m].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.elementary import decay, pow
from backdrive.laws.base import Parameter, Rate

CANUDAS = "Canudas de Wit et al., IEEE TAC 40(3), 1995, Table I"


@leaf
def fading(v: float, v_s: float, delta: float):
    """exp(-|v/v_s|^delta): 1 at rest, 0 at speed."""
    r = abs(v) * (1.0 / v_s)  # in a loop over ticks the division is done once
    return decay(-pow(r, delta))


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: -s(v), s(v) and sigma_2 v."""
    F_c, F_s, v_s, delta, sigma_2 = p[1], p[2], p[3], p[4], p[5]
    s = F_c + (F_s - F_c) * fading(v, v_s, delta)
    return -s, s, sigma_2 * v


COMMON: dict[str, Parameter] = {
    "coulomb": Parameter(
        symbol="F_c",
        unit="force",
        lower=0.0,
        typical=1.0,
        source=CANUDAS,
        log=True,
        start=lambda d: d.coulomb,
    ),
    "breakaway": Parameter(
        symbol="F_s",
        unit="force",
        lower=0.0,
        typical=1.5,
        source=CANUDAS,
        log=True,
        start=lambda d: d.breakaway,
        peak=True,
    ),
    "stribeck_velocity": Parameter(
        symbol="v_s",
        unit="length/s",
        lower=1e-9,
        upper=1e6,
        typical=1e-3,
        source=CANUDAS,
        log=True,
        start=lambda d: d.slow,
    ),
    "viscous": Parameter(
        symbol="sigma_2",
        unit="force.s/length",
        lower=0.0,
        typical=0.4,
        source=CANUDAS,
        start=lambda d: d.viscous,
    ),
}


@dataclass(frozen=True, kw_only=True)
class StribeckTustin(Rate):
    """Coulomb, viscous and Stribeck friction with a free exponent.

    Attributes:
        coulomb: F_c, friction once the joint slides [N.m or N].
        breakaway: F_s, friction at the slowest motion [N.m or N].
        stribeck_velocity: v_s, speed at which 1/e of the difference is left [rad/s or m/s].
        exponent: delta [-].
        viscous: sigma_2 [N.m.s/rad or N.s/m].
    """

    NAME: ClassVar[str] = "stribeck-tustin"
    KIND: ClassVar[int] = 3
    RESISTS: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "coulomb": COMMON["coulomb"],
        "breakaway": COMMON["breakaway"],
        "stribeck_velocity": COMMON["stribeck_velocity"],
        "exponent": Parameter(
            symbol="delta",
            unit="1",
            lower=0.1,
            upper=4.0,
            typical=1.0,
            source="Armstrong-Helouvry et al., Automatica 30(7), 1994: 0.5 to 2; harmonic drives up to 3 "
            "(Rhoban BAM, eRob80)",
            start=1.0,
        ),
        "viscous": COMMON["viscous"],
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(
        coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, exponent=0.8, viscous=1.0
    )

    coulomb: float
    breakaway: float
    stribeck_velocity: float
    exponent: float = 1.0
    viscous: float = 0.0
