"""Quantisation step and noise of a channel; encoder steps are computed here only."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast
from weakref import WeakKeyDictionary

import numpy as np

from backdrive.logs.log import Log
from backdrive.logs.quantiles import median

COARSE = 3.0  # least step, in units of the last decimal, that can be distinguished from rounding
FEWEST_LEVELS = 6  # least number of level differences to detect a step
MOST_ROUNDS = 8
#: Steps and noise of channels of logs that are still in use, since many ask for them.
_kept: WeakKeyDictionary[Log, dict[tuple[str, str, int], float]] = WeakKeyDictionary()


def encoder_step(log: Log, joint: str | int = 0) -> float:
    """Return the smallest step of the positions of a joint [rad or m].

    Args:
        log: the step follows from the joint's encoder counts if known, otherwise from the finite readings.
        joint: name or column.

    Returns:
        The step; 0 where the readings come in no steps, or there are none.
    """
    column = log.column(joint)
    counts = log.joints[column].encoder_counts
    if counts:
        return 1.0 / counts
    return 0.0 if log.position is None else channel_step(log, "position", column)


def channel_step(log: Log, channel: str, joint: int) -> float:
    """Return the result of `resolution` for a column of a channel that the log holds, which is computed once a log."""
    return _once(log, channel, joint, resolution)


def channel_noise(log: Log, channel: str, joint: int) -> float:
    """Return the result of `white_noise` for a column of a channel that the log holds, which is computed once a log."""
    return _once(log, channel, joint, white_noise)


def _once(log: Log, channel: str, joint: int, of: Callable[[np.ndarray], float]) -> float:
    kept, key = _kept.setdefault(log, {}), (of.__name__, channel, joint)
    if key not in kept:
        kept[key] = of(log.channels[channel][:, joint])
    return kept[key]


def white_noise(*pieces: np.ndarray) -> float:
    """Return the standard deviation of the sample-to-sample noise of a signal in one or several pieces, (m,) each."""
    bends = [np.abs(np.diff(x, 2)) for x in pieces if x.size > 2]
    # white noise of variance s2 has second differences of variance 6 s2; steps hardly touch their median
    return median(np.concatenate(bends) if len(bends) > 1 else bends[0]) / (0.6745 * 6**0.5) if bends else 0.0


def resolution(values: np.ndarray) -> float:
    """Return the step g such that all values (m,) are whole multiples of g apart, 0 if there is none.

    It is the greatest common divisor of the differences between levels, by Euclid's method with a tolerance. Readings printed
    with few decimals are multiples of the last decimal. If they follow a coarser grid apart from that rounding, the step of
    this grid is returned.
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
    unit = _decimal(levels)
    if unit and (step := _before_rounding(levels, unit)):
        return step
    step = least = float(apart.min())
    apart = apart[
        apart < 1e5 * least
    ]  # for longer ones, the rounding of the step would decide whether they fit
    while True:  # every round halves the step at least
        multiples = apart / step
        left = np.abs(multiples - np.round(multiples))
        broken = left > 0.02 * np.minimum(multiples, 5)
        # for a continuous signal, the differences have a common divisor only by chance
        if np.mean(broken) < 0.02:
            return step
        step *= float(left[broken].min())
        if step < least / 64:
            return 0.0


def _before_rounding(levels: np.ndarray, unit: float) -> float:
    """Return the step that levels had before they were rounded to a unit; 0 if they had none.

    Args:
        levels: ascending, multiples of the unit apart, (m,).
        unit: of the rounding.
    """
    apart = np.diff(levels)
    step = float(apart.min())
    if step < COARSE * unit or apart.size < FEWEST_LEVELS:
        return 0.0
    step = float(apart[apart < step + 1.5 * unit].mean())
    longest = 0.5 * step / unit  # steps that are counted surely, with a step that is known so well
    for _ in range(MOST_ROUNDS):
        counts = np.round(apart / step)
        told = counts <= max(longest, 1.0)
        number = float(counts[told].sum())
        step = float(apart[told].sum() / number)
        longest = 0.25 * step * number / (unit * np.sqrt(np.count_nonzero(told)))
        if told.all():
            break
    number = np.concatenate([[0.0], np.cumsum(np.round(apart / step))])
    slope, start = cast("np.ndarray", np.polyfit(number, levels - levels[0], 1))
    off = np.abs(levels - levels[0] - start - slope * number)
    return unit * round(float(slope) / unit, 9) if off.max() < 0.75 * unit else 0.0


def _decimal(levels: np.ndarray) -> float:
    """Return the unit of the last decimal that values were printed with; 0 where they have more than ten, or none."""
    size = max(float(np.abs(levels[[0, -1]]).max()), 1.0)
    some = levels[:: max(1, levels.size // 16)]  # which nearly always show that there are more decimals
    if np.abs(some - np.round(some, 10)).max() >= 2e-14 * size:
        return 0.0
    for places in range(11):
        if all(np.abs(x - np.round(x, places)).max() < 1e-14 * size for x in (some, levels)):
            return 10.0**-places if places else 0.0
    return 0.0
