"""Metrics of curves and torques, with units and without grades."""

from __future__ import annotations

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.laws import CoulombViscous, Law, Polyline

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)  # exact for the squares of linear and quadratic sections


def curve_distance(
    first: Law, second: Law, top_speed: float, *, direction: int = 1, lowest: float = 0.0
) -> float:
    """Return the root mean square difference of two friction curves from rest, or from a lowest speed, to a speed.

    Exact for line sections: the integral is cut at every knot of either curve.

    Args:
        first: one curve.
        second: the other.
        top_speed: V, end of the range [rad/s or m/s].
        direction: 1 for motion along +q, -1 for motion along -q.
        lowest: begin of the range, 0 in the thesis [rad/s or m/s].

    Returns:
        E of Iwatani 2017, (2.16) [N.m or N].

    Raises:
        InvalidInput: top_speed is not positive, lowest is not below it, or direction is neither 1 nor -1.
    """
    speed, weight = _quadrature((first, second), lowest, top_speed, direction)
    difference = first.torque(direction * speed) - second.torque(direction * speed)
    return float(np.sqrt(weight @ difference**2 / (top_speed - lowest)))


def relative_curve_distance(
    first: Law, second: Law, top_speed: float, *, direction: int = 1, lowest: float = 0.0
) -> float:
    """Return the distance of two friction curves relative to the size of the second.

    Args:
        first: one curve.
        second: the other, to which the distance is relative.
        top_speed: V, end of the range [rad/s or m/s].
        direction: 1 for motion along +q, -1 for motion along -q.
        lowest: begin of the range, 0 in the thesis [rad/s or m/s].

    Returns:
        E_p of Iwatani 2017, (2.17) [-]; NaN where the second curve is zero.

    Raises:
        InvalidInput: top_speed is not positive, lowest is not below it, or direction is neither 1 nor -1.
    """
    speed, weight = _quadrature((second,), lowest, top_speed, direction)
    size = float(np.sqrt(weight @ second.torque(direction * speed) ** 2 / (top_speed - lowest)))
    distance = curve_distance(first, second, top_speed, direction=direction, lowest=lowest)
    return distance / size if size > 0 else float("nan")


def mean_magnitude(signal: np.ndarray) -> float:
    """Return the root mean square of a signal over an experiment.

    Args:
        signal: velocity, torque, or an error, evenly sampled, (n,).

    Returns:
        V_s or F_s of Iwatani 2017, (2.23), in the signal's unit.

    Raises:
        InvalidInput: it is empty or not finite.
    """
    x = np.asarray(signal, dtype=np.float64)
    if x.ndim != 1 or x.size == 0 or not np.all(np.isfinite(x)):
        raise InvalidInput(
            f"A signal of shape {x.shape} with {int(np.sum(~np.isfinite(x)))} values that are not finite has no mean magnitude.",
            remedy="Give one finite number a sample, (n,).",
        )
    return float(np.sqrt(np.mean(x**2)))


def tracking_error(desired: np.ndarray, position: np.ndarray) -> float:
    """Return the root mean square deviation of a position from the desired one over an experiment.

    Args:
        desired: p_d [rad or m], evenly sampled, (n,).
        position: p_s [rad or m], (n,).

    Returns:
        E_s of Iwatani 2017, (2.26) [rad or m].

    Raises:
        InvalidInput: the lengths differ, or a value is not finite.
    """
    a, b = np.asarray(desired, dtype=np.float64), np.asarray(position, dtype=np.float64)
    if a.shape != b.shape:
        raise InvalidInput(
            f"{a.shape} desired positions and {b.shape} positions.", remedy="Give one of each a sample, (n,)."
        )
    return mean_magnitude(a - b)


def _quadrature(
    laws: tuple[Law, ...], lowest: float, top_speed: float, direction: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes inside (lowest, top_speed) and their weights, section by section between the knots."""
    if not 0 <= lowest < top_speed < np.inf or direction not in (1, -1):
        raise InvalidInput(
            f"top_speed = {top_speed}, lowest = {lowest}, direction = {direction}.",
            remedy="Give a positive speed above the lowest one, and 1 or -1 as direction.",
        )
    knots = [np.array([lowest, top_speed])]
    for law in laws:
        if isinstance(law.rate, Polyline):
            knots.append(np.array(law.rate.velocity))
        elif not isinstance(law.rate, CoulombViscous):
            knots.append(top_speed * np.linspace(0.0, 1.0, 65) ** 2)  # smooth laws bend most near rest
    edges = np.unique(np.concatenate(knots))
    edges = edges[(edges >= lowest) & (edges <= top_speed)]
    half = 0.5 * np.diff(edges)[:, None]
    middle = 0.5 * (edges[:-1] + edges[1:])[:, None]
    return np.ravel(middle + half * NODES), np.ravel(half * WEIGHTS)
