"""What line sections come short by where friction bends, as a part of the errors of their knots.

The best line sections of length h through a function f miss it by about h^2 f'' / 12 at a knot, and by half as much, the other
way, between two knots (de Boor, A Practical Guide to Splines, 1978). The curvature is taken from the knots; what noise adds to
its square is subtracted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from backdrive.identification.design import Choice


def with_bends(choice: Choice) -> Choice:
    """Return a choice whose errors at the knots count what line sections miss of a bent curve."""
    k = len(choice.candidate.terms)
    covariance = choice.covariance.copy()
    covariance[k:, k:] += bend_covariance(
        choice.candidate.form.knots, choice.coefficients[k:], covariance[k:, k:]
    )
    return replace(choice, covariance=covariance)


def bend_covariance(knots: np.ndarray, coefficients: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the covariance of what line sections miss of one curve, or of one each way, (r, r); 0 for a straight line.

    Args:
        knots: speeds, ascending [rad/s or m/s], (n,).
        coefficients: torques at the knots, of one curve after the other [N.m or N], (r,).
        covariance: of the coefficients, (r, r).
    """
    added, n = np.zeros_like(covariance), knots.size
    if n < 3:
        return added
    bend = shortfall(knots)
    for first in range(0, coefficients.size, n):
        way = slice(first, first + n)
        short = (bend @ coefficients[way]) ** 2 - np.diag(bend @ covariance[way, way] @ bend.T)
        added[way, way] = np.diag(np.maximum(short, 0.0))
    return added


def shortfall(knots: np.ndarray) -> np.ndarray:
    """Return the matrix from a curve's values at knots to what line sections miss there, (n, n).

    Args:
        knots: speeds, ascending, at least three [rad/s or m/s], (n,).
    """
    n, h = knots.size, np.diff(knots)
    slopes = np.zeros((n - 1, n))
    slopes[np.arange(n - 1), np.arange(n - 1)], slopes[np.arange(n - 1), np.arange(1, n)] = -1.0 / h, 1.0 / h
    second = 2.0 * np.diff(slopes, axis=0) / (h[1:] + h[:-1])[:, None]
    second = np.vstack([second[:1], second, second[-1:]])  # at the ends, that of the neighbours
    beside = np.concatenate([h[:1], h, h[-1:]]) ** 2
    return second * (0.5 * (beside[1:] + beside[:-1]) / 12.0)[:, None]
