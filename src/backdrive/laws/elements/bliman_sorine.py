"""Bliman and Sorine's second-order model: two Dahl bristles of opposite sign, so that break-away overshoots.

    x_1' = (F v - |v| x_1)/(eta e),   x_2' = (F v - |v| x_2)/e
    tau_f = (1 + b) x_1 - b x_2 + viscous(v)

e: distance over which the slow bristle yields [rad or m]. eta < 1: distance of the fast bristle, relative to e [-]. b: overshoot,
the weight of the slow bristle [-]. F: bound of the rate law in the direction of motion. The paper's symbols are
F_1 = (1 + b) F and F_2 = b F. Break-away from rest peaks at F (1 + b (1 - eta) r^(-eta/(1 - eta))), r = (1 + b)/(eta b),
after a distance e eta/(1 - eta) ln r; after a reversal in sliding it overshoots by twice as much. Rate independent: only the
path counts. One step is exact for a constant velocity. P.-A. Bliman, M. Sorine, Proc. 3rd European Control Conference, Rome,
1995.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from backdrive._jit import leaf
from backdrive._types import Array
from backdrive.elementary import decay
from backdrive.laws.base import Element, Parameter, Rate


@leaf
def step(p: Array, e: int, x: Array, y: Array, lo: float, hi: float, dp: float, dt: float):
    """Torque of one tick from the states x to y: the two bristles as torques, which approach the rate law's bound."""
    distance, ratio, overshoot = p[e], p[e + 1], p[e + 2]
    fast, slow = x[0], x[1]
    if dp != 0.0:
        bound = hi if dp > 0.0 else lo
        path = abs(dp) / distance
        fast = bound + (fast - bound) * decay(-path / ratio)
        slow = bound + (slow - bound) * decay(-path)
    y[0], y[1] = fast, slow
    return (1.0 + overshoot) * fast - overshoot * slow


@dataclass(frozen=True, kw_only=True)
class BlimanSorine(Element):
    """Two bristles in difference.

    Attributes:
        distance: e, over which the slow bristle yields [rad or m].
        ratio: eta, distance of the fast bristle relative to that of the slow one [-].
        overshoot: b, weight of the slow bristle [-].
    """

    NAME: ClassVar[str] = "bliman-sorine"
    KIND: ClassVar[int] = 3
    STATE_ROW: ClassVar[bool] = True
    DRIFTS: ClassVar[bool] = True
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "distance": Parameter(
            symbol="e", unit="length", lower=1e-12, upper=1e3, log=True, start=lambda d: 3.0 * d.length
        ),
        "ratio": Parameter(symbol="eta", unit="1", lower=1e-3, upper=0.999, start=0.4),
        "overshoot": Parameter(symbol="b", unit="1", lower=0.0, upper=10.0, start=0.3),
    }
    EXAMPLE: ClassVar[dict[str, Any]] = dict(distance=1e-3, ratio=0.3, overshoot=0.5)
    CLAIMS: ClassVar[tuple[str, ...]] = (
        "The torque depends on the path alone, not on the speed at which it is run through.",
        "Break-away exceeds the Coulomb torque by a peak that depends on no velocity.",
        "Vibration below break-away drifts.",
        "No closed cycle gets work out of it, under bounds that do not change with speed.",
    )

    distance: float
    ratio: float = 0.5
    overshoot: float = 0.5

    def states(self) -> int:
        """Return 2: the two bristles."""
        return 2

    def advice(self, rate: Rate, load: tuple[float, float] = (0.0, 0.0), temperature: float = 20.0) -> str:
        """Return a warning if the bounds change with speed, which may create energy; otherwise an empty string."""
        if all(
            strongest <= weakest * (1.0 + 1e-12) for weakest, strongest, _ in rate.span(load, temperature)
        ):
            return ""
        return (
            f"'{self.NAME}' has its own break-away: under a rate law that changes with speed it may create energy; "
            "use a Coulomb rate law with it."
        )
