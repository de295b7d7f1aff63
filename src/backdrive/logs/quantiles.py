"""Median and quantiles of a series, as of `numpy.median` and `numpy.quantile`, sooner: NumPy sorts partially at several ranks.

At one rank alone its partial sort compares several samples at once; the value of the next rank is the least of what is above.
"""

from __future__ import annotations

import math

import numpy as np


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
    if not x.size:
        return math.nan
    rank = share * (x.size - 1)
    low = min(int(rank), x.size - 1)
    first, second = at_rank(x, low)
    apart, rest = second - first, rank - low
    if not rest or not apart:  # not between two infinities
        return second if math.isnan(second) else first
    return second - apart * (1.0 - rest) if rest >= 0.5 else first + apart * rest


def at_rank(x: np.ndarray, rank: int) -> tuple[float, float]:
    """Return the values of a rank of a series and of the next rank; of the last rank, its value twice.

    NaN is the largest; with any in the series, the second value is NaN.

    Args:
        x: (n,), at least one.
        rank: from 0 to n - 1.
    """
    inside = x.copy()
    inside.partition(rank)
    first, above = float(inside[rank]), inside[rank + 1 :]
    return first, float(above.min()) if above.size else first
