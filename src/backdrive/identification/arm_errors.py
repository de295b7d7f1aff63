"""Standard errors of an arm's coefficients, from their changes if blocks of a few seconds are left out.

Residuals of an arm are not white noise: friction varies slowly, and flexible joints oscillate after every reversal. The error
of a coefficient depends on how residuals correlate with its column. With total normal equations G, priors H, those of a block
G_b and its score s_b (columns times weighted residuals, summed), the fit without the block is

    x_b - x = -(G + H - G_b)^-1 s_b,       D = f^2 (B - 1)/B sum_b (x_b - x) (x_b - x)'

D is the delete-a-block jackknife (Shao & Wu, Annals of Statistics 17, 1989; CR3 of Cameron & Miller, J. Human Resources 50, 2015).
It equals a cluster-robust sandwich, corrected for the influence of each block on its own residuals. The factor f widens it by
Student's distribution (`regression.few`). A few blocks do not determine D in all directions of many coefficients. D is
therefore mixed with the covariance for uncorrelated residuals, scaled to the size of D (Ledoit & Wolf, J. Multivariate Analysis
88, 2004, with a fixed share):

    cov x = (1 - a) D + a c V G V + V H V,       V = (G + H)^-1,       c = tr(V^-1 D) / tr(V G)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from backdrive.identification import regression

BLOCK = 5.0  # length of a block, beyond which residuals are taken as independent [s]
FEWEST, MOST = 8, 128  # least and largest number of blocks of a log
MIXED = 0.2  # a, share of the covariance for uncorrelated residuals [-]


def blocks_of(rows: int, rate: float) -> np.ndarray:
    """Return the block of each row, (n,).

    Args:
        rows: number of rows.
        rate: rows per second [Hz].
    """
    return regression.block_index(rows, min(max(round(rows / rate / BLOCK), FEWEST), MOST))


@dataclass(frozen=True, kw_only=True, eq=False)
class FitErrors:
    """Covariance of penalised least squares between bounds.

    Attributes:
        covariance: of all coefficients, zero for those at a bound, (p, p).
        loose: standard error of each coefficient at a bound if it alone were freed, 0 for free ones, (p,).
        pushed: distance of that freed estimate below the bound [its standard error], 0 for free ones, (p,).
    """

    covariance: np.ndarray
    loose: np.ndarray
    pushed: np.ndarray


def errors_of_fit(
    blocks: regression.Blocks, held: np.ndarray, pull: np.ndarray, free: np.ndarray, misfit: float = 1.0
) -> FitErrors:
    """Return the covariance of a fit.

    Args:
        blocks: weighted normal equations of the residuals at the solution; their moments are the scores.
        held: H, precision of the priors, (p, p).
        pull: gradient of the priors at the solution, -H (x - start), (p,).
        free: coefficients that are at no bound, (p,).
        misfit: true variance of the data's contribution, divided by its jackknife estimate [-].
    """
    used = np.flatnonzero(blocks.rows > 0)
    gram, slope = blocks.gram.sum(axis=0), blocks.moment.sum(axis=0) + pull
    bound = np.flatnonzero(~free)
    inner = np.ix_(free, free)
    total = gram + held
    inverse = regression.invert(total[inner], 1e-15)
    without = total - blocks.gram[used]
    left = slope - blocks.moment[used]
    right = np.concatenate([without[:, free][:, :, bound], left[:, free, None]], axis=2)
    size = np.sqrt(np.diag(total)[free])
    scaled = without[:, free][:, :, free] / np.outer(size, size) + regression.RIDGE * np.eye(size.size)
    solved = np.linalg.solve(scaled, right / size[:, None]) / size[:, None]
    covariance = np.zeros_like(gram)
    scatter = misfit * _scatter(solved[:, :, -1])
    even = float(np.trace(total[inner] @ scatter)) / max(float(np.trace(inverse @ gram[inner])), 1e-300)
    covariance[inner] = (1.0 - MIXED) * scatter + inverse @ (MIXED * even * gram + held)[inner] @ inverse
    loose, pushed = np.zeros(free.size), np.zeros(free.size)
    for m, i in enumerate(bound):
        direction = np.zeros(free.size)  # of coefficient i and the response of the free ones
        direction[free], direction[i] = -inverse @ total[free, i], 1.0
        bend = max(float(direction @ total @ direction), 1e-300)
        step = float(direction @ slope) / bend
        across = without[:, i][:, free]
        steps = (left[:, i] - np.einsum("bf,bf->b", across, solved[:, :, -1])) / np.maximum(
            without[:, i, i] - np.einsum("bf,bf->b", across, solved[:, :, m]), 1e-300
        )
        alone = float(direction @ (MIXED * even * gram + held) @ direction) / bend**2
        loose[i] = np.sqrt((1.0 - MIXED) * misfit * float(_scatter((steps - step)[:, None])[0, 0]) + alone)
        pushed[i] = max(-step / loose[i], 0.0) if loose[i] > 0.0 else 0.0
    return FitErrors(covariance=covariance, loose=loose, pushed=pushed)


def _scatter(changes: np.ndarray) -> np.ndarray:
    """Return the covariance, (p, p), from the changes without each block, (B, p), widened for few blocks."""
    used = max(len(changes), 2)
    return changes.T @ changes * ((used - 1) / used * regression.few(used) ** 2)
