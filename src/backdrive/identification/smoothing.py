"""The low pass of the motion before a fit, low enough that encoder noise does not dominate the acceleration.

The rounding error of an encoder is a white noise of the position. After two differentiations its mean square grows with the
fifth power of the cutoff frequency. Errors in the acceleration bias the inertia, and all correlated terms, towards zero, by the
share of the error in the mean square. The cutoff is therefore lowered until that share is small. If this would remove the
motion itself, the best compromise is used, with a warning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.identification.motion_bins import moving_average
from backdrive.identification.signals import between_gaps, default_cutoff
from backdrive.logs.filters import fade, fft_length, power_gain, spectrum_of
from backdrive.logs.log import Log
from backdrive.logs.resolution import encoder_step

SHARE = 0.1  # largest RMS encoder error, relative to the RMS acceleration; it biases the inertia by 1 % [-]
FINE = 0.02  # the same for a fit sample by sample, whose standard errors are that much smaller [-]
SUSPECT = 0.3  # RMS error and lost motion, relative to the acceleration, above which there is a warning [-]
CLEAR = 0.1  # largest share of the error in the mean square for a reliable estimate of the motion [-]
UNSURE = 0.1  # relative uncertainty of the encoder's error, where little of it is allowed [-]
LOWEST = 3.0  # lowest cutoff frequency [Hz]
FACTOR = 0.8  # ratio of successive cutoff frequencies [-]
LONGEST = 100_000  # largest number of evaluated samples
GRID = 1024  # number of frequencies for the error


@dataclass(frozen=True, kw_only=True)
class Smoothing:
    """The low pass of one joint's motion.

    Attributes:
        cutoff: cutoff frequency [Hz]; None: the default.
        note: reason for a lower cutoff frequency than the default, in a sentence; empty otherwise.
        warning: a sentence on errors that no cutoff removes; empty if there are none.
    """

    cutoff: float | None = None
    note: str = ""
    warning: str = ""


def smoothing(
    logs: Sequence[Log], joint: str, cutoff: float | None = None, share: float = SHARE
) -> Smoothing:
    """Return the low pass for a fit of one joint.

    Args:
        logs: logs of the joint.
        joint: name.
        cutoff: given by the user [Hz]; None: from sampling rate and encoder.
        share: largest RMS encoder error, relative to the RMS acceleration, if the motion allows it [-].
    """
    if cutoff is not None:
        return Smoothing(cutoff=cutoff)
    each = [_of_log(log.select(joint), share) for log in logs]
    lowered = [one for one in each if one.cutoff is not None]
    return min(lowered, key=lambda one: one.cutoff or np.inf, default=Smoothing())


def _of_log(log: Log, share: float) -> Smoothing:
    period = log.period
    if not period > 0 or not (step := encoder_step(log)) > 0.0 or (position := _longest(log)) is None:
        return Smoothing()
    rate = 1.0 / period
    cutoffs = [default_cutoff(rate)]
    while cutoffs[-1] * FACTOR >= LOWEST:
        cutoffs.append(cutoffs[-1] * FACTOR)
    error = np.array([noise(step, f, rate) for f in cutoffs])
    power = _accelerations(position, cutoffs, rate)
    signal = np.maximum(power - error, 0.0)
    if error[0] <= share**2 * signal[0]:
        return Smoothing()
    clear = error <= CLEAR * power
    for limit, doubt in (((share, UNSURE),) if share < SHARE else ()) + ((SHARE, 0.0),):
        whole = float(np.max((signal - doubt * error)[clear], initial=0.0))
        wrong = error + np.maximum(whole - signal, 0.0)
        enough = np.flatnonzero((error <= limit**2 * signal) & (wrong <= 4.0 * limit**2 * max(whole, 1e-300)))
        if enough.size:
            break
    k = int(enough[0]) if enough.size else int(np.argmin(wrong))
    left = float(np.sqrt(wrong[k] / whole)) if whole > 0.0 else np.inf
    unit = log.joints[0].unit
    usual = f"{cutoffs[0]:.3g} Hz"
    note = (
        f"The motion was low-passed at {cutoffs[k]:.3g} Hz (--cutoff): at the usual {usual}, encoder steps of {step:.2g} {unit} "
        f"would make up {_percent(error[0], signal[0])} of the acceleration."
    )
    warning = ""
    if left > SUSPECT:
        warning = (
            f"The encoder is too coarse for this motion: its steps of {step:.2g} {unit} and what a low pass of {cutoffs[k]:.3g} Hz "
            f"takes away are {_percent(wrong[k], whole)} of the acceleration. A higher --cutoff makes the inertia too small, "
            "a lower one blurs reversals: give the inertia (--known inertia=...), or record faster motion or a finer encoder."
        )
    return Smoothing(cutoff=float(cutoffs[k]) if k else None, note=note if k else "", warning=warning)


def _percent(wrong: float, right: float) -> str:
    share = np.sqrt(wrong / right) if right > 0.0 else np.inf
    return f"{100.0 * share:.2g} %" if share < 10.0 else "many times the size"


def noise(step: float, cutoff: float, rate: float, width: int = 1, correlation: float = 0.0) -> float:
    """Return the mean square error of the acceleration due to an encoder's steps [rad^2/s^4 or m^2/s^4].

    Args:
        step: of the encoder [rad or m].
        cutoff: of the low pass [Hz].
        rate: sampling rate [Hz].
        width: length of the means of the acceleration [sample].
        correlation: of neighbouring means, which `Bins.whiten` removes [-].
    """
    f, error = error_spectrum(step, cutoff, rate)
    twice = (rate * np.sin(2.0 * np.pi * f)) ** 4
    mean = (np.sin(np.pi * f * width) / (width * np.sin(np.pi * f))) ** 2
    turn = np.cos(2.0 * np.pi * f * width)
    if correlation < 0.0:
        share = moving_average(correlation)
        white = (1.0 + share**2) / (1.0 + share**2 + 2.0 * share * turn)
    else:
        white = (1.0 + correlation**2 - 2.0 * correlation * turn) / (1.0 - correlation**2)
    return float(np.mean(error * twice * mean * white))


def error_spectrum(step: float, cutoff: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the power of a low-passed position's rounding error by frequency; its mean is the mean square error.

    Args:
        step: of the encoder [rad or m].
        cutoff: of the low pass [Hz].
        rate: sampling rate [Hz].

    Returns:
        Frequencies by the rate [-], and the power there [rad^2 or m^2], (k,) each.
    """
    f = (np.arange(GRID) + 0.5) / (2 * GRID)
    return f, step**2 / 12.0 * power_gain(f, min(cutoff / rate, 0.49)) ** 2


def _longest(log: Log) -> np.ndarray | None:
    """Return the longest stretch of positions without a gap, at most `LONGEST` samples from its middle."""
    if log.position is None or len(log) < 50:
        return None
    good = np.flatnonzero(np.isfinite(log.position[:, 0]) & np.isfinite(log.time))
    if good.size < 50:
        return None
    part = max((good[rows] for rows in between_gaps(log.time[good], log.period, 1)), key=len)
    middle = max(0, (len(part) - LONGEST) // 2)
    return log.position[part[middle : middle + LONGEST], 0]


def _accelerations(position: np.ndarray, cutoffs: Sequence[float], rate: float) -> np.ndarray:
    """Return the mean square acceleration after each low pass [rad^2/s^4 or m^2/s^4], from one transform, (k,)."""
    n, pad = position.size, min(fade(min(cutoffs) / rate), position.size - 1)
    length = fft_length(n + 2 * pad)
    f = np.arange(length // 2 + 1) / length
    spectrum = spectrum_of(position, pad, length) * -((rate * np.sin(2.0 * np.pi * f)) ** 2)
    gains = (power_gain(f, cutoff / rate) for cutoff in cutoffs)
    return np.array([np.mean(np.fft.irfft(spectrum * gain, length)[pad : pad + n] ** 2) for gain in gains])
