"""The ladder: one compiled entry for every law, chosen by an integer.

A law is a row `p`: p[0] is the number m of rate-law parameters, p[1:1+m] the rate law's row, p[1+m:] the element's. Where
friction grows with the load, p[0] is m + 1/2, and the last of the m numbers say how (`growth`). A rate law reads its row from
p[1] on, an element from p[e] on: a slice would cost more than the law. `rate` and `element` are the integers of their
classes; `x` is the element's state, followed by as much room for `solve` to keep it while it tries steps; `load` is the pair
of motor-side and external torque, a tuple, `temp` the temperature. `limits`, `step` and `solve` are the three kernels that a
law offers.
"""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit, ladder
from backdrive.laws import growth
from backdrive.laws.elements import (
    bliman_sorine,
    dahl,
    dead_zone,
    decaying,
    elastoplastic,
    gms,
    hayward_armstrong,
    leuven,
    lugre,
    maxwell_slip,
    none,
    reset_integrator,
    smoothed_gms,
    xiong_kikuuwe,
)
from backdrive.laws.rates import (
    coulomb_viscous,
    degressive,
    gear_load,
    load_dependent,
    load_temperature,
    lorentz,
    makkar,
    polyline,
    sigmoid,
    stribeck,
)

STEPS = 60  # of `solve` at most; line sections need a handful
CLOSE = 1e-14  # of what is left of the balance when `solve` ends to the velocities in it
FASTEST = 1e100  # beyond this speed [rad/s or m/s] a velocity counts as this one, so that nothing overflows


@ladder
def curve(rate, p, v, load, temp):
    """Rate law at velocity v, without its growth with the load: (lo, hi, viscous)."""
    if rate == 0:
        return coulomb_viscous.limits(p, v, load, temp)
    if rate == 1:
        return polyline.limits(p, v, load, temp)
    if rate == 2:
        return stribeck.limits(p, v, load, temp)
    if rate == 3:
        return lorentz.limits(p, v, load, temp)
    if rate == 4:
        return makkar.limits(p, v, load, temp)
    if rate == 5:
        return sigmoid.limits(p, v, load, temp)
    if rate == 6:
        return degressive.limits(p, v, load, temp)
    if rate == 7:
        return load_dependent.limits(p, v, load, temp)
    if rate == 8:
        return load_temperature.limits(p, v, load, temp)
    if rate == 9:
        return gear_load.limits(p, v, load, temp)
    return np.nan, np.nan, np.nan


@ladder
def limits(rate, p, v, load, temp):
    """Rate law at velocity v under a load: (lo, hi, viscous)."""
    lo, hi, viscous = curve(rate, p, v, load, temp)
    m = int(p[0])
    if p[0] > m:
        lo, hi = growth.grown(p, m + 1 - growth.ROW, v, load, lo, hi, viscous)
    return lo, hi, viscous


@ladder
def carry(element, p, e, x, lo, hi, dp, dt):
    """Torque of the element between the limits, and the motion that the viscous part sees; `x` is advanced in place."""
    if element == 0:
        return none.step(lo, hi, dp), dp
    if element == 1:
        return dead_zone.step(p, e, lo, hi, dp, dt)
    if element == 2:
        return dahl.step(p, e, x, lo, hi, dp), dp
    if element == 3:
        return bliman_sorine.step(p, e, x, lo, hi, dp), dp
    if element == 4:
        return reset_integrator.step(p, e, x, lo, hi, dp, dt), dp
    if element == 5:
        return lugre.step(p, e, x, lo, hi, dp, dt), dp
    if element == 6:
        return elastoplastic.step(p, e, x, lo, hi, dp, dt), dp
    if element == 7:
        return hayward_armstrong.step(p, e, x, lo, hi, dp)
    if element == 8:
        return xiong_kikuuwe.step(p, e, x, lo, hi, dp, dt), dp
    if element == 9:
        return decaying.step(p, e, x, lo, hi, dp, dt)
    if element == 10:
        return maxwell_slip.step(p, e, x, lo, hi, dp), dp
    if element == 11:
        return leuven.step(p, e, x, lo, hi, dp, dt), dp
    if element == 12:
        return gms.step(p, e, x, lo, hi, dp, dt), dp
    if element == 13:
        return smoothed_gms.step(p, e, x, lo, hi, dp, dt), dp
    return np.nan, np.nan


@ladder
def step(rate, element, p, x, dp, dt, load, temp):
    """Friction torque of one tick; `x` is advanced in place."""
    v = dp / dt
    if abs(v) > FASTEST:
        v = FASTEST if v > 0.0 else -FASTEST
        dp = v * dt
    return bounded(rate, element, p, x, v, dp, dt, load, temp)


@ladder
def bounded(rate, element, p, x, v, dp, dt, load, temp):
    """Friction torque of a `step` at a velocity v = dp/dt that is at most FASTEST."""
    lo, hi, viscous = limits(rate, p, v, load, temp)
    slides = element == 1 or element == 7 or element == 9  # noqa: PLR1714 (the compiler follows it)
    if element != 0 and not slides and viscous * v < 0.0:
        # what weakens with speed narrows the bounds
        weaker = min(abs(viscous), hi if v > 0.0 else -lo)
        if v > 0.0:
            hi -= weaker
            viscous += weaker
        else:
            lo += weaker
            viscous -= weaker
    f, slid = carry(element, p, 1 + int(p[0]), x, lo, hi, dp, dt)
    if slides:
        viscous = limits(rate, p, slid / dt, load, temp)[2]
    return f + viscous


@jit
def solve(rate, element, p, x, v_free, dt, dt_over_m, load, temp):
    """Velocity at the end of a step of a mass held by this friction, implicit in the friction; `x` stays as it is.

    v + dt/m friction(v dt) = v_free, the velocity that the step would end with without friction. Where friction is set-valued,
    v + dt/m (gsgn(lo, v, hi) + viscous(v)) contains v_free; where friction jumps at rest (a slipping element of GMS, a bristle
    of the reset integrator that has given) v may be next to the jump. A `step` over v dt then advances the state.
    """
    if not np.isfinite(v_free):
        return np.nan
    at_rest = v_free
    if element <= 1:
        lo, hi, _ = limits(rate, p, 0.0, load, temp)
        if dt_over_m * lo <= v_free <= dt_over_m * hi:
            return 0.0
        at_rest -= dt_over_m * (hi if v_free > 0.0 else lo)
    else:
        at_rest -= dt_over_m * _tried(rate, element, p, x, 0.0, dt, load, temp)
        if at_rest == 0.0:
            return 0.0
    if not np.isfinite(at_rest):
        return np.nan
    toward = 1.0 if at_rest > 0.0 else -1.0
    close = CLOSE * (abs(v_free) + abs(at_rest))
    # a: a speed at which friction is too weak; b: one at which it is too strong
    a, excess_a, b = 0.0, -abs(at_rest), abs(at_rest)
    excess_b = _excess(rate, element, p, x, b, toward, v_free, dt, dt_over_m, load, temp)
    side, grown = 0, 1.0
    for _ in range(STEPS):
        if not excess_b < 0.0:
            break
        a, excess_a, b = b, excess_b, b - 2.0 * grown * excess_b
        grown *= 2.0
        excess_b = _excess(rate, element, p, x, b, toward, v_free, dt, dt_over_m, load, temp)
    if excess_b == 0.0:
        return toward * b
    # regula falsi, a side that stays halved (Illinois): exact where the curve is a straight line; then bisection
    for k in range(2 * STEPS):
        speed = b - excess_b * (b - a) / (excess_b - excess_a) if k < STEPS else 0.5 * (a + b)
        if not a < speed < b:
            break
        excess = _excess(rate, element, p, x, speed, toward, v_free, dt, dt_over_m, load, temp)
        if abs(excess) <= close:
            return toward * speed
        if excess > 0.0:
            b, excess_b = speed, excess
            if side > 0:
                excess_a *= 0.5
            side = 1
        else:
            a, excess_a = speed, excess
            if side < 0:
                excess_b *= 0.5
            side = -1
    return toward * (b - excess_b * (b - a) / (excess_b - excess_a))


@jit
def _tried(rate, element, p, x, v, dt, load, temp):
    """Friction torque of a step at velocity v that is not taken."""
    n = x.size // 2
    for i in range(n):
        x[n + i] = x[i]
    friction = step(rate, element, p, x, v * dt, dt, load, temp)
    for i in range(n):
        x[i] = x[n + i]
    return friction


@jit
def _excess(rate, element, p, x, speed, toward, v_free, dt, dt_over_m, load, temp):
    """How much a trial speed asks for beyond what the step provides, along the direction of motion."""
    v = toward * speed
    if element <= 1:
        lo, hi, viscous = limits(rate, p, v, load, temp)
        friction = (hi if toward > 0.0 else lo) + viscous
    else:
        friction = _tried(rate, element, p, x, v, dt, load, temp)
    return toward * (v + dt_over_m * friction - v_free)


@jit
def steady(rate, p, v, load, temp, out):
    """Fill `out` with the steady friction torque at the velocities `v` (n,), under loads (n, 2) or (1, 2); 0 at v = 0."""
    loads, temps = load.shape[0] > 1, temp.size > 1
    for i in range(v.size):
        j = i if loads else 0
        lo, hi, viscous = limits(rate, p, v[i], (load[j, 0], load[j, 1]), temp[i if temps else 0])
        out[i] = none.step(lo, hi, v[i]) + viscous
