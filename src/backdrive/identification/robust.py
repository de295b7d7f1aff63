"""Linear least squares with Huber's loss, which limits the influence of outliers, by reweighting and then Newton's method."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dposv  # type: ignore[attr-defined]

from backdrive.identification.regression import PIECE, RIDGE, Blocks, accumulate_rows
from backdrive.logs.quantiles import at_rank

HUBER = 1.345  # width of Huber's loss, for 95 % efficiency with normal residuals [standard deviation]
# largest change of all residuals together in the last round, and in the last of Newton's [width of Huber's loss]
SETTLED, NEARLY = 1e-2, 0.03
CLOSE = 3.0  # largest such change before a Newton step [width of Huber's loss]
HELD = 0.05  # weight of a residual on the line in a Newton step, so that no column is undetermined [-]
MANY = 8  # largest number of repetitions of a robust fit


def robust_spread(residual: np.ndarray, w: np.ndarray | None = None) -> float:
    """Return the standard deviation of residuals with weight, from the median of their magnitudes; 0 if there are none."""
    size = np.abs(residual if w is None else residual[w > 0])
    return _spread_of(size) if size.size else 0.0


def _spread_of(size: np.ndarray) -> float:
    """Return the standard deviation of residuals, from the median of their magnitudes."""
    first, second = at_rank(size, (size.size - 1) // 2)
    return 1.4826 * (first if size.size % 2 else 0.5 * (first + second))


def huber_loss(size: np.ndarray, width: float) -> np.ndarray:
    """Return Huber's loss: the square, and beyond a width the line that continues it [square of the residual's unit].

    Args:
        size: magnitude of the residual, (...).
        width: above which the loss is a line [unit of the residual].
    """
    return np.where(size <= width, size**2, 2.0 * width * size - width**2)


def huber_weights(residual: np.ndarray, width: float | np.ndarray) -> np.ndarray:
    """Return Huber's weights [-].

    Args:
        residual: of the fit, (...).
        width: magnitude above which a residual gets less weight [unit of the residual].
    """
    return np.minimum(1.0, width / np.maximum(np.abs(residual), 1e-300))


def robust_weights(
    X: np.ndarray, y: np.ndarray, w: np.ndarray, rounds: int = MANY, start: np.ndarray | None = None
) -> np.ndarray:
    """Return `w` times Huber's weights, by iteratively reweighted least squares, (n,); arguments as of `robust_solution`."""
    lighter, lost, _ = _reweigh(X, y, w, rounds, start)
    weights = w.copy()
    weights[lighter] -= lost
    return weights


def robust_blocks(
    X: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    block: np.ndarray,
    every: Blocks,
    rounds: int = MANY,
    start: np.ndarray | None = None,
) -> tuple[Blocks, np.ndarray]:
    """Return the normal equations by block with `robust_weights`, and these; arguments as of `accumulate` and `robust_solution`.

    `every` holds the equations with `w`.
    """
    lighter, lost, _ = _reweigh(X, y, w, rounds, start, every.whole)
    weights = w.copy()
    weights[lighter] -= lost
    return every.less(accumulate_rows(X, y, lost, lighter, block, len(every.rows))), weights


def robust_solution(
    X: np.ndarray, y: np.ndarray, w: np.ndarray, rounds: int = MANY, start: np.ndarray | None = None
) -> np.ndarray:
    """Return the coefficients fitted with Huber's loss, (p,).

    Args:
        X: regressor, (n, p).
        y: right-hand side, (n,).
        w: weights, (n,).
        rounds: largest number of repetitions.
        start: coefficients of a similar fit, which save repetitions, (p,); None: those of least squares.
    """
    return _reweigh(X, y, w, rounds, start)[2]


def _reweigh(
    X: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    rounds: int,
    start: np.ndarray | None = None,
    whole: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rows with less weight than `w`, (m,), how much less by Huber's loss, (m,), and the solution, (p,).

    `whole` holds X'X and X'y with `w`, if they are known.
    """
    inside = np.flatnonzero(w)
    p, prior, count = X.shape[1], w[inside], inside.size
    gram, moment = (np.zeros((p, p)), np.zeros(p)) if whole is None else whole
    for first in range(0, count if whole is None else 0, PIECE):  # in pieces that the cache holds
        rows, right = _rows(X, y, inside[first : first + PIECE], prior[first : first + PIECE])
        gram += rows.T @ rows
        moment += right @ rows
    scale = np.sqrt(np.maximum(gram.diagonal(), 1e-300))
    gram = gram / (scale[:, None] * scale)
    gram.reshape(-1)[:: p + 1] += RIDGE
    moment = moment / scale
    lighter, lost, residual, direct = inside[:0], prior[:0], np.full(count, np.inf), False
    solution = _solve_unit(gram, moment) if start is None else start * scale
    for _ in range(rounds):
        left = y - X @ (solution / scale)
        residual, before = left if count == y.size else left[inside], residual
        size = np.abs(residual)
        width = HUBER * _spread_of(size) if count else 0.0
        before -= residual
        moved = float(before @ before)
        settled = NEARLY if direct else SETTLED  # a standard error changes them by about a width
        if moved <= (settled * width) ** 2:
            break
        lighter = (size > width).nonzero()[0] if width > 0.0 else inside[:0]
        lost = prior[lighter] * (1.0 - width / size[lighter])
        # Newton's step near the solution, where the width is steady; reweighting is slower, but leads there from anywhere
        direct = moved <= (CLOSE * width) ** 2
        given = (1.0 - HELD) * prior[lighter] if direct else lost
        rows, right = _rows(X, y, inside[lighter], given)  # few, subtracted from all equations
        rows /= scale
        if direct:  # the line that continues the square pulls with a constant force
            far = residual[lighter]
            right -= (np.copysign(width, far) - HELD * far) * np.sqrt(prior[lighter] / (1.0 - HELD))
        solution = _solve_unit(gram - rows.T @ rows, moment - right @ rows)
    return inside[lighter], lost, solution / scale


def _rows(X: np.ndarray, y: np.ndarray, at: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return some rows of X, (m, p), and of y, (m,), times the square roots of their weights."""
    rows, right = X.take(at, axis=0), y.take(at)
    if not (weight == 1.0).all():
        root = np.sqrt(weight)
        rows *= root[:, None]
        right *= root
    return rows, right


def _solve_unit(gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Return the solution of normal equations with columns of about unit length, (p,)."""
    _, solution, failure = dposv(gram, moment)
    return solution if failure == 0 else np.linalg.solve(gram, moment)
