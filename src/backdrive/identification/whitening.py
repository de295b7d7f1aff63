"""Coloured noise as an autoregression of first order, and the transform that makes it white.

    r_k  ->  (r_k - c^g r_(k-1)) / sqrt(1 - c^(2 g))

c: correlation of neighbouring samples; g: distance of two samples that are used (Cochrane & Orcutt, JASA 44, 1949).
"""

from __future__ import annotations

import numpy as np

from backdrive.identification import regression

MOST = 0.99  # largest correlation of the noise of neighbouring bins [-]
# most negative correlation of neighbouring bins, and negative correlation above which it is set to zero [-]
OPPOSITE, SLIGHT = -0.48, -0.1
HIDDEN = 0.5  # largest share of the residual's mean square that is taken as error of the acceleration [-]
Pair = tuple[float, float]
CLEAN = (0.0, 0.0)


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


def correlation_of(residual: np.ndarray, used: np.ndarray, false: Pair = CLEAN) -> float:
    """Return the correlation of the noise of neighbouring bins, within limits [-]; slightly negative values are set to 0.

    The error of the acceleration alternates, and hides a part of the correlation of the torque's noise. It is subtracted where
    residuals are correlated positively.

    Args:
        residual: of the fit, (n,).
        used: mask of the fitted samples, (n,).
        false: mean square, and mean product of neighbours, of what the acceleration's error adds to the residual.
    """
    at = np.flatnonzero(used)
    spread = regression.robust_spread(residual[at])
    width = regression.HUBER * spread
    score = np.clip(residual[at], -width, width)
    correlation = min(max(neighbours(score, np.diff(at)), OPPOSITE), MOST)
    if SLIGHT < correlation < 0.0:
        return 0.0
    if not (correlation > 0.0 and spread > 0.0):
        return correlation
    share = min(1.0 / spread**2, HIDDEN / max(false[0], 1e-300))
    return min((correlation - share * false[1]) / (1.0 - share * false[0]), MOST)


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
