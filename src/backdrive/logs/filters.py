"""Zero-phase filters and differentiation on a uniform clock. Torque and every regressor get the same filter.

Filtering both sides of a linear model with the same linear filter does not change its parameters. So the filter may remove
what the sampling cannot resolve, without bias of the fit.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from functools import cache, lru_cache

import numpy as np

from backdrive.errors import InvalidInput

SHORT = 1 << 16  # the gains of up to so many samples are kept for the next series [sample]
CIRCLE = 1 << 13  # length of the pieces of a long series, unless the response is longer [sample]
ROUNDING = 34.0  # natural logarithm of what no longer changes a number, inverse [-]
AT_ONCE = 1 << 16  # pieces are transformed together, in half the time; more would not fit the cache [sample]
FINE = 8.0  # least rate of means that are low-passed [cutoff frequency]
LEAST_MEANS = 50  # least number of such means, if there are as many samples
ODD = tuple(3**i * 5**j for i in range(20) for j in range(14))  # odd factors of lengths that transform fast


def low_pass(x: np.ndarray, cutoff: float, rate: float, order: int = 4) -> np.ndarray:
    """Filter with a Butterworth low pass as if forwards and backwards, along axis 0.

    The squared gain of the two passes, 1 / (1 + (tan(pi f T) / tan(pi f_c T))^(2 order)), is applied in the frequency domain.
    The phase is zero, and only the continued ends cause a transient.

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
    if x.ndim == 1:
        return low_pass_rows(x[None], cutoff, rate, order)[0]
    rows = low_pass_rows(x.reshape(x.shape[0], -1).T, cutoff, rate, order)
    return np.ascontiguousarray(rows.T).reshape(x.shape)


def low_pass_rows(
    rows: Sequence[np.ndarray] | np.ndarray,
    cutoff: float,
    rate: float,
    order: int = 4,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Return what `low_pass` makes of series of equal length, (k, n); together they take two thirds of the time.

    Args:
        rows: uniform samples of each series, (k, n).
        cutoff: corner frequency of one pass [Hz].
        rate: sampling frequency [Hz].
        order: of one pass.
        out: array for the result, apart from `rows`, (k, n); None: a new one.

    Raises:
        InvalidInput: as `low_pass`.
    """
    if not (cutoff > 0 and rate > 0):
        raise InvalidInput(f"cutoff = {cutoff} Hz at rate = {rate} Hz.", remedy="Both must be positive.")
    if not cutoff > 1e-12 * rate:
        raise InvalidInput(
            f"cutoff = {cutoff:g} Hz at rate = {rate:g} Hz: the filter would remove everything.",
            remedy="Give a higher one.",
        )
    size = len(rows[0]) if len(rows) else 0
    if not len(rows):
        return np.array(rows, dtype=np.float64)
    if cutoff >= 0.45 * rate:
        result = np.empty((len(rows), size)) if out is None else out
        result[:] = rows
        return result
    if size < 2:
        raise InvalidInput(f"{size} samples are too few to filter.", remedy="Give a longer log.")
    margin, circle = fade(cutoff / rate, order), CIRCLE
    while 8 * margin > circle:
        circle *= 2
    result = np.empty((len(rows), size)) if out is None else out
    if size > 2 * circle:
        _in_pieces(
            [np.asarray(row, dtype=np.float64) for row in rows],
            _gain_of(circle, cutoff / rate, order),
            margin,
            result,
        )
        return result
    pad = min(margin, size - 1)
    circle = fft_length(size + 2 * pad)
    gain, at_once = _gain_of(circle, cutoff / rate, order), max(1, AT_ONCE // circle)
    for k in range(0, len(rows), at_once):
        x = np.asarray(rows[k : k + at_once], dtype=np.float64)
        spectrum = spectrum_of(x, pad, circle)
        spectrum *= gain
        filtered = np.fft.irfft(spectrum, circle)[:, pad : pad + size]
        np.add(filtered, 0.5 * (x[:, :1] + x[:, -1:]), out=result[k : k + at_once])
    return result


def low_pass_means(x: np.ndarray, cutoff: float, rate: float) -> tuple[np.ndarray, float]:
    """Return the low-passed means of neighbouring samples, and their rate [Hz]: nearly `low_pass`, of fewer samples.

    Args:
        x: uniform samples, (n,).
        cutoff: corner frequency of one pass [Hz].
        rate: sampling frequency [Hz].
    """
    width = max(1, min(int(rate / (FINE * cutoff)), x.size // LEAST_MEANS))
    rate /= width
    return low_pass(means(x, width), cutoff, rate), rate


def fade(cutoff: float, order: int = 4) -> int:
    """Return the number of samples after which the response of `low_pass` has faded.

    Args:
        cutoff: by the sampling rate [-].
        order: of one pass.
    """
    # of the poles, before sampling
    slowest = math.tan(math.pi * cutoff) * cmath.exp(0.5j * math.pi * (1.0 + 1.0 / order))
    return math.ceil(ROUNDING / -math.log(abs((1.0 + slowest) / (1.0 - slowest))))


def _in_pieces(rows: Sequence[np.ndarray], gain: np.ndarray, margin: int, result: np.ndarray) -> None:
    """Filter long series in overlapping pieces, which the cache holds.

    Args:
        rows: uniform samples of each series, (k, n).
        gain: at the frequencies of a piece [-], (c / 2 + 1,); n is at least 2 c.
        margin: number of samples after which the response has faded; each piece begins and ends so much outside of what it gives.
        result: array for the filtered series, (k, n).
    """
    size, circle = len(rows[0]), 2 * (gain.size - 1)
    length, at_once = circle - 2 * margin, max(1, AT_ONCE // circle)
    pieces = [
        (row, into, begin) for row, into in zip(rows, result, strict=True) for begin in range(0, size, length)
    ]
    for k in range(0, len(pieces), at_once):
        part = pieces[k : k + at_once]
        x = np.empty((len(part), circle))
        for window, (row, _, begin) in zip(x, part, strict=True):
            _reflect(row, begin - margin, window)
        level = 0.5 * (x[:, :1] + x[:, -1:])
        x -= level
        spectrum = np.fft.rfft(x)
        spectrum *= gain
        filtered = np.fft.irfft(spectrum, circle)
        for piece, shift, (_, into, begin) in zip(filtered, level, part, strict=True):
            end = min(begin + length, size)
            np.add(piece[margin : margin + end - begin], shift, out=into[begin:end])


def _reflect(row: np.ndarray, first: int, window: np.ndarray) -> None:
    """Write a window of a series, continued by point reflection at its ends, from an index on."""
    n, size = row.size, window.size
    before, after = max(-first, 0), max(first + size - n, 0)
    window[before : size - after] = row[first + before : first + size - after]
    if before:
        window[:before] = 2.0 * row[0] - row[before:0:-1]
    if after:
        window[size - after :] = 2.0 * row[-1] - row[-2 : -after - 2 : -1]


def _gain_of(circle: int, cutoff: float, order: int) -> np.ndarray:
    """Return `_gain`, kept for the next series unless it is long."""
    return (_gain if circle <= SHORT else _gain.__wrapped__)(circle, cutoff, order)


@lru_cache(maxsize=16)
def _gain(n: int, cutoff: float, order: int) -> np.ndarray:
    """Return the gain of `low_pass` at the frequencies of a circle of n samples [-], (n // 2 + 1,)."""
    return power_gain(np.arange(n // 2 + 1) / n, cutoff, order)


def power_gain(frequency: np.ndarray, cutoff: float, order: int = 4) -> np.ndarray:
    """Return the gain of `low_pass` at a frequency [-].

    Args:
        frequency: by the sampling rate [-], any shape.
        cutoff: by the sampling rate [-].
        order: of one pass.
    """
    power = square = (np.tan(np.pi * frequency) / np.tan(np.pi * cutoff)) ** 2
    for _ in range(order - 1):  # not `**`: products take a tenth of the time
        power = power * square
    return 1.0 / (1.0 + power)


def spectrum_of(x: np.ndarray, pad: int, n: int) -> np.ndarray:
    """Return the transform of series whose ends are continued by point reflection, (..., n // 2 + 1).

    The mean of the two end values is subtracted first.

    Args:
        x: uniform samples, (..., m).
        pad: samples by which each end is continued.
        n: length of the circle, at least m + 2 pad.
    """
    m, first, last = x.shape[-1], x[..., :1], x[..., -1:]
    circle = np.empty((*x.shape[:-1], n))
    for row, into in zip(x.reshape(-1, m), circle.reshape(-1, n), strict=True):
        _reflect(row, -pad, into[: m + 2 * pad])
    rest = n - m - 2 * pad  # a line back to the beginning
    begin, end = circle[..., 2 * pad + m - 1 : 2 * pad + m], circle[..., :1]
    circle[..., 2 * pad + m :] = np.arange(1, rest + 1) * ((end - begin) / (rest + 1)) + begin
    circle -= 0.5 * (first + last)  # what lies between the two continued ends on the circle
    return np.fft.rfft(circle)


@cache
def fft_length(n: int) -> int:
    """Return the smallest even number >= n whose prime factors are 2, 3 and 5.

    `scipy.fft.next_fast_len` knows it too; to import it takes a fifteenth of the time of a whole identification.
    """
    return min(odd << max(1, (-(-n // odd) - 1).bit_length()) for odd in ODD)


def derivative(x: np.ndarray, period: float) -> np.ndarray:
    """Differentiate by central differences over two samples to either side, along axis 0; over fewer at the ends.

    The error is of the fourth order of the period. Differences over one sample to either side would take an acceleration of a
    twentieth of the sampling rate as 3 % too small.

    Args:
        x: uniform samples, (n, ...).
        period: sampling interval [s].
    """
    x = np.asarray(x, dtype=np.float64)
    if len(x) < 2:
        raise InvalidInput(f"{len(x)} samples are too few to differentiate.", remedy="Give a longer log.")
    result = np.empty_like(x)
    np.subtract(x[2:], x[:-2], out=result[1:-1])
    if len(x) > 4:
        inner = result[2:-2]
        inner *= 8.0
        inner -= x[4:]
        inner += x[:-4]
        inner /= 6.0
    result[1:-1] /= 2.0 * period
    result[0], result[-1] = (x[1] - x[0]) / period, (x[-1] - x[-2]) / period
    return result


def gain_of_derivative(frequency: np.ndarray) -> np.ndarray:
    """Return by what `derivative` multiplies a wave, but for the imaginary unit and the sampling rate [-], (n,).

    Args:
        frequency: by the sampling rate [-], (n,).
    """
    return (8.0 * np.sin(2.0 * np.pi * frequency) - np.sin(4.0 * np.pi * frequency)) / 6.0


def means(x: np.ndarray, width: int) -> np.ndarray:
    """Return the means of neighbouring samples, so many each; what is left over at the end is left out.

    A product with ones: `mean` takes six times the time where the means are of a few samples.

    Args:
        x: samples, (n,).
        width: [sample].
    """
    rows = x[: x.size // width * width].reshape(-1, width)
    return rows @ np.ones(width) / width


def deflections(position: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """Return the deflection of a bristle, straight at first, as a share of the distance at which it slips [-], (n, w).

    Args:
        position: [rad or m], (n,).
        widths: distances at which it slips [rad or m], (w,).
    """
    z = np.zeros((position.size, widths.size))
    for k, step in enumerate(np.diff(position).tolist(), start=1):
        z[k] = np.minimum(np.maximum(z[k - 1] + step, -widths), widths)
    return z / widths
