"""Bounded least squares from many starts at once: every trial of a step is one compiled call over all of them.

Levenberg and Marquardt's method in scaled coordinates. The Jacobian is by forward differences, all columns of all starts in
one batch; then several dampings are tried in one batch, and the best is taken if it lowers the cost. A coordinate at its
bound whose gradient points outwards is held. A robust loss enters by weights (iteratively reweighted least squares).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification.dynamic import stopping

STEP = 1e-5  # of the forward differences, in scaled coordinates
DAMPINGS = np.array([0.01, 0.1, 1.0, 10.0])  # tried in one batch, times the damping of the step before
HUBER = 2.0  # residuals beyond so many standard deviations count linearly
CHUNK = 4_000_000  # residuals of one batch at most

#: Loss -> (cost per residual, weight) of the residual in standard deviations.
LOSSES: dict[str, Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]] = {
    "linear": lambda z: (z**2, np.ones_like(z)),
    "huber": lambda z: (
        np.where(z <= HUBER, z**2, 2 * HUBER * z - HUBER**2),
        np.where(z <= HUBER, 1.0, HUBER / np.maximum(z, HUBER)),
    ),
    "absolute": lambda z: (2 * z, 1.0 / np.maximum(z, 0.3)),
}


@dataclass(frozen=True, kw_only=True)
class Found:
    """Where a search ended.

    Attributes:
        point: search coordinates, (P,).
        cost: sum of the loss over all residuals.
        residual: at the point, (m,).
        jacobian: of the residual by the search coordinates, (m, P).
        weight: of every residual in the last step, (m,).
        converged: the last steps no longer lowered the cost.
        evaluations: of the model.
        interrupted: a person stopped it; this is the best so far.
        others: costs that the other starts ended with.
    """

    point: np.ndarray
    cost: float
    residual: np.ndarray
    jacobian: np.ndarray
    weight: np.ndarray
    converged: bool
    evaluations: int
    interrupted: bool = False
    others: tuple[float, ...] = ()


class Search:
    """Least squares of `residuals(points (B, P)) -> (B, m)` between bounds.

    Args:
        residuals: of a batch of points; NaN where a point makes no sense.
        lower: bounds of the search coordinates, (P,).
        upper: bounds of the search coordinates, (P,).
        loss: `linear`, `huber` or `absolute`.
        sigma: standard deviation of a residual, by which the loss judges what is large; None: from the residuals.
        step: of the forward differences.
    """

    def __init__(self, residuals, lower, upper, *, loss="huber", sigma=None, step=STEP):
        self.residuals, self.lower, self.upper = residuals, np.asarray(lower), np.asarray(upper)
        self.loss, self.sigma, self.step = loss, sigma, step
        self.evaluations = 0
        self.best: Found | None = None
        self.stopped = False
        self.ended: dict[
            bytes, tuple[int, Found]
        ] = {}  # start, or end where one came to rest -> iterations, end

    def evaluate(self, points: np.ndarray) -> np.ndarray:
        """Return the residuals of a batch, (B, m)."""
        stopping.check()
        self.evaluations += len(points)
        return self.residuals(points)

    def scale(self, residual: np.ndarray) -> float:
        """Return the standard deviation that the loss counts in."""
        if self.sigma is not None:
            return self.sigma
        return max(1.4826 * float(np.median(np.abs(residual))), 1e-300)

    def cost(self, residual: np.ndarray, sigma: float) -> float:
        """Return the loss of residuals [their unit squared]; infinite where one is not finite."""
        if not np.all(np.isfinite(residual)):
            return np.inf
        if self.loss == "linear":
            return float(residual @ residual)
        if self.loss == "absolute":
            return float(np.abs(residual).sum())
        return float(LOSSES[self.loss](np.abs(residual) / sigma)[0].sum()) * sigma**2

    def weights(self, residual: np.ndarray, sigma: float) -> np.ndarray:
        """Return the weights of reweighted least squares, (m,)."""
        return LOSSES[self.loss](np.abs(residual) / sigma)[1]

    def jacobian(self, points: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Return the Jacobians of a batch whose residuals are `at`, (K, m, P)."""
        K, P = points.shape
        backwards = points + self.step > self.upper
        steps = np.where(backwards, -self.step, self.step)
        J = np.empty((K, at.shape[1], P))
        for k in range(K):
            moved = points[k] + np.diag(steps[k])
            J[k] = ((self.evaluate(moved) - at[k]) / steps[k][:, None]).T
        return J

    def run(
        self,
        starts: np.ndarray,
        *,
        iterations: int = 40,
        tolerance: float = 1e-8,
        tick: Callable[[int, float], None] | None = None,
    ) -> Found:
        """Descend from every start and return the best end.

        Args:
            starts: search coordinates, (K, P).
            iterations: at most.
            tolerance: relative fall of the cost below which a start is done.
            tick: called with the iteration and the best cost.

        From where a search has started or come to rest before, none is made again. An interruption ends this search and later
        ones with the best that any of them found; before there is one, it passes on.
        """
        if self.stopped and self.best is not None:
            return replace(self.best, interrupted=True)
        points = np.clip(np.atleast_2d(starts), self.lower, self.upper)
        key = points.tobytes()
        allowed, before = self.ended.get(key, (-1, None))
        if before is not None and (before.converged or iterations <= allowed):
            if tick is not None:
                tick(0, before.cost)
            return before
        try:
            at = self.evaluate(points)
        except KeyboardInterrupt:
            self.stopped = True
            if self.best is None:
                raise
            return replace(self.best, interrupted=True)
        stopping.keep()
        sigma = [self.scale(r) if np.all(np.isfinite(r)) else 1.0 for r in at]
        costs = np.array([self.cost(r, s) for r, s in zip(at, sigma)])
        damping, still = np.full(len(points), 1e-2), np.zeros(len(points), dtype=int)
        interrupted, done = False, 0
        try:
            for done in range(1, iterations + 1):
                for k in np.nonzero((still < 2) & np.isfinite(costs))[0]:
                    s = sigma[k] = self.scale(at[k])
                    costs[k] = self.cost(at[k], s)
                    J = self.jacobian(points[k : k + 1], at[k : k + 1])[0]
                    trials, dampings = self._trials(points[k], at[k], J, s, damping[k])
                    ends = self.evaluate(trials)
                    ended = [self.cost(r, s) for r in ends]
                    best = int(np.argmin(ended))
                    if ended[best] < costs[k]:
                        still[k] = still[k] + 1 if costs[k] - ended[best] <= tolerance * costs[k] else 0
                        points[k], at[k], costs[k] = trials[best], ends[best], ended[best]
                        damping[k] = np.clip(dampings[best], 1e-12, 1e8)
                    else:
                        damping[k] = min(damping[k] * 100.0, 1e8)
                        still[k] += 1
                if tick is not None:
                    tick(done, float(np.min(costs)))
                if np.all((still >= 2) | ~np.isfinite(costs)):
                    break
        except KeyboardInterrupt:
            interrupted = self.stopped = True
        common = min((self.scale(r) for r in at if np.all(np.isfinite(r))), default=1.0)
        costs = np.array([self.cost(r, common) for r in at])
        k = int(np.argmin(costs))
        try:
            J = self.jacobian(points[k : k + 1], at[k : k + 1])[0]
        except KeyboardInterrupt:
            interrupted = self.stopped = True
            J = self.jacobian(points[k : k + 1], at[k : k + 1])[0]
        found = Found(
            point=points[k],
            cost=float(costs[k]),
            residual=at[k],
            jacobian=J,
            weight=self.weights(at[k], self.scale(at[k])),
            converged=bool(still[k] >= 2),
            evaluations=self.evaluations,
            interrupted=interrupted,
            others=tuple(float(c) for i, c in enumerate(costs) if i != k),
        )
        if self.best is None or found.cost < self.best.cost:
            self.best = found
        if interrupted:
            return replace(self.best, interrupted=True)
        self.ended[key] = (iterations, found)
        if found.converged:
            self.ended[found.point[None].tobytes()] = (iterations, found)
        return found

    def _trials(self, point, residual, J, sigma, damping):
        """Return the ends of damped steps, bounds held where the descent would leave them."""
        w = self.weights(residual, sigma)
        usable = np.isfinite(J).all(axis=0)
        J = np.where(usable, J, 0.0)
        gradient = J.T @ (w * residual)
        normal = J.T @ (w[:, None] * J)
        free = usable & ~(((point <= self.lower) & (gradient > 0)) | ((point >= self.upper) & (gradient < 0)))
        size = np.sqrt(np.maximum(np.diag(normal), 1e-30))
        trials, dampings = [], DAMPINGS * damping
        for d in dampings:
            move = np.zeros_like(point)
            if free.any():
                A = normal[np.ix_(free, free)] / np.outer(size[free], size[free])
                A[np.diag_indices_from(A)] += d
                move[free] = -np.linalg.lstsq(A, gradient[free] / size[free], rcond=None)[0] / size[free]
            trials.append(np.clip(point + np.clip(move, -3.0, 3.0), self.lower, self.upper))
        return np.array(trials), dampings


def screen(search: Search, points: np.ndarray, keep: int) -> np.ndarray:
    """Return the `keep` points of lowest cost that are not next to each other, best first, (keep, P)."""
    costs = np.full(len(points), np.inf)
    size = None
    i = 0
    while i < len(points):
        batch = points[i : i + (64 if size is None else max(1, CHUNK // size))]
        residuals = search.evaluate(batch)
        size = residuals.shape[1]
        costs[i : i + len(batch)] = [
            search.cost(r, search.scale(r)) if np.isfinite(r).all() else np.inf for r in residuals
        ]
        i += len(batch)
    chosen: list[int] = []
    spread = np.maximum(np.ptp(points, axis=0), 1e-9)
    for k in np.argsort(costs, kind="stable"):
        apart = [np.abs((points[k] - points[c]) / spread).max() for c in chosen]
        if np.isfinite(costs[k]) and all(a > 0.05 for a in apart):
            chosen.append(int(k))
        if len(chosen) == keep:
            break
    return points[chosen] if chosen else points[:1]
