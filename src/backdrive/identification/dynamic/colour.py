"""A fit again with its noise whitened, where neighbouring residuals are correlated.

The means of the residuals over bins are whitened (`whitening`). Least squares of these numbers is more accurate under coloured
noise than that of the residuals (Aitken 1935; Cochrane & Orcutt, JASA 44, 1949). It weighs fast changes more, to which
errors of the encoder and what the law lacks near a reversal belong: hence the bins, those of `motion`. If it moves a number by more
than noise moves two such fits apart, the law lacks something, and the first fit is kept (Hausman, Econometrica 46, 1978).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from backdrive.identification.dynamic.fit import Fit, conclude
from backdrive.identification.dynamic.search import Search
from backdrive.identification.dynamic.torque import TorqueProblem
from backdrive.identification.whitening import neighbours, whiten

FILLED = 0.75  # least share of the samples of a bin that count [-]
FEWEST = 100  # least number of bins
LEAST = 0.3  # correlation of neighbouring bins below which the noise is taken as white [-]
MOST = 0.995  # largest correlation that is used [-]
ITERATIONS = 12  # largest number of iterations, which begin at the first fit
WORTH = 0.95  # largest median of the standard errors relative to those of the first fit [-]
MOVED = 3.5  # largest change of a number, relative to the error by which the two fits differ [-]
LEAST_DIFFERENCE = 0.5  # least such error [standard error of the first fit]


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
    apart = np.diff(bins)
    correlation = min(neighbours(average(first.weight * first.residual), apart), MOST)
    if not correlation > LEAST:
        return fit

    def white_means(residual: np.ndarray) -> np.ndarray:
        return whiten(average(residual).T, apart, correlation).T

    search = Search(lambda p: white_means(problem.residuals(p)), problem.lower, problem.upper, loss=fit.loss)
    found = replace(search.run(first.point, iterations=ITERATIONS), instants=bins * width)
    if found.interrupted:
        raise KeyboardInterrupt
    second = conclude(problem, found, fit.loss, white_means)
    if not found.converged or second.at_bound != fit.at_bound or not _agrees(fit, second):
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


def _agrees(first: Fit, second: Fit) -> bool:
    """Return whether the second fit is more accurate and moves no number by more than noise moves two such fits apart.

    The difference of an efficient estimate from another one has the variance by which theirs differ (Hausman 1978).
    """
    names = [n for n in first.problem.names if 0.0 < first.standard_errors[n] < np.inf]
    before, after = (np.array([one.standard_errors[n] for n in names]) for one in (first, second))
    moved = np.array([second.values[n] - first.values[n] for n in names])
    apart = np.sqrt(np.maximum(before**2 - after**2, (LEAST_DIFFERENCE * before) ** 2))
    return bool(names and np.median(after / before) < WORTH and np.all(np.abs(moved) < MOVED * apart))
