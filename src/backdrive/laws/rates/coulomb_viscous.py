"""Coulomb and viscous friction.

    tau_f in gsgn(-F_n, v, F_p) + (sigma_p v for v > 0, sigma_n v for v < 0)

F_p, F_n: Coulomb torque in the positive and negative direction [N.m or N]. sigma_p, sigma_n: viscous coefficients
[N.m.s/rad or N.s/m]. gsgn is Iwatani 2017, (3.2). `coulomb-viscous` has separate parameters for each direction. `coulomb`
has one parameter: the Coulomb torque in both directions, without viscous friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.laws.base import Parameter, Rate

HP3J = "Iwatani 2017, Sec. 3.5.2: joint 0 of a 6-joint arm with harmonic drives"
EROB = "Rhoban BAM, identified eRob80:100 with a 100:1 harmonic drive, M1"


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: lower and upper Coulomb bound and the viscous part at velocity v."""
    F_p, F_n, sigma_p, sigma_n = p[1], p[2], p[3], p[4]
    viscous = sigma_n * v if v < 0.0 else sigma_p * v
    return -F_n, F_p, viscous


@dataclass(frozen=True, kw_only=True)
class Coulomb(Rate):
    """Coulomb friction: one torque against every motion.

    Attributes:
        coulomb: Coulomb torque F [N.m or N].
    """

    NAME: ClassVar[str] = "coulomb"
    KIND: ClassVar[int] = 0
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
        )
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(coulomb=5.0)

    coulomb: float

    def row(self) -> np.ndarray:
        """Return [F, F, 0, 0]."""
        return np.array([self.coulomb, self.coulomb, 0.0, 0.0])


@dataclass(frozen=True, kw_only=True)
class CoulombViscous(Rate):
    """Coulomb and viscous friction, by direction.

    Attributes:
        coulomb_positive: Coulomb torque for motion along +q [N.m or N].
        coulomb_negative: its magnitude for motion along -q [N.m or N].
        viscous_positive: viscous coefficient for motion along +q [N.m.s/rad or N.s/m].
        viscous_negative: the same along -q [N.m.s/rad or N.s/m].
    """

    NAME: ClassVar[str] = "coulomb-viscous"
    WORDS: ClassVar[str] = "Coulomb and viscous, by direction"
    KIND: ClassVar[int] = 0
    RESISTS: ClassVar[bool] = True
    SYMMETRIC: ClassVar[bool] = False
    TIES: ClassVar[dict[str, str]] = {"coulomb_negative": "coulomb_positive"}
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "coulomb_positive": Parameter(
            symbol="F_p",
            unit="force",
            lower=0.0,
            typical=6.85,
            source=HP3J,
            log=True,
            start=lambda d: d.coulomb,
        ),
        "coulomb_negative": Parameter(
            symbol="F_n",
            unit="force",
            lower=0.0,
            typical=6.85,
            source=HP3J,
            log=True,
            start=lambda d: d.coulomb,
        ),
        "viscous_positive": Parameter(
            symbol="sigma_p",
            unit="force.s/length",
            lower=0.0,
            typical=8.39,
            source=EROB,
            start=lambda d: d.viscous,
        ),
        "viscous_negative": Parameter(
            symbol="sigma_n",
            unit="force.s/length",
            lower=0.0,
            typical=8.39,
            source=EROB,
            start=lambda d: d.viscous,
        ),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(
        coulomb_positive=5.0, coulomb_negative=4.0, viscous_positive=1.0, viscous_negative=2.0
    )

    coulomb_positive: float
    coulomb_negative: float
    viscous_positive: float = 0.0
    viscous_negative: float = 0.0
