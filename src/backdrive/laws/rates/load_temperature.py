"""Friction that depends on load and temperature: Bittencourt and Gunnarsson (ASME JDSMC 134(5), 2012).

    s(v) = F_c0 + F_cl |tau_l| + F_sl |tau_l| exp(-|v/v_sl|^delta) + (F_s0 + F_sT T) exp(-|v/(v_s0 + v_sT T)|^delta)
    tau_f in s(v) sgn(v) + (F_v0 + F_vT exp(-T/T_v)) v

tau_l: torque through the gears, here half the difference of motor-side and external torque of the pair `load` [N.m or N].
T: temperature [degC]. F_c0, F_s0: torques [N.m or N]; F_sT: slope of F_s0 over T [N.m/degC or N/degC]. F_cl, F_sl: growth with
the load [-]. F_v0, F_vT: viscous coefficients [N.m.s/rad or N.s/m]. v_sl, v_s0: Stribeck velocities [rad/s or m/s]; v_sT: slope
of v_s0 over T [rad/s/degC or m/s/degC]. T_v: warming that lowers the F_vT term to 1/e [degC]. s(v) is at least 0 and the
Stribeck velocity at least 1e-9, because the lines in T may give unphysical values. An unknown temperature (NaN) gives NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.elementary import exp
from backdrive.laws.base import Parameter, Rate
from backdrive.laws.rates.stribeck import fading


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: -s(v), s(v) and the viscous part under a load at a temperature."""
    F_c0, F_cl, F_sl, v_sl, F_s0, F_sT, v_s0, v_sT, F_v0, F_vT, T_v, delta = (
        p[1],
        p[2],
        p[3],
        p[4],
        p[5],
        p[6],
        p[7],
        p[8],
        p[9],
        p[10],
        p[11],
        p[12],
    )
    carried = 0.5 * abs(load[0] - load[1])
    v_s = v_s0 + v_sT * temp
    v_s = max(v_s, 1e-9)
    s = F_c0 + F_cl * carried + F_sl * carried * fading(v, v_sl, delta)
    s += (F_s0 + F_sT * temp) * fading(v, v_s, delta)
    s = max(s, 0.0)
    return -s, s, (F_v0 + F_vT * exp(-temp / T_v)) * v


@dataclass(frozen=True, kw_only=True)
class LoadTemperature(Rate):
    """Stribeck friction of a gear box under load and at a temperature.

    Attributes:
        coulomb: F_c0 [N.m or N].
        coulomb_load: F_cl, growth of the Coulomb torque with the load [-].
        stribeck_load: F_sl, growth of the Stribeck torque with the load [-].
        stribeck_velocity_load: v_sl of the load's Stribeck torque [rad/s or m/s].
        stribeck: F_s0, Stribeck torque at 0 degC [N.m or N].
        stribeck_temperature: F_sT, its growth [N.m/degC or N/degC].
        stribeck_velocity: v_s0 at 0 degC [rad/s or m/s].
        stribeck_velocity_temperature: v_sT, its growth [rad/s/degC or m/s/degC].
        viscous: F_v0, viscous coefficient of a hot gear box [N.m.s/rad or N.s/m].
        viscous_temperature: F_vT, additional viscous coefficient at 0 degC [N.m.s/rad or N.s/m].
        thinning: T_v, warming after which this addition has fallen to 1/e [degC].
        exponent: delta [-].
    """

    NAME: ClassVar[str] = "load-temperature"
    KIND: ClassVar[int] = 9
    RESISTS: ClassVar[bool] = True
    NEEDS: ClassVar[tuple[str, ...]] = ("load", "temperature")
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "coulomb": Parameter(symbol="F_c0", unit="force", lower=0.0, log=True, start=lambda d: d.coulomb),
        "coulomb_load": Parameter(symbol="F_cl", unit="1", lower=0.0, upper=2.0, start=0.05),
        "stribeck_load": Parameter(symbol="F_sl", unit="1", lower=0.0, upper=2.0, start=0.05),
        "stribeck_velocity_load": Parameter(
            symbol="v_sl", unit="length/s", lower=1e-9, upper=1e6, log=True, start=lambda d: d.slow
        ),
        "stribeck": Parameter(
            symbol="F_s0", unit="force", start=lambda d: max(d.breakaway - d.coulomb, 0.05 * d.coulomb)
        ),
        "stribeck_temperature": Parameter(symbol="F_sT", unit="force/degC"),
        "stribeck_velocity": Parameter(
            symbol="v_s0", unit="length/s", lower=-1e6, upper=1e6, start=lambda d: d.slow
        ),
        "stribeck_velocity_temperature": Parameter(symbol="v_sT", unit="length/s/degC"),
        "viscous": Parameter(symbol="F_v0", unit="force.s/length", lower=0.0, start=lambda d: d.viscous),
        "viscous_temperature": Parameter(
            symbol="F_vT", unit="force.s/length", lower=0.0, start=lambda d: d.viscous
        ),
        "thinning": Parameter(symbol="T_v", unit="degC", lower=0.1, upper=1e4, log=True, start=25.0),
        "exponent": Parameter(symbol="delta", unit="1", lower=0.1, upper=4.0, start=1.0),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(
        coulomb=3.0,
        coulomb_load=0.05,
        stribeck_load=0.1,
        stribeck_velocity_load=0.1,
        stribeck=1.0,
        stribeck_temperature=0.05,
        stribeck_velocity=0.02,
        stribeck_velocity_temperature=0.001,
        viscous=0.5,
        viscous_temperature=3.0,
        thinning=20.0,
        exponent=1.3,
    )

    coulomb: float
    coulomb_load: float = 0.0
    stribeck_load: float = 0.0
    stribeck_velocity_load: float = 1.0
    stribeck: float = 0.0
    stribeck_temperature: float = 0.0
    stribeck_velocity: float = 1.0
    stribeck_velocity_temperature: float = 0.0
    viscous: float = 0.0
    viscous_temperature: float = 0.0
    thinning: float = 20.0
    exponent: float = 1.3
