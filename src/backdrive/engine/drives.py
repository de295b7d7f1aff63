"""Drives: from a drive's input to the torque on the motor side.

    controller   open:      y = gain r
                 position:  y = K_p (r - q) + K_d (r' - v) + K_i integral(r - q), |y| <= limit
                 velocity:  y = K_p (r - v) + K_i integral(r - v), |y| <= limit
    actuator     torque:    u = y
                 motor:     i = (U y - k_t v)/(R + R_s y^2),   u = k_t i/(1 + c |i|)

r: input of the drive. q, v: position and velocity of the motor's side. U: supply voltage [V] if y is a duty, and 1 if y is a
voltage. k_t: torque constant on the joint's side, and also the back-EMF constant [N.m/A]. R, R_s: resistance of the motor and
of the supply [ohm]. c: saturation, the relative decrease of the torque constant with current [1/A]. The input is delayed by
`delay`. Between samples it is interpolated or held.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from backdrive._jit import jit, leaf
from backdrive.engine import servo
from backdrive.parameters import ABOVE_ZERO, Bound, WithBounds

STATES = servo.STATES + 1  # those of the servo, and the input of the previous step
CONTROLLERS = ("open", "position", "velocity")
ACTUATORS = ("torque", "motor")
NOT_BELOW_ZERO = Bound(0.0, np.inf)


@jit
def input_at(r, t, hold):
    """Input at the time t in samples: interpolated, or held; constant beyond its ends."""
    last = r.size - 1
    if t <= 0.0:
        return r[0]
    if t >= last:
        return r[last]
    k = int(t)
    if hold > 0.0:
        return r[k]
    return r[k] + (t - k) * (r[k + 1] - r[k])


@jit
def torque(d, s, r, supply, q, v, h):
    """Torque of one step h for the input r; `s` is advanced in place. If the supply is NaN, the drive's own is used."""
    kind, limit = int(d[0]), d[6]
    before, s[3] = s[3], r
    if kind == 0:
        y = d[1] * r
        if abs(y) > limit:
            y = limit if y > 0.0 else -limit
    elif kind == 1:
        y = servo.tick(d, 2, s, h, r, (r - before) / h, q, limit)
    else:
        e = r - v
        s[0] += h * e
        y = d[2] * e + d[4] * s[0]
        if abs(y) > limit:
            if y * e > 0.0:
                s[0] -= h * e
            y = limit if y > 0.0 else -limit
    if d[7] == 0.0:
        return y
    k_t = d[9]
    U = d[8] if np.isnan(supply) else supply
    i = (U * y - k_t * v) / (d[10] + d[11] * y * y)
    return k_t * i / (1.0 + d[12] * abs(i))


@leaf
def begin(d, s, r, q, dt):
    """Set the state of a drive before the first sample, at the position q, of its input r (n,)."""
    s[1], s[3] = q, input_at(r, -d[13] / dt, d[14])


@leaf
def torque_at(d, s, r, t, on, supply, q, v, h, dt):
    """Torque of one step h from the time t in samples of the input r (n,); 0 where the drive is switched off."""
    if on > 0.0:
        return torque(d, s, input_at(r, t - d[13] / dt, d[14]), supply, q, v, h)
    return 0.0


@jit
def along(d, s, r, supply, q, v, dt, out):
    """Fill `out` with the torque of a drive along a motion: position q and velocity v (n,); `supply` is (n,) or (1,)."""
    begin(d, s, r, q[0], dt)
    for k in range(r.size):
        out[k] = torque_at(d, s, r, k, 1.0, supply[k if supply.size > 1 else 0], q[k], v[k], dt, dt)


@dataclass(frozen=True, kw_only=True)
class DriveModel(WithBounds):
    """A drive in the loop.

    Attributes:
        controller: kind of controller: `open`, `position` or `velocity`.
        actuator: `torque` if the controller's output is a torque, `motor` if it is the voltage or the duty of a motor.
        gain: gain of the open controller [output/input].
        proportional: K_p [output/rad, output/m, or per unit of velocity].
        derivative: K_d [output.s/rad or output.s/m].
        integral: K_i [output/(rad.s) or output/(m.s)].
        filter_time: time constant of the low pass on the measured velocity [s].
        limit: largest output of the controller [N.m, N, V, or 1 for a duty].
        supply: U, voltage at full duty [V]; 1 where the controller's output is a voltage.
        torque_constant: k_t, on the joint's side of the gears [N.m/A or N/A].
        resistance: R [ohm].
        supply_resistance: R_s [ohm].
        saturation: c, relative decrease of the torque constant with current [1/A].
        delay: delay of the input [s].
        hold: the input is held between samples, not interpolated.
    """

    BOUNDS: ClassVar = {
        "gain": Bound(-np.inf, np.inf),
        "proportional": NOT_BELOW_ZERO,
        "derivative": NOT_BELOW_ZERO,
        "integral": NOT_BELOW_ZERO,
        "filter_time": NOT_BELOW_ZERO,
        "limit": ABOVE_ZERO,
        "supply": ABOVE_ZERO,
        "torque_constant": ABOVE_ZERO,
        "resistance": ABOVE_ZERO,
        "supply_resistance": NOT_BELOW_ZERO,
        "saturation": NOT_BELOW_ZERO,
        "delay": Bound(-np.inf, np.inf),
    }
    CHOICES: ClassVar = {"controller": CONTROLLERS, "actuator": ACTUATORS}

    controller: Literal["open", "position", "velocity"] = "open"
    actuator: Literal["torque", "motor"] = "torque"
    gain: float = 1.0
    proportional: float = 0.0
    derivative: float = 0.0
    integral: float = 0.0
    filter_time: float = 0.0
    limit: float = np.inf
    supply: float = 1.0
    torque_constant: float = 1.0
    resistance: float = 1.0
    supply_resistance: float = 0.0
    saturation: float = 0.0
    delay: float = 0.0
    hold: bool = False

    def row(self) -> np.ndarray:
        """Return the row that `torque` reads, (15,)."""
        return np.array(
            [
                CONTROLLERS.index(self.controller),
                self.gain,
                self.proportional,
                self.derivative,
                self.integral,
                self.filter_time,
                self.limit,
                ACTUATORS.index(self.actuator),
                self.supply,
                self.torque_constant,
                self.resistance,
                self.supply_resistance,
                self.saturation,
                self.delay,
                float(self.hold),
            ]
        )
