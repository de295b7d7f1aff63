"""Residuals that repeat with the motion: what a model misses, or an encoder rounds, in each of many like cycles.

A motion that repeats exactly has the same misfit in every cycle. More cycles do not average it, so that it must not count as
noise of as many samples. It shows as correlation at lags far beyond those of noise: at the period and its multiples.
"""

from __future__ import annotations

import numpy as np

CLEAR = 5.0  # least correlation at a lag that shows a repetition [standard deviation]
BESIDE = 2.0  # the same of lags beside it [standard deviation]
LEAST = 20.0  # least number of products at a lag


def with_repeats(correlation: np.ndarray, total: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return a correlation with the lags added at which residuals repeat; as it is where they do not, (L,).

    Estimates at lags without correlation scatter by the root of the sum of all squared correlations, by the number of products
    (M. S. Bartlett, J. R. Stat. Soc. Suppl. 8, 1946).

    Args:
        correlation: of the noise, 1 at lag 0 [-], (K,).
        total: sum of the products of residuals by lag, (n,).
        counts: number of these products, 1 at least, (n,).
    """
    near = correlation.size
    found = total / counts * (counts[0] / max(float(total[0]), 1e-300))
    scatter = np.sqrt((2.0 * float(correlation @ correlation) - 1.0) / counts)
    open_ = (found > BESIDE * scatter) & (counts >= LEAST)
    open_[:near] = False
    clear = open_ & (found > CLEAR * scatter)
    if not clear.any():
        return correlation
    stretch = np.cumsum(np.diff(open_, prepend=False))  # odd within a run of lags
    kept = open_ & np.isin(stretch, stretch[clear])
    whole = np.zeros(int(np.flatnonzero(kept)[-1]) + 1)
    whole[:near] = correlation
    whole[kept[: whole.size]] = found[kept]
    return whole
