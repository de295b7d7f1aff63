"""Uncertainty of a fit: a covariance valid for noise correlated in time, and 95 % intervals by three methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.identification import regression
from backdrive.identification.dynamic.search import Search, SearchResult
from backdrive.identification.options import Interval

BLOCKS = 60  # number of blocks of time whose scores are taken as independent
UNSEEN = 1e4  # standard error above which a parameter counts as without effect on the residuals [search coordinate]
RISE = 1.96  # square root of the cost's rise at the ends of a 95 % profile interval [standard deviation]
CLOSE = 0.003  # relative tolerance of `RISE` at the ends of a profile interval [-]
WEAK = 0.10  # relative standard error above which a parameter counts as not identifiable [-]


METHODS: tuple[str, ...] = get_args(Interval)
STEPS = 8  # largest number of iterations of the refit at each point of a profile


@dataclass(frozen=True, kw_only=True, eq=False)
class Covariance:
    """Covariance of the search coordinates.

    Attributes:
        matrix: (P, P); NaN for coordinates at a bound, infinite for coordinates without effect on the residuals.
        correlation: between them, (P, P).
    """

    matrix: np.ndarray
    correlation: np.ndarray


def search_covariance(
    jacobian: np.ndarray,
    residual: np.ndarray,
    weight: np.ndarray,
    free: np.ndarray,
    edges: Sequence[int] = (),
    inputs: np.ndarray | None = None,
) -> Covariance:
    """Return the covariance of a weighted least-squares fit.

    The scores are summed over blocks of time before they are squared. Residuals that keep their sign for a while (encoder
    steps, effects not in the law) thus count as one error. No variance is smaller than that for independent residuals and
    errors of the motion.

    Args:
        jacobian: derivatives of the residuals with respect to the search coordinates, (m, P).
        residual: (m,).
        weight: of the residuals, (m,).
        free: coordinates that are not at a bound, (P,).
        edges: index in the residuals at which each record ends.
        inputs: changes of the residuals by random errors of the motion, one draw per row, (D, m).
    """
    m, P = jacobian.shape
    matrix, correlation = np.full((P, P), np.nan), np.eye(P)
    result = Covariance(matrix=matrix, correlation=correlation)
    if m <= free.sum():
        return result
    variance = float((weight * residual) @ residual) / max(m - int(free.sum()), 1)
    length = np.linalg.norm(np.where(np.isfinite(jacobian), jacobian, 0.0), axis=0)
    seen = free & (length * UNSEEN > np.sqrt(variance)) & np.isfinite(jacobian).all(axis=0)
    matrix[free & ~seen, free & ~seen] = np.inf
    if not seen.any():
        return result
    size = length[seen]
    J = jacobian[:, seen] / size
    bread = inverse(J.T @ (weight[:, None] * J))
    scores = J * (weight * residual)[:, None]
    bounds = sorted({0, m, *edges})
    parts = []
    for a, b in zip(bounds, bounds[1:], strict=False):
        count = max(1, round(BLOCKS * (b - a) / m))
        cuts = np.unique(np.linspace(a, b, count + 1).astype(int))
        parts.append(np.add.reduceat(scores, cuts[:-1], axis=0))
    plain = variance * bread
    sandwich = regression.cluster_covariance(bread, np.concatenate(parts))
    if inputs is not None and len(inputs):
        moves = (inputs * weight) @ J @ bread
        plain = plain + moves.T @ moves / len(inputs)
    root = np.sqrt(np.maximum(np.diag(plain), 1e-300))
    grown = np.sqrt(np.maximum(np.diag(sandwich) / root**2, 1.0))
    at = np.ix_(seen, seen)
    matrix[at] = plain * np.outer(grown, grown) / np.outer(size, size)
    correlation[at] = plain / np.outer(root, root)
    return result


def inverse(gram: np.ndarray) -> np.ndarray:
    """Return the inverse of a Gram matrix; directions that the data do not determine get a large, finite variance.

    Args:
        gram: symmetric, with a diagonal of the order of 1, (P, P).
    """
    value, vector = np.linalg.eigh(gram)
    value = np.maximum(value, 1e-14 * value.max())
    return (vector / value) @ vector.T


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
    sigma = max(regression.robust_spread(found.residual), 1e-300)
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
