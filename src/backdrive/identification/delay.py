"""Series shifted in time: the motion that belongs to a delayed torque."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from backdrive.identification.signals import Signals

LATE = 0.015  # least delay of the torque with a remark [s]
PIECE = 65_536  # number of samples that are interpolated together


def earlier(x: np.ndarray, samples: float, linear: bool = False) -> np.ndarray:
    """Return a series delayed by some samples, by cubic interpolation; beyond its ends, it keeps its first and last value.

    Args:
        x: the series, time last, (..., n).
        samples: the delay [sample]; negative for an advance.
        linear: interpolate linearly instead.
    """
    if samples == 0.0:
        return x
    n = x.shape[-1]
    whole, weights = cubic(samples)
    if linear:
        u = 1.0 - (samples - whole)
        weights = (0.0, 1.0 - u, u, 0.0)
    whole = min(max(whole, -n - 2), n + 2)  # beyond this, only an end value remains
    rows, moved = x.reshape(-1, n), np.empty(x.shape)
    for row, result in zip(rows, moved.reshape(-1, n), strict=True):
        for first in range(0, n, PIECE):  # in pieces that the cache holds
            last = min(first + PIECE, n)
            part = _hold_ends(row, first - whole - 2, last - whole + 1)
            result[first:last] = np.correlate(part, weights, "valid")
    return moved


def _hold_ends(row: np.ndarray, first: int, last: int) -> np.ndarray:
    """Return row[first:last] of a series that keeps its first and last value beyond its ends."""
    n = row.size
    if first >= 0 and last <= n:
        return row[first:last]
    before, after = min(max(-first, 0), last - first), min(max(last - n, 0), last - first)
    part = np.empty(last - first)
    part[:before], part[part.size - after :] = row[0], row[-1]
    part[before : part.size - after] = row[max(first, 0) : max(min(last, n), 0)]
    return part


def cubic(samples: float) -> tuple[int, tuple[float, float, float, float]]:
    """Return the integer part of a delay, and the interpolation weights of the four samples around it."""
    whole = int(np.floor(samples))
    u = 1.0 - (samples - whole)  # position between the sample before and the sample after [-]
    return whole, (
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u * u - 1.0) * (u - 2.0) / 2.0,
        -u * (u + 1.0) * (u - 2.0) / 2.0,
        u * (u * u - 1.0) / 6.0,
    )


def delay_signals(signals: Signals, delay: float) -> Signals:
    """Return signals with motion and load delayed by a time [s]; torque and model torque are not shifted."""
    if not delay:
        return signals
    return replace(
        delay_motion(signals, delay),
        jerk=earlier(signals.jerk, delay * signals.rate),
        sliding=_delay_sliding(signals, delay),
    )


def _delay_sliding(signals: Signals, delay: float) -> np.ndarray:
    """Return the mask of `delay_signals`, (n,)."""
    return (earlier(signals.sliding.astype(float), float(round(delay * signals.rate))) > 0.5) & signals.moving


def correction(delay: float) -> float:
    """Return the delay by which motion is shifted for residuals: 0 where it is not worth a remark [s]."""
    return delay if abs(delay) >= LATE else 0.0


def in_step(signals: Signals, delay: float) -> Signals:
    """Return signals whose motion is as late as their torque, where that is worth a remark: for residuals, away from reversals."""
    return delay_signals(signals, correction(delay))


def sliding_in_step(signals: Signals, delay: float) -> np.ndarray:
    """Return where signals slide `in_step`, (n,), without the rest of them."""
    return _delay_sliding(signals, delay) if correction(delay) else signals.sliding


def delay_motion(signals: Signals, delay: float) -> Signals:
    """Return signals with position, velocity, acceleration and load delayed by a time [s]; all else is as it was."""
    if not delay:
        return signals
    samples = delay * signals.rate
    return replace(
        signals,
        velocity=earlier(signals.velocity, samples),
        acceleration=earlier(signals.acceleration, samples),
        position=None if signals.position is None else earlier(signals.position, samples),
        load=None if signals.load is None else np.ascontiguousarray(earlier(signals.load.T, samples).T),
    )


def torque_between(signals: Signals, delay: float) -> np.ndarray:
    """Return the torque delayed by half a sample and a given time [s], (n,): (u_(k-1) + u_k) / 2 for zero delay."""
    return earlier(signals.torque, 0.5 + delay * signals.rate, linear=True)
