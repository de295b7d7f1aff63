"""The ladder: one compiled entry for every law, chosen by an integer.

A law is a row `p`: p[0] is the number m of rate-law parameters, p[1:1+m] the rate law's row, p[1+m:] the element's.
`rate` and `element` are the integers of their classes, `x` the element's state, `load` the pair of motor-side and
external torque, `temp` the temperature. `limits`, `step` and `solve` are the three kernels that a law offers.
"""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit
from backdrive.laws.elements import none
from backdrive.laws.rates import coulomb_viscous, polyline

STEPS = 60  # of `solve` at most; line sections need a handful


@jit
def limits(rate, p, v, load, temp):
    """Rate law at velocity v: (lo, hi, viscous)."""
    r = p[1 : 1 + int(p[0])]
    if rate == 0:
        return coulomb_viscous.limits(r, v, load, temp)
    if rate == 1:
        return polyline.limits(r, v, load, temp)
    return np.nan, np.nan, np.nan


@jit
def step(rate, element, p, x, dp, dt, load, temp):
    """Friction torque of one tick; `x` is advanced in place."""
    lo, hi, viscous = limits(rate, p, dp / dt, load, temp)
    if element == 0:
        return none.step(lo, hi, viscous, dp)
    return np.nan


@jit
def solve(rate, element, p, x, v_free, dt_over_m, load, temp):
    """Velocity at the end of a step of a mass held by this friction, implicit in the friction.

    v + dt/m (gsgn(lo, v, hi) + viscous(v)) contains v_free, the velocity that the step would end with without friction.
    """
    lo, hi, _ = limits(rate, p, 0.0, load, temp)
    if dt_over_m * lo <= v_free <= dt_over_m * hi:
        return 0.0
    if not np.isfinite(v_free):
        return np.nan
    toward = 1.0 if v_free > 0.0 else -1.0
    # a: a speed at which friction is too weak; b: one at which it is too strong
    a, excess_a = 0.0, dt_over_m * (hi if v_free > 0.0 else -lo) - abs(v_free)
    b, excess_b = abs(v_free), _excess(rate, p, v_free, toward, v_free, dt_over_m, load, temp)
    if excess_b <= 0.0:
        return v_free
    for _ in range(STEPS):  # regula falsi with Illinois' halving: exact where the curve is a straight line
        speed = b - excess_b * (b - a) / (excess_b - excess_a)
        if not a < speed < b:
            break
        excess = _excess(rate, p, toward * speed, toward, v_free, dt_over_m, load, temp)
        if excess == 0.0:
            return toward * speed
        if excess > 0.0:
            b, excess_b, excess_a = speed, excess, 0.5 * excess_a
        else:
            a, excess_a, excess_b = speed, excess, 0.5 * excess_b
        if b - a <= 1e-15 * b:
            break
    return toward * (b - excess_b * (b - a) / (excess_b - excess_a))


@jit
def _excess(rate, p, v, toward, v_free, dt_over_m, load, temp):
    """How much a trial velocity asks for beyond what the step provides, along the direction of motion."""
    lo, hi, viscous = limits(rate, p, v, load, temp)
    friction = (hi if toward > 0.0 else lo) + viscous
    return toward * (v + dt_over_m * friction - v_free)


@jit
def steady(rate, p, v, load, temp, out):
    """Fill `out` with the steady friction torque at the velocities `v`; 0 at v = 0."""
    for i in range(v.size):
        lo, hi, viscous = limits(rate, p, v[i], load, temp)
        out[i] = none.step(lo, hi, viscous, v[i])
