"""Autocorrelation of noise, and the resulting errors of weighted sums.

The residuals of a regression come in runs of neighbouring samples. The variance of their sum with weights z is z' G z, where G
is the autocovariance of the noise. Its shape is estimated from all runs together, its size from each run.

The weights of the lags are one up to the last lag with a significant correlation, and then fall linearly (Politis & Romano,
J. Time Series Analysis 16, 1995; the lag nearly as in Politis, J. Nonparametric Statistics 15, 2003). Weights that fall from
the first lag on would mix high-frequency noise, such as that of an acceleration, into the level at zero frequency. In each run
a line or a polynomial of the velocity was fitted, so its residuals are smaller than the noise. With Q the orthonormal columns
of that fit and P = 1 - Q Q', their autocovariance is that of P G P. The missing part is added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg.lapack import dpotrf  # type: ignore[attr-defined]
from scipy.special import stdtrit

from backdrive.identification import regression, robust
from backdrive.identification.lag_products import (
    between_columns,
    products,
    sums,
    toeplitz,
    transforms,
    white_loss,
)
from backdrive.identification.repeats import with_repeats
from backdrive.logs.filters import fft_length

LONGEST = 400  # largest lag of a correlation [sample]
SEEN = 2.0  # least significant correlation, relative to sqrt(log10 N / N) [-]
QUIET = 10  # number of consecutive insignificant lags that end the correlation
ROUNDS = 4  # number of iterations; in each, the part removed by the fit follows from the last correlation
WHOLE = 10.0  # weight of the noise of all runs in the noise of one run [independent sample]
RARE = 0.99865  # share of normal errors below three standard ones [-]
FEW = 50.0  # independent samples up to which a correlation cannot be seen to its end
FEWEST = 3.0  # least degrees of freedom of an error
SLOW = 0.02  # least share of columns in the independent samples with which the colour counts in what a fit takes [-]
SLOWER = 2.0  # variance of a sum by that for white noise above which noise is slow [-]
LONG = 100_000  # number of samples above which a fit takes hardly anything
LEAST = 0.1  # least variance of a sum, relative to that of white noise of the same size [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class Noise:
    """Noise of residuals in runs of samples.

    Attributes:
        correlation: autocorrelation by lag, 1 at lag 0 [-], (L,).
        size: standard deviation of the noise in each run [unit of the residuals], (R,).
        widening: factor on standard errors, as of `rare`, for the number of independent samples behind a run's size and behind
            the correlation [-], (R,).
    """

    correlation: np.ndarray
    size: np.ndarray
    widening: np.ndarray

    def covariance(self, z: np.ndarray, run: int) -> np.ndarray:
        """Return the covariance of the sums over a run of noise weighted by z, (k, k).

        Args:
            z: rows of weights, (k, n).
            run: index of the run.
        """
        full = z @ toeplitz(z.T, self.correlation)
        white = z @ z.T
        return (self.widening[run] * self.size[run]) ** 2 * _possible(full, white)


def noise_of(residuals: Sequence[np.ndarray], velocities: Sequence[np.ndarray], degree: int = 1) -> Noise:
    """Return the noise of residuals from which a polynomial of the velocity is removed in each run.

    Args:
        residuals: of each run, (n,).
        velocities: of each run, (n,).
        degree: of the polynomial.
    """
    bases = [_basis(v, degree) for v in velocities]
    left = [r - Q @ (Q.T @ r) for r, Q in zip(residuals, bases, strict=True)]
    power = np.array([float(np.mean(r**2)) for r in left])
    lags = min(LONGEST, max(r.size for r in left))
    raw = np.zeros(lags)
    for r, p in zip(left, power, strict=True):
        if p > 0.0:
            raw += sums(r, lags) / p
    correlation, weights, kept = np.ones(1), np.ones(1), np.ones(len(left))
    pairs = [products(Q, lags) for Q in bases]
    for _ in range(ROUNDS):
        taken, count = np.zeros(lags), np.full(lags, 1e-300)
        for i, (Q, QQ) in enumerate(zip(bases, pairs, strict=True)):
            lost = _fit_loss(Q, QQ, correlation)
            kept[i] = max(1.0 - lost[0] / len(Q), LEAST)
            if raw[0] > 0.0 and not power[i] > 0.0:  # a silent run tells nothing of the correlation
                continue
            taken += lost / kept[i]
            count += np.maximum(len(Q) - np.arange(lags), 0) / kept[i]
        whole = (raw + taken) / count
        raw_correlation = whole / whole[0]
        weights = lag_weights(raw_correlation, sum(r.size for r in left))
        correlation = raw_correlation[: weights.size] * weights
    correlation = _if_few(correlation, lags, sum(r.size for r in left))
    wide = max(float(correlation[0] + 2.0 * correlation[1:].sum()), 1.0)
    independent = np.array([r.size for r in left]) / wide
    size = np.sqrt(power / kept)
    shrunk = np.where(size > 0.0, _shrunk(size, independent), 0.0)
    squares = 2.0 * float(weights[1:] @ weights[1:])  # the variance of a sum of correlations, by that of one
    freedom = 1.0 / (1.0 / (independent + WHOLE - (degree + 1)) + squares / sum(r.size for r in left))
    return Noise(correlation=correlation, size=np.maximum(size, shrunk), widening=rare(freedom))


def _if_few(correlation: np.ndarray, lags: int, count: int) -> np.ndarray:
    """Return a correlation, or where it leaves few independent samples an autoregression's, if that is longer.

    Args:
        correlation: estimated, by lag [-], (L,).
        lags: number of lags.
        count: number of samples.
    """
    first = float(correlation[1]) if correlation.size > 1 else 0.0
    if not first > 0.0 or count * (1.0 - first) > FEW * (1.0 + first):
        return correlation
    regular = first ** np.arange(lags)
    return regular if regular[1:].sum() > correlation[1:].sum() else correlation


def rare(freedom: float | np.ndarray) -> Any:
    """Return the factor on standard errors with which three of them hold what three of normal errors do, 99.73 % [-].

    It is Student's quantile; 1.96 of such errors hold more than 95 %.

    Args:
        freedom: degrees of freedom of the noise's size, (...); at least `FEWEST` is used.
    """
    return stdtrit(np.maximum(freedom, FEWEST), RARE) / 3.0


def _shrunk(size: np.ndarray, independent: np.ndarray) -> np.ndarray:
    """Return the noise of each run, shrunk towards that of all runs if the run has few independent samples, (R,).

    With few samples, the noise of a run is often underestimated, and the standard error of a sum would be too small.

    Args:
        size: standard deviation of each run alone, (R,).
        independent: equivalent number of independent samples of each run, (R,).
    """
    whole = float(independent @ size**2) / float(independent.sum())
    return np.sqrt((independent * size**2 + WHOLE * whole) / (independent + WHOLE))


def covariance_of_fit(
    X: np.ndarray, residual: np.ndarray, used: np.ndarray, share: float = 1.0
) -> np.ndarray:
    """Return the covariance of coefficients fitted with Huber's loss, for the correlation of the fit's residuals, (p, p).

    It is widened for the lost degrees of freedom, and by Student's distribution for the number of independent samples.

    Args:
        X: regressor of evenly spaced samples, (n, p).
        residual: of the fit, (n,).
        used: mask of the fitted samples, (n,).
        share: of the samples that was independent before they were whitened [-].
    """
    p = X.shape[1]
    spread = robust.robust_spread(residual[used]) or float(np.sqrt(np.mean(residual[used] ** 2)))
    width = robust.HUBER * spread
    score = np.where(used, np.clip(residual, -width, width), 0.0)
    if not float(score @ score) > 0.0:
        return np.zeros((p, p))
    kept = X * used[:, None]
    inverse = regression.invert(kept.T @ kept)
    covariance, independent = covariance_of_scores(kept, score, used, inverse)
    bread = inverse / max(float(np.mean(np.abs(residual[used]) <= width)), LEAST)
    freedom = min(independent - p, max(share * np.count_nonzero(used), FEWEST))
    return regression.widen_covariance(bread @ covariance @ bread, freedom)


def covariance_of_scores(
    X: np.ndarray, score: np.ndarray, used: np.ndarray, inverse: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the covariance of the sums X' score for stationary noise, (p, p), and its number of independent samples.

    Args:
        X: regressor of evenly spaced samples, 0 at those that are not used, (n, p).
        score: residuals of the fit, clipped or weighted, 0 at samples that are not used, (n,).
        used: mask of the fitted samples, (n,).
        inverse: of X'X, (p, p).
    """
    size, p = int(np.count_nonzero(used)), X.shape[1]
    lags = min(LONGEST, len(score))
    total, counts = sums(np.stack([score, used]), len(score))
    counts = np.maximum(counts, 1.0)
    each = transforms(X, lags)
    lost = white_loss(each, inverse, lags)
    for _ in range(ROUNDS):
        lagged = total[:lags] + total[0] / max(size - float(lost[0]), LEAST * size) * lost
        lagged /= counts[:lags]
        correlation = taper(lagged / lagged[0], size)
        wide = max(correlation[0] + 2.0 * float(correlation[1:].sum()), 1.0)
        if p * wide < SLOW * size or size > LONG:
            break
        lost = _loss_of_colour(X, used, inverse, correlation, lags)
    weights = 1.0 - np.arange(correlation.size) / correlation.size  # those that fall from the first lag on
    other = between_columns(each, lagged[: weights.size] / lagged[0] * weights) if wide > SLOWER else None
    whole = with_repeats(correlation, total, counts)
    if whole.size > correlation.size:
        each = transforms(X, whole.size)
        far = np.arange(correlation.size, whole.size)
        wide += 2.0 * float(whole[far] @ (1.0 - far / len(X)))
    full = between_columns(each, whole)
    return lagged[0] * _possible(full, X.T @ X, other), size / wide


def _possible(full: np.ndarray, white: np.ndarray, other: np.ndarray | None = None) -> np.ndarray:
    """Return the covariance of weighted sums, or the nearest possible one, since an estimated correlation need not be one, (k, k).

    No sum has less than `LEAST` of the variance that it has for white noise; others keep theirs.

    Args:
        full: by the estimated correlation, for noise of unit size, (k, k).
        white: for white noise of the same size, (k, k).
        other: by an estimate that leaves no negative variance, for the sums that are corrected, (k, k); None: none.
    """
    if full.size == 1 and other is None:
        return np.maximum(full, LEAST * white)
    size = np.sqrt(np.maximum(np.diag(white), 1e-300))
    beyond = 0.5 * (full + full.T) - LEAST * white
    scaled = beyond / np.outer(size, size)
    if dpotrf(scaled)[1] == 0:  # no negative variance, in a fraction of the time
        return 0.5 * (full + full.T)
    values, vectors = np.linalg.eigh(scaled)
    least = 0.0 if other is None else np.einsum("ik,ij,jk->k", vectors, other / np.outer(size, size), vectors)
    values = np.where(values < 0.0, np.maximum(least, 0.0), values)
    return (vectors * values) @ vectors.T * np.outer(size, size) + LEAST * white


def taper(correlation: np.ndarray, count: int) -> np.ndarray:
    """Return a correlation, unchanged up to its last significant lag, and reduced linearly to zero over as many lags more.

    Args:
        correlation: estimated correlation by lag, 1 at lag 0 [-], (L,).
        count: number of samples behind the estimate.
    """
    weights = lag_weights(correlation, count)
    return correlation[: weights.size] * weights


def lag_weights(correlation: np.ndarray, count: int) -> np.ndarray:
    """Return the weights of the lags that `taper` keeps [-], (K,).

    Args:
        correlation: as of `taper`, (L,).
        count: number of samples behind the estimate.
    """
    seen = np.abs(correlation[1:]) >= SEEN * np.sqrt(np.log10(max(count, 10)) / count)
    last = quiet = 0
    for lag, one in enumerate(seen.tolist(), 1):
        quiet = 0 if one else quiet + 1
        last = lag if one else last
        if quiet >= QUIET:
            break
    lags = np.arange(min(max(2 * last, 1), correlation.size))
    return np.minimum(1.0, 2.0 - lags / max(last, 1))


def _basis(velocity: np.ndarray, degree: int) -> np.ndarray:
    """Return orthonormal columns of a polynomial of the velocity, (n, degree + 1)."""
    v = velocity - velocity.mean()
    return np.linalg.qr(np.vander(v / max(float(np.abs(v).max()), 1e-300), degree + 1))[0]


def _fit_loss(Q: np.ndarray, QQ: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Return the decrease of the sum of products e_k e_(k+h) of unit noise by a fit of columns Q, by lag, (lags,).

    With the shift J_h, averaged with its transpose, that is tr J_h (G - P G P) = 2 tr Q' J_h G Q - tr (Q' J_h Q) (Q' G Q).
    """
    G = toeplitz(Q, correlation)
    n = fft_length(len(Q) + QQ.shape[2])
    both = np.conj(np.fft.rfft(Q.T, n)) * np.fft.rfft(G.T, n)
    across = np.fft.irfft(2.0 * both.sum(axis=0).real, n)[: QQ.shape[2]]  # forwards and backwards
    return across - np.einsum("abh,ab->h", QQ, Q.T @ G)


def _loss_of_colour(
    X: np.ndarray, used: np.ndarray, inverse: np.ndarray, correlation: np.ndarray, lags: int
) -> np.ndarray:
    """Return the same for noise of a correlation: with G its matrix, 2 tr J_h G H - tr J_h H G H, by lag, (lags,).

    Args:
        X: columns, 0 at samples that are not used, (n, p).
        used: mask of the fitted samples, (n,).
        inverse: (X'X)^-1, (p, p).
        correlation: by lag [-], (L,).
        lags: number of lags.
    """
    G = toeplitz(X, correlation) * used[:, None]
    left = 2.0 * G - X @ (inverse @ (X.T @ G))
    size = fft_length(len(X) + lags)
    each, other = np.fft.rfft((X @ inverse).T, size), np.fft.rfft(left.T, size)
    return np.fft.irfft(np.sum(np.conj(each) * other, axis=0).real, size)[:lags]
