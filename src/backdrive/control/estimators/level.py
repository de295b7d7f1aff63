"""Online adaptation of the level of a friction law: the shape of its curve is known, and its level drifts with temperature
and wear.

    tau_hat = theta f,   theta <- P(theta + g f e_d / (f_0^2 + f^2))   where |f| >= f_0
    e = tau - theta f,   e_d = e - clip(e, -d, d),   g = dt/(T + dt)

f: torque of the law at theta = 1, whose state does not depend on theta. f_0: floor, below which nothing is learned. d:
bound of the torque that the law cannot explain. T: time constant. P: clip to [theta_lo, theta_hi]. This is the projected normalised
gradient with a dead zone (G. C. Goodwin, K. S. Sin, Adaptive Filtering, Prediction and Control, 1984, Ch. 3; P. A. Ioannou,
J. Sun, Robust Adaptive Control, 1996, Ch. 4 and 8).

The error of theta never grows. Let tau = theta* f + n with |n| <= d and theta* within the bounds, and h = theta - theta*, so
that e = n - h f. If |e| <= d, theta does not change. Otherwise |h f| >= |e| - d = |e_d| > 0, and e_d has the sign of -h f. If h f
had the sign of e, |n| = |e| + |h f| would exceed d. So e_d = -k h f with 0 < k <= 1, and before the clip

    h <- (1 - g k f^2/(f_0^2 + f^2)) h,   the factor within (0, 1] since 0 < g < 1.

Clipping to an interval that contains theta* does not increase |h|. Hence V = h^2 never increases, whatever the motion.
Without noise (d = 0), each tick with |f| >= f_0 multiplies |h| by 1 - g/2 or less. After such ticks for 2 (T + dt), |h| has
fallen to 1/e. With noise and a drift theta*', |h+| <= |h| - g/2 max(|h| - 2 d/f_0, 0) + |theta*'| dt while |f| >= f_0. In the
limit, |h| is at most 2 d/f_0 + 2 (T + dt) |theta*'|.

A small force of a hand cannot be separated from friction. The loop therefore learns only after the joint has slid for longer
than the lag of the force estimate. It also ignores an error that no level within the bounds explains,
|e| > (theta_hi - theta_lo) |f| + d, since that is an external push. The bounds limit the effect of a light hand;
`drift.passive_level` returns the upper bound that keeps the joint passive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive.errors import InvalidInput
from backdrive.laws import Law
from backdrive.parameters import NOT_NEGATIVE, POSITIVE, WithBounds

TIE = 5e-7  # relative difference from `slowest` within which a speed is taken as equal to it [-]


@leaf
def learn(theta, f, force, slid, dt, time, settle, floor, dead_zone, lower, upper):  # noqa: PLR0913  (a kernel's row)
    """Return the level after one tick, from the estimated external force: e = -force. `slid`: time for which the joint slides."""
    if not slid >= settle or not abs(force) <= (upper - lower) * abs(f) + dead_zone:
        return theta
    return adapt(theta, f, theta * f - force, dt, time, floor, dead_zone, lower, upper)


@leaf
def adapt(theta, f, tau, dt, time, floor, dead_zone, lower, upper):
    """Return the level after one sample."""
    if not abs(f) >= floor:
        return theta
    e = tau - theta * f
    if abs(e) <= dead_zone:
        return theta
    e -= np.copysign(dead_zone, e)
    r = floor / f
    theta += dt / (time + dt) * (e / f) / (1.0 + r * r)
    return min(max(theta, lower), upper)


@dataclass(frozen=True, kw_only=True)
class Adaptation(WithBounds):
    """Settings for learning the level of a joint's friction in the loop, from the external force estimated in free motion.

    Attributes:
        slowest: speed below which the joint does not slide, some encoder counts per tick [rad/s or m/s].
        settle: time for which it has to slide before the level is learned, some lags of the force estimate [s].
        time: T, time constant [s].
        floor: f_0, smallest friction at which the level is learned [N.m or N]; None: half the law's Coulomb torque.
        dead_zone: d, error that is attributed to noise [N.m or N]; None: a twentieth of the Coulomb torque.
        lower: smallest level [-].
        upper: largest level [-]; above 1 the compensation may exceed the identified friction.
        start: level at the start [-].
    """

    BOUNDS: ClassVar = {
        "slowest": POSITIVE,
        "settle": POSITIVE,
        "time": POSITIVE,
        "floor": POSITIVE,
        "dead_zone": NOT_NEGATIVE,
        "lower": POSITIVE,
        "upper": POSITIVE,
        "start": POSITIVE,
    }

    slowest: float
    settle: float = 0.05
    time: float = 5.0
    floor: float | None = None
    dead_zone: float | None = None
    lower: float = 0.5
    upper: float = 1.0
    start: float = 1.0

    def __post_init__(self):
        super().__post_init__()
        if not self.lower <= self.start <= self.upper:
            raise InvalidInput(f"{self}.", remedy="Give lower <= start <= upper.")

    def row(self, law: Law) -> tuple[float, ...]:
        """Return time, slowest, settle, floor, dead zone, lower and upper level for a law.

        Raises:
            InvalidInput: the law has no Coulomb torque, and floor or dead zone is not given.
        """
        F = 0.0 if law.rate.SMOOTH else float(np.mean(Law(rate=law.rate).coulomb()))
        if not F > 0.0 and (self.floor is None or self.dead_zone is None):
            raise InvalidInput(
                f"The law '{law.name}' has no Coulomb torque to take floor and dead zone from.",
                remedy="Give `floor` and `dead_zone` [N.m or N].",
            )
        floor = 0.5 * F if self.floor is None else self.floor
        dead_zone = 0.05 * F if self.dead_zone is None else self.dead_zone
        # `slowest` is often a whole number of counts per tick, so rounding must not decide at this speed
        slowest = self.slowest * (1.0 - TIE)
        return self.time, slowest, self.settle, floor, dead_zone, self.lower, self.upper
