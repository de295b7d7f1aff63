"""The dynamics of one axis: motor and load, an elastic or rigid transmission, gravity, and friction with true sticking.

    M w' = u - c - [friction]            c = K_c (p - q) + D_c (w - v)
    L v' = c - a sin q - b cos q - o - [friction]

p, w: position and velocity on the motor's side, where the encoder is; q, v: on the load's side. The friction acts on either
side (Iwatani 2017, Fig. 3.2: on the load's side). With a rigid transmission, motor and load are one mass. Gravity is (2.10):
a = 0 and b = M L g for a joint angle from the horizontal. o: constant torque.

A step consists of half a step of drift, a velocity update, and another half step of drift. The velocity update is implicit in
the friction (`laws.kernels.solve`), so that a held mass rests exactly. Laws that depend on the load or grow with it
(`laws.growth`) take the motor's torque and -c as their pair of loads. For a rigid axis, c is the torque of gravity and of the
load's inertia. In addition to any law, the axis may have Coulomb friction mu |c|. To account for it, the implicit step reduces
the velocity that the mass would have without friction.
"""

from __future__ import annotations

from backdrive._jit import jit, leaf
from backdrive.elementary import cos, sin
from backdrive.laws import growth, kernels

STATES = 5  # p, w, q, v, c


@jit
def gravity(j, q):
    """Torque of gravity and of the offset at the load's position q."""
    a, b = j[4], j[5]
    if a == 0.0:
        return j[9] if b == 0.0 else b * cos(q) + j[9]
    return a * sin(q) + b * cos(q) + j[9]


@leaf
def drift(j, s, u, h):
    """Drift for half a step h, and return what the velocity follows from under the torque u, friction aside.

    Returns:
        Velocity after the step without friction; h by the mass on which the friction acts; torque by which its bounds are
        wider, not negative; the pair of loads of the law. The state `s` holds what `arrive` needs.
    """
    M, L, K_c, D_c, mu = j[0], j[1], j[2], j[3], j[8]
    rigid, on_load = j[6] > 0.0, j[7] > 0.0
    half = 0.5 * h
    load = (u, -s[4])
    widening = mu * growth.beyond(0.0, load)
    w, v = s[1], s[3]
    middle_p, middle_q = s[0] + half * w, s[2] + half * v
    g = gravity(j, middle_p if rigid else middle_q)
    if rigid:
        c, dt_over_m = g, h / (M + L)
        v_free = w + dt_over_m * (u - g)
    else:
        c = K_c * (middle_p - middle_q) + D_c * (w - v)
        w += h / M * (u - c)
        v += h / L * (c - g)
        v_free, dt_over_m = (v, h / L) if on_load else (w, h / M)
    s[0], s[1], s[2], s[3], s[4] = middle_p, w, middle_q, v, c
    return v_free, dt_over_m, widening, load


@leaf
def narrow(v_free, dt_over_m, widening):
    """Velocity without friction, reduced by friction with the bounds -widening and widening."""
    shrinkage = dt_over_m * widening
    if abs(v_free) <= shrinkage:
        return 0.0
    if v_free > 0.0:
        return v_free - shrinkage
    return v_free + shrinkage


@leaf
def implicit_velocity(rate, element, p, x, v_free, h, dt_over_m, widening, load, temp):
    """Velocity of a mass after a step h under friction whose bounds are widened by `widening` >= 0."""
    if widening > 0.0:
        v_free = narrow(v_free, dt_over_m, widening)
    return kernels.solve_step(rate, element, p, x, v_free, h, dt_over_m, load, temp)


@leaf
def arrive(j, s, after, h):
    """Finish a step h that `drift` began, with the velocity after it of the mass on which the friction acts."""
    rigid, on_load = j[6] > 0.0, j[7] > 0.0
    half = 0.5 * h
    w, v = s[1], s[3]
    if rigid:
        s[4] += j[1] * (after - w) / h
        w = v = after
    elif on_load:
        v = after
    else:
        w = after
    s[1], s[3] = w, v
    s[0] += half * w
    s[2] = s[0] if rigid else s[2] + half * v


@jit
def advance(j, s, rate, element, p, x, u, h, temp):
    """Advance the state `s` of the axis `j` by one step h under the torque u, in place.

    `rate`, `element`, `p`, `x` are the friction law and its state.
    """
    v_free, dt_over_m, widening, load = drift(j, s, u, h)
    after = implicit_velocity(rate, element, p, x, v_free, h, dt_over_m, widening, load, temp)
    arrive(j, s, after, h)
