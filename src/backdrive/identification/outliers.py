"""Single samples of a torque that are far off what a model predicts, and off both their neighbours."""

from __future__ import annotations

import numpy as np

from backdrive.logs.quantiles import median

WILD = 8.0  # residual above which a sample is an outlier [standard deviation]
LEAST = 0.05  # the same, relative to the friction: what a model misses about reversals is small beside it [-]


def count_single(error: np.ndarray, slides: np.ndarray, friction: np.ndarray) -> int:
    """Return how many samples are outliers.

    Friction that builds up after a reversal is far off for a while, so its neighbours count that do not slide yet.

    Args:
        error: measured minus predicted torque of neighbouring samples [N.m or N], (n,).
        slides: mask of the samples that are judged, of which there is one, (n,).
        friction: measured [N.m or N], (n,).
    """
    away = error - median(error[slides])
    bound = max(WILD * 1.4826 * median(np.abs(away[slides])), LEAST * float(np.abs(friction[slides]).mean()))
    far = np.abs(away) > bound
    alone = ~(far[:-2] | far[2:]) & (np.abs(away[1:-1] - 0.5 * (away[:-2] + away[2:])) > bound)
    return int(np.count_nonzero(far[1:-1] & alone & slides[1:-1]))
