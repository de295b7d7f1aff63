"""The search of a fit by forward dynamics. Its cost has steps and kinks, since a joint may stick in one trial and slide
in the next.

Forward differences are therefore wide at first and narrow at the end. Damped steps of several lengths are tried, and the
one with the lowest loss is accepted. Many starting points are screened before a few are optimised. All trials of all
starting points form one batch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from backdrive.identification.dynamic import stopping
from backdrive.identification.dynamic.search import CHUNK, Search, SearchResult, screen

WIDE, NARROW = 1.6e-2, 1.5e-3  # first and last width of the forward differences [search coordinate]
FINE = 1e-5  # width of the forward differences in the refinement of a smooth cost [search coordinate]
FACTORS = np.array([0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0])  # tried dampings, relative to the last one
LENGTHS = (1.0, 0.4)  # tried lengths of a damped step, relative to the full step [-]
FARTHEST = 2.0  # longest step [search coordinate]
GAIN = 2e-4  # relative decrease of the loss below which the differences become narrower [-]


@dataclass
class Descent:
    """The state of a descent from one starting point.

    Attributes:
        point: search coordinates, (P,).
        residual: at the point, (m,).
        cost: loss at the point.
        damping: of the last accepted step.
        wide: width of the forward differences [search coordinate].
        done: whether the descent has converged.
    """

    point: np.ndarray
    residual: np.ndarray
    cost: float
    damping: float = 1e-2
    wide: float = WIDE
    done: bool = False


class MotionSearch(Search):
    """Least squares or least absolute deviations by forward dynamics."""

    def evaluate(self, points: np.ndarray) -> np.ndarray:
        """Return the residuals of a batch, (B, m), computed in pieces of limited size."""
        first = super().evaluate(points[:1])
        piece = max(1, CHUNK // max(first.shape[1], 1))
        rest = [
            super(MotionSearch, self).evaluate(points[i : i + piece]) for i in range(1, len(points), piece)
        ]
        return np.concatenate([first, *rest])

    def begin(self, points: np.ndarray) -> list[Descent]:
        """Return the initial states of descents from given points."""
        points = np.clip(np.atleast_2d(points), self.lower, self.upper)
        residuals = self.evaluate(points)
        return [Descent(p, r, self.cost(r, self.scale(r))) for p, r in zip(points, residuals, strict=True)]

    def descend(
        self, ways: list[Descent], iterations: int, tick: Callable[[int, float], None] | None = None
    ) -> list[Descent]:
        """Advance all descents in parallel. After an interruption, each holds its best point so far.

        Args:
            ways: descents, advanced in place.
            iterations: largest number of iterations.
            tick: called with the iteration and the least loss.
        """
        for i in range(1, iterations + 1):
            under_way = [w for w in ways if not w.done and np.isfinite(w.cost)]
            if not under_way:
                break
            slopes = self.slopes(under_way)
            trials = [
                self.trials(
                    w.point, w.residual, J, self.scale(w.residual), FACTORS * w.damping, LENGTHS, FARTHEST
                )
                for w, J in zip(under_way, slopes, strict=True)
            ]
            ends = self.evaluate(np.concatenate([points for points, _ in trials]))
            place = 0
            for w, (points, dampings) in zip(under_way, trials, strict=True):
                self._take(w, points, ends[place : place + len(points)], dampings)
                place += len(points)
            if tick is not None:
                tick(i, min(w.cost for w in ways))
        return ways

    def _take(self, way: Descent, points, ends, dampings):
        costs = [self.cost(r, self.scale(way.residual)) for r in ends]
        best = int(np.argmin(costs))
        gain = way.cost - costs[best]
        if gain > 0.0:
            way.point, way.residual, way.cost = points[best], ends[best], costs[best]
            way.damping = max(dampings[best], 1e-8)
        else:
            way.damping = min(way.damping * 10.0, 1e6)
        if gain <= GAIN * way.cost:
            way.done = way.wide <= NARROW
            way.wide = min(way.wide, max(0.5 * way.wide, NARROW))

    def slopes(self, ways: list[Descent]) -> list[np.ndarray]:
        """Return the Jacobian of the residuals for each descent, (m, P), computed in one batch."""
        steps = [np.where(w.point + w.wide > self.upper, -w.wide, w.wide) for w in ways]
        moved = self.evaluate(
            np.concatenate([w.point + np.diag(s) for w, s in zip(ways, steps, strict=True)])
        )
        P = len(self.lower)
        return [
            ((moved[k * P : (k + 1) * P] - w.residual) / s[:, None]).T
            for k, (w, s) in enumerate(zip(ways, steps, strict=True))
        ]

    def result_of(self, ways: list[Descent], interrupted: bool) -> SearchResult:
        """Return the best end of the descents."""
        costs = [w.cost for w in ways]
        k = int(np.argmin(costs))
        best = Descent(ways[k].point, ways[k].residual, costs[k], wide=NARROW)
        return SearchResult(
            point=best.point,
            cost=best.cost,
            residual=best.residual,
            jacobian=self.slopes([best])[0],
            weight=self.weights(best.residual, self.scale(best.residual)),
            converged=ways[k].done,
            evaluations=self.evaluations,
            interrupted=interrupted,
        )


def seek(  # noqa: PLR0913  (arguments of `fit_motion`, passed on)
    search: MotionSearch,
    start: np.ndarray,
    boxes: tuple[np.ndarray, np.ndarray],
    *,
    begin: int = 256,
    descend: int = 6,
    finish: int = 2,
    short: int = 8,
    iterations: int = 20,
    polish: int = 0,
    refine: int = 0,
    seed: int = 0,
    tick: Callable[[str, int, float], None] | None = None,
) -> SearchResult:
    """Screen starting points, optimise a few for some iterations and the best of them further; return the best end.

    Args:
        search: residuals and loss to minimise.
        start: first starting point, (P,).
        boxes: lower and upper bounds within which starting points are drawn, (P,) each.
        begin: number of drawn starting points; below two, only `start` is optimised.
        descend: number of screened points that are optimised for a few iterations.
        finish: number of these that are optimised further.
        short: number of iterations of the first descents.
        iterations: largest number of iterations of the further descents.
        polish: generations of differential evolution around the best point, followed by another descent.
        refine: largest number of last iterations, with differences narrow enough for a smooth cost.
        seed: of the starting points and of the evolution.
        tick: called with the stage, the iteration and the least loss.
    """
    inform = (lambda stage: None) if tick is None else (lambda stage: lambda i, c: tick(stage, i, c))
    ways = search.begin(start)
    stopping.keep()
    try:
        if begin > 1:
            from scipy.stats import qmc

            count = max(1, round(np.log2(begin)))
            drawn = qmc.Sobol(len(start), rng=np.random.default_rng(seed)).random_base2(count)
            points = np.vstack([start, boxes[0] + (boxes[1] - boxes[0]) * drawn])
            ways += search.begin(screen(search, points, descend))
            search.descend(ways[1:], short, inform("short"))
            ways.sort(key=lambda w: w.cost)
            ways = ways[: max(1, finish)]
        search.descend(ways, iterations, inform("descent"))
        if polish:
            best = min(ways, key=lambda w: w.cost)
            ways.insert(0, evolve(search, best, boxes, polish, seed, inform("polish")))
            search.descend(ways[:1], max(1, iterations // 2), inform("last"))
        if refine:
            k = int(np.argmin([w.cost for w in ways]))
            ways[k].wide, ways[k].done = FINE, False
            search.descend([ways[k]], refine, inform("refined"))
        return search.result_of(ways, False)
    except KeyboardInterrupt:
        return search.result_of(ways, True)


def evolve(search, best, boxes, generations, seed, tick, *, population=24, spread=0.05) -> Descent:
    """Return the best point of differential evolution around a given one."""
    from scipy.optimize import differential_evolution

    rng = np.random.default_rng(seed)
    reach = spread * (boxes[1] - boxes[0])
    first = best.point + reach * rng.standard_normal((population, len(best.point)))
    first[0] = best.point
    sigma = search.scale(best.residual)
    ended = differential_evolution(
        lambda X: np.array([search.cost(r, sigma) for r in search.evaluate(X.T)]),
        list(zip(search.lower, search.upper, strict=True)),
        mutation=(0.4, 0.9),
        recombination=0.75,
        init=np.clip(first, search.lower, search.upper),
        maxiter=generations,
        tol=0.0,
        rng=rng,
        polish=False,
        vectorized=True,
        updating="deferred",
        callback=None
        if tick is None
        else lambda intermediate_result: tick(intermediate_result.nit, float(intermediate_result.fun)),
    )
    residual = search.evaluate(ended.x[None])[0]
    return Descent(ended.x, residual, search.cost(residual, sigma), wide=0.5 * WIDE)
