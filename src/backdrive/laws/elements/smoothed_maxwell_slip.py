"""A smoothed Maxwell-slip model: its elements change from sticking to slipping without a kink.

    f_i' = k_i v (1 - h(r_i) r_i),   r_i = sgn(v) f_i/(w_i s(v)),   tau_f = sum f_i + viscous(v),   sum w_i = 1
    h(r) = m(r) g(r)/(m(1) g(1)),   m(r) = 1 - tanh(l (r + b))/2 + tanh(l (r - b))/2,   g(r) = (1 + tanh(c r))/2

k_i: stiffness of element i [N.m/rad or N/m]. w_i: its share of the rate law's bound s(v) [-]. m: 0 while the element holds
(|r| < b), 1 while it slips; l: sharpness of this change [-]. g: 0 after a reversal, 1 during loading; c: sharpness of this
change [-]. A slipping element follows its bound at once. There is no attraction C, and hence no frictional lag as in GMS. The
step is implicit in f_i. Under a constant bound the torque depends on the path only.

The idea of one smooth equation is that of the S-GMS, which has the lag: M. Boegli, T. De Laet, J. De Schutter, J. Swevers,
IEEE/ASME T-Mech. 19(5), 2014. The functions m and g come from the open Fortran library `friction` of J. Christopherson. Here
g contains sgn(v), and h is divided by its value at 1. So the steady torque equals the rate law at every speed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from backdrive._jit import jit, leaf
from backdrive._types import Array
from backdrive.elementary import tanh
from backdrive.laws.base import Parameter
from backdrive.laws.elements.maxwell_slip import MANY, Parallel

SECANTS, STEPS = 40, 100
NOTHING = 1e-150  # of a bound [N.m or N]
FAR = 1e16  # times a bound: a pull after which the element slips


@leaf
def gate(r: float, sharp: float, margin: float, reversal: float):
    """m(r) g(r), not yet normalised."""
    held = 1.0 - 0.5 * tanh(sharp * (r + margin)) + 0.5 * tanh(sharp * (r - margin))
    return held * (0.5 + 0.5 * tanh(reversal * r))


@jit
def load_element(r: float, path: float, full: float, sharp: float, margin: float, reversal: float):
    """Torque u of an element after a path from the torque r: u = r + path (1 - h(u) u), in units of its break-away."""
    if r >= 1.0:
        low, high = 1.0, r
    else:
        low, high = r, min(r + path, 1.0)
    if low == high:
        return low
    inverse = 1.0 / (1.0 + path)
    below = ((low - r) - path * (1.0 - gate(low, sharp, margin, reversal) / full * low)) * inverse
    above = ((high - r) - path * (1.0 - gate(high, sharp, margin, reversal) / full * high)) * inverse
    if below >= 0.0:
        return low
    if above < 0.0:  # an element that yields after opposite loading moves further than its spring alone
        high, above = 1.0, (1.0 - r) * inverse
    if above == 0.0:
        return high
    u = low
    side = 0
    for k in range(STEPS):  # regula falsi, half the residual at an end that stays (Illinois), then bisection
        u = high - above * (high - low) / (above - below) if k < SECANTS else 0.5 * (low + high)
        if not low < u < high:
            break
        value = ((u - r) - path * (1.0 - gate(u, sharp, margin, reversal) / full * u)) * inverse
        if value > 0.0:
            high, above = u, value
            if side > 0:
                below *= 0.5
            side = 1
        else:
            low, below = u, value
            if side < 0:
                above *= 0.5
            side = -1
        if not abs(value) > 1e-15:
            break
    return u


@leaf
def step(p: Array, e: int, x: Array, y: Array, lo: float, hi: float, dp: float, dt: float):
    """Torque of one tick from the states x to y, the elements' torques."""
    n = int(p[e])
    sharp, margin, reversal = p[e + 1 + 2 * n], p[e + 2 + 2 * n], p[e + 3 + 2 * n]
    s = hi if dp > 0.0 else lo
    total = 0.0
    if dp == 0.0:
        for i in range(n):
            y[i] = x[i]
    else:
        full = gate(1.0, sharp, margin, reversal)
        for i in range(n):
            bound = p[e + 1 + n + i] * s
            pull = p[e + 1 + i] * dp
            if abs(bound) <= NOTHING:
                y[i] = 0.0
            elif abs(pull) > FAR * abs(bound):
                y[i] = bound
            else:
                y[i] = bound * load_element(x[i] / bound, pull / bound, full, sharp, margin, reversal)
    for i in range(n):
        total += y[i]
    return total


@dataclass(frozen=True, kw_only=True)
class SmoothedMaxwellSlip(Parallel):
    """Maxwell-slip elements that begin to slip smoothly.

    Attributes:
        stiffness: k_i [N.m/rad or N/m], (N,).
        share: w_i of the bound of the rate law [-], (N,).
        sharpness: l, of the change from sticking to slipping [-].
        margin: b, share of an element's bound at which it begins to slip [-].
        reversal: c, sharpness of the return to sticking after a reversal [-].
    """

    NAME: ClassVar[str] = "smoothed-maxwell-slip"
    KIND: ClassVar[int] = 13
    PARAMETERS: ClassVar[dict[str, Parameter]] = MANY | {
        "sharpness": Parameter(
            symbol="l",
            unit="1",
            lower=1.0,
            upper=1e4,
            typical=100.0,
            source="`friction` library, GMS example",
            start=100.0,
        ),
        "margin": Parameter(
            symbol="b",
            unit="1",
            lower=0.1,
            upper=0.999,
            typical=0.95,
            source="`friction` library, GMS example",
            start=0.9,
        ),
        "reversal": Parameter(
            symbol="c",
            unit="1",
            lower=1.0,
            upper=1e4,
            typical=10.0,
            source="`friction` library, GMS example",
            start=10.0,
        ),
    }
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "The torque has a derivative with respect to every parameter.",
        "Vibration below break-away drifts by no more than the share of slip at its peak.",
        "No motion from rest gets work out of it.",
    )

    sharpness: float = 100.0
    margin: float = 0.95
    reversal: float = 10.0

    def states(self) -> int:
        """Return N: the elements' torques."""
        return len(self.stiffness)
