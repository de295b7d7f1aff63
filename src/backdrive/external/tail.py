"""The rate at which a score exceeds a level that it has seldom or never reached, by the peaks-over-threshold method.

Above a high level u, there are lambda clusters a second, and their peaks have a generalised Pareto distribution (Pickands,
Annals of Statistics 3, 1975; Davison & Smith, J. R. Statist. Soc. B 52, 1990):

    rate(x) = lambda (1 + xi (x - u)/sigma)^(-1/xi)

xi > 0 is a heavy tail. The posterior of xi and sigma is computed on a grid. The prior is flat in log sigma and 0.2 +- 0.2 for
xi; lambda has Jeffreys' prior. The level of a rate is that with this EXPECTED rate, averaged over the posterior. So few peaks
give a higher level.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import gamma

from backdrive.errors import NotIdentifiable

FEWEST = 10  # clusters that a tail is fitted to
ENOUGH = 100  # number of clusters that the highest threshold should leave
SHARES = (0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995)  # of the samples below the threshold
SHAPES = np.linspace(-0.5, 1.0, 61)
SCALES = np.geomspace(0.1, 10.0, 81)  # by the mean excess [-]
USUAL, SPREAD = 0.2, 0.2  # shape beforehand
EXCESSES = np.r_[0.0, np.geomspace(1e-3, 1e6, 500)]  # at which a rate is looked up, by the mean scale [-]
LIKELY = 1e-6  # weight relative to the largest below which a point of the posterior is left out [-]
ENDS = (0.05, 0.95)  # of an interval
RATES = np.array([0.1, 0.3, 0.5, 0.7, 0.9])  # quantiles of lambda


@dataclass(frozen=True, kw_only=True, eq=False)
class Tail:
    """The tail of a score.

    Attributes:
        start: u, where it begins [unit of the score].
        peaks: number of clusters beyond.
        highest: of the peaks [unit of the score].
        exposure: time in which they came [s].
        scale: sigma of each point of the grid [unit of the score], (k,).
        shape: xi, (k,).
        weight: posterior, (k,).
    """

    start: float
    peaks: int
    highest: float
    exposure: float
    scale: np.ndarray
    shape: np.ndarray
    weight: np.ndarray

    def rate(self, level: float) -> float:
        """Return the expected rate of clusters beyond a level [1/s]."""
        beyond = _survival(max(level - self.start, 0.0), self.scale, self.shape)
        return float((self.peaks + 0.5) / self.exposure * (self.weight @ beyond))

    def level(self, rate: float) -> float:
        """Return the level with a given expected rate [1/s], at least the tail's beginning."""
        excess = float(self.scale @ self.weight) * EXCESSES
        rates = np.array([self.rate(self.start + x) for x in excess.tolist()])
        if rates[0] <= rate:
            return self.start
        shown = rates > 0.0  # the end of a tail of finite length
        return self.start + float(np.interp(-np.log(rate), -np.log(rates[shown]), excess[shown]))

    def interval(self, rate: float) -> tuple[float, float]:
        """Return the 90 % interval of the level of a rate [1/s]; `level`, whose rate is an expectation, may be above it."""
        clusters = gamma.ppf(RATES, self.peaks + 0.5) / self.exposure
        odds = np.maximum(clusters[:, None] / rate, 1.0)
        thin = np.where(np.abs(self.shape) < 1e-9, 1e-9, self.shape)
        levels = (self.start + self.scale / thin * (odds**thin - 1.0)).ravel()
        weights = np.tile(self.weight / RATES.size, RATES.size)
        order = np.argsort(levels)
        low, high = np.interp(ENDS, np.cumsum(weights[order]), levels[order])
        return float(low), float(high)


def _survival(excess: np.ndarray | float, scale: np.ndarray, shape: np.ndarray) -> np.ndarray:
    thin = np.where(np.abs(shape) < 1e-9, 1e-9, shape)
    return np.maximum(1.0 + thin * excess / scale, 0.0) ** (-1.0 / thin)


def clusters(score: np.ndarray, time: np.ndarray, level: float | np.ndarray, apart: float) -> np.ndarray:
    """Return first and past-last index of every group of samples beyond a level whose neighbours are close in time, (k, 2).

    Args:
        score: (n,); NaN is not beyond.
        time: instants [s], (n,).
        level: one, or (n,).
        apart: time without a sample beyond, after which a new group begins [s].
    """
    beyond = np.flatnonzero(score > level)
    if not beyond.size:
        return np.zeros((0, 2), dtype=int)
    cut = np.flatnonzero(np.diff(time[beyond]) > apart)
    first, last = np.r_[beyond[0], beyond[cut + 1]], np.r_[beyond[cut], beyond[-1]]
    return np.column_stack([first, last + 1])


def tail(parts: list[tuple[np.ndarray, np.ndarray]], exposure: float, apart: float) -> Tail:
    """Return the tail of a score.

    Args:
        parts: score (NaN where it does not count) and instants [s] of every series.
        exposure: time in which it counts [s].
        apart: time by which clusters are apart [s].

    Raises:
        NotIdentifiable: fewer than ten clusters.
    """
    pooled = np.concatenate([score[np.isfinite(score)] for score, _ in parts])
    best: tuple[float, np.ndarray] = 0.0, np.zeros(0)
    for share in SHARES:
        start = float(np.quantile(pooled, share)) if pooled.size else 0.0
        peaks = _peaks(parts, start, apart)
        if peaks.size >= ENOUGH or peaks.size > best[1].size:
            best = start, peaks
    start, peaks = best
    excess = peaks - start
    if excess.size < FEWEST or not excess.mean() > 0.0:
        raise NotIdentifiable(
            f"Only {excess.size} peaks are available for the tail.",
            remedy=f"Record longer: at least {FEWEST} are needed.",
        )
    shape, scale = (x.ravel() for x in np.meshgrid(SHAPES, SCALES * excess.mean(), indexing="ij"))
    thin = np.where(np.abs(shape) < 1e-9, 1e-9, shape)
    inside = 1.0 + thin[:, None] * excess / scale[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        likely = -(1.0 + 1.0 / thin) * np.log(inside).sum(axis=1) - excess.size * np.log(scale)
    likely = np.where((inside > 0.0).all(axis=1), likely, -np.inf) - 0.5 * ((shape - USUAL) / SPREAD) ** 2
    weight = np.exp(likely - likely.max())
    shape, scale, weight = (x[weight > LIKELY] for x in (shape, scale, weight))
    return Tail(
        start=start,
        peaks=excess.size,
        highest=float(peaks.max()),
        exposure=exposure,
        scale=scale,
        shape=shape,
        weight=weight / weight.sum(),
    )


def _peaks(parts: list[tuple[np.ndarray, np.ndarray]], start: float, apart: float) -> np.ndarray:
    """Return the highest value of every cluster, (k,)."""
    highest = [np.zeros(0)]
    for score, time in parts:
        plain = np.where(np.isfinite(score), score, -np.inf)
        spans = clusters(plain, time, start, apart)
        if len(spans):
            highest.append(np.maximum.reduceat(np.append(plain, -np.inf), spans.ravel())[::2])
    return np.concatenate(highest)
