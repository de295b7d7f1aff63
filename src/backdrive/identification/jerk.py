"""The jerk without most of the sensor's error, which tells a delay that the jerk after a plain low pass leaves open.

The power of a position's white error grows with the sixth power of the frequency in the jerk. Most motions are slow for most of
the time and quick for moments: where they start, stop, or go from one polynomial into the next. Such moments tell a delay best.
Each band of frequencies is therefore kept where its power is well above that of the error, and left out elsewhere.
"""

from __future__ import annotations

import numpy as np

from backdrive.identification.motion_error import MotionError
from backdrive.identification.signals import Signals
from backdrive.logs.filters import low_pass, power_gain

BANDS = (5.0, 10.0, 20.0, 40.0, 80.0)  # borders of the bands [Hz]; below the first, all is kept
ABOVE = 6.0  # least power of a band that is kept, relative to that of the error [-]


def clear_jerk(s: Signals, error: MotionError, cutoff: float) -> np.ndarray:
    """Return the jerk [rad/s^3 or m/s^3], (n,).

    Args:
        s: motion.
        error: of the measured motion; without one, all is kept.
        cutoff: of the low pass by which the motion was differentiated [Hz].
    """
    frequency, power = error.spectrum(cutoff, s.rate, beyond=1)
    corners = [min(corner / s.rate, 0.49) for corner in BANDS]
    gains = [power_gain(frequency, corner) for corner in corners]
    below = low_pass(s.jerk, corners[0] * s.rate, s.rate)
    kept = below.copy()
    for k in range(1, len(corners)):
        upto = low_pass(s.jerk, corners[k] * s.rate, s.rate)
        limit = ABOVE * float(np.mean(power * (gains[k] - gains[k - 1]) ** 2))
        kept += _above(upto - below, limit, max(1, round(1.0 / corners[k])))
        below = upto
    return kept


def _above(band: np.ndarray, limit: float, width: int) -> np.ndarray:
    """Return a band, the more of it the further its power over `width` samples is above a limit, and nothing below, (n,)."""
    power = np.convolve(band**2, np.ones(width) / width, "same")
    return np.maximum(1.0 - limit / np.maximum(power, 1e-300), 0.0) * band
