"""What the encoder's rounding takes from the inertia of a fit of torque: false acceleration makes it too small, and moves the rest.

    x += (J'WJ - n e e')^-1 e n I/s,     n = s^2 sum(w a^2)

J, W: derivatives of the residuals and their weights; e, s: place of the inertia I among the search coordinates x, and its slope; a:
false acceleration, of the motion rounded once more at a random phase and low-passed (W. Fuller, Measurement Error Models, 1987,
Sec. 1.2), averaged and whitened like the residuals. The fit is kept as it is where the correction is small, or large against what
the linear step may claim.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from backdrive.identification.dynamic.covariance import inverse
from backdrive.identification.dynamic.fit import NEAR, Fit, conclude
from backdrive.identification.dynamic.search import Search
from backdrive.identification.dynamic.torque import DRAWS, Stretch, TorqueProblem
from backdrive.logs.filters import derivative, low_pass

FELT = 0.2  # least change of the inertia that is worth it [standard error]
MOST = 0.3  # largest part of what determines the inertia that is taken as noise [-]
FARTHEST = 2.0  # largest change of any other number [standard error]
WORSE = 1.02  # largest cost, relative to that of the fit [-]


def restore_inertia(fit: Fit, whiten: Callable[[np.ndarray], np.ndarray] | None = None) -> Fit | None:
    """Return a fit of torque with what false acceleration took from the inertia given back; the same where it must not be.

    Args:
        fit: to all samples that count, or to their whitened means.
        whiten: what its search did to the residuals, (..., m); None: nothing.

    Returns:
        The fit; None if false acceleration determines the inertia to more than `MOST`.
    """
    problem, found = fit.problem, fit.found
    left = found.interrupted or fit.at_bound or "inertia" not in problem.names
    if left or not isinstance(problem, TorqueProblem):
        return fit
    false = false_acceleration(problem)
    false = false if whiten is None or not false.size else whiten(false)
    errors = np.array([fit.standard_errors[name] for name in problem.names])
    free = (found.point > problem.lower + NEAR) & (found.point < problem.upper - NEAR)
    free &= np.isfinite(found.jacobian).all(axis=0) & np.isfinite(errors) & (errors > 0.0)
    at = problem.names.index("inertia")
    if not false.size or not free[at]:
        return fit
    length = np.linalg.norm(found.jacobian[:, free], axis=0)
    J = found.jacobian[:, free] / length
    bread = inverse(J.T @ (found.weight[:, None] * J)) / np.outer(length, length)
    k = int(np.count_nonzero(free[:at]))
    value = fit.values["inertia"]
    slope = problem.unknowns[at].slope(value)
    part = slope**2 * float(np.mean((found.weight * false**2).sum(axis=1))) * bread[k, k]
    if part > MOST:
        return None
    move = np.zeros_like(found.point)
    move[free] = bread[:, k] / bread[k, k] * part / (1.0 - part) * value / slope
    slopes = np.array([u.slope(fit.values[u.name]) for u in problem.unknowns])
    moved = np.abs(move * slopes)[free] / errors[free]
    others = np.delete(moved, k)
    if moved[k] < FELT or (others.size and others.max() > FARTHEST):
        return fit
    point = found.point + move
    if np.any(point[free] <= problem.lower[free] + NEAR) or np.any(point[free] >= problem.upper[free] - NEAR):
        return fit
    search = Search(
        problem.residuals if whiten is None else lambda p: whiten(problem.residuals(p)),
        problem.lower,
        problem.upper,
        loss=fit.loss,
    )
    residual = search.evaluate(point[None])[0]
    if not search.cost(residual, search.scale(found.residual)) <= WORSE * found.cost:
        return fit
    after = replace(search.at(point, residual), instants=found.instants, independent=found.independent)
    more = found.evaluations + search.evaluations
    return conclude(problem, replace(after, converged=found.converged, evaluations=more), fit.loss, whiten)


def false_acceleration(problem: TorqueProblem, seed: int = 0) -> np.ndarray:
    """Return the acceleration that the encoder's rounding looks like [rad/s^2 or m/s^2], (DRAWS, m); empty without steps."""
    rng, draws = np.random.default_rng(seed), DRAWS if problem.count > 0.0 else 0
    rows = [[_false(s, problem.count, rng)[s.judged] for s in problem.stretches] for _ in range(draws)]
    return np.array([np.concatenate(row) for row in rows])


def _false(s: Stretch, step: float, rng: np.random.Generator) -> np.ndarray:
    """Return the acceleration that rounding to steps looks like, where these begin at a random phase, (n,)."""
    path = (np.cumsum(s.dp) if s.position is None else s.position) / step + rng.uniform()
    error = low_pass(step * (np.round(path) - path), min(s.bandwidth, 0.1 / s.dt), 1.0 / s.dt)
    return derivative(derivative(error, s.dt), s.dt)
