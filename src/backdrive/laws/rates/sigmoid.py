"""A sigmoid with offset, as identified on the Franka Emika Panda: Gaz et al. (IEEE RA-L 4(4), 2019).

    tau_f(v) = phi_1 / (1 + exp(-phi_2 (v + phi_3))) - phi_1 / (1 + exp(-phi_2 phi_3))

phi_1: span between the two directions [N.m or N]. phi_2: steepness [s/rad or s/m]. phi_3: offset that makes the directions
unequal [rad/s or m/s]. Friction is 0 at rest and rises smoothly: nothing holds a joint for good, and there is no Coulomb
torque for a presliding element to carry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array, Pair
from backdrive.elementary import tanh
from backdrive.laws.base import Parameter, Rate

GAZ = "Gaz et al., IEEE RA-L 4(4), 2019, joint 1"


@leaf
def limits(p: Array, v: float, load: Pair, temp: float):
    """Rate law: no set-valued part; the whole curve is in the last number."""
    phi_1, phi_2, phi_3 = p[1], p[2], p[3]
    # a/(1 + e^-x) - a/(1 + e^-y) = a/2 (tanh(x/2) - tanh(y/2)): no overflow
    return 0.0, 0.0, 0.5 * phi_1 * (tanh(0.5 * phi_2 * (v + phi_3)) - tanh(0.5 * phi_2 * phi_3))


@dataclass(frozen=True, kw_only=True)
class Sigmoid(Rate):
    """Smooth, asymmetric friction from one sigmoid.

    Attributes:
        span: phi_1, friction at high speed in both directions together [N.m or N].
        steepness: phi_2 [s/rad or s/m].
        shift: phi_3, velocity by which the curve is shifted [rad/s or m/s].
    """

    NAME: ClassVar[str] = "sigmoid"
    KIND: ClassVar[int] = 6
    SMOOTH: ClassVar[bool] = True
    SYMMETRIC: ClassVar[bool] = False
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "span": Parameter(
            symbol="phi_1",
            unit="force",
            lower=0.0,
            typical=0.54615,
            source=GAZ,
            log=True,
            start=lambda d: 2.0 * d.coulomb,
        ),
        "steepness": Parameter(
            symbol="phi_2",
            unit="s/length",
            lower=1e-6,
            upper=1e9,
            typical=5.1181,
            source=GAZ,
            log=True,
            start=lambda d: 3.0 / d.slow,
        ),
        "shift": Parameter(
            symbol="phi_3", unit="length/s", lower=-1e6, upper=1e6, typical=0.039533, source=GAZ
        ),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(span=9.0, steepness=30.0, shift=0.005)

    span: float  # pyright: ignore[reportIncompatibleMethodOverride]  (its name in files; no element calls a smooth law's span)
    steepness: float
    shift: float = 0.0
