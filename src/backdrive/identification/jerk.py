"""The jerk without most of what an encoder adds to it, which tells a delay that the jerk after a plain low pass leaves open.

An encoder's rounding error is a white noise of the position, so that its power in the jerk grows with the sixth power of the
frequency. Most motions are slow for most of the time and quick for moments: where they start, stop, or go from one polynomial into
the next. Such moments tell a delay best. Each band of frequencies is therefore kept where its power is well above that of the
encoder's error, and left out elsewhere.
"""

from __future__ import annotations

import numpy as np

from backdrive.identification.signals import Signals
from backdrive.identification.smoothing import error_spectrum
from backdrive.logs.filters import low_pass, power_gain

BANDS = (5.0, 10.0, 20.0, 40.0, 80.0)  # borders of the bands [Hz]; below the first, all is kept
ABOVE = 6.0  # least power of a band that is kept, relative to that of the encoder's error [-]


def clear_jerk(s: Signals, step: float, cutoff: float) -> np.ndarray:
    """Return the jerk [rad/s^3 or m/s^3], (n,).

    Args:
        s: motion.
        step: of the encoder [rad or m]; 0: unknown, so that all is kept.
        cutoff: of the low pass by which the motion was differentiated [Hz].
    """
    frequency, error = error_spectrum(step, cutoff, s.rate)
    error *= (s.rate * np.sin(2.0 * np.pi * frequency)) ** 6
    corners = [min(corner / s.rate, 0.49) for corner in BANDS]
    gains = [power_gain(frequency, corner) for corner in corners]
    below = low_pass(s.jerk, corners[0] * s.rate, s.rate)
    kept = below.copy()
    for k in range(1, len(corners)):
        upto = low_pass(s.jerk, corners[k] * s.rate, s.rate)
        limit = ABOVE * float(np.mean(error * (gains[k] - gains[k - 1]) ** 2))
        kept += _above(upto - below, limit, max(1, round(1.0 / corners[k])))
        below = upto
    return kept


def _above(band: np.ndarray, limit: float, width: int) -> np.ndarray:
    """Return a band, the more of it the further its power over `width` samples is above a limit, and nothing below, (n,)."""
    power = np.convolve(band**2, np.ones(width) / width, "same")
    return np.maximum(1.0 - limit / np.maximum(power, 1e-300), 0.0) * band
