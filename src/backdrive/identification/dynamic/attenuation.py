"""What the encoder's rounding takes from the inertia of a fit of torque: false acceleration makes it too small, and moves the rest.

    x += (J'WJ - n e e')^-1 e n I/s,     n = s^2 sum(w a^2)

J, W: derivatives of the residuals and their weights; e, s: place of the inertia I among the search coordinates x, and its slope; a:
false acceleration, from random rounding errors low-passed like the motion (W. Fuller, Measurement Error Models, 1987, Sec. 1.2).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from backdrive.identification.dynamic.covariance import inverse
from backdrive.identification.dynamic.fit import NEAR
from backdrive.identification.dynamic.search import Search, SearchResult
from backdrive.identification.dynamic.torque import DRAWS, TorqueProblem
from backdrive.identification.regression import MOST_NOISE
from backdrive.logs.filters import derivative

FELT = 0.05  # least change of the inertia that is worth it [standard error for white noise]


def restore_inertia(
    problem: TorqueProblem,
    search: Search,
    found: SearchResult,
    whiten: Callable[[np.ndarray], np.ndarray] | None = None,
) -> SearchResult:
    """Return the end of a search with what false acceleration took from the inertia given back; the same where that is little.

    Args:
        problem: whose residuals were fitted.
        search: that found it.
        found: its end.
        whiten: what the search did to the residuals, (..., m); None: nothing.
    """
    if "inertia" not in problem.names or found.interrupted:
        return found
    false = false_acceleration(problem)
    if not false.size:
        return found
    false = false if whiten is None else whiten(false)
    at = problem.names.index("inertia")
    free = (found.point > problem.lower + NEAR) & (found.point < problem.upper - NEAR)
    length = np.linalg.norm(np.where(np.isfinite(found.jacobian), found.jacobian, np.inf), axis=0)
    free &= (length > 0.0) & np.isfinite(length)
    if not free[at]:
        return found
    J = found.jacobian[:, free] / length[free]
    bread = inverse(J.T @ (found.weight[:, None] * J)) / np.outer(length[free], length[free])
    k = int(np.count_nonzero(free[:at]))
    value = problem.values(found.point)["inertia"]
    slope = problem.unknowns[at].slope(value)
    noise = slope**2 * float(np.mean((found.weight * false**2).sum(axis=1)))
    noise = min(noise, MOST_NOISE / bread[k, k])
    move = np.zeros_like(found.point)
    move[free] = bread[:, k] / (1.0 - noise * bread[k, k]) * noise * value / slope
    variance = float((found.weight * found.residual) @ found.residual) / len(found.residual)
    if not abs(move[at]) > FELT * np.sqrt(variance * bread[k, k]):
        return found
    point = np.clip(found.point + move, problem.lower, problem.upper)
    residual = search.evaluate(point[None])[0]
    return found if not np.isfinite(residual).all() else search.at(point, residual)


def false_acceleration(problem: TorqueProblem, seed: int = 0) -> np.ndarray:
    """Return the acceleration that random encoder rounding errors look like [rad/s^2 or m/s^2], (DRAWS, m); empty without steps."""
    rng, draws = np.random.default_rng(seed), DRAWS if problem.count > 0.0 else 0
    rows = [
        [derivative(derivative(problem.rounding(s, rng), s.dt), s.dt)[s.judged] for s in problem.stretches]
        for _ in range(draws)
    ]
    return np.array([np.concatenate(row) for row in rows])
