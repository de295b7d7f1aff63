"""Covariance of a fit, valid for noise correlated in time and for effects that are not in the law.

With the derivatives J of the residuals r, their weights w, and the scores s = w r, the least cost has J's = 0. For residuals with
the autocovariance G of the scores and the mean slope c of a score over its residual, the covariance of the coordinates is

    (J'J)^-1 J' G J (J'J)^-1 / c^2.

G is estimated as far as it is significant, with the part added that the fit took (`identification/noise.py`). It is that of
stationary noise. Where the scores of blocks of time scatter significantly more, their scatter counts instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from backdrive.identification import noise, regression

BLOCKS = 60  # number of blocks of time whose scores are taken as independent
SURE = 0.01  # probability by chance of a scatter of blocks that counts [-]
LEAST = 1e-12  # eigenvalue below which the data do not determine a direction, relative to the largest one [-]
ALMOST = 1.0 - 1e-9  # least weight of a residual that is not clipped, relative to the largest one [-]
UNSEEN = 1e4  # standard error above which a parameter counts as without effect on the residuals [search coordinate]


@dataclass(frozen=True, kw_only=True, eq=False)
class Covariance:
    """Covariance of the search coordinates.

    Attributes:
        matrix: (P, P); NaN for coordinates at a bound, infinite for coordinates without effect on the residuals.
        correlation: between them, (P, P).
    """

    matrix: np.ndarray
    correlation: np.ndarray


def search_covariance(
    jacobian: np.ndarray,
    residual: np.ndarray,
    weight: np.ndarray,
    free: np.ndarray,
    instants: np.ndarray | None = None,
    inputs: np.ndarray | None = None,
    independent: float = 1.0,
) -> Covariance:
    """Return the covariance of a weighted least-squares fit, such that 1.96 standard errors correspond to 95 %.

    It follows from the autocorrelation of the weighted residuals. Where the scatter of blocks of time significantly exceeds
    it, the residuals are not stationary noise (encoder steps, effects not in the law), and that scatter counts. No variance
    is smaller than that for independent residuals and errors of the motion.

    Args:
        jacobian: derivatives of the residuals with respect to the search coordinates, (m, P).
        residual: (m,).
        weight: of the residuals, (m,).
        free: coordinates that are not at a bound, (P,).
        instants: index of the sample of each residual, with records at least `noise.LONGEST` apart, (m,); None: consecutive.
        inputs: changes of the residuals by random errors of the motion, one draw per row, (D, m).
        independent: share of the residuals that was independent before they were whitened [-].
    """
    m, P = jacobian.shape
    matrix, correlation = np.full((P, P), np.nan), np.eye(P)
    result = Covariance(matrix=matrix, correlation=correlation)
    if m <= free.sum():
        return result
    variance = float((weight * residual) @ residual) / max(m - int(free.sum()), 1)
    length = np.linalg.norm(np.where(np.isfinite(jacobian), jacobian, 0.0), axis=0)
    seen = free & (length * UNSEEN > np.sqrt(variance)) & np.isfinite(jacobian).all(axis=0)
    matrix[free & ~seen, free & ~seen] = np.inf
    if not seen.any():
        return result
    size, at = length[seen], np.arange(m) if instants is None else _places(instants)
    J = jacobian[:, seen] / size
    bread = inverse(J.T @ (weight[:, None] * J))
    plain = variance * bread
    if inputs is not None and len(inputs):
        moves = (inputs * weight) @ J @ bread
        plain = plain + moves.T @ moves / len(inputs)
    least = np.sqrt(np.maximum(np.diag(plain), 1e-300))
    noisy = _noise_covariance(J, residual, weight, at, independent)
    root = np.sqrt(np.maximum(np.diag(noisy), 1e-300))
    grown = np.maximum(_excess(J, weight * residual, bread, at, root**2), least / root)
    matrix[np.ix_(seen, seen)] = noisy * np.outer(grown, grown) / np.outer(size, size)
    correlation[np.ix_(seen, seen)] = plain / np.outer(least, least)
    return result


def _places(instants: np.ndarray) -> np.ndarray:
    """Return the place of each residual among all: samples, or bins where each residual is of a bin; records stay far apart."""
    apart = np.diff(instants)
    width = max(int(apart.min(initial=1 << 30)), 1)
    if width == 1 or not apart.size:
        return instants
    far = np.where(apart >= max(noise.LONGEST, 2 * width), noise.LONGEST, 0)
    return np.concatenate([[0], np.cumsum(apart // width + far)])


def _noise_covariance(
    J: np.ndarray, residual: np.ndarray, weight: np.ndarray, at: np.ndarray, share: float
) -> np.ndarray:
    """Return the covariance for stationary noise with the autocorrelation of the weighted residuals, (P, P).

    Args:
        J: derivatives of the residuals, with columns of unit length, (m, P).
        residual: (m,).
        weight: of the residuals, (m,).
        at: index of the sample of each residual, (m,).
        share: of the residuals that was independent before they were whitened [-].
    """
    value, vector = np.linalg.eigh(J.T @ J)
    seen = value > LEAST * value.max()
    spread = vector / np.sqrt(np.maximum(value, 1e-14 * value.max()))  # J @ spread has orthonormal columns
    n, begin = int(at[-1] - at[0]) + 1, at - at[0]
    Z, score, used = np.zeros((n, int(seen.sum()))), np.zeros(n), np.zeros(n, dtype=bool)
    Z[begin], score[begin], used[begin] = J @ spread[:, seen], weight * residual, True
    power = float(score @ score)
    if not power > 0.0:
        return np.zeros((len(value), len(value)))
    inner = power / len(at) * np.eye(len(value))  # of directions that the data do not determine
    known, independent = noise.covariance_of_scores(Z, score, used, np.eye(Z.shape[1]))
    inner[np.ix_(seen, seen)] = known
    covariance = spread @ inner @ spread.T / slope_of_scores(weight) ** 2
    freedom = min(independent - Z.shape[1], max(share * len(at), noise.FEWEST))
    return regression.widen_covariance(covariance, freedom)


def slope_of_scores(weight: np.ndarray) -> float:
    """Return the mean slope of a score over its residual, from the weights of the residuals, (m,)."""
    most = float(weight.max())
    return max(most * float(np.mean(weight >= ALMOST * most)), noise.LEAST)


def _excess(
    J: np.ndarray, score: np.ndarray, bread: np.ndarray, at: np.ndarray, variance: np.ndarray
) -> np.ndarray:
    """Return the factor on each standard error by which blocks of time scatter more than stated; 1 if not significant, (P,).

    With v the variance and a_b the share of a block in it for white noise, the sum of the squared contributions of the blocks
    divided by v is that of chi squared with 1 / sum(a_b^2) degrees of freedom, divided by them.

    Args:
        J: derivatives of the residuals, (m, P).
        score: weighted residuals, (m,).
        bread: inverse of the normal equations, (P, P).
        at: index of the sample of each residual, (m,).
        variance: as stated, (P,).
    """
    m = len(score)
    bounds = [0, *(np.flatnonzero(np.diff(at) >= noise.LONGEST) + 1).tolist(), m]
    cuts = []
    for a, b in zip(bounds, bounds[1:], strict=False):
        count = max(1, round(BLOCKS * (b - a) / m))
        cuts.append(np.unique(np.linspace(a, b, count + 1).astype(int))[:-1])
    first = np.concatenate(cuts)
    sums = np.add.reduceat(J * score[:, None], first, axis=0)
    sums -= np.diff(np.append(first, m))[:, None] / m * sums.sum(axis=0)  # which is 0 at the least cost
    scatter = np.diag(regression.cluster_covariance(bread, sums))
    share = np.add.reduceat((J @ bread) ** 2, first, axis=0)
    share = share / np.maximum(share.sum(axis=0), 1e-300)
    freedom = 1.0 / np.maximum((share**2).sum(axis=0), 1e-300)
    excess = scatter / np.maximum(variance, 1e-300)
    return np.where(excess > chdtri(freedom, SURE) / freedom, np.sqrt(np.maximum(excess, 1.0)), 1.0)


def inverse(gram: np.ndarray) -> np.ndarray:
    """Return the inverse of a Gram matrix; directions that the data do not determine get a large, finite variance.

    Args:
        gram: symmetric, with a diagonal of the order of 1, (P, P).
    """
    value, vector = np.linalg.eigh(gram)
    value = np.maximum(value, 1e-14 * value.max())
    return (vector / value) @ vector.T
