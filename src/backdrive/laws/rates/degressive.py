"""Degressive viscous friction: it grows with speed ever more slowly, as in greased harmonic drives.

    tau_f in F sgn(v) + k |v|^n sgn(v),      0 < n <= 1

F: Coulomb torque [N.m or N]. k: torque of the viscous part at 1 rad/s or 1 m/s [N.m or N, per (rad/s)^n or (m/s)^n].
n: exponent; 1 is linear viscous friction, 1/2 the square root, 2/3 that of a lubricated rolling bearing (A. Palmgren,
Grundlagen der Waelzlagertechnik, 1964). A power law of harmonic drives: S. Wolf, M. Iskandar, ICRA 2018.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.elementary import pow
from backdrive.laws.base import Parameter, Rate
from backdrive.laws.rates.coulomb_viscous import HP3J


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: -F, F and k |v|^n sgn(v)."""
    F, k, n = p[1], p[2], p[3]
    speed = abs(v)
    if n == 0.5:
        growth = k * np.sqrt(speed)
    else:
        growth = k * pow(speed, n)
    return -F, F, -growth if v < 0.0 else growth


@dataclass(frozen=True, kw_only=True)
class Degressive(Rate):
    """Coulomb friction and a viscous part that flattens with speed.

    Attributes:
        coulomb: F [N.m or N].
        growth: k, torque of the viscous part at unit speed [N.m.(s/rad)^n or N.(s/m)^n].
        exponent: n [-].
    """

    NAME: ClassVar[str] = "degressive"
    KIND: ClassVar[int] = 7
    RESISTS: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "coulomb": Parameter(
            symbol="F",
            unit="force",
            lower=0.0,
            typical=6.85,
            source=HP3J,
            log=True,
            start=lambda d: d.coulomb,
        ),
        "growth": Parameter(
            symbol="k", unit="force.(s/length)^n", lower=0.0, start=lambda d: d.viscous * d.speed**0.5
        ),
        "exponent": Parameter(
            symbol="n",
            unit="1",
            lower=0.05,
            upper=1.0,
            typical=2.0 / 3.0,
            source="Palmgren 1964, lubricated rolling bearings",
            start=1.0,
        ),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(coulomb=4.0, growth=1.5, exponent=0.5)

    coulomb: float
    growth: float
    exponent: float = 0.5
