"""Zero-phase filters and differentiation on a uniform clock. Torque and every regressor get the same filter.

Filtering both sides of a linear model with one linear filter leaves its parameters unchanged, so the filter may take away
what the sampling cannot resolve without biasing the fit.
"""

from __future__ import annotations

import numpy as np

from backdrive.errors import InvalidInput


def low_pass(x: np.ndarray, cutoff: float, rate: float, order: int = 4) -> np.ndarray:
    """Filter forwards and backwards with a Butterworth low pass, along axis 0.

    Args:
        x: uniform samples, (n, ...).
        cutoff: corner frequency of one pass [Hz].
        rate: sampling frequency [Hz].
        order: of one pass.

    Returns:
        The filtered samples, the shape of `x`; a copy of `x` where the cut-off is above 0.45 of the rate.

    Raises:
        InvalidInput: cutoff or rate are not positive, or there are too few samples to filter.
    """
    x = np.asarray(x, dtype=np.float64)
    if not (cutoff > 0 and rate > 0):
        raise InvalidInput(f"cutoff = {cutoff} Hz at rate = {rate} Hz.", remedy="Both must be positive.")
    if cutoff >= 0.45 * rate:
        return x.copy()
    from scipy.signal import butter, sosfiltfilt

    sos = butter(order, cutoff, fs=rate, output="sos")
    pad = min(int(3 * rate / cutoff), x.shape[0] - 1)
    if pad < 1:
        raise InvalidInput(f"{x.shape[0]} samples are too few to filter.", remedy="Give a longer log.")
    return sosfiltfilt(sos, x, axis=0, padlen=pad)


def derivative(x: np.ndarray, period: float) -> np.ndarray:
    """Differentiate by central differences, along axis 0 (one-sided at the ends).

    Args:
        x: uniform samples, (n, ...).
        period: sampling interval [s].
    """
    return np.gradient(np.asarray(x, dtype=np.float64), period, axis=0)


def decimate(x: np.ndarray, factor: int) -> np.ndarray:
    """Keep every `factor`-th sample after a zero-phase 8th-order Chebyshev-I low pass, along axis 0.

    Args:
        x: uniform samples, (n, ...).
        factor: 1 keeps everything.
    """
    if factor <= 1:
        return np.array(x, dtype=np.float64)
    from scipy.signal import decimate as scipy_decimate

    return scipy_decimate(np.asarray(x, dtype=np.float64), factor, n=8, ftype="iir", axis=0, zero_phase=True)


def shift(x: np.ndarray, samples: float) -> np.ndarray:
    """Move a signal later by a whole or broken number of samples, by linear interpolation, ends held.

    Args:
        x: uniform samples, (n,) or (n, J).
        samples: how far; negative moves it earlier [sample].
    """
    x = np.asarray(x, dtype=np.float64)
    index = np.arange(x.shape[0], dtype=np.float64)
    columns = x.reshape(x.shape[0], -1)
    moved = np.stack([np.interp(index - samples, index, c) for c in columns.T], axis=1)
    return moved.reshape(x.shape)
