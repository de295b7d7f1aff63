"""Bounded least squares by the method of Levenberg and Marquardt, with residuals evaluated in batches.

The Jacobian is computed by forward differences in scaled coordinates, all columns in one batch. Several dampings are then
tried in another batch, and the best step is taken if it lowers the cost. A coordinate at its bound is held if descent points
outwards. A robust loss enters by weights (iteratively reweighted least squares).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification import robust
from backdrive.identification.dynamic import stopping

STEP = 1e-5  # step of the forward differences [search coordinate]
DAMPINGS = np.array([0.01, 0.1, 1.0, 10.0])  # tried dampings, relative to the last one
HUBER = 2.0  # residuals above this size count linearly [standard deviation]
CHUNK = 4_000_000  # largest number of residuals in one batch

#: Loss -> function from the magnitude of residuals [standard deviation] to the weight of each.
LOSSES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "linear": np.ones_like,
    "huber": lambda z: HUBER / np.maximum(z, HUBER),
    "absolute": lambda z: 1.0 / np.maximum(z, 0.3),
}


@dataclass(frozen=True, kw_only=True)
class SearchResult:
    """Where a search ended.

    Attributes:
        point: search coordinates, (P,).
        cost: sum of the loss over all residuals.
        residual: at the point, (m,).
        jacobian: derivatives of the residuals with respect to the search coordinates, (m, P).
        weight: of every residual at the point, (m,).
        converged: the last steps hardly lowered the cost.
        evaluations: number of evaluations of the model.
        interrupted: a person stopped the search; this is the best result so far.
        instants: index of the sample of each residual, (m,); None: as the problem has them.
        independent: share of the residuals that was independent before they were whitened [-].
    """

    point: np.ndarray
    cost: float
    residual: np.ndarray
    jacobian: np.ndarray
    weight: np.ndarray
    converged: bool
    evaluations: int
    interrupted: bool = False
    instants: np.ndarray | None = None
    independent: float = 1.0


class Search:
    """Least squares of `residuals(points (B, P)) -> (B, m)` between bounds.

    Args:
        residuals: function that returns the residuals of a batch of points, NaN for invalid points.
        lower: bounds of the search coordinates, (P,).
        upper: bounds of the search coordinates, (P,).
        loss: `linear`, `huber` or `absolute`.
        sigma: standard deviation of a residual, which scales the loss; None: from the residuals.
        step: of the forward differences [search coordinate].
    """

    def __init__(self, residuals, lower, upper, *, loss="huber", sigma=None, step=STEP):
        self.residuals, self.lower, self.upper = residuals, np.asarray(lower), np.asarray(upper)
        self.loss, self.sigma, self.step = loss, sigma, step
        self.evaluations = 0
        self.best: SearchResult | None = None
        self.stopped = False
        #: Starting point, or end of a converged search -> allowed iterations, tolerance, result.
        self.ended: dict[bytes, tuple[int, float, SearchResult]] = {}

    def evaluate(self, points: np.ndarray) -> np.ndarray:
        """Return the residuals of a batch, (B, m)."""
        stopping.check()
        self.evaluations += len(points)
        return self.residuals(points)

    def scale(self, residual: np.ndarray) -> float:
        """Return the standard deviation that scales the loss."""
        if self.sigma is not None:
            return self.sigma
        return max(robust.robust_spread(residual), 1e-300)

    def cost(self, residual: np.ndarray, sigma: float) -> float:
        """Return the loss of residuals [their unit squared; `absolute`: their unit]; infinite if one is not finite."""
        if not np.all(np.isfinite(residual)):
            return np.inf
        if self.loss == "linear":
            return float(residual @ residual)
        if self.loss == "absolute":
            return float(np.abs(residual).sum())
        return float(robust.huber_loss(np.abs(residual) / sigma, HUBER).sum()) * sigma**2

    def weights(self, residual: np.ndarray, sigma: float) -> np.ndarray:
        """Return the weights of reweighted least squares, (m,)."""
        return LOSSES[self.loss](np.abs(residual) / sigma)

    def jacobian(self, point: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Return the Jacobian, (m, P), at a point, (P,), with its residual, (m,)."""
        steps = np.where(point + self.step > self.upper, -self.step, self.step)
        return np.ascontiguousarray(((self.evaluate(point + np.diag(steps)) - residual) / steps[:, None]).T)

    def at(self, point: np.ndarray, residual: np.ndarray) -> SearchResult:
        """Return the result of a search that converges at a point, (P,), with its residual, (m,)."""
        sigma = self.scale(residual)
        return SearchResult(
            point=point,
            cost=self.cost(residual, sigma),
            residual=residual,
            jacobian=self.jacobian(point, residual),
            weight=self.weights(residual, sigma),
            converged=True,
            evaluations=self.evaluations,
        )

    def run(  # noqa: PLR0912  (one loop of a search: propose, test, accept, stop)
        self,
        start: np.ndarray,
        *,
        iterations: int = 40,
        tolerance: float = 1e-8,
        tick: Callable[[int, float], None] | None = None,
    ) -> SearchResult:
        """Minimise the loss from a starting point and return the end.

        Args:
            start: search coordinates, (P,).
            iterations: largest number of iterations.
            tolerance: relative decrease of the cost below which the search is converged.
            tick: called with the iteration and the cost.

        A search is not repeated from a point at which an earlier one of no wider tolerance started or converged. After an
        interruption, this and all later searches return the best result so far. If there is no result yet, it is raised.
        """
        if self.stopped and self.best is not None:
            return replace(self.best, interrupted=True)
        point = np.clip(start, self.lower, self.upper)
        key = point.tobytes()
        allowed, close, before = self.ended.get(key, (-1, np.inf, None))
        if before is not None and close <= tolerance and (before.converged or iterations <= allowed):
            if tick is not None:
                tick(0, before.cost)
            return before
        try:
            residual = self.evaluate(point[None])[0]
        except KeyboardInterrupt:
            self.stopped = True
            if self.best is None:
                raise
            return replace(self.best, interrupted=True)
        stopping.keep()
        cost, damping, still = self.cost(residual, self.scale(residual)), 1e-2, 0
        interrupted = False
        try:
            for done in range(1, iterations + 1):
                if still == 2 or not np.isfinite(cost):
                    break
                sigma = self.scale(residual)
                cost = self.cost(residual, sigma)
                J = self.jacobian(point, residual)
                trials, dampings = self.trials(point, residual, J, sigma, DAMPINGS * damping)
                ends = self.evaluate(trials)
                costs = [self.cost(r, sigma) for r in ends]
                best = int(np.argmin(costs))
                if costs[best] < cost:
                    still = still + 1 if cost - costs[best] <= tolerance * cost else 0
                    point, residual, cost = trials[best], ends[best].copy(), costs[best]
                    damping = float(np.clip(dampings[best], 1e-12, 1e8))
                else:
                    damping = min(damping * 100.0, 1e8)
                    still += 1
                if tick is not None:
                    tick(done, cost)
        except KeyboardInterrupt:
            interrupted = self.stopped = True
        try:
            found = self.at(point, residual)
        except KeyboardInterrupt:
            interrupted = self.stopped = True
            found = self.at(point, residual)
        found = replace(found, converged=still == 2, interrupted=interrupted)
        if self.best is None or found.cost < self.best.cost:
            self.best = found
        if interrupted:
            return replace(self.best, interrupted=True)
        self.ended[key] = (iterations, tolerance, found)
        if found.converged:
            self.ended[found.point.tobytes()] = (iterations, tolerance, found)
        return found

    def trials(
        self,
        point: np.ndarray,
        residual: np.ndarray,
        jacobian: np.ndarray,
        sigma: float,
        dampings: np.ndarray,
        lengths: tuple[float, ...] = (1.0,),
        farthest: float = 3.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of damped steps, (T, P), and their dampings, (T,); the ends lie within the bounds.

        Args:
            point: search coordinates, (P,).
            residual: at the point, (m,).
            jacobian: at the point, (m, P).
            sigma: standard deviation that scales the loss.
            dampings: tried dampings.
            lengths: tried lengths of each step, relative to the full step [-].
            farthest: largest change of a coordinate in a full step [search coordinate].
        """
        w = self.weights(residual, sigma)
        usable = np.isfinite(jacobian).all(axis=0)
        J = jacobian if usable.all() else np.where(usable, jacobian, 0.0)
        gradient = J.T @ (w * residual)
        normal = J.T @ (w[:, None] * J)
        free = usable & ~(((point <= self.lower) & (gradient > 0)) | ((point >= self.upper) & (gradient < 0)))
        size = np.sqrt(np.maximum(np.diag(normal), 1e-30))
        ends = []
        value, vector = np.linalg.eigh(normal[np.ix_(free, free)] / np.outer(size[free], size[free]))
        along, directions = vector.T @ (gradient[free] / size[free]), vector / size[free][:, None]
        for damping in dampings:
            move, stiff = np.zeros_like(point), value + damping
            if stiff.size:
                told = stiff > stiff.size * np.finfo(float).eps * stiff[-1]
                move[free] = -directions[:, told] @ (along[told] / stiff[told])
            move = np.clip(move, -farthest, farthest)
            ends += [np.clip(point + length * move, self.lower, self.upper) for length in lengths]
        return np.array(ends), np.repeat(dampings, len(lengths))


def screen(search: Search, points: np.ndarray, keep: int) -> np.ndarray:
    """Return at most `keep` points of lowest cost that lie apart from each other, best first, (keep, P)."""
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
