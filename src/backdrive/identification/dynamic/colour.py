"""A fit again with its noise whitened, where neighbouring residuals are correlated or an encoder's rounding is felt.

The means of the residuals over bins are whitened (`whitening`). Least squares of these numbers is more accurate under coloured
noise than that of the residuals (Aitken 1935; Cochrane & Orcutt, JASA 44, 1949). It weighs fast changes more, to which
errors of the encoder and what the law lacks near a reversal belong: hence the bins, those of `motion`, and the known covariance of
what rounding adds. If it moves a number by more than noise moves two such fits apart, the law lacks something, and the first fit
is kept (`agreement`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from backdrive.identification import robust
from backdrive.identification.agreement import agree
from backdrive.identification.dynamic.attenuation import FAST, clear_of_reversals, restore_inertia
from backdrive.identification.dynamic.fit import Fit, conclude
from backdrive.identification.dynamic.rounding import false_acceleration
from backdrive.identification.dynamic.search import Search
from backdrive.identification.dynamic.torque import DRAWS, TorqueProblem
from backdrive.identification.terms import RIGID
from backdrive.identification.whitening import (
    LAGS,
    SHOWN,
    WHITE,
    Colour,
    as_noise,
    colour_of,
    whiten,
    whiten_both,
)

FILLED = 0.75  # least share of the samples of a bin that count [-]
FEWEST = 100  # least number of bins
LEAST = 0.3  # correlation of neighbouring bins below which the noise is taken as white [-]
ROUNDED = 0.8  # largest share of uncorrelated residuals' mean square that is taken as rounding [-]
BIN_REACH = 1.0  # distance from a reversal within which a low pass misleads the mean of most of a bin, by its cutoff [-]
ITERATIONS = 40  # largest number of iterations, which begin at the first fit
WORTH = 0.95  # largest median of the friction's standard errors relative to those of the first fit [-]


def whiten_noise(fit: Fit, seconds: float) -> Fit:
    """Return a fit of torque with its coloured noise whitened; the same fit where that does not help, or contradicts it.

    Args:
        fit: to all samples that count.
        seconds: length of a bin [s].

    Raises:
        KeyboardInterrupt: a person interrupted it.
    """
    problem, first = fit.problem, fit.found
    if not isinstance(problem, TorqueProblem) or fit.at_bound:  # what a bound keeps from the data is no noise
        return fit
    width = max(1, round(seconds / max(s.dt for s in problem.stretches)))
    bins, average = bins_of(problem.instants, width)
    if bins.size < FEWEST or first.interrupted:
        return fit
    colour = _colour(problem, fit, bins, average)
    if colour == WHITE:
        return fit
    apart = np.diff(bins)

    def white_means(residual: np.ndarray) -> np.ndarray:
        means = average(residual).T
        if not colour.rounding:
            return whiten(means, apart, colour.correlation).T
        return whiten_both(means.reshape(len(means), -1), bins, colour).reshape(means.shape).T

    search = Search(lambda p: white_means(problem.residuals(p)), problem.lower, problem.upper, loss=fit.loss)
    found = replace(
        search.run(first.point, iterations=ITERATIONS), instants=bins * width, independent=colour.independent
    )
    if found.interrupted:
        raise KeyboardInterrupt
    second = conclude(problem, found, fit.loss, white_means)
    if not found.converged or second.at_bound != fit.at_bound:
        return fit
    clear = average(clear_of_reversals(fit, BIN_REACH) - 0.5) > 0.0
    second = restore_inertia(second, white_means, clear)
    if second is None or not _agrees(fit, second, bool(colour.rounding)):
        return fit
    plain = np.concatenate(second.errors())
    return replace(
        second,
        rms=float(np.sqrt(np.mean(plain**2))),
        mean_absolute=float(np.abs(plain).mean()),
        samples=fit.samples,
        aic=fit.aic,
        evaluations=fit.evaluations + second.evaluations,
    )


def _colour(
    problem: TorqueProblem, fit: Fit, bins: np.ndarray, average: Callable[[np.ndarray], np.ndarray]
) -> Colour:
    """Return the noise of the means of a fit's residuals; `WHITE` where it is about that.

    Args:
        problem: that of the fit.
        fit: of torque.
        bins: index of each mean, (n,).
        average: from residuals to means.
    """
    found, at = fit.found, bins - bins[0]
    grid = np.zeros((1 + DRAWS, at[-1] + 1))
    used = np.zeros(grid.shape[1], dtype=bool)
    used[at], grid[0, at] = True, average(found.weight * found.residual)
    false: tuple[float, ...] = ()
    if "inertia" in fit.values and (false_rows := false_acceleration(problem)).size:
        grid[1:, at] = average(found.weight * false_rows * fit.values["inertia"])
        false = tuple(_product(grid[1:], used, lag) for lag in range(LAGS))
    columns = np.zeros((used.size, found.jacobian.shape[1]))
    columns[at] = average(found.jacobian.T).T
    colour = colour_of(grid[0], used, columns, false)
    if colour.correlation > LEAST:
        return colour
    power = robust.robust_spread(grid[0, at]) ** 2
    if colour.correlation > 0.0 or not (power > 0.0 and false and false[0] > 0.0):
        return WHITE
    shares = min(1.0 / power, ROUNDED / false[0]) * np.array(false)
    return Colour(0.0, as_noise(shares / (1.0 - shares[0]))) if shares[0] > SHOWN else WHITE


def _product(rows: np.ndarray, used: np.ndarray, lag: int) -> float:
    """Return the mean product of used values that are so many bins apart, of all rows, (k, n)."""
    n = used.size
    both = used[lag:] & used[: n - lag]
    return float(np.sum(rows[:, lag:] * rows[:, : n - lag]) / (len(rows) * max(np.count_nonzero(both), 1)))


def bins_of(instants: np.ndarray, width: int) -> tuple[np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """Return the index of each filled bin, (n,), and the function that averages residuals, (..., m), over them, (..., n).

    A mean is multiplied by the root of its number of samples.

    Args:
        instants: index of the sample of each residual, (m,).
        width: of a bin [sample].
    """
    bins = instants // width
    edges = np.concatenate([[0], np.flatnonzero(np.diff(bins)) + 1, [bins.size]])
    filled = np.diff(edges) >= FILLED * width
    begin, end = edges[:-1][filled], edges[1:][filled]
    root = np.sqrt(end - begin)

    def average(residual: np.ndarray) -> np.ndarray:
        total = np.zeros((*residual.shape[:-1], residual.shape[-1] + 1))
        np.cumsum(residual, axis=-1, out=total[..., 1:])
        return (total[..., end] - total[..., begin]) / root

    return bins[begin], average


def _agrees(first: Fit, second: Fit, rounded: bool) -> bool:
    """Return whether the second fit tells friction better and moves no number by more than noise moves two fits apart.

    What rounding does to inertia and delay is not in their first errors, so that these two say nothing where it is felt.

    Args:
        first: before whitening.
        second: after it.
        rounded: the encoder's rounding is felt.
    """
    names = [n for n in first.problem.names if 0.0 < first.standard_errors[n] < np.inf]
    before, after = (np.array([one.standard_errors[n] for n in names]) for one in (first, second))
    moved = np.array([second.values[n] - first.values[n] for n in names])
    of_law = np.array([n not in (*RIGID, "delay") for n in names], dtype=bool)
    better = of_law.any() and np.median((after / before)[of_law]) < WORTH
    told = np.array([not (rounded and n in FAST) for n in names], dtype=bool)
    return bool(better and agree(moved[told], before[told], after[told]))
