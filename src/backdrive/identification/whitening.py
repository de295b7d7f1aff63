"""Coloured noise as an autoregression of first order, and the transform that makes it white.

    r_k  ->  (r_k - c^g r_(k-1)) / sqrt(1 - c^(2 g))

c: correlation of neighbouring samples; g: distance of two samples that are used (Cochrane & Orcutt, JASA 44, 1949).
"""

from __future__ import annotations

import numpy as np


def neighbours(residual: np.ndarray, apart: np.ndarray) -> float:
    """Return the correlation of neighbouring residuals [-]; 0 if there are none.

    Args:
        residual: clipped or weighted, (n,).
        apart: distance of each residual from the one before, (n - 1,).
    """
    beside = apart == 1
    power = float(np.mean(residual**2)) if residual.size else 0.0
    if not beside.any() or not power > 0.0:
        return 0.0
    return float(np.mean((residual[1:] * residual[:-1])[beside])) / power


def whiten(rows: np.ndarray, apart: np.ndarray, correlation: float) -> np.ndarray:
    """Return rows as the noise of each is white and of the same size, the first one as it is, (n, ...).

    Args:
        rows: one a sample, (n, ...).
        apart: distance of each sample from the one before, (n - 1,).
        correlation: of the noise of neighbouring samples, from 0 to below 1 [-].
    """
    result = np.array(rows)
    # as if all were neighbours: one factor for all takes a third of the time
    result[1:] -= correlation * rows[:-1]
    result[1:] /= np.sqrt(1.0 - correlation**2)
    far = np.flatnonzero(apart != 1)
    kept = (correlation ** apart[far]).reshape(-1, *[1] * (rows.ndim - 1))
    result[far + 1] = (rows[far + 1] - kept * rows[far]) / np.sqrt(1.0 - kept**2)
    return result
