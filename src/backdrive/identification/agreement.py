"""Whether two fits to the same data agree, one of which is more efficient than the other (Hausman, Econometrica 46, 1978)."""

from __future__ import annotations

import numpy as np

MOVED = 3.5  # largest change of a number, relative to the error by which the two fits differ [-]
LEAST_DIFFERENCE = 0.5  # least such error [standard error of the first fit]


def agree(moved: np.ndarray, before: np.ndarray, after: np.ndarray, apart: np.ndarray | None = None) -> bool:
    """Return whether no number moved by more than noise moves two fits apart.

    An efficient estimate and its difference from another one are independent, so the variance of the difference is that by which
    theirs differ. It is not taken as less than a share of the first one's, as errors are estimates themselves.

    Args:
        moved: change of each number from the first fit to the second, more efficient one, (n,).
        before: standard errors of the first fit, (n,).
        after: those of the second, (n,).
        apart: which numbers the two fits tell by different samples, (n,): there the variances add; None: none.
    """
    difference = np.sqrt(np.maximum(before**2 - after**2, (LEAST_DIFFERENCE * before) ** 2))
    if apart is not None:
        difference = np.where(apart, np.hypot(before, after), difference)
    return bool(np.all(np.abs(moved) <= MOVED * difference))
