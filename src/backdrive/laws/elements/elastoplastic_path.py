"""The elastoplastic bristle without damping, between bounds that stay: what it holds depends on the way since it turned.

With x the displacement over z_s and u = z/z_s along the motion, du/dx = 1 - a(u) u: from -1 to the elastic share b the bristle is a
spring, and from there on the way through the sliding range is one curve u(x), tabulated once. Close to full sliding, with
w = 1 - u and c = pi^2/(4 (1 - b)^2), dw/dx = -w - c w^2, so that 1/w + c grows by the factor e^x. P. Dupont et al., as in
`elastoplastic`, whose step is implicit and therefore needs more and smaller ones for the same course.
"""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit, leaf
from backdrive._types import Array
from backdrive.elementary import exp
from backdrive.laws.elements.elastoplastic import plastic

NODES = 512  # of the curve, evenly in x
CLOSE = 0.02  # share of the sliding range that is left where the closed form takes over [-]
SLID = 1e-15  # what is left of 1 where the bristle counts as fully bent [-]


@leaf
def slope(u: float, b: float):
    """du/dx beyond the elastic share."""
    return 1.0 - plastic(min((u - b) / (1.0 - b), 1.0)) * u


@leaf
def runge_kutta(u: float, h: float, b: float):
    """Share of the bound after a step in x."""
    k_1 = slope(u, b)
    k_2 = slope(u + 0.5 * h * k_1, b)
    k_3 = slope(u + 0.5 * h * k_2, b)
    k_4 = slope(u + h * k_3, b)
    return u + h / 6.0 * (k_1 + 2.0 * (k_2 + k_3) + k_4)


@jit
def tabulate(curve: Array, b: float):
    """Fill a curve, (NODES,), of u from the elastic share to where the closed form takes over; return its spacing in x."""
    last = 1.0 - CLOSE * (1.0 - b)
    h, way, u = 0.01 * (1.0 - b), 0.0, b
    while u < last:
        way += h
        u = runge_kutta(u, h, b)
    h = way / (curve.size - 1)
    curve[0] = b
    for k in range(1, curve.size):
        curve[k] = runge_kutta(curve[k - 1], h, b)
    return h


@leaf
def bend(curve: Array, h: float, b: float, u: float, x: float):
    """Share of the bound, from u >= b, after a displacement x >= 0."""
    count = curve.size - 1
    if u < curve[count]:
        low, high = 0, count
        while high - low > 1:
            middle = (low + high) // 2
            if curve[middle] <= u:
                low = middle
            else:
                high = middle
        at = low + (u - curve[low]) / (curve[high] - curve[low]) + x / h
        if at < count:
            k = int(at)
            return curve[k] + (at - k) * (curve[k + 1] - curve[k])
        u, x = curve[count], (at - count) * h
    c = 0.25 * np.pi**2 / (1.0 - b) ** 2
    left = 1.0 / ((1.0 / (1.0 - u) + c) * exp(min(x, 700.0)) - c)
    return 1.0 - left if left > SLID else 1.0


@jit
def follow(path: Array, scale: float, b: float, curve: Array, h: float, level: Array):
    """Fill z/z_s along a path, (n,) each, of a bristle that is not bent at first; scale: 1/z_s."""
    z = 0.0
    level[0] = z
    for k in range(1, path.size):
        x = (path[k] - path[k - 1]) * scale
        way = 1.0 if x > 0.0 else -1.0
        u, x = z * way, x * way
        if u < 1.0:
            straight = min(x, b - u)
            if straight > 0.0:
                u, x = u + straight, x - straight
            if x > 0.0:
                u = bend(curve, h, b, u, x)
            z = u * way
        level[k] = z


def elastoplastic_level(path: Array, width: float, elastic: float) -> Array:
    """Return the share of the bound that an undamped elastoplastic bristle holds along a path, (n,); at first it is not bent.

    Args:
        path: position [rad or m], (n,).
        width: displacement over which it would bend to the bound were it elastic, z_s [rad or m].
        elastic: share of the bound up to which it is elastic, b in 0 to 0.99 [-].
    """
    curve, level = np.empty(NODES), np.empty(path.size)
    follow(path, 1.0 / width, elastic, curve, float(tabulate(curve, elastic)), level)
    return level
