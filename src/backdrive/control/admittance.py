"""Sensorless admittance control: the joint follows a virtual mass that the estimated external force moves.

    m q_d'' + b q_d' = tau_e,     u = K_p (q_d - q) + K_d (q_d' - q');   Iwatani 2017, (4.6)

m: virtual inertia [kg.m^2 or kg]. b: virtual viscosity [N.m.s/rad or N.s/m] (the thesis prints other units). With the period T

    v_d <- (m v_d + T tau_e)/(m + b T),   q_d <- q_d + T v_d.

Compute tau_e with the torque of the previous tick. With one more sample of delay, the loop would be unstable at T K_d/m = 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from backdrive._jit import jit, leaf
from backdrive.errors import InvalidInput
from backdrive.parameters import NOT_NEGATIVE, POSITIVE, WithBounds

ROW = 5
STATES = 3  # q_d, v_d, position before


@jit
def tick(c, i, s, j, tau_e, q, T):
    """Return the torque of one tick; `c[i:]`: m, b, K_p, K_d, limit; `s[j:]`: state."""
    m, b, limit = c[i], c[i + 1], c[i + 4]
    v = (q - s[j + 2]) / T
    s[j + 2] = q
    v_d = (m * s[j + 1] + T * tau_e) / (m + b * T)
    s[j + 1] = v_d
    s[j] += T * v_d
    u = c[i + 2] * (s[j] - q) + c[i + 3] * (v_d - v)
    return min(max(u, -limit), limit)


@leaf
def absent(c, i, s, j, tau_e, q, T):
    """Return no torque: `tick` where no joint follows a virtual mass."""
    return 0.0


@dataclass(frozen=True, kw_only=True)
class Admittance(WithBounds):
    """A virtual mass and the position controller that follows it.

    Attributes:
        inertia: m [kg.m^2 or kg].
        viscosity: b [N.m.s/rad or N.s/m].
        proportional: K_p [N.m/rad or N/m].
        derivative: K_d [N.m.s/rad or N.s/m].
        limit: of the torque [N.m or N].
    """

    BOUNDS: ClassVar = {
        "inertia": POSITIVE,
        "viscosity": NOT_NEGATIVE,
        "proportional": NOT_NEGATIVE,
        "derivative": NOT_NEGATIVE,
        "limit": POSITIVE,
    }

    inertia: float
    viscosity: float
    proportional: float
    derivative: float
    limit: float

    def row(self) -> np.ndarray:
        """Return the row that `tick` reads, (5,)."""
        return np.array([self.inertia, self.viscosity, self.proportional, self.derivative, self.limit])

    def virtual_force(self, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Return the force that acts on the virtual object, tau_a = m q'' + b q', Iwatani 2017, (4.19) [N.m or N].

        Args:
            velocity: q', as a filter of the encoder gives it [rad/s or m/s], any shape.
            acceleration: q'' [rad/s^2 or m/s^2], the same shape.

        Raises:
            InvalidInput: the shapes differ.
        """
        v, a = np.asarray(velocity, dtype=np.float64), np.asarray(acceleration, dtype=np.float64)
        if v.shape != a.shape:
            raise InvalidInput(
                f"Velocities {v.shape} and accelerations {a.shape}.", remedy="Give one of each per sample."
            )
        return self.inertia * a + self.viscosity * v

    def start(self, position: float) -> np.ndarray:
        """Return the state at rest at a position, (3,)."""
        return np.array([position, 0.0, position])
