"""Coloured noise of means over bins, and the transform that makes it white.

The torque's noise is an autoregression of first order,

    r_k  ->  (r_k - c^g r_(k-1)) / sqrt(1 - c^(2 g))

c: correlation of neighbouring samples; g: distance of two samples that are used (Cochrane & Orcutt, JASA 44, 1949). Where an
encoder is coarse, the acceleration's error stands beside it, whose autocorrelation is known from the encoder's steps and the low
pass. The numerator above then has a covariance in a band of a few samples; its Cholesky factor makes both white (Aitken 1935).

Means of an autoregression are none: their products at all lags but 0 are those of one, and their square is smaller, since a mean
takes fast changes away (K. R. W. Brewer, J. Econometrics 1, 1973). That share is a white error of negative power beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky_banded, solve_banded, solveh_banded

from backdrive.identification import robust

MOST = 0.99  # largest correlation of the noise of neighbouring bins [-]
# most negative correlation of neighbouring bins, and negative correlation above which it is set to zero [-]
OPPOSITE, SLIGHT = -0.48, -0.1
CLIPPED = (
    0.71  # mean square of normal noise that is clipped at Huber's width, relative to that of the noise [-]
)
CUBIC = (
    0.05  # share of the mean square of such clipped noise that grows as its cube and higher odd powers [-]
)
HIDDEN = 0.5  # largest share of the residual's mean square that is taken as error of the acceleration [-]
SHOWN = 0.05  # least power of the acceleration's error, relative to the innovation of the noise, that is whitened too [-]
LAGS = 4  # number of lags of the acceleration's error; beyond, means of a low-passed motion are hardly correlated
RIDGE = 1e-3  # least power of the acceleration's error at any frequency, relative to its mean [-]
SMALL = 0.01  # share of the noise's slow part below which what a fit takes of it is left out [-]
ROUNDS = 5  # repetitions, each with the last correlation
LEAST_OF_MEANS = (
    0.4  # least correlation of neighbouring means that is taken as that of an averaged autoregression [-]
)
HALVINGS = 40  # of the range in which a correlation is sought
PIECE = 2_000  # number of rows that are whitened together, which the cache holds
ANGLES = np.linspace(0.0, np.pi, 257)  # frequencies at which a spectrum is tested [rad/bin]


@dataclass(frozen=True)
class Colour:
    """Noise of neighbouring bins.

    Attributes:
        correlation: of neighbours in an autoregression of first order [-]; negative: in a moving average of first order.
        rounding: products of the acceleration's error by lag, relative to the power of the autoregression [-]; empty: none.
        averaged: share of that power that averaging took [-].
    """

    correlation: float = 0.0
    rounding: tuple[float, ...] = ()
    averaged: float = 0.0

    @property
    def beside(self) -> tuple[float, ...]:
        """Products by lag of all that stands beside the autoregression, relative to its power [-]; empty: nothing."""
        if not self.averaged:
            return self.rounding
        first, *others = self.rounding or (0.0,) * LAGS
        return (first - self.averaged, *others)

    @property
    def independent(self) -> float:
        """Share of the bins that counts as independent, by the noise's slow part [-]."""
        return (1.0 - self.correlation) / (1.0 + self.correlation) if self.correlation > 0.0 else 1.0

    @property
    def memory(self) -> float:
        """Number of bins after which the correlation is 1/e; 0 without a positive one [-]."""
        return -1.0 / math.log(self.correlation) if 0.0 < self.correlation < 1.0 else 0.0


WHITE = Colour()


def neighbours(residual: np.ndarray, apart: np.ndarray) -> float:
    """Return the correlation of neighbouring residuals [-]; 0 if there are none.

    Args:
        residual: clipped or weighted, (n,).
        apart: distance of each residual from the one before, (n - 1,).
    """
    beside = apart == 1
    power = float(np.mean(residual**2)) if residual.size else 0.0
    if not beside.any() or not power > 0.0:
        return 0.0
    return float(np.mean((residual[1:] * residual[:-1])[beside])) / power


def colour_of(
    residual: np.ndarray,
    used: np.ndarray,
    columns: np.ndarray,
    false: tuple[float, ...] = (),
    width: int = 1,
) -> Colour:
    """Return the noise of neighbouring bins, with a correlation within limits.

    A slightly negative one, and a positive one below its standard error, are set to 0.

    The error of the acceleration alternates, and hides a part of the correlation of the torque's noise. It is told apart where
    residuals are correlated positively. So is what the fit took of the noise.

    Args:
        residual: of the fit, (n,).
        used: mask of the fitted samples, (n,).
        columns: that were fitted, (n, p).
        false: products by lag of what the acceleration's error adds to the residual, (LAGS,); empty: nothing.
        width: of the means [sample].
    """
    at = np.flatnonzero(used)
    large = robust.HUBER * robust.robust_spread(residual[at])
    score = np.clip(residual[at], -large, large)
    correlation = min(max(before_clipping(neighbours(score, np.diff(at))), OPPOSITE), MOST)
    if SLIGHT < correlation < 1.0 / math.sqrt(max(at.size, 1)):
        return WHITE
    if not (correlation > 0.0 and large > 0.0 and false and false[0] > 0.0):
        return of_means(before_fit(correlation, columns, used), width)
    shares = min(CLIPPED / float(np.mean(score**2)), HIDDEN / false[0]) * np.array(false)
    alone, rounding = float((correlation - shares[1]) / (1.0 - shares[0])), shares / (1.0 - shares[0])
    if not 0.0 < alone <= MOST or rounding[0] < SHOWN * (
        1.0 - alone
    ):  # what the model lacks is no such noise
        return of_means(before_fit(correlation, columns, used), width)
    return replace(of_means(before_fit(alone, columns, used), width), rounding=as_noise(rounding))


def of_means(correlation: float, width: int) -> Colour:
    """Return the noise of means of an autoregression.

    Args:
        correlation: of neighbouring means [-].
        width: of a mean [sample].
    """
    if width < 2 or correlation < LEAST_OF_MEANS:
        return Colour(correlation)
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):  # the correlation of neighbouring means grows with that of samples
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _of_neighbours(middle, width) < correlation else (low, middle)
    kept = (0.5 * (low + high)) ** width
    return Colour(kept, averaged=1.0 - kept / correlation)


def _of_neighbours(sample: float, width: int) -> float:
    """Return the correlation of neighbouring means of an autoregression, by that of neighbouring samples [-]."""
    lags = np.arange(1, width)
    whole = width + 2.0 * float((width - lags) @ sample**lags)
    return sample * ((1.0 - sample**width) / (1.0 - sample)) ** 2 / whole


def before_clipping(correlation: float) -> float:
    """Return the correlation of normal noise by that of the same noise after clipping [-].

    Of a function of normal noise the correlation is a sum of powers of that of the noise, by the squares of its coefficients in
    Hermite's polynomials (Price, IRE Trans. Information Theory 4, 1958).
    """
    found = correlation
    for _ in range(ROUNDS):
        found = correlation + CUBIC * (found - found**3)
    return found


def before_fit(correlation: float, columns: np.ndarray, used: np.ndarray) -> float:
    """Return the correlation of neighbours in noise, by that in the residuals of a fit, which took what looks like its columns [-].

    With P = 1 - Q Q', Q the orthonormal columns, G the correlation of the noise, and J the shift by a sample and back, halved, the
    residuals' products of neighbours and squares are those of the noise less tr (J G - P J P G) and tr (G - P G).

    Args:
        correlation: of neighbouring residuals [-].
        columns: that were fitted, (n, p).
        used: mask of the fitted samples, (n,).
    """
    count, pairs = int(np.count_nonzero(used)), int(np.count_nonzero(used[1:] & used[:-1]))
    p = columns.shape[1]
    if (
        not (correlation > -SLIGHT and pairs > 0 and count > p)
        or 4.0 * p < SMALL * (1.0 - correlation) * count
    ):
        return correlation
    Q = np.zeros(columns.shape)
    Q[used] = np.linalg.qr(columns[used])[0]
    beside = np.zeros(Q.shape)
    beside[1:] += 0.5 * Q[:-1]
    beside[:-1] += 0.5 * Q[1:]
    beside *= used[:, None]
    found = correlation
    for _ in range(ROUNDS):
        band = np.tile([[-found], [1.0 + found**2]], len(Q))  # of the inverse of G, but for a factor
        band[1, [0, -1]] = 1.0
        G = (1.0 - found**2) * solveh_banded(band, Q)
        inside = Q.T @ G
        squares = float(np.trace(inside))
        products = 2.0 * float(np.sum(beside * G)) - float(np.sum((beside.T @ Q) * inside))
        before, found = found, (correlation * (count - squares) / count * pairs + products) / pairs
        found = min(max(found, correlation), 0.5 * (1.0 + correlation), MOST)
        if abs(found - before) < SMALL * (1.0 - found):
            break
    return found


def as_noise(products: np.ndarray) -> tuple[float, ...]:
    """Return products by lag that some noise has: as they are, or with white noise more where the cut at the last lag left none.

    Args:
        products: of neighbours by lag, (LAGS,).
    """
    found = [float(product) for product in products]
    found[0] += max(RIDGE * found[0] - float(np.min(power_of(found, ANGLES))), 0.0)
    return tuple(found)


def power_of(products: Sequence[float], angle: np.ndarray) -> np.ndarray:
    """Return the power by frequency of noise with given products by lag, in their unit, (n,).

    Args:
        products: of neighbours by lag.
        angle: frequencies [rad/bin], (n,).
    """
    return sum(
        ((1.0 + (lag > 0)) * product * np.cos(lag * angle) for lag, product in enumerate(products)),
        np.zeros_like(angle),
    )


def whiten(rows: np.ndarray, apart: np.ndarray, correlation: float) -> np.ndarray:
    """Return rows as the noise of each is white and of the same size, the first one as it is, (n, ...).

    Args:
        rows: one a sample, (n, ...).
        apart: distance of each sample from the one before, (n - 1,).
        correlation: of the noise of neighbouring samples, from 0 to below 1 [-].
    """
    result = np.array(rows)
    # as if all were neighbours: one factor for all takes a third of the time
    result[1:] -= correlation * rows[:-1]
    result[1:] /= np.sqrt(1.0 - correlation**2)
    far = np.flatnonzero(apart != 1)
    kept = (correlation ** apart[far]).reshape(-1, *[1] * (rows.ndim - 1))
    result[far + 1] = (rows[far + 1] - kept * rows[far]) / np.sqrt(1.0 - kept**2)
    return result


def whiten_some(rows: np.ndarray, at: np.ndarray, correlation: float) -> np.ndarray:
    """Return rows of which some are as `whiten` makes them, all others as they are, (n, ...).

    Args:
        rows: one a sample, (n, ...).
        at: index of each sample that is whitened, ascending, (m,).
        correlation: of the noise of neighbouring samples, from 0 to below 1 [-].
    """
    result = np.empty_like(rows)
    for first in range(1, len(rows), PIECE):  # all as if they were neighbours
        part, before = result[first : first + PIECE], rows[first - 1 : first - 1 + PIECE]
        np.multiply(before[: len(part)], correlation, out=part)
        np.subtract(rows[first : first + PIECE], part, out=part)
        part /= np.sqrt(1.0 - correlation**2)
    apart = np.diff(at)
    far = np.flatnonzero(apart != 1)
    here, kept = at[far + 1], (correlation ** apart[far]).reshape(-1, *[1] * (rows.ndim - 1))
    result[here] = (rows[here] - kept * rows[at[far]]) / np.sqrt(1.0 - kept**2)
    same = np.ones(len(rows), dtype=bool)
    same[at[1:]] = False
    result[same] = rows[same]
    return result


def whiten_both(rows: np.ndarray, at: np.ndarray, colour: Colour) -> np.ndarray:
    """Return rows as the autoregression and the acceleration's error together are white and of the same size, (n, m).

    Args:
        rows: one a bin, (n, m).
        at: index of each bin, ascending, (n,).
        colour: with a correlation from 0 to below 1, and something beside it.
    """
    kept = np.append(0.0, colour.correlation ** np.diff(at))
    left = rows - kept[:, None] * np.vstack([rows[:1], rows[:-1]])
    n, false = at.size, np.append(colour.beside, 0.0)
    index = np.arange(n)
    before = np.maximum(index - 1, 0)

    def product(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        return false[np.minimum(np.abs(at[i] - at[j]), LAGS)]

    band = np.zeros((LAGS + 1, n))
    for k in range(min(LAGS + 1, n)):
        i, j = index[k:], index[: n - k]
        here, there = kept[i], kept[j]
        band[k, : n - k] = product(i, j) + here * there * product(before[i], before[j])
        band[k, : n - k] -= here * product(before[i], j) + there * product(i, before[j])
    band[0] += 1.0 - kept**2
    lower = cholesky_banded(band, lower=True)
    return np.sqrt(1.0 + false[0]) * solve_banded((LAGS, 0), lower, left)
