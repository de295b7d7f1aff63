"""The Leuven model: hysteresis with memory of its reversals that changes smoothly into sliding.

    z' = v (1 - sgn(v F_h) |F_h/s(v)|^n),   tau_f = F_h(z) + sigma_1 z' + viscous(v)

F_h: hysteresis torque of the bristle z, here Maxwell-slip elements (stiffness k_i [N.m/rad or N/m], share w_i of the bound
s(v) of the rate law), so that its memory of reversals is as long as there are elements. n: how sharply sliding sets in [-].
sigma_1: damping of the bristle [N.m.s/rad or N.s/m]. The step is implicit in z. J. Swevers, F. Al-Bender, C. Ganseman, T.
Prajogo, IEEE TAC 45(4), 2000; with F_h/s and Maxwell-slip elements: V. Lampaert, J. Swevers, F. Al-Bender, IEEE TAC 47(4),
2002.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from backdrive._jit import jit, leaf
from backdrive.laws.base import Parameter
from backdrive.laws.elements.hayward_armstrong import clipped
from backdrive.laws.elements.maxwell_slip import MANY, Parallel

STEPS = 60


@leaf
def pulled(p, e, x, dz, lo, hi):
    """Hysteresis torque after the bristle has moved by dz; `x` stays as it is."""
    n = int(p[e])
    total = 0.0
    for i in range(n):
        w = p[e + 1 + n + i]
        total += clipped(x[i] + p[e + 1 + i] * dz, w * lo, w * hi)
    return total


@jit
def moved(p, e, x, way, path, lo, hi):
    """How far the bristle moves, along the motion, while the joint moves by path > 0: the root u of u = path (1 - ...)."""
    n = p[e + 1 + 2 * int(p[e])]
    S = hi if way > 0.0 else -lo
    low, high = 0.0, 2.0  # of u/path
    below = (way * pulled(p, e, x, 0.0, lo, hi)) / S
    below = _sharp(below, n) - 1.0
    if below >= 0.0:
        return 0.0
    above = 1.0 + _sharp(way * pulled(p, e, x, way * 2.0 * path, lo, hi) / S, n)
    u = 0.0
    side = 0
    for _ in range(STEPS):  # regula falsi, a side that stays halved (Illinois)
        u = high - above * (high - low) / (above - below)
        if not low < u < high:
            break
        value = u - 1.0 + _sharp(way * pulled(p, e, x, way * u * path, lo, hi) / S, n)
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
    return u * path


@leaf
def _sharp(r, n):
    """sgn(r) |r|^n."""
    return r**n if r > 0.0 else -((-r) ** n)


@leaf
def step(p, e, x, lo, hi, dp, dt):
    """Torque of one tick; the states are the elements' torques."""
    n = int(p[e])
    sigma_1 = p[e + 2 + 2 * n]
    dz = dp
    if dp > 0.0:
        dz = moved(p, e, x, 1.0, dp, lo, hi) if hi > 0.0 else 0.0
    elif dp < 0.0:
        dz = -moved(p, e, x, -1.0, -dp, lo, hi) if lo < 0.0 else 0.0
    total = 0.0
    for i in range(n):
        w = p[e + 1 + n + i]
        x[i] = clipped(x[i] + p[e + 1 + i] * dz, w * lo, w * hi)
        total += x[i]
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
        "sharpness": Parameter(symbol="n", unit="1", lower=0.5, upper=50.0, typical=2.0),
        "damping": Parameter(symbol="sigma_1", unit="force.s/length", lower=0.0, log=True),
    }
    CLAIMS: ClassVar[tuple[str, ...]] = ("Presliding remembers as many reversals as there are elements.",)

    sharpness: float = 2.0
    damping: float = 0.0

    def states(self) -> int:
        """Return N: the elements' torques."""
        return len(self.stiffness)
