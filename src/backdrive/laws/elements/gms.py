"""The generalised Maxwell-slip model: Maxwell-slip elements that, once slipping, follow the rate law with a lag.

    stick: f_i' = k_i v, until |f_i| reaches w_i s(v);   slip: f_i' = C (w_i sgn(v) - f_i/s(v)), until v changes sign
    tau_f = sum f_i + viscous(v),   sum w_i = 1

k_i: stiffness of element i [N.m/rad or N/m]. w_i: its share [-]. C: attraction, how fast slipping elements follow the rate law
[N.m/s or N/s]. s(v): bound of the rate law in the direction of motion. F. Al-Bender, V. Lampaert, J. Swevers, IEEE TAC
50(11), 2005.

In slow slipping, the torque of an element can grow almost without motion. If s falls with speed, the model can therefore
create energy: fast loading, slow slipping and unloading gain (s(0) - s(v))^2 w_i^2/(2 k_i). The step is implicit in the
slipping torque, and of first order, since slipping begins at the end of a tick. With sines of 0.5 to 2 Hz, C of 20 to
400 N.m/s and ticks of 1 ms, its error is 0.04 to 0.2 % of the torque's root mean square. Two substeps reduce this error by a
factor of 1.5 to 3.5, five by 4 to 13, and ten by 7 to 23.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.laws.base import Parameter, Rate
from backdrive.laws.elements.maxwell_slip import MANY, MOST, Parallel

ATTRACTION = Parameter(
    symbol="C", unit="force/s", lower=1e-9, typical=100.0, log=True, start=lambda d: 20.0 * d.coulomb
)


@leaf
def section(
    f: float,
    regime: float,
    way: float,
    k: float,
    w: float,
    s: float,
    C: float,
    lag: float,
    dp: float,
    dt: float,
):
    """Torque and regime of one element after a tick dp != 0 along `way` under the bound s; lag = 1 + dt C/|s|."""
    slipped = (f + dt * way * C * w) / lag
    stuck = f + k * dp
    bound = w * s
    gives = (stuck - bound) * way >= 0.0
    slips = regime == way
    after = slipped if slips else (bound if gives else stuck)
    return after, way if slips or gives else 0.0


@leaf
def step(p: Array, e: int, x: Array, y: Array, lo: float, hi: float, dp: float, dt: float):
    """Torque of one tick from the states x to y: the elements' torques, then their regimes, +1, -1 slipping, 0 sticking."""
    n = int(p[e])
    if e < 0 or n < 0 or n > MOST:  # tells the compiler that no index is negative
        return np.nan
    C = p[e + 1 + 2 * n]
    s = hi if dp >= 0.0 else lo
    way = 1.0 if dp > 0.0 else -1.0
    total = 0.0
    if dp == 0.0:
        for i in range(2 * n):
            y[i] = x[i]
    else:
        lag = 1.0 + dt * C / abs(s) if s != 0.0 else np.inf
        for i in range(n):
            y[i], y[n + i] = section(x[i], x[n + i], way, p[e + 1 + i], p[e + 1 + n + i], s, C, lag, dp, dt)
    for i in range(n):
        total += y[i]
    return total


@dataclass(frozen=True, kw_only=True)
class GMS(Parallel):
    """Maxwell-slip elements with frictional lag.

    Attributes:
        stiffness: k_i [N.m/rad or N/m], (N,).
        share: w_i of the bound of the rate law [-], (N,).
        attraction: C [N.m/s or N/s].
    """

    NAME: ClassVar[str] = "gms"
    KIND: ClassVar[int] = 12
    PARAMETERS: ClassVar[dict[str, Parameter]] = MANY | {"attraction": ATTRACTION}
    EXAMPLE: ClassVar[dict[str, Any]] = dict(**Parallel.EXAMPLE, attraction=100.0)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "Vibration below break-away does not drift.",
        "The torque lags behind the velocity in sliding.",
        "No motion from rest gets work out of it, under bounds that do not change with speed.",
    )

    attraction: float

    def states(self) -> int:
        """Return 2 N: the elements' torques and regimes."""
        return 2 * len(self.stiffness)

    def advice(self, rate: Rate, load: tuple[float, float] = (0.0, 0.0), temperature: float = 20.0) -> str:
        """Return a warning if the bounds change with speed, which may create energy; otherwise an empty string."""
        if all(
            strongest <= weakest * (1.0 + 1e-12) for weakest, strongest, _ in rate.span(load, temperature)
        ):
            return ""
        return (
            f"'{self.NAME}' lets torque grow in slow slipping without motion: under a rate law that changes with speed it may "
            "create a little energy; 'smoothed-maxwell-slip' and 'maxwell-slip' do not."
        )
