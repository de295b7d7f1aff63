"""The Leuven model: hysteresis with memory of its reversals that changes smoothly into sliding.

    z' = v (1 - sgn(v F_h) |F_h/s(v)|^n),   tau_f = F_h(z) + sigma_1 z' + viscous(v)

F_h: hysteresis torque of the bristle z, here that of Maxwell-slip elements with the stiffness k_i [N.m/rad or N/m] and the share
w_i of the rate law's bound s(v) [-]. It remembers as many reversals as there are elements. n: how sharply sliding sets in [-].
sigma_1: damping of the bristle [N.m.s/rad or N.s/m]. The step is implicit in z. J. Swevers, F. Al-Bender, C. Ganseman, T.
Prajogo, IEEE TAC 45(4), 2000; with F_h/s and Maxwell-slip elements: V. Lampaert, J. Swevers, F. Al-Bender, IEEE TAC 47(4),
2002.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import jit, leaf
from backdrive._types import Array
from backdrive.elementary import pow
from backdrive.laws.base import Parameter
from backdrive.laws.elements.hayward_armstrong import clip_torque
from backdrive.laws.elements.maxwell_slip import MANY, Parallel

SECANTS, STEPS = 40, 100
FAR = 1e5  # limit of a torque against the motion, relative to the bound [-]
NOTHING = 1e-150  # of a bound [N.m or N]


@leaf
def pull_bristle(p: Array, e: int, x: Array, dz: float, lo: float, hi: float):
    """Hysteresis torque after the bristle has moved by dz; `x` stays as it is."""
    n = int(p[e])
    total = 0.0
    for i in range(n):
        w = p[e + 1 + n + i]
        total += clip_torque(x[i] + p[e + 1 + i] * dz, w * lo, w * hi)
    return total


@jit
def bristle_travel(p: Array, e: int, x: Array, way: float, path: float, lo: float, hi: float):
    """Travel of the bristle along the motion while the joint moves by path > 0: the root u of u = path (1 - ...)."""
    N = int(p[e])
    n = p[e + 1 + 2 * N]
    S = hi if way > 0.0 else -lo
    below = _sharp(way * pull_bristle(p, e, x, 0.0, lo, hi) / S, n) - 1.0
    if below >= 0.0:
        return 0.0
    low, high = 0.0, -below  # of u/path
    if high > 2.0:  # the torque opposes the motion beyond the bound: at most until the last element slips
        farthest = 0.0
        for i in range(N):
            farthest = max(farthest, (p[e + 1 + N + i] * S - way * x[i]) / p[e + 1 + i])
        high = min(high, 1.0 + farthest / path)
    below = max(below, -1.0)
    above = high - 1.0 + _sharp(way * pull_bristle(p, e, x, way * high * path, lo, hi) / S, n)
    u = 0.0
    side = 0
    for k in range(STEPS):  # regula falsi, half the residual at an end that stays (Illinois), then bisection
        u = high - above * (high - low) / (above - below) if k < SECANTS else 0.5 * (low + high)
        if not low < u < high:
            break
        value = u - 1.0 + _sharp(way * pull_bristle(p, e, x, way * u * path, lo, hi) / S, n)
        if value > 0.0:
            high, above = u, value
            if side > 0:
                below *= 0.5
            side = 1
        else:
            low, below = u, max(value, -1.0)
            if side < 0:
                above *= 0.5
            side = -1
        if not abs(value) > 1e-15:
            break
    return u * path


@leaf
def _sharp(r: float, n: float):
    """sgn(r) |r|^n; r far below -1 is cut, so that nothing overflows."""
    return pow(r, n) if r > 0.0 else -pow(min(-r, FAR), n)


@leaf
def step(p: Array, e: int, x: Array, y: Array, lo: float, hi: float, dp: float, dt: float):
    """Torque of one tick from the states x to y, the elements' torques."""
    n = int(p[e])
    sigma_1 = p[e + 2 + 2 * n]
    dz = dp
    total = 0.0
    if dp != 0.0 and (hi if dp > 0.0 else -lo) <= NOTHING:
        for i in range(n):
            y[i] = 0.0
        return total
    if dp > 0.0:
        dz = bristle_travel(p, e, x, 1.0, dp, lo, hi)
    elif dp < 0.0:
        dz = -bristle_travel(p, e, x, -1.0, -dp, lo, hi)
    for i in range(n):
        w = p[e + 1 + n + i]
        y[i] = clip_torque(x[i] + p[e + 1 + i] * dz, w * lo, w * hi)
        total += y[i]
    return total + sigma_1 * (dz / dt)


@dataclass(frozen=True, kw_only=True)
class Leuven(Parallel):
    """Maxwell-slip hysteresis behind a bristle.

    Attributes:
        stiffness: k_i [N.m/rad or N/m], (N,).
        share: w_i of the bound of the rate law [-], (N,).
        sharpness: n, how sharply sliding sets in [-].
        damping: sigma_1 [N.m.s/rad or N.s/m].
    """

    NAME: ClassVar[str] = "leuven"
    KIND: ClassVar[int] = 11
    DRIFTS: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = MANY | {
        "sharpness": Parameter(symbol="n", unit="1", lower=0.5, upper=50.0, typical=2.0, start=2.0),
        "damping": Parameter(
            symbol="sigma_1",
            unit="force.s/length",
            lower=0.0,
            log=True,
            start=lambda d: 0.2 * d.stiffness * d.lag,
        ),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(**Parallel.EXAMPLE, sharpness=2.0, damping=5.0)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "Presliding remembers as many reversals as there are elements.",
        "Vibration below break-away drifts.",
        "No motion from rest gets work out of it.",
    )

    sharpness: float = 2.0
    damping: float = 0.0

    def states(self) -> int:
        """Return N: the elements' torques."""
        return len(self.stiffness)
