"""Arrays with samples along either axis, by the number of samples."""

from __future__ import annotations

import numpy as np


def orient(value: np.ndarray, n: int) -> np.ndarray | None:
    """Return the array as (n, k), transposed if only its second axis has length n; None if neither has."""
    if value.ndim == 1:
        return value[:, None] if value.size == n else None
    if value.shape[0] == n:
        return value
    return value.T if value.shape[1] == n else None


def extent(shape: tuple[int, ...], n: int) -> int:
    """Return how many joints an array of this shape holds over n samples; 0 if it does not fit."""
    if len(shape) == 1:
        return 1 if shape[0] == n else 0
    return shape[1] if shape[0] == n else shape[0] if shape[1] == n else 0
