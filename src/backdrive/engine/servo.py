"""The joint's own position loop: a sampled PID, as the high-gain controller of Iwatani 2017, 2.3.2.

    u_k = K_p e_k + K_d (dr_k - v_k) + K_i T sum(e_j),   e_k = r_k - p_k

r: reference. p: encoder's position. v: backward difference of p after a first-order low pass. The integral is frozen if the
torque exceeds its limit in the direction of the error.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np

from backdrive._jit import jit
from backdrive.parameters import NOT_NEGATIVE, WithBounds

STATES = 3  # integral of the error, position of the tick before, filtered velocity


@jit
def tick(g, o, s, T, r, dr, p, limit):
    """Torque command of one tick; `s` is advanced in place.

    `g[o:]`: row of `Servo`. `s`: state. T: period. r, dr: reference and its velocity. p: measured position. `limit`: largest
    torque.
    """
    K_p, K_d, K_i, filter_time = g[o], g[o + 1], g[o + 2], g[o + 3]
    e = r - p
    s[2] += T / (T + filter_time) * ((p - s[1]) / T - s[2])
    s[1] = p
    s[0] += T * e
    u = K_p * e + K_d * (dr - s[2]) + K_i * s[0]
    if abs(u) > limit:
        if u * e > 0.0:
            s[0] -= T * e
        u = limit if u > 0.0 else -limit
    return u


@dataclass(frozen=True, kw_only=True)
class Servo(WithBounds):
    """A PID position controller.

    Attributes:
        proportional: K_p [N.m/rad or N/m].
        derivative: K_d [N.m.s/rad or N.s/m].
        integral: K_i [N.m/(rad.s) or N/(m.s)].
        filter_time: time constant of the low pass on the measured velocity [s].
    """

    BOUNDS: ClassVar = dict.fromkeys(("proportional", "derivative", "integral", "filter_time"), NOT_NEGATIVE)

    proportional: float
    derivative: float
    integral: float = 0.0
    filter_time: float = 0.0

    @classmethod
    def from_bandwidth(cls, inertia: float, bandwidth: float, *, filter_time: float = 0.0) -> Servo:
        """Return gains for a mass: a double pole at the bandwidth and a slow integral.

        Args:
            inertia: inertia that the servo moves [kg.m^2 or kg].
            bandwidth: bandwidth of the position loop [rad/s].
            filter_time: time constant of the low pass on the measured velocity [s].
        """
        return cls(
            proportional=inertia * bandwidth**2,
            derivative=2.0 * inertia * bandwidth,
            integral=0.1 * inertia * bandwidth**3,
            filter_time=filter_time,
        )

    def gains(self) -> dict[str, float]:
        """Return the gains by name."""
        return asdict(self)

    def row(self) -> np.ndarray:
        """Return the gains as the row that `tick` reads, (4,)."""
        return np.array([self.proportional, self.derivative, self.integral, self.filter_time])
