"""The thesis' decaying elastoplastic friction: the spring of Hayward and Armstrong lets go at a rate alpha.

    K (p - q) in gsgn(-F_n, q' - alpha (p - q), F_p),   tau_f = K (p - q) + viscous(q')

p: position of the joint, q: of the slider. K: stiffness [N.m/rad or N/m]. alpha: decay rate [1/s]. The backward Euler step is
a leaky clip: f = clip((f + K dp)/(1 + alpha dt), -F_n, F_p), Iwatani 2017, (3.12)-(3.21). At rest the torque fades with the time
constant 1/alpha. At a constant velocity it is min(F, K v/alpha), so below the velocity alpha F/K it acts as viscous friction.
With alpha = 0 the law is (3.11). The viscous part uses the slider's velocity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.laws.base import Element, Parameter, Rate
from backdrive.laws.elements.dahl import STIFFNESS
from backdrive.laws.elements.hayward_armstrong import between


@leaf
def step(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """State, torque and slider's motion after one tick; the state is K (p - q)."""
    K, alpha = p[e], p[e + 1]
    left, yielding = 1.0 / (1.0 + alpha * dt), 1.0 / K  # in a loop over ticks both divisions are done once
    trial = (z + K * dp) * left
    if trial > hi and not hi < lo:  # branches can be predicted, so a tick need not wait for the last
        after, slid = hi, between(dp - (hi - z) * yielding, dp)
    elif trial < lo or trial > hi:
        after, slid = lo, dp - (lo - z) * yielding
        slid = slid if trial == lo else between(slid, dp)
    else:
        after, slid = trial, alpha * dt * yielding * trial
    return after, after, slid


@dataclass(frozen=True, kw_only=True)
class Decaying(Element):
    """A spring that leaks in series with a Coulomb slider.

    Attributes:
        stiffness: K [N.m/rad or N/m].
        decay_rate: alpha [1/s].
    """

    NAME: ClassVar[str] = "decaying"
    KIND: ClassVar[int] = 9
    SLIDER: ClassVar[bool] = True
    DRIFTS: ClassVar[bool] = True
    STEADY: ClassVar[bool] = False
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "stiffness": STIFFNESS,
        "decay_rate": Parameter(
            symbol="alpha",
            unit="1/s",
            lower=0.0,
            upper=1e6,
            typical=20.0,
            source="Iwatani 2017, Sec. 3.5.1",
            log=True,
            start=2.0,
        ),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(stiffness=1e4, decay_rate=20.0)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "At a constant velocity the torque is min(F, K v/alpha).",
        "At rest the torque fades, and under a bias the joint creeps.",
        "No motion from rest gets work out of it, unless the viscous part falls with speed.",
    )

    stiffness: float
    decay_rate: float = 20.0

    def states(self) -> int:
        """Return 1: the spring's torque."""
        return 1

    def advice(self, rate: Rate, load: tuple[float, float] = (0.0, 0.0), temperature: float = 20.0) -> str:
        """Return a warning if friction would drive the joint at low speed; otherwise an empty string.

        There the viscous part may be negative, while the spring carries little because it leaks.
        """
        for way, curve in rate.curves(load, temperature).items():
            for speed, bound, viscous in curve:
                held = (
                    min(bound, self.stiffness * speed / self.decay_rate) if self.decay_rate > 0.0 else bound
                )
                if held + viscous < 0.0:
                    return (
                        f"'{self.NAME}' carries {held:g} at the velocity {way * speed:g}, where the falling curve subtracts "
                        f"{-viscous:g}: friction drives the joint. Lower decay_rate or raise stiffness."
                    )
        return ""
