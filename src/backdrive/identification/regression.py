"""Linear least squares over blocks of samples: cross-validation and cluster-robust standard errors.

Neighbouring samples of a log are not independent, but blocks of them nearly are. Cross-validation holds out blocks, and the
standard errors are computed from blocks (the cluster-robust sandwich of Liang & Zeger 1986).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetri, dposv  # type: ignore[attr-defined]

NORMAL = 1.959964  # half width of a 95 % interval [standard error]
MOST_NOISE = 0.5  # largest share of a column's mean square that is taken as noise [-]
WELL = 1e6  # condition number up to which an inverse is as accurate as a pseudoinverse [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class Blocks:
    """Normal equations block by block.

    Attributes:
        gram: weighted X'X of every block, (B, p, p).
        moment: weighted X'y of every block, (B, p).
        power: weighted y'y of every block, (B,).
        rows: sum of the weights of every block, (B,).
    """

    gram: np.ndarray
    moment: np.ndarray
    power: np.ndarray
    rows: np.ndarray

    @cached_property
    def whole(self) -> tuple[np.ndarray, np.ndarray]:
        """X'X and X'y of all blocks together, (p, p) and (p,)."""
        return self.gram.sum(axis=0), self.moment.sum(axis=0)

    def solution(self) -> np.ndarray:
        """Return the coefficients fitted to all blocks, (p,)."""
        return solve(*self.whole)

    def map_columns(self, spread: np.ndarray) -> Blocks:
        """Return the equations of the regressor X @ spread."""
        return Blocks(
            gram=spread.T @ self.gram @ spread, moment=self.moment @ spread, power=self.power, rows=self.rows
        )

    def less(self, other: Blocks) -> Blocks:
        """Return the equations without those of some of their samples."""
        rows = self.rows - other.rows
        return Blocks(
            gram=self.gram - other.gram,
            moment=self.moment - other.moment,
            power=self.power - other.power,
            rows=np.where(rows > EMPTY * self.rows, rows, 0.0),
        )

    def without_noise(self, noise: float) -> Blocks:
        """Return the equations with the noise of the first column subtracted, since it biases the coefficient towards zero.

        Args:
            noise: mean square of the noise; at most half of the column's is subtracted (Fuller, Measurement Error Models, 1987).
        """
        rows, whole = float(self.rows.sum()), float(self.gram[:, 0, 0].sum())
        share = min(noise * rows, MOST_NOISE * whole) / max(rows, 1e-300)
        gram = self.gram.copy()
        gram[:, 0, 0] -= share * self.rows
        return replace(self, gram=gram)


EMPTY = 1e-12  # share of the weight of a block below which rounding left it [-]
PIECE = 4096  # number of rows that are multiplied together
RIDGE = 1e-13  # ridge weight in scaled normal equations, which keeps undetermined directions small [-]


def solve(gram: np.ndarray, moment: np.ndarray, size: np.ndarray | None = None) -> np.ndarray:
    """Solve normal equations scaled to unit columns.

    Args:
        gram: X'X, (..., p, p).
        moment: X'y, (..., p).
        size: squared length that a column has where it is determined, (p,); None: that of each gram.
    """
    size = gram.diagonal(axis1=-2, axis2=-1) if size is None else size
    scale = np.sqrt(np.maximum(size, 1e-300))
    scaled = np.divide(gram, scale[..., :, None] * scale[..., None, :], order="C")
    scaled.reshape(-1, gram.shape[-1] ** 2)[:, :: gram.shape[-1] + 1] += RIDGE  # the diagonals
    if gram.ndim == 2:  # the common case, without the overhead of numpy
        _, solution, failure = dposv(scaled, moment / scale)
        if failure == 0:
            return solution / scale
    return np.linalg.solve(scaled, (moment / scale)[..., None])[..., 0] / scale


def block_index(n: int, blocks: int) -> np.ndarray:
    """Return the block of each of n consecutive samples, (n,)."""
    return np.minimum(np.arange(n) * blocks // max(n, 1), blocks - 1)


def accumulate(X: np.ndarray, y: np.ndarray, w: np.ndarray, block: np.ndarray, blocks: int) -> Blocks:
    """Return the normal equations by block.

    Args:
        X: regressor, (n, p).
        y: right-hand side, (n,).
        w: weights, (n,).
        block: block of each sample, sorted, (n,).
        blocks: number of blocks.
    """
    edges, p = np.searchsorted(block, np.arange(blocks + 1)).tolist(), X.shape[1]
    root = np.sqrt(w)  # so that each product is symmetric, which takes half the time
    whole, rows, begun, done = np.empty((blocks, p + 1, p + 1)), np.empty((0, p + 1)), 0, 0
    for b, (first, last) in enumerate(zip(edges, edges[1:], strict=False)):
        if last > done:  # of several blocks at once, in pieces that the cache holds
            begun, done = first, max([last, *(edge for edge in edges if edge <= first + PIECE)])
            rows = np.empty((done - begun, p + 1))
            np.multiply(X[begun:done], root[begun:done, None], out=rows[:, :p])
            np.multiply(y[begun:done], root[begun:done], out=rows[:, p])
        part = rows[first - begun : last - begun]
        np.matmul(part.T, part, out=whole[b])
    gram, moment = np.ascontiguousarray(whole[:, :p, :p]), whole[:, :p, p].copy()
    return Blocks(gram=gram, moment=moment, power=whole[:, p, p].copy(), rows=np.bincount(block, w, blocks))


def accumulate_rows(
    X: np.ndarray, y: np.ndarray, w: np.ndarray, rows: np.ndarray, block: np.ndarray, blocks: int
) -> Blocks:
    """Return the normal equations of some rows (m,) by block, with weights (m,); other arguments as of `accumulate`."""
    return accumulate(X.take(rows, axis=0), y.take(rows), w, block.take(rows), blocks)


def block_losses(blocks: Blocks, theta: np.ndarray) -> np.ndarray:
    """Return the weighted squared error of every block, (B,), for its own coefficients, (B, p)."""
    slope = (blocks.gram @ theta[..., None])[..., 0] - 2.0 * blocks.moment
    return blocks.power + (slope * theta).sum(axis=1)


def leave_one_out_solutions(blocks: Blocks) -> np.ndarray:
    """Return the solution without each block, (B, p)."""
    return solutions(blocks)[1]


def solutions(blocks: Blocks) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients fitted to all blocks, (p,), and those without each block, (B, p)."""
    gram, moment = blocks.whole
    grams, moments = (
        np.empty((len(blocks.gram) + 1, *gram.shape)),
        np.empty((len(blocks.gram) + 1, moment.size)),
    )
    grams[0], moments[0] = gram, moment
    np.subtract(gram, blocks.gram, out=grams[1:])
    np.subtract(moment, blocks.moment, out=moments[1:])
    every = solve(grams, moments, gram.diagonal())  # a column of one block alone is undetermined without it
    return every[0], every[1:]


def sandwich(blocks: Blocks, theta: np.ndarray) -> np.ndarray:
    """Return the covariance of `theta` from the scatter of the blocks' scores, (p, p)."""
    scores = (blocks.moment - blocks.gram @ theta)[blocks.rows > 0]
    return cluster_covariance(invert(blocks.whole[0]), scores)


def cluster_covariance(inverse: np.ndarray, scores: np.ndarray) -> np.ndarray:
    """Return the covariance of a fit from its scores, summed over blocks that are taken as independent, (p, p).

    It is widened by Student's distribution for the number of blocks, so that 1.96 standard errors correspond to 95 %.

    Args:
        inverse: of the normal equations, (p, p).
        scores: regressor times residual, one block per row, (B, p).
    """
    used = max(len(scores), 2)
    return inverse @ (scores.T @ scores) @ inverse * used / (used - 1) * few(used) ** 2


def few(blocks: int) -> float:
    """Return the 97.5 % quantile of Student's distribution for a number of blocks, divided by the normal one, to 1 % [-]."""
    return 1.0 + 1.22 / (blocks - 1)


def widen_covariance(covariance: np.ndarray, freedom: float) -> np.ndarray:
    """Return a covariance widened so that 1.96 standard errors correspond to Student's 97.5 % quantile, (p, p).

    Args:
        covariance: estimated from residuals, (p, p).
        freedom: degrees of freedom of the residuals; at least 1 is used.
    """
    from scipy.special import stdtrit

    return covariance * (float(stdtrit(max(freedom, 1.0), 0.975)) / NORMAL) ** 2


def classical(X: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the covariance of an ordinary least-squares fit with independent errors of equal variance, (p, p).

    Args:
        X: regressor, (n, p).
        residual: of the fit, (n,).
    """
    freedom = max(len(X) - X.shape[1], 1)
    return widen_covariance(float(residual @ residual) / freedom * invert(X.T @ X), freedom)


def invert(gram: np.ndarray, least: float = 1e-10) -> np.ndarray:
    """Return the pseudoinverse of normal equations scaled to unit columns, (p, p).

    Args:
        gram: X'X, or Z'X with instruments Z, (p, p).
        least: singular value below which a direction is undetermined, relative to the largest one [-].
    """
    scale = np.sqrt(np.maximum(np.abs(gram.diagonal()), 1e-300))
    size = scale[:, None] * scale
    scaled = gram / size
    factors, order, failure = dgetrf(scaled)
    if failure == 0:  # if all directions are determined, sooner known
        inverse, _ = dgetri(factors, order)
        if np.vdot(scaled, scaled) * np.vdot(inverse, inverse) < WELL**2:
            return inverse / size
    return np.linalg.pinv(scaled, rcond=least) / size


def long_run(z: np.ndarray, width: int | None = None) -> np.ndarray:
    """Return the covariance of the sums of rows z over correlated samples, (k, k).

    Newey & West, Econometrica 55, 1987, with weights that fall to zero at the lag `width`.

    Args:
        z: rows of mean zero, (k, n).
        width: lag at which the weights reach zero [sample]; None: the square root of the number of samples.
    """
    width = width or int(np.sqrt(z.shape[1])) + 1
    rest = np.zeros((z.shape[0], width))
    total = np.cumsum(np.hstack([rest, z, rest]), axis=1)
    sums = total[:, width:] - total[:, :-width]  # sums over overlapping windows give triangular weights
    return sums @ sums.T / width


def condition(gram: np.ndarray) -> float:
    """Return the condition number of the regressor with columns scaled to unit length [-]."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    eigenvalues = np.linalg.eigvalsh(gram / np.outer(scale, scale))
    return float(np.sqrt(eigenvalues[-1] / max(eigenvalues[0], 1e-300)))
