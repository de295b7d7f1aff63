"""Uncertainty of a fit: 95 % intervals by three methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, get_args

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.identification import robust
from backdrive.identification.dynamic.covariance import BLOCKS, inverse
from backdrive.identification.dynamic.search import Search, SearchResult
from backdrive.identification.options import Interval

RISE = 1.96  # square root of the cost's rise at the ends of a 95 % profile interval [standard deviation]
CLOSE = 0.003  # relative tolerance of `RISE` at the ends of a profile interval [-]
WEAK = 0.10  # relative standard error above which a parameter counts as not identifiable [-]


METHODS: tuple[str, ...] = get_args(Interval)
STEPS = 8  # largest number of iterations of the refit at each point of a profile


def profile(
    best: float,
    cost: Callable[[float], float],
    least: float,
    variance: float,
    error: float,
    lower: float,
    upper: float,
) -> tuple[float, float]:
    """Return the 95 % profile interval of one search coordinate.

    Args:
        best: coordinate with the least cost.
        cost: function from the coordinate to the cost, with all other coordinates refitted.
        least: the cost at `best`.
        variance: of a residual, scaled for correlation.
        error: standard error of the coordinate, which sets the first step.
        lower: bound of the coordinate.
        upper: bound of the coordinate.

    Returns:
        Coordinates at which the cost has risen by 1.96^2 variances, below and above; a bound if it never does.
    """
    from scipy.optimize import brentq

    risen = {best: -RISE}

    def rise(at: float) -> float:
        if at not in risen:
            risen[at] = float(np.sqrt(max(cost(at) - least, 0.0) / variance)) - RISE
        return 0.0 if abs(risen[at]) < CLOSE * RISE else risen[at]

    ends = []
    for way, bound in ((-1.0, lower), (1.0, upper)):
        inside = at = best
        step = RISE * max(error, 1e-9)
        for _ in range(12):
            inside, at = at, float(np.clip(at + way * step, lower, upper))
            if rise(at) >= 0.0 or at == bound:
                break
            step *= 1.6
        root = rise(at) >= 0.0  # nearly linear between `inside` and `at`
        ends.append(float(brentq(rise, inside, at, xtol=1e-3 * step)) if root else bound)  # type: ignore[arg-type]
    return ends[0], ends[1]


def bootstrap(
    jacobian: np.ndarray,
    residual: np.ndarray,
    weight: np.ndarray,
    free: np.ndarray,
    *,
    draws: int = 200,
    windows: int = BLOCKS,
    seed: int = 0,
) -> np.ndarray:
    """Return standard errors of the search coordinates from windows drawn with replacement, (P,).

    For each draw, the coordinates take one Gauss-Newton step from the fit. This is exact if the model is linear within the
    errors.

    Args:
        jacobian: derivatives of the residuals with respect to the search coordinates, (m, P).
        residual: (m,).
        weight: of the residuals, (m,).
        free: coordinates that are not at a bound, (P,).
        draws: number of draws.
        windows: number of windows of the residuals.
        seed: of the draws.
    """
    m = len(residual)
    J = jacobian[:, free]
    cuts = np.unique(np.linspace(0, m, windows + 1).astype(int))
    grams = np.array([J[a:b].T @ (weight[a:b, None] * J[a:b]) for a, b in zip(cuts, cuts[1:], strict=False)])
    moments = np.array(
        [J[a:b].T @ (weight[a:b] * residual[a:b]) for a, b in zip(cuts, cuts[1:], strict=False)]
    )
    rng = np.random.default_rng(seed)
    moves = np.empty((draws, J.shape[1]))
    for i in range(draws):
        drawn = rng.integers(0, len(grams), len(grams))
        moves[i] = -np.linalg.lstsq(grams[drawn].sum(axis=0), moments[drawn].sum(axis=0), rcond=1e-10)[0]
    errors = np.full(jacobian.shape[1], np.nan)
    errors[free] = moves.std(axis=0, ddof=1)
    return errors


def intervals(
    problem: Any,
    found: SearchResult,
    errors: Mapping[str, float],
    method: Interval = "covariance",
    *,
    loss: str = "huber",
    step: float = 1e-5,
    seed: int = 0,
    tick: Callable[[str], None] | None = None,
) -> tuple[dict[str, tuple[float, float]], bool]:
    """Return the 95 % interval of every estimated parameter within its range [SI]; the whole range if it has no error.

    The second value is False if a person interrupted the profiles. The remaining parameters then have the interval of the
    covariance.

    Args:
        problem: the fitted problem, with `unknowns`, `lower`, `upper` and `residuals`.
        found: end of the search.
        errors: standard errors by name [SI].
        method: `covariance`: a normal distribution in the search coordinate, asymmetric for a logarithmic coordinate;
            `profile`: values of the parameter for which the cost, with all others refitted, stays below a limit scaled for
            correlated residuals; `bootstrap`: windows of time drawn with replacement.
        loss: of the fit.
        step: of the forward differences of a profile [search coordinate].
        seed: of the bootstrap.
        tick: called with the name of each parameter before its profile.

    Raises:
        UnknownName: no such method.
        InvalidInput: a profile of absolute deviations, whose rise does not determine an error.
    """
    check_interval(method, loss)
    unknowns, point = problem.unknowns, found.point
    root = np.array(
        [errors[u.name] / u.slope(float(u.outward(x))) for u, x in zip(unknowns, point, strict=True)],
        dtype=float,
    )
    free = np.isfinite(root) & (root > 0.0)
    if method == "bootstrap" and free.any():
        root[free] = bootstrap(found.jacobian, found.residual, found.weight, free, seed=seed)[free]
    result, done = {}, True
    for i, u in enumerate(unknowns):
        if not free[i]:
            ends = np.array([problem.lower[i], problem.upper[i]])
        else:
            ends = point[i] + RISE * root[i] * np.array([-1.0, 1.0])
        if free[i] and method == "profile" and done:
            if tick is not None:
                tick(u.name)
            try:
                ends = np.array(_profile_interval(problem, found, i, free, float(root[i]), loss, step))
            except KeyboardInterrupt:
                done = False
        ends = np.clip(ends, problem.lower[i], problem.upper[i])
        low, high = (float(u.outward(e)) for e in ends)
        result[u.name] = (low, high)
    return result, done


def check_interval(method: str, loss: str) -> None:
    """Refuse an unknown kind of interval, or one that does not exist for this loss.

    Raises:
        UnknownName: no such method.
        InvalidInput: a profile of absolute deviations.
    """
    lookup(method, dict.fromkeys(METHODS, 0), "kind of interval")
    if method == "profile" and loss == "absolute":
        raise InvalidInput(
            "Profile intervals need a sum of squares, but the loss is 'absolute'.",
            remedy="Ask for bootstrap intervals.",
        )


def _profile_interval(
    problem: Any, found: SearchResult, i: int, free: np.ndarray, error: float, loss: str, step: float
) -> tuple[float, float]:
    """Return the profile interval of one search coordinate."""
    others = np.arange(len(found.point)) != i
    J = found.jacobian[:, free]
    size = np.linalg.norm(J, axis=0)
    J = J / size
    at = int(np.flatnonzero(np.flatnonzero(free) == i)[0])
    bread = inverse(J.T @ (found.weight[:, None] * J))[at, at] / size[at] ** 2
    sigma = max(robust.robust_spread(found.residual), 1e-300)
    start = found.point[others]
    whole = Search(None, problem.lower, problem.upper, loss=loss, sigma=sigma)
    least = whole.cost(found.residual, sigma)

    def cost(held: float) -> float:
        def residuals(points: np.ndarray) -> np.ndarray:
            return problem.residuals(np.insert(points, i, held, axis=1))

        search = Search(
            residuals, problem.lower[others], problem.upper[others], loss=loss, sigma=sigma, step=step
        )
        ended = search.run(start, iterations=STEPS, tolerance=1e-6)
        if ended.interrupted:
            raise KeyboardInterrupt
        return ended.cost

    return profile(
        float(found.point[i]),
        cost,
        least,
        error**2 / bread,
        error,
        float(problem.lower[i]),
        float(problem.upper[i]),
    )
