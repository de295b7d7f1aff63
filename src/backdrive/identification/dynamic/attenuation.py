"""What the measured motion does to a fit of torque: its rounding and its low pass mislead inertia and delay.

    f += (F - S)^-1 (g - Z'r),   o -= A^+ (r + D df),   Z = c (D - A (cA)^+ cD),   F = Z'D

r: residuals; D, A: their derivatives by the fast coordinates f, inertia and delay, and by the others o, each row times the root
of its weight; ^+: least squares; c: 1 for samples that are clear of reversals, else 0. The fast coordinates are estimated with
the instruments Z, the others by all samples (R. Davidson & J. MacKinnon, Estimation and Inference in Econometrics, 1993, Sec.
7.4). At a reversal friction jumps, and the acceleration with it; of that jump the low pass of the motion takes most, as far as
`REACH` over its cutoff. With those samples, a torque without delay looks early, and the inertia small. Where the clear ones do
not determine f, c = 1.

    S = mean of E'cE,     g = mean of E'c e

E, e: what rounding adds to D and r, by draws (W. Fuller, Measurement Error Models, 1987, Sec. 1.2). The motion is rounded once
more at a random phase and low-passed; E has its acceleration for the inertia, and minus the rate of change of e for the delay;
averaged and whitened like the residuals. Where viscous friction outweighs inertia, a delay is told apart from an inertia by the
jerk alone, of which rounding is a much larger share than of the acceleration: then a little less inertia looks like a torque that
is much too early. Where rounding is nearly all that a direction has, it is taken as `MOST` of it, so that the errors stay finite.

The errors are those of the derivatives A and A A^+ D + Z (I - F^-1 S), I the identity. The numbers stay where a change would be
more than the linear step may claim; then the errors have its square.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from backdrive.identification.dynamic.covariance import inverse
from backdrive.identification.dynamic.fit import NEAR, Fit, conclude
from backdrive.identification.dynamic.rounding import of_rounding
from backdrive.identification.dynamic.search import Search, SearchResult
from backdrive.identification.dynamic.stretch import near_reversals
from backdrive.identification.dynamic.torque import TorqueProblem
from backdrive.identification.signals import default_cutoff

FAST = "inertia", "delay"  # told by fast changes, to which the errors of the motion belong
REACH = 1.5  # distance from a reversal within which a low pass misleads, by its cutoff [-]
TOLD = 1e-4  # least share of what all rows tell of a fast direction that has to be clear of reversals [-]
FELT = 0.01  # share of what determines a direction below which rounding is not felt [-]
MOST = 0.9  # largest part of what determines a direction that is taken as noise [-]
LARGE = 0.3  # part of what determines the inertia that may be noise [-]
FARTHEST = 4.0  # largest change of a number besides inertia and delay, whose own change moves it too [standard error]
WORSE = 1.02  # largest cost of the rows that are clear, relative to that of the fit or of the linear step [-]
FLAT = 1e-14  # least curvature of a direction, relative to the largest [-]


def restore_inertia(
    fit: Fit,
    whiten: Callable[[np.ndarray], np.ndarray] | None = None,
    clear: np.ndarray | None = None,
) -> Fit | None:
    """Return a fit of torque with what the measured motion took from inertia and delay given back, and the errors that it leaves.

    Args:
        fit: to all samples that count, or to their whitened means.
        whiten: what its search did to the residuals, (..., m); None: nothing.
        clear: which of its residuals are clear of reversals, (n,); None: by the samples.

    Returns:
        The fit; the same where rounding is not felt and all samples are clear, where inertia or delay are at a bound or neither is
        fitted, and of an interrupted search; None if rounding determines the inertia to more than `LARGE`.
    """
    problem, found = fit.problem, fit.found
    if found.interrupted or not isinstance(problem, TorqueProblem) or not set(FAST).isdisjoint(fit.at_bound):
        return fit
    errors = np.array([fit.standard_errors[name] for name in problem.names])
    free = (found.point > problem.lower + NEAR) & (found.point < problem.upper - NEAR)
    free &= np.isfinite(found.jacobian).all(axis=0) & np.isfinite(errors) & (errors > 0.0)
    fast = free & np.isin(problem.names, FAST)
    clear = clear_of_reversals(fit, REACH) if clear is None else clear
    if not fast.any() or not (problem.count > 0.0 or not clear.all()):
        return fit
    root = np.sqrt(found.weight)[:, None]
    A, D = found.jacobian[:, free & ~fast] * root, found.jacobian[:, fast] * root
    r = found.residual[:, None] * root
    clear, Z = _instruments(A, D, clear)
    F = Z.T @ Z  # = Z'D
    size = np.sqrt(np.diag(F))
    value, vector = np.linalg.eigh(F / np.outer(size, size))
    ways = vector / np.sqrt(np.maximum(value, FLAT)) / size[:, None]  # the cost rises alike along each
    S, g = of_rounding(fit, whiten, fast, clear, lambda S: bool(_largest(ways, S) > 0.1 * FELT))
    share, turn = np.linalg.eigh(ways.T @ S @ ways)
    if share[-1] <= FELT and clear.all():
        return fit
    of_inertia = np.array(problem.names)[fast] == "inertia"
    if np.any(np.diag(S)[of_inertia] * np.sum(ways[of_inertia] ** 2, axis=1) > LARGE):
        return None
    ways = ways @ turn
    left = 1.0 - np.minimum(share, MOST)
    move, told = np.zeros_like(found.point), found.jacobian.copy()
    move[fast] = ways / left @ ways.T @ (g - (Z.T @ r)[:, 0])
    move[free & ~fast] = -_solve(A, r + D @ move[fast, None])[:, 0]
    told[:, fast] = (A @ _solve(A, D) + Z @ (ways * left) @ np.linalg.inv(ways)) / root
    end = _shift(fit, whiten, move, errors, clear)
    return conclude(problem, end, fit.loss, whiten, told, move if end is found else None)


def clear_of_reversals(fit: Fit, reach: float) -> np.ndarray:
    """Return which samples that count are farther from a reversal than a low pass reaches, (m,).

    Args:
        fit: of a `TorqueProblem`.
        reach: of the low pass, by its cutoff [-].
    """
    problem, late = fit.problem, fit.values.get("delay", 0.0)
    assert isinstance(problem, TorqueProblem)
    rows = []
    for s in problem.stretches:
        samples = math.ceil(reach / ((s.cutoff or default_cutoff(1.0 / s.dt)) * s.dt))
        rows.append(~near_reversals(s, samples, late / s.dt)[s.judged])
    return np.concatenate(rows)


def _instruments(A: np.ndarray, D: np.ndarray, clear: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows that tell the fast coordinates, (m,), and their instruments, 0 in others, (m, k).

    Args:
        A: derivatives by the other coordinates, (m, p).
        D: by the fast ones, (m, k).
        clear: rows that are clear of reversals, (m,). Where they tell too little, all rows do.
    """
    whole = D - A @ _solve(A, D)
    if clear.all():
        return clear, whole
    Z = np.zeros_like(D)
    Z[clear] = D[clear] - A[clear] @ _solve(A[clear], D[clear])
    size = np.linalg.norm(whole, axis=0)
    told = np.linalg.eigvals(
        np.linalg.solve(whole.T @ whole / np.outer(size, size), Z.T @ Z / np.outer(size, size))
    )
    return (clear, Z) if np.min(told.real) > TOLD else (np.ones_like(clear), whole)


def _largest(ways: np.ndarray, S: np.ndarray) -> float:
    """Return the largest share of S in what tells the fast coordinates [-]."""
    return float(np.linalg.eigvalsh(ways.T @ S @ ways)[-1])


def _solve(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return the least-squares solution of A x = B, (p, k); 0 for columns of A that are 0."""
    size, x = np.linalg.norm(A, axis=0), np.zeros((A.shape[1], B.shape[1]))
    there = size > 0.0
    if there.any():
        A, size = A[:, there], size[there]
        x[there] = inverse(A.T @ A / np.outer(size, size)) @ (A.T @ B / size[:, None]) / size[:, None]
    return x


def _shift(
    fit: Fit,
    whiten: Callable[[np.ndarray], np.ndarray] | None,
    move: np.ndarray,
    errors: np.ndarray,
    clear: np.ndarray,
) -> SearchResult:
    """Return the end of a search at another point; the same where that is too far, at a bound, or fits worse.

    Args:
        fit: whose search ended.
        whiten: what the search did to the residuals; None: nothing.
        move: of its point, (P,).
        errors: standard errors of the fit, (P,).
        clear: rows that tell inertia and delay, (m,).
    """
    problem, found = fit.problem, fit.found
    point, moves = found.point + move, move != 0.0
    low, high = problem.lower + NEAR, problem.upper - NEAR
    far = [
        abs(m * u.slope(fit.values[u.name])) > FARTHEST * e
        for m, u, e in zip(move, problem.unknowns, errors, strict=True)
        if m and u.name not in FAST
    ]
    if any(far) or np.any(moves & ((point <= low) | (point >= high))):
        return found
    search = Search(
        problem.residuals if whiten is None else lambda p: whiten(problem.residuals(p)),
        problem.lower,
        problem.upper,
        loss=fit.loss,
    )
    residual = search.evaluate(point[None])[0]
    sigma, linear = search.scale(found.residual), found.residual + found.jacobian[:, moves] @ move[moves]
    before, expected, cost = (search.cost(x[clear], sigma) for x in (found.residual, linear, residual))
    if not cost <= WORSE * max(before, expected):
        return found
    after = replace(search.at(point, residual), instants=found.instants, independent=found.independent)
    return replace(after, converged=found.converged, evaluations=found.evaluations + search.evaluations)
