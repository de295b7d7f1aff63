"""Products of series and of their later samples, and of columns with the matrix of a correlation by lag, by fast transforms."""

from __future__ import annotations

import numpy as np

from backdrive.logs.filters import fft_length

PIECE = 16_384  # number of frequencies whose products are summed together


def sums(x: np.ndarray, lags: int) -> np.ndarray:
    """Return the sum over k of x_k x_(k+h) for each lag h, of each series in the last axis, (..., lags)."""
    n = fft_length(x.shape[-1] + lags)
    each = np.fft.rfft(x, n)
    return np.fft.irfft(each.real**2 + each.imag**2, n)[..., :lags]


def products(x: np.ndarray, lags: int) -> np.ndarray:
    """Return the sum over k of a_k b_(k+h) for every two columns a and b of x and each lag h, (m, m, lags)."""
    n = fft_length(x.shape[0] + lags)
    each = np.fft.rfft(x.T, n)
    return np.fft.irfft(np.conj(each)[:, None] * each, n)[..., :lags]


def transforms(X: np.ndarray, lags: int) -> np.ndarray:
    """Return the transforms of columns X (n, p) on a circle of an even number of samples, at least n + `lags`, (p, m)."""
    return np.fft.rfft(np.ascontiguousarray(X.T), fft_length(len(X) + lags))


def between_columns(each: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Return X' T X for columns X and the symmetric Toeplitz matrix T of a correlation, (p, p).

    Args:
        each: from `transforms` for L lags at least, (p, m).
        correlation: by lag [-], (L,).
    """
    p, m = each.shape
    weight = np.fft.rfft(_circle(correlation, 2 * (m - 1))).real / (m - 1)
    weight[[0, -1]] *= 0.5  # all other frequencies stand for two
    total = np.zeros((p, p))
    for first in range(0, m, PIECE):
        part = each[:, first : first + PIECE].view(np.float64)  # real and imaginary parts side by side
        total += (part * np.repeat(weight[first : first + PIECE], 2)) @ part.T
    return total


def white_loss(each: np.ndarray, inverse: np.ndarray, lags: int) -> np.ndarray:
    """Return the decrease of the sum of products e_k e_(k+h) of white unit noise by a fit of columns X, by lag, (lags,).

    With H = X (X'X)^-1 X', that is the sum over k of H_(k,k+h). A few smooth columns take it from all short lags alike, so that
    the residuals of a short log look as if their noise was negatively correlated.

    Args:
        each: from `transforms`, (p, m).
        inverse: (X'X)^-1, (p, p).
        lags: number of lags.
    """
    power = np.empty(each.shape[1])
    for first in range(0, power.size, PIECE):
        part = each[:, first : first + PIECE].view(np.float64)
        both = np.einsum("pm,pm->m", inverse @ part, part)
        power[first : first + PIECE] = both[::2] + both[1::2]
    return np.fft.irfft(power)[:lags]


def _circle(correlation: np.ndarray, size: int) -> np.ndarray:
    """Return a symmetric correlation by lag on a circle, (size,)."""
    circle = np.zeros(size)
    circle[: correlation.size] = correlation
    circle[size - correlation.size + 1 :] = correlation[:0:-1]
    return circle


def toeplitz(z: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Return the product of a correlation's symmetric Toeplitz matrix and columns z, (n, k).

    Args:
        z: columns, (n, k).
        correlation: by lag [-], (L,).
    """
    n, m = z.shape[0], min(correlation.size, z.shape[0])
    if m == 1:
        return correlation[0] * z
    size = fft_length(n + m)
    spectrum = np.fft.rfft(_circle(correlation[:m], size)) * np.fft.rfft(z.T, size)
    return np.fft.irfft(spectrum, size)[:, :n].T
