"""Gear friction: it grows with the transmitted torque. At low speed the growth depends on which side drives.

    e = exp(-(v/v_s)^2)
    F = F_c + (K + e S)|T|,   S = S_d where T v > 0, the motor drives the load;   S = S_b where T v < 0, the load drives it
    tau_f in F sgn(v) + K_v v

T: torque that the gears transmit to the load [N.m or N], the negative of the external torque in the pair `load`. It covers
gravity and the acceleration of the load, but not the acceleration of the motor. K: friction of the sliding teeth per unit of
|T| [-]. S_d, S_b: increase of K at rest [-], so that a joint can hold a larger load than it can lift. v_s: velocity at which
this increase has fallen to 1/e [rad/s or m/s]. F_c: Coulomb torque without load [N.m or N]. K_v: viscous coefficient
[N.m.s/rad or N.s/m]. Friction in proportion to the transmitted torque: Dohring, Lee, Newman, "A load-dependent transmission
friction model: theory and experiments", ICRA 1993; two directions of power: Wang, Kim, "Directional efficiency in geared
transmissions", ICRA 2015.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.elementary import decay
from backdrive.laws.base import Parameter, Rate


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: lo, hi and K_v v under the transmitted torque -load[1]."""
    F_c, K, S_d, S_b, v_s, K_v = p[1], p[2], p[3], p[4], p[5], p[6]
    size = abs(load[1])
    if size == 0.0:
        return -F_c, F_c, K_v * v
    ratio = v / v_s
    e = decay(-(ratio * ratio))
    driving = F_c + (K + e * S_d) * size
    driven = F_c + (K + e * S_b) * size
    if load[1] < 0.0:
        return -driven, driving, K_v * v
    return -driving, driven, K_v * v


FITTED = "fitted to the XL330 logs of Rhoban BAM"


@dataclass(frozen=True, kw_only=True)
class GearLoad(Rate):
    """Friction in proportion to the torque that the gears transmit.

    Attributes:
        coulomb: F_c, Coulomb torque without load [N.m or N].
        load: K, growth with the load in sliding [-].
        driving: S_d, increase of K at rest if the motor drives the load [-].
        driven: S_b, increase of K at rest if the load drives the motor back [-].
        stribeck_velocity: v_s [rad/s or m/s].
        viscous: K_v [N.m.s/rad or N.s/m].
    """

    NAME: ClassVar[str] = "gear-load"
    KIND: ClassVar[int] = 10
    RESISTS: ClassVar[bool] = True
    NEEDS: ClassVar[tuple[str, ...]] = ("load",)
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "coulomb": Parameter(
            symbol="F_c",
            unit="force",
            lower=0.0,
            typical=0.0062,
            source=FITTED,
            log=True,
            start=lambda d: d.coulomb,
        ),
        "load": Parameter(
            symbol="K", unit="1", lower=0.0, upper=2.0, typical=0.26, source=FITTED, start=0.05
        ),
        "driving": Parameter(
            symbol="S_d", unit="1", lower=0.0, upper=2.0, typical=0.18, source=FITTED, start=0.05
        ),
        "driven": Parameter(
            symbol="S_b", unit="1", lower=0.0, upper=2.0, typical=0.17, source=FITTED, start=0.05
        ),
        "stribeck_velocity": Parameter(
            symbol="v_s",
            unit="length/s",
            lower=1e-9,
            upper=1e6,
            typical=0.31,
            source=FITTED,
            log=True,
            start=lambda d: d.slow,
        ),
        "viscous": Parameter(
            symbol="K_v",
            unit="force.s/length",
            lower=0.0,
            typical=0.0072,
            source=FITTED,
            log=True,
            start=lambda d: d.viscous,
        ),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(
        coulomb=3.0, load=0.15, driving=0.1, driven=0.2, stribeck_velocity=0.05, viscous=1.0
    )

    coulomb: float
    load: float = 0.0
    driving: float = 0.0
    driven: float = 0.0
    stribeck_velocity: float = 1.0
    viscous: float = 0.0
