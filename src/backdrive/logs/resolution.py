"""In which steps a channel comes, and how much noise it has: the only home of encoder steps."""

from __future__ import annotations

import numpy as np

from backdrive.logs.log import Log


def encoder_step(log: Log) -> float:
    """Return the smallest step of the positions of a log's only joint [rad or m].

    Args:
        log: of one joint; its count counts where it is known, else the readings tell, of the finite of them.

    Returns:
        The step; 0 where the readings come in no steps, or there are none.
    """
    counts = log.joints[0].encoder_counts
    if counts:
        return 1.0 / counts
    return 0.0 if log.position is None else resolution(log.position[:, 0])


def white_noise(x: np.ndarray) -> float:
    """Return the standard deviation of the sample-to-sample noise of a signal (m,)."""
    return float(np.median(np.abs(np.diff(x, 2)))) / (0.6745 * np.sqrt(6)) if x.size > 2 else 0.0


def resolution(values: np.ndarray) -> float:
    """Return the step g such that all values (m,) are whole multiples of g apart, 0 if there is none.

    It is the greatest common divisor of the differences between levels, by Euclid's method with a tolerance.
    """
    values = values[:: max(1, values.size // 4096)]
    levels = np.unique(values[np.isfinite(values)])
    if levels.size < 2:
        return 0.0
    apart = np.diff(levels)
    # what rounding leaves between equal values is no step
    apart = apart[apart > 2e-11 * np.abs(levels[[0, -1]]).max()]
    if not apart.size:
        return 0.0
    step = least = float(apart.min())
    apart = apart[apart < 1e5 * least]  # of longer ones the rounding of the step would decide
    while True:  # every round halves the step at least
        multiples = apart / step
        left = np.abs(multiples - np.round(multiples))
        broken = left > 0.02 * np.minimum(multiples, 5)
        # differences of a continuous signal are whole multiples of anything only by chance
        if np.mean(broken) < 0.02:
            return step
        step *= float(left[broken].min())
        if step < least / 64:
            return 0.0
