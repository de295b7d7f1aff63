"""Load-dependent friction, M1 to M6: a geared servo whose friction grows with the torque through its gears.

    e = exp(-|v/v_s|^alpha)
    F = F_c + e F_st + |K_m tau_m - K_e tau_e| + e |S_m tau_m - S_e tau_e| + e Q
    tau_f in F sgn(v) + K_v v
    Q = Q_e tau_e^2 for |tau_e| < |tau_m|,   Q_m tau_m^2 for |tau_e| > |tau_m|,   if tau_e opposes tau_m;   else 0

tau_m, tau_e: torque of the motor and of everything else on the joint (gravity, a hand) [N.m or N], the pair `load`.
F_c, F_st: Coulomb and Stribeck torque [N.m or N]. v_s, alpha: Stribeck velocity [rad/s or m/s] and exponent. K, S: growth
with the load [-]. Q: quadratic growth [1/(N.m) or 1/N]. K_v: viscous coefficient [N.m.s/rad or N.s/m]. M1 has F_c and K_v;
M2 adds F_st; M3 and M4 add one growth for both torques to M1 and M2; M5 gives each torque its own; M6 adds Q. Duclusaud,
Passault, Padois, Ly, "Extended Friction Models for the Physics Simulation of Servo Actuators", arXiv 2410.08650, 2024.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.laws.base import Parameter, Rate
from backdrive.laws.rates.stribeck import fading


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: -F, F and K_v v under the load (tau_m, tau_e)."""
    F_c, F_st, v_s, alpha, K_v = p[1], p[2], p[3], p[4], p[5]
    tau_m, tau_e = load[0], load[1]
    e = fading(v, v_s, alpha)
    f = F_c + e * F_st
    if not p[6] + p[7] + p[8] + p[9] + p[10] + p[11] > 0.0:  # M1, M2: the load may be unknown
        return -f, f, K_v * v
    f += abs(p[6] * tau_m - p[7] * tau_e) + e * abs(p[8] * tau_m - p[9] * tau_e)
    if tau_m * tau_e < 0.0:
        if abs(tau_e) < abs(tau_m):
            f += e * p[10] * tau_e * tau_e
        elif abs(tau_e) > abs(tau_m):
            f += e * p[11] * tau_m * tau_m
    return -f, f, K_v * v


BAM = "Rhoban BAM, Dynamixel MX-106, M6"
ALL: dict[str, Parameter] = {
    "coulomb": Parameter(
        symbol="F_c", unit="force", lower=0.0, typical=0.100, source=BAM, log=True, start=lambda d: d.coulomb
    ),
    "stribeck": Parameter(
        symbol="F_st",
        unit="force",
        lower=0.0,
        typical=0.122,
        source=BAM,
        log=True,
        start=lambda d: max(d.breakaway - d.coulomb, 0.05 * d.coulomb),
    ),
    "stribeck_velocity": Parameter(
        symbol="v_s",
        unit="length/s",
        lower=1e-9,
        upper=1e6,
        typical=1.75,
        source=BAM,
        log=True,
        start=lambda d: d.slow,
    ),
    "exponent": Parameter(
        symbol="alpha", unit="1", lower=0.1, upper=4.0, typical=1.14, source=BAM, start=1.0
    ),
    "viscous": Parameter(
        symbol="K_v", unit="force.s/length", lower=0.0, typical=0.0507, source=BAM, start=lambda d: d.viscous
    ),
    "load": Parameter(symbol="K", unit="1", lower=0.0, upper=2.0, start=0.05),
    "load_stribeck": Parameter(symbol="S", unit="1", lower=0.0, upper=2.0, start=0.05),
    "load_motor": Parameter(
        symbol="K_m", unit="1", lower=0.0, upper=2.0, typical=0.198, source=BAM, start=0.05
    ),
    "load_external": Parameter(
        symbol="K_e", unit="1", lower=0.0, upper=2.0, typical=0.0222, source=BAM, start=0.05
    ),
    "load_stribeck_motor": Parameter(
        symbol="S_m", unit="1", lower=0.0, upper=2.0, typical=0.199, source=BAM, start=0.03
    ),
    "load_stribeck_external": Parameter(
        symbol="S_e", unit="1", lower=0.0, upper=2.0, typical=0.0871, source=BAM, start=0.03
    ),
    "quadratic_external": Parameter(
        symbol="Q_e", unit="1/force", lower=0.0, typical=7.33e-5, source=BAM, start=lambda d: 0.01 / d.coulomb
    ),
    "quadratic_motor": Parameter(
        symbol="Q_m", unit="1/force", lower=0.0, typical=0.0100, source=BAM, start=lambda d: 0.01 / d.coulomb
    ),
}


def _only(*names: str) -> dict[str, Parameter]:
    return {name: ALL[name] for name in names}


@dataclass(frozen=True, kw_only=True)
class LoadDependent(Rate):
    """Base of M1 to M6: one row of eleven numbers, with neutral values for those that a law lacks."""

    KIND: ClassVar[int] = 8
    RESISTS: ClassVar[bool] = True
    NEEDS: ClassVar[tuple[str, ...]] = ("load",)

    def row(self) -> np.ndarray:
        """Return [F_c, F_st, v_s, alpha, K_v, K_m, K_e, S_m, S_e, Q_e, Q_m], (11,)."""
        value = self.values()
        both, fading_both = value.get("load", 0.0), value.get("load_stribeck", 0.0)
        return np.array(
            [
                value["coulomb"],
                value.get("stribeck", 0.0),
                value.get("stribeck_velocity", 1.0),
                value.get("exponent", 1.0),
                value["viscous"],
                value.get("load_motor", both),
                value.get("load_external", both),
                value.get("load_stribeck_motor", fading_both),
                value.get("load_stribeck_external", fading_both),
                value.get("quadratic_external", 0.0),
                value.get("quadratic_motor", 0.0),
            ]
        )


@dataclass(frozen=True, kw_only=True)
class M1(LoadDependent):
    """Coulomb and viscous friction.

    Attributes:
        coulomb: F_c [N.m or N].
        viscous: K_v [N.m.s/rad or N.s/m].
    """

    NAME: ClassVar[str] = "m1"
    NEEDS: ClassVar[tuple[str, ...]] = ()
    PARAMETERS: ClassVar[dict[str, Parameter]] = _only("coulomb", "viscous")
    EXAMPLE: ClassVar[dict[str, Any]] = dict(coulomb=4.0, viscous=1.0)

    coulomb: float
    viscous: float = 0.0


@dataclass(frozen=True, kw_only=True)
class M2(LoadDependent):
    """Coulomb, viscous and Stribeck friction.

    Attributes:
        coulomb: F_c [N.m or N].
        viscous: K_v [N.m.s/rad or N.s/m].
        stribeck: F_st, Stribeck torque, which the slowest motion adds [N.m or N].
        stribeck_velocity: v_s [rad/s or m/s].
        exponent: alpha [-].
    """

    NAME: ClassVar[str] = "m2"
    NEEDS: ClassVar[tuple[str, ...]] = ()
    PARAMETERS: ClassVar[dict[str, Parameter]] = _only(
        "coulomb", "viscous", "stribeck", "stribeck_velocity", "exponent"
    )
    EXAMPLE: ClassVar[dict[str, Any]] = dict(**M1.EXAMPLE, stribeck=2.0, stribeck_velocity=0.05, exponent=1.5)

    coulomb: float
    viscous: float = 0.0
    stribeck: float = 0.0
    stribeck_velocity: float = 1.0
    exponent: float = 1.0


@dataclass(frozen=True, kw_only=True)
class M3(LoadDependent):
    """Coulomb and viscous friction that grows with the load.

    Attributes:
        coulomb: F_c [N.m or N].
        viscous: K_v [N.m.s/rad or N.s/m].
        load: K, growth with |tau_m - tau_e| [-].
    """

    NAME: ClassVar[str] = "m3"
    PARAMETERS: ClassVar[dict[str, Parameter]] = _only("coulomb", "viscous", "load")
    EXAMPLE: ClassVar[dict[str, Any]] = dict(**M1.EXAMPLE, load=0.1)

    coulomb: float
    viscous: float = 0.0
    load: float = 0.0


@dataclass(frozen=True, kw_only=True)
class M4(M2):
    """Stribeck friction that grows with the load, both in sliding and at break-away.

    Attributes:
        load: K, growth with |tau_m - tau_e| [-].
        load_stribeck: S, growth of the Stribeck torque with |tau_m - tau_e| [-].
    """

    NAME: ClassVar[str] = "m4"
    NEEDS: ClassVar[tuple[str, ...]] = ("load",)
    PARAMETERS: ClassVar[dict[str, Parameter]] = M2.PARAMETERS | _only("load", "load_stribeck")
    EXAMPLE: ClassVar[dict[str, Any]] = dict(**M2.EXAMPLE, load=0.1, load_stribeck=0.05)

    load: float = 0.0
    load_stribeck: float = 0.0


@dataclass(frozen=True, kw_only=True)
class M5(M2):
    """Stribeck friction that grows with the motor's and with the external torque, each by its own factor.

    Attributes:
        load_motor: K_m [-].
        load_external: K_e [-].
        load_stribeck_motor: S_m [-].
        load_stribeck_external: S_e [-].
    """

    NAME: ClassVar[str] = "m5"
    NEEDS: ClassVar[tuple[str, ...]] = ("load",)
    PARAMETERS: ClassVar[dict[str, Parameter]] = M2.PARAMETERS | _only(
        "load_motor", "load_external", "load_stribeck_motor", "load_stribeck_external"
    )
    EXAMPLE: ClassVar[dict[str, Any]] = dict(
        **M2.EXAMPLE,
        load_motor=0.15,
        load_external=0.05,
        load_stribeck_motor=0.06,
        load_stribeck_external=0.02,
    )

    load_motor: float = 0.0
    load_external: float = 0.0
    load_stribeck_motor: float = 0.0
    load_stribeck_external: float = 0.0


@dataclass(frozen=True, kw_only=True)
class M6(M5):
    """M5 with a quadratic increase at low speed where the motor and a load oppose each other.

    Attributes:
        quadratic_external: Q_e, if the opposing external torque is smaller than the motor's [1/(N.m) or 1/N].
        quadratic_motor: Q_m, if the opposing external torque is larger than the motor's [1/(N.m) or 1/N].
    """

    NAME: ClassVar[str] = "m6"
    PARAMETERS: ClassVar[dict[str, Parameter]] = M5.PARAMETERS | _only(
        "quadratic_external", "quadratic_motor"
    )
    EXAMPLE: ClassVar[dict[str, Any]] = dict(**M5.EXAMPLE, quadratic_external=0.004, quadratic_motor=0.008)

    quadratic_external: float = 0.0
    quadratic_motor: float = 0.0
