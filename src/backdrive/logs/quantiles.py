"""Median and quantiles of long series, as of `numpy.median` and `numpy.quantile`, sooner.

A sorted sample of the series bounds the value sought, so that only the few values between these bounds are sorted (Floyd & Rivest,
Communications of the ACM 18, 1975). The result is exact. NumPy sorts partially at several ranks, for NaN among others.
"""

from __future__ import annotations

import math

import numpy as np

SMALL = 4000  # shorter series are sorted partially as they are
SAMPLE = 0.6  # exponent of the sample's size
MARGIN = 1.7  # distance of a bound from the rank sought [root of the sample's size]


def median(x: np.ndarray) -> float:
    """Return the median of a series; NaN if it is empty or holds a NaN.

    Args:
        x: (n,).
    """
    return quantile(x, 0.5)


def quantile(x: np.ndarray, share: float) -> float:
    """Return the value below which a share of a series lies, interpolated between two samples; NaN if it is empty or holds a NaN.

    Args:
        x: (n,).
        share: from 0 to 1 [-].
    """
    if not x.size or math.isnan(x.min()):
        return math.nan
    rank = share * (x.size - 1)
    low = min(int(rank), x.size - 1)
    first, second = at_rank(x, low)
    apart, rest = second - first, rank - low
    if not rest or not apart:  # not between two infinities
        return first
    return second - apart * (1.0 - rest) if rest >= 0.5 else first + apart * rest


def at_rank(x: np.ndarray, rank: int) -> tuple[float, float]:
    """Return the values of a rank of a series and of the next rank; of the last rank, its value twice. NaN is the largest.

    Args:
        x: (n,), at least one.
        rank: from 0 to n - 1.
    """
    inside, at = (x.copy(), rank) if x.size < SMALL else _between_bounds(x, rank)
    after = min(at + 1, inside.size - 1)
    inside.partition((at, after))
    return float(inside[at]), float(inside[after])


def _between_bounds(x: np.ndarray, rank: int) -> tuple[np.ndarray, int]:
    """Return the values within bounds that hold a rank and the next one, and the rank among them; all if a sample misled."""
    sample = np.sort(x[:: int(x.size / x.size**SAMPLE)])
    middle, margin = rank * sample.size // x.size, 2 + int(MARGIN * math.sqrt(sample.size))
    low, high = sample[max(middle - margin, 0)], sample[min(middle + margin, sample.size - 1)]
    below = x < low
    inside, at = x.take(np.flatnonzero(below ^ (x <= high))), rank - int(np.count_nonzero(below))
    found = high >= low and 0 <= at < inside.size - 1  # not if a bound is NaN
    return (inside, at) if found else (x.copy(), rank)
