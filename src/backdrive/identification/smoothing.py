"""The low pass of the motion before a fit, low enough that the motion's white error does not dominate the acceleration.

Errors in the acceleration bias the inertia, and all correlated terms, towards zero, by the share of the error in the mean square.
The cutoff is therefore lowered until that share is small. If this would remove the motion itself, the best compromise is used,
with a warning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from backdrive.identification.clock import between_gaps, uniform
from backdrive.identification.motion_error import MotionError, mean_error, motion_error
from backdrive.identification.signals import default_cutoff
from backdrive.logs.filters import fade, fft_length, gain_of_derivative, power_gain, spectrum_of
from backdrive.logs.log import Log

SHARE = 0.1  # largest RMS error, relative to the RMS acceleration; it biases the inertia by 1 % [-]
FINE = 0.02  # the same for a fit sample by sample, whose standard errors are that much smaller [-]
SUSPECT = 0.3  # RMS error and lost motion, relative to the acceleration, above which there is a warning [-]
CLEAR = 0.1  # largest share of the error in the mean square for a reliable estimate of the motion [-]
UNSURE = 0.1  # relative uncertainty of the error, where little of it is allowed [-]
LOWEST = 3.0  # lowest cutoff frequency [Hz]
FACTOR = 0.8  # ratio of successive cutoff frequencies [-]
LONGEST = 100_000  # largest number of evaluated samples


@dataclass(frozen=True, kw_only=True)
class Smoothing:
    """The low pass of one joint's motion.

    Attributes:
        cutoff: cutoff frequency [Hz]; None: the default.
        note: reason for a lower cutoff frequency than the default, in a sentence; empty otherwise.
        warning: a sentence on errors that no cutoff removes; empty if there are none.
        error: white error of the measured motion, of the logs that are fitted.
    """

    cutoff: float | None = None
    note: str = ""
    warning: str = ""
    error: MotionError = field(default_factory=MotionError)


def smoothing(
    logs: Sequence[Log],
    joint: str,
    cutoff: float | None = None,
    share: float = SHARE,
    held_out: Sequence[Log] = (),
) -> Smoothing:
    """Return the low pass for a fit of one joint.

    Args:
        logs: logs of the joint.
        joint: name.
        cutoff: given by the user [Hz]; None: from sampling rate and white error.
        share: largest RMS error, relative to the RMS acceleration, if the motion allows it [-].
        held_out: further logs that are to be low-passed alike.
    """
    each = [_of_log(log.select(joint), cutoff, share) for log in (*logs, *held_out)]
    lowest = min(each, key=lambda one: one.cutoff or np.inf, default=Smoothing())
    error = mean_error([one.error for one in each[: len(logs)]], [len(log) for log in logs])
    warning = lowest.warning or next((one.warning for one in each if one.warning), "")
    return replace(lowest, error=error, warning=warning)


def _of_log(log: Log, cutoff: float | None, share: float) -> Smoothing:
    period = log.period
    if not period > 0 or (measured := _longest(log)) is None:
        return Smoothing(cutoff=cutoff)
    rate = 1.0 / period
    of_motion = motion_error(
        log, measured, rate, white=share < SHARE
    )  # a finer one would take the motion away
    found = Smoothing(cutoff=cutoff, error=of_motion)
    if not of_motion.size > 0.0:
        return found
    if cutoff is not None:
        return replace(found, warning=_words_at(log, measured, of_motion, cutoff, rate))
    cutoffs = [default_cutoff(rate)]
    while cutoffs[-1] * FACTOR >= LOWEST:
        cutoffs.append(cutoffs[-1] * FACTOR)
    orders = 1 if log.position is None else 2
    about = _rough_acceleration(measured, of_motion, rate, cutoffs[0], orders)
    if of_motion.in_acceleration(cutoffs[0], rate) <= share**2 * about:
        return found
    error = np.array([of_motion.in_acceleration(f, rate) for f in cutoffs])
    power = _accelerations(measured, cutoffs, rate, orders)
    signal = np.maximum(power - error, 0.0)
    if error[0] <= share**2 * signal[0]:
        return found
    clear = error <= CLEAR * power
    for limit, doubt in (((share, UNSURE),) if share < SHARE else ()) + ((SHARE, 0.0),):
        whole = float(np.max((signal - doubt * error)[clear], initial=0.0))
        wrong = error + np.maximum(whole - signal, 0.0)
        enough = np.flatnonzero((error <= limit**2 * signal) & (wrong <= 4.0 * limit**2 * max(whole, 1e-300)))
        if enough.size:
            break
    k = int(enough[0]) if enough.size else int(np.argmin(wrong))
    left = float(np.sqrt(wrong[k] / whole)) if whole > 0.0 else np.inf
    cause, sensor = _words(of_motion, log)
    note = (
        f"The motion was low-passed at {cutoffs[k]:.3g} Hz (--cutoff): at the usual {cutoffs[0]:.3g} Hz, {cause} "
        f"would make up {_percent(error[0], signal[0])} of the acceleration."
    )
    warning = ""
    if left > SUSPECT:
        warning = (
            f"The {sensor} for this motion: {cause} and what a low pass of {cutoffs[k]:.3g} Hz "
            f"takes away are {_percent(wrong[k], whole)} of the acceleration. A higher --cutoff makes the inertia too small, "
            "a lower one blurs reversals: give the inertia to a search (--law auto --known inertia=...), or record faster motion "
            "or with a finer sensor."
        )
    return replace(found, cutoff=float(cutoffs[k]) if k else None, note=note if k else "", warning=warning)


def _words_at(log: Log, measured: np.ndarray, error: MotionError, cutoff: float, rate: float) -> str:
    """Return a sentence on the error that a given cutoff frequency [Hz] leaves in the acceleration; empty if it is small."""
    if not 0.0 < cutoff < 0.5 * rate:
        return ""
    wrong = error.in_acceleration(cutoff, rate)
    right = max(
        float(_accelerations(measured, [cutoff], rate, 1 if log.position is None else 2)[0]) - wrong, 0.0
    )
    if wrong <= SUSPECT**2 * right:
        return ""
    return (
        f"At the given cutoff of {cutoff:.3g} Hz, the share of {_words(error, log)[0]} in the acceleration is "
        f"{_percent(wrong, right)}: inertia, delay and friction may be further off than their errors. Lower --cutoff, or omit it."
    )


def _words(error: MotionError, log: Log) -> tuple[str, str]:
    """Return what the error is and what is wrong with the sensor, in words."""
    unit = log.joints[0].unit
    if log.position is not None:
        if error.step:
            return f"encoder steps of {error.step:.2g} {unit}", "encoder is too coarse"
        return f"noise of the position of {error.size:.2g} {unit}", "position is too noisy"
    of = f"{unit}/s" if error.orders == 1 else f"{unit} in the positions that it was computed from"
    if error.step:
        return f"steps of the velocity of {error.step:.2g} {of}", "velocity is too coarse"
    return f"noise of the velocity of {error.size:.2g} {of}", "velocity is too noisy"


def _percent(wrong: float, right: float) -> str:
    share = np.sqrt(wrong / right) if right > 0.0 else np.inf
    return f"{100.0 * share:.3g} %" if share < 10.0 else "many times the size"


def _longest(log: Log) -> np.ndarray | None:
    """Return the positions, or velocities without them, of the longest stretch without a gap, at most `LONGEST` from its middle."""
    motion = log.velocity if log.position is None else log.position
    if motion is None or len(log) < 50:
        return None
    good = np.flatnonzero(np.isfinite(motion[:, 0]) & np.isfinite(log.time))
    if good.size < 50:
        return None
    part = max(between_gaps(log.time[good], log.period, 1), key=lambda rows: rows.stop - rows.start)
    first = max(part.start, (part.start + part.stop - LONGEST) // 2)
    part = slice(first, min(first + LONGEST, part.stop))
    rows = part if good.size == len(log) else good[part]
    longest = log if part == slice(0, len(log)) else log.rows(rows)
    _, along = uniform(longest, log.period)  # a lost sample is no jump of the position
    motion = along.velocity if along.position is None else along.position
    return None if motion is None else motion[:, 0]


def _rough_acceleration(
    measured: np.ndarray, error: MotionError, rate: float, cutoff: float, orders: int
) -> float:
    """Return about the mean square acceleration [rad^2/s^4 or m^2/s^4], from differences over some samples.

    Args:
        measured: positions [rad or m] or velocities [rad/s or m/s], (n,).
        error: of them.
        rate: sampling rate [Hz].
        cutoff: of the low pass that the differences are to equal about [Hz].
        orders: derivatives from what is measured to the acceleration [-].
    """
    lag = max(1, round(0.3 * rate / cutoff))
    if measured.size <= 2 * lag:
        return 0.0
    before, after = measured[: -2 * lag], measured[2 * lag :]
    change = after - 2.0 * measured[lag:-lag] + before if orders == 2 else 0.5 * (after - before)
    noise = 6.0 if orders == 2 else 0.5  # white noise in the change, by its variance
    if error.orders > orders:  # the velocity is a difference of noisy positions
        noise *= 2.0 * rate**2
    return (float(np.mean(change**2)) - noise * error.size**2) * (rate / lag) ** (2 * orders)


def _accelerations(measured: np.ndarray, cutoffs: Sequence[float], rate: float, orders: int) -> np.ndarray:
    """Return the mean square acceleration after each low pass [rad^2/s^4 or m^2/s^4], from one transform, (k,).

    Args:
        measured: positions [rad or m] or velocities [rad/s or m/s], (n,).
        cutoffs: of the low passes [Hz], (k,).
        rate: sampling rate [Hz].
        orders: derivatives from what is measured to the acceleration [-].
    """
    n, pad = measured.size, min(fade(min(cutoffs) / rate), measured.size - 1)
    length = fft_length(n + 2 * pad)
    f = np.arange(length // 2 + 1) / length
    spectrum = spectrum_of(measured, pad, length) * (1j * rate * gain_of_derivative(f)) ** orders
    gains = (power_gain(f, cutoff / rate) for cutoff in cutoffs)
    return np.array([np.mean(np.fft.irfft(spectrum * gain, length)[pad : pad + n] ** 2) for gain in gains])
