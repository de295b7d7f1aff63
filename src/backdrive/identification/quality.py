"""How well a model explains measured torque, pooled over stretches, files or left-out blocks."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from backdrive.logs.filters import low_pass
from backdrive.model import Quality

JUDGED_BELOW = 5.0  # corner of the zero-phase low pass on both torques [Hz]


def judge(pairs: Iterable[tuple[np.ndarray, np.ndarray, float, np.ndarray]]) -> Quality:
    """Return the relative residual over all pairs.

    Args:
        pairs: measured torque, predicted torque [N.m or N], sampling rate [Hz] and the mask of judged samples, each (n,).
    """
    above, below, raw_above, raw_below, count = 0.0, 0.0, 0.0, 0.0, 0
    for tau, tau_hat, rate, judged in pairs:
        error = tau - tau_hat
        smooth, smooth_error = low_pass(tau, JUDGED_BELOW, rate), low_pass(error, JUDGED_BELOW, rate)
        above += float(np.sum(smooth_error[judged] ** 2))
        below += float(np.sum(smooth[judged] ** 2))
        raw_above += float(np.sum(error[judged] ** 2))
        raw_below += float(np.sum(tau[judged] ** 2))
        count += int(np.count_nonzero(judged))
    return Quality(
        residual=100.0 * float(np.sqrt(above / below)) if below > 0 else float("nan"),
        residual_raw=100.0 * float(np.sqrt(raw_above / raw_below)) if raw_below > 0 else float("nan"),
        rms=float(np.sqrt(raw_above / count)) if count else float("nan"),
        samples=count,
    )
