"""Hayward and Armstrong's elastoplastic contact: a spring in series with a Coulomb slider; Iwatani 2017, (3.3), (3.11).

    tau_f = K (p - q) + viscous(q'),   K (p - q) in gsgn(-F_n, q', F_p)

p: position of the joint, q: of the slider. K: stiffness [N.m/rad or N/m]. F_p, F_n: bounds of the rate law. The backward
Euler step is a clip: f = clip(f + K dp, -F_n, F_p). There is neither drift nor leakage: a joint at rest keeps its torque. The
viscous part uses the slider's motion, limited to the joint's, because falling bounds may move the slider further. V. Hayward,
B. Armstrong, in Experimental Robotics VI, Springer, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.laws.base import Element, Parameter
from backdrive.laws.elements.dahl import STIFFNESS


@leaf
def clip_torque(f: float, lo: float, hi: float):
    """Return f within [lo, hi]; a NaN stays a NaN."""
    f = hi if f > hi else f
    return lo if f < lo else f


@leaf
def between(slid: float, dp: float):
    """Slider's motion, limited to the range from 0 to the joint's motion, which it leaves if bounds fall; a NaN stays a NaN."""
    if slid * dp < 0.0:
        return 0.0
    if abs(slid) > abs(dp):
        return dp
    return slid


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """State, torque and slider's motion after one tick; the state is K (p - q)."""
    K = p[e]
    trial = z + K * dp
    after = clip_torque(trial, lo, hi)
    slid = 0.0 if after == trial else between(dp - (after - z) / K, dp)
    return after, after, slid


@dataclass(frozen=True, kw_only=True)
class HaywardArmstrong(Element):
    """A spring in series with a Coulomb slider.

    Attributes:
        stiffness: K [N.m/rad or N/m].
    """

    NAME: ClassVar[str] = "hayward-armstrong"
    KIND: ClassVar[int] = 7
    SLIDER: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = {"stiffness": STIFFNESS}
    EXAMPLE: ClassVar[dict[str, Any]] = dict(stiffness=1e4)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "Vibration below break-away does not drift.",
        "No motion from rest gets work out of it, unless the viscous part falls with speed.",
    )

    stiffness: float

    def states(self) -> int:
        """Return 1: the spring's torque."""
        return 1
