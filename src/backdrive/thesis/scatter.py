"""Significance of a difference between cases relative to the scatter over hands: paired, by Student's 95 % interval."""

from __future__ import annotations

import numpy as np


def interval(differences: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval of a mean, by Student's t.

    Args:
        differences: one a hand, (n,), n >= 2.
    """
    from scipy.special import stdtrit

    d = np.asarray(differences, dtype=np.float64)
    half = float(stdtrit(d.size - 1, 0.975)) * d.std(ddof=1) / np.sqrt(d.size)
    return float(d.mean() - half), float(d.mean() + half)


ALIKE = 0.05  # means that differ by no more are "almost equivalent" [-]


def clearly_less(small: np.ndarray, large: np.ndarray) -> bool:
    """Return whether one case is significantly smaller, and by more than `ALIKE` in the mean; see `less`."""
    return less(small, large) and float(np.mean(small)) < (1.0 - ALIKE) * float(np.mean(large))


def less(small: np.ndarray, large: np.ndarray) -> bool:
    """Return whether one case is significantly smaller than another with the same hands: the interval of the difference is
    above zero.

    Args:
        small: of the one, a number a hand, (n,).
        large: of the other, with the same hands, (n,).
    """
    return interval(np.asarray(large) - np.asarray(small))[0] > 0.0
