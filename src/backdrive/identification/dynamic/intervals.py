"""95 % intervals of what a fit found: from its covariance, from profiles of its cost, or from windows drawn again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, get_args

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.search import Found, Search
from backdrive.identification.dynamic.uncertainty import bootstrap, inverse, profile
from backdrive.identification.options import Interval

METHODS: tuple[str, ...] = get_args(Interval)
REACH = 1.96  # standard errors of a 95 % interval
STEPS = 8  # of the search that fits all others again, per point of a profile


def intervals(
    problem: Any,
    found: Found,
    errors: Mapping[str, float],
    method: Interval = "covariance",
    *,
    loss: str = "huber",
    step: float = 1e-5,
    seed: int = 0,
    tick: Callable[[str], None] | None = None,
) -> tuple[dict[str, tuple[float, float]], bool]:
    """Return the 95 % interval of every number that was sought [SI], within its range; all of that where a number has no error.

    The second thing returned is False where a person interrupted profiles: the rest have the interval of the covariance.

    Args:
        problem: what was fitted: `unknowns`, `lower`, `upper` and `residuals`.
        found: where the search ended.
        errors: standard errors by name [SI].
        method: `covariance`: a normal distribution in the search coordinate, lopsided for what is sought in its logarithm;
            `profile`: how far the number can be held off its best value before all others can no longer make up for it,
            scaled so that correlated residuals count as in the covariance; `bootstrap`: windows of time drawn with
            replacement.
        loss: of the fit.
        step: of the forward differences of a profile, in search coordinates.
        seed: of the bootstrap.
        tick: called with the name before the profile of each number.

    Raises:
        UnknownName: no such method.
        InvalidInput: a profile of absolute deviations, whose rise says nothing about an error.
    """
    check(method, loss)
    unknowns, point = problem.unknowns, found.point
    root = np.array(
        [errors[u.name] / u.slope(float(u.outward(x))) for u, x in zip(unknowns, point)], dtype=float
    )
    free = np.isfinite(root) & (root > 0.0)
    if method == "bootstrap" and free.any():
        root[free] = bootstrap(found.jacobian, found.residual, found.weight, free, seed=seed)[free]
    result, done = {}, True
    for i, u in enumerate(unknowns):
        if not free[i]:
            ends = np.array([problem.lower[i], problem.upper[i]])
        else:
            ends = point[i] + REACH * root[i] * np.array([-1.0, 1.0])
        if free[i] and method == "profile" and done:
            if tick is not None:
                tick(u.name)
            try:
                ends = np.array(_profiled(problem, found, i, free, float(root[i]), loss, step))
            except KeyboardInterrupt:
                done = False
        ends = np.clip(ends, problem.lower[i], problem.upper[i])
        low, high = (float(u.outward(e)) for e in ends)
        result[u.name] = (low, high)
    return result, done


def check(method: str, loss: str) -> None:
    """Refuse a kind of interval that there is not, or not with this loss.

    Raises:
        UnknownName: no such method.
        InvalidInput: a profile of absolute deviations.
    """
    lookup(method, dict.fromkeys(METHODS, 0), "kind of interval")
    if method == "profile" and loss == "absolute":
        raise InvalidInput(
            "A profile needs squares, and the loss is 'absolute'.", remedy="Ask for bootstrap intervals."
        )


def _profiled(
    problem: Any, found: Found, i: int, free: np.ndarray, error: float, loss: str, step: float
) -> tuple[float, float]:
    """Return the profile interval of one search coordinate."""
    others = np.arange(len(found.point)) != i
    J = found.jacobian[:, free]
    size = np.linalg.norm(J, axis=0)
    J = J / size
    at = int(np.flatnonzero(np.flatnonzero(free) == i)[0])
    bread = inverse(J.T @ (found.weight[:, None] * J))[at, at] / size[at] ** 2
    sigma = max(1.4826 * float(np.median(np.abs(found.residual))), 1e-300)
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
