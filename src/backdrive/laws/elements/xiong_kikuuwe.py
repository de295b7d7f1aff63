"""Damped springs in series with Coulomb sliders as differential equations: one or several side by side, under lagging bounds.

    f_i = clip(K_i a_i + B_i v, -w_i g_n, w_i g_p),   a_i' = (f_i - K_i a_i)/B_i,   tau_f = sum f_i + viscous(v)
    t_d g' = s(v) - g     (g = s(v) where t_d = 0),   sum w_i = 1

K_i: stiffness [N.m/rad or N/m], B_i: damping [N.m.s/rad or N.s/m], a_i: stretch, w_i: share of the bound s(v) of the rate law. t_d:
time by which the bound lags behind the velocity [s]. The step of each is that of `visco-elastoplastic`: as an ordinary differential
equation (B > 0) that model is the one of X. Xiong, R. Kikuuwe, M. Yamamoto, J. Applied Mathematics 2013, 320276. The backward Euler
steps of both are identical to the last bit. Several elements with lag form their multistate model, Tribology Letters 51(3), 2013.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.laws.base import Element, Parameter
from backdrive.laws.elements.dahl import STIFFNESS
from backdrive.laws.elements.maxwell_slip import MANY, Parallel
from backdrive.laws.elements.visco_elastoplastic import DAMPING, ROBOT, ViscoElastoplastic, section


@leaf
def step(p: Array, e: int, x: Array, y: Array, lo: float, hi: float, dp: float, dt: float):
    """Torque of one tick from the states x to y: the spring torques K_i a_i, the lagging bounds (0 before the first tick)."""
    n = int(p[e])
    beta, lag = p[e + 1 + 2 * n], p[e + 2 + 2 * n]
    upper, lower = x[n], x[n + 1]
    if lag > 0.0:
        if upper == 0.0 and lower == 0.0:
            upper, lower = hi, lo
        a = dt / (lag + dt)
        upper += a * (hi - upper)
        lower += a * (lo - lower)
        hi, lo = upper, lower
    y[n], y[n + 1] = upper, lower
    total = 0.0
    for i in range(n):
        y[i], f = section(x[i], p[e + 1 + i], p[e + 1 + n + i], beta, lo, hi, dp, dt)
        total += f
    return total


@dataclass(frozen=True, kw_only=True)
class XiongKikuuwe(Element):
    """A damped spring in series with a Coulomb slider, as an ordinary differential equation.

    Attributes:
        stiffness: K [N.m/rad or N/m].
        damping: B > 0 [N.m.s/rad or N.s/m].
        lag: t_d, time by which the bound lags behind the velocity [s].
    """

    NAME: ClassVar[str] = "xiong-kikuuwe"
    KIND: ClassVar[int] = 14
    STATE_ROW: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "stiffness": STIFFNESS,
        "damping": replace(DAMPING, lower=1e-12),
        "lag": Parameter(symbol="t_d", unit="s", lower=0.0, upper=10.0, typical=0.003, start=0.003),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(**ViscoElastoplastic.EXAMPLE, lag=0.003)

    stiffness: float
    damping: float = 1.0
    lag: float = 0.0

    def states(self) -> int:
        """Return 3: the spring's torque and the two bounds."""
        return 3

    def row(self) -> np.ndarray:
        """Return [1, K, 1, B/K, t_d]."""
        return np.array([1.0, self.stiffness, 1.0, self.damping / self.stiffness, self.lag])


@dataclass(frozen=True, kw_only=True)
class XiongKikuuweMulti(Parallel):
    """Damped springs in series with Coulomb sliders, side by side, under bounds that lag.

    Attributes:
        stiffness: K_i [N.m/rad or N/m], (N,).
        share: w_i of the bound of the rate law [-], (N,).
        damping_time: B_i/K_i, the same of every element [s].
        lag: t_d, time by which the bound lags behind the velocity [s].
    """

    NAME: ClassVar[str] = "xiong-kikuuwe-multi"
    KIND: ClassVar[int] = 14
    PARAMETERS: ClassVar[dict[str, Parameter]] = MANY | {
        "damping_time": Parameter(
            symbol="B/K", unit="s", lower=0.0, upper=10.0, typical=0.01, source=ROBOT, log=True, start=0.002
        ),
        "lag": Parameter(symbol="t_d", unit="s", lower=0.0, upper=10.0, typical=0.003, start=0.003),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(**Parallel.EXAMPLE, damping_time=0.002, lag=0.003)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "Vibration below break-away does not drift.",
        "The torque lags behind the velocity in sliding.",
        "No motion from rest gets work out of it.",
    )

    damping_time: float = 0.0
    lag: float = 0.0

    def states(self) -> int:
        """Return N + 2: the springs' torques and the two bounds."""
        return len(self.stiffness) + 2
