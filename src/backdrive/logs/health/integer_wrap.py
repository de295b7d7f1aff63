"""Integers read with the wrong type: -1 read as 65535, or a counter that overflowed its 16 or 32 bits.

A wrap moves a value by 2^16 or 2^32 times the channel's resolution, whatever the scale. Two signs identify a wrap: all values
lie within one such period, and a jump of nearly one period becomes an ordinary step when the period is subtracted. If a log
was resampled after the fault, it contains values between the two levels. They cannot be repaired, so those samples are
dropped. Positions are checked by `encoder-wrap`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.logs.health._exam import Exam, once
from backdrive.logs.health._finding import (
    Changes,
    Finding,
    Repair,
    check,
    columns_of,
    count_of,
    with_columns,
    without_rows,
)
from backdrive.logs.resolution import resolution

CHANNELS = ("velocity", "torque", "drive_input", "external_torque", "load", "model_torque")
_BITS = (16, 32)
#: What is left of a jump without the period may be this share of the period.
_LEFT = 0.05
#: And this one where all values are near zero or near the period, as small numbers of two signs are when read as unsigned.
_SPLIT_LEFT = 0.4


@dataclass(frozen=True, eq=False)
class _Wrap:
    period: float
    bits: int
    mended: np.ndarray
    rows: np.ndarray
    lost: np.ndarray


@check("integer-wrap", "values wrapped by a wrong integer type")
def find(exam: Exam) -> Iterator[Finding]:
    """Report every channel that jumps by 2^16 or 2^32 of its own steps."""
    for channel, j, joint in exam.columns(*CHANNELS):
        wrap = _wrap(exam, channel, j)
        if wrap is None:
            continue
        between = f", {wrap.lost.size} of them between the levels and lost" if wrap.lost.size else ""
        yield Finding(
            joint=joint,
            channel=channel,
            severity="spoils",
            sentence=(
                f"{channel} of {joint} was read with the wrong integer type: {count_of(wrap.rows.size, 'sample')} "
                f"off by {wrap.period:.6g} (2^{wrap.bits} steps){between}, first at sample {wrap.rows[0]}."
            ),
            remedy=f"Read the column as signed {wrap.bits}-bit numbers, or use --repair: it takes the period off again.",
            value=wrap.period,
            where=wrap.rows,
            repairable=True,
        )


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Take the period off; drop samples that were interpolated between the two levels."""
    changes: Changes = {}
    notes: list[str] = []
    lost = np.zeros(len(exam.log), bool)
    for finding, channel, j, _ in columns_of(exam, findings):
        wrap = _wrap(exam, channel, j)
        assert wrap is not None
        changes[channel, j] = wrap.mended
        lost[wrap.lost] = True
        notes.append(
            f"{channel} of {finding.joint}: {wrap.period:.6g} was taken off again at "
            f"{count_of(wrap.rows.size, 'wrapped sample')}."
        )
    return without_rows(
        with_columns(exam.log, changes, notes), lost, "sample", "interpolated across a wrap were dropped."
    )


@once
def _wrap(exam: Exam, channel: str, j: int) -> _Wrap | None:
    survey = exam.survey(channel)
    span = survey.high[j] - survey.low[j]
    if survey.step[j] < 0.2 * span:
        return None
    step = exam.quantum(channel, j)
    for bits in _BITS:
        period = step * 2.0**bits
        if span < 1.3 * period:
            period = _fine(exam.sample(channel, j), step, 0.25 * period) * 2.0**bits
            wrap = _unwrap(exam.column(channel, j), period, bits)
            if wrap is not None:
                return wrap
    for bits in _BITS:  # raw numbers that were resampled, so that their resolution is gone
        period = 2.0**bits
        if survey.low[j] > -_LEFT * period and 0.9 * period < survey.high[j] < 1.001 * period:
            wrap = _split(exam.column(channel, j), period, bits)
            if wrap is not None:
                return wrap
    return None


def _fine(x: np.ndarray, step: float, near: float) -> float:
    """Return the step from the values near zero: 2^32 of them must not carry the rounding of the wrapped ones."""
    levels = np.unique(x[np.abs(x) < near])
    fine = resolution(levels)
    if not abs(fine - step) < 0.01 * step:
        return step
    width = float(levels[-1] - levels[0])
    return float(width / np.round(width / fine))


def _unwrap(x: np.ndarray, period: float, bits: int) -> _Wrap | None:
    change = np.diff(x)
    times = np.round(change / period)
    jumps = np.flatnonzero(times)
    if not jumps.size:
        return None
    left = np.abs(change[jumps] - period * times[jumps]).max()
    split = not np.any((x > 0.25 * period) & (x < 0.75 * period)) and x.min() > -0.25 * period
    if left > (_SPLIT_LEFT if split else _LEFT) * period:
        return None
    turns = np.concatenate([[0.0], np.cumsum(times)])
    turns += np.round(np.median(x - period * turns) / period)
    mended = x - period * turns
    if np.unique(mended).size <= 4:  # a signal that switches between its two limits
        return None
    return _Wrap(period, bits, mended, np.flatnonzero(turns), np.empty(0, np.intp))


def _split(x: np.ndarray, period: float, bits: int) -> _Wrap | None:
    top, bottom = x > 0.75 * period, x < 0.25 * period
    between = ~(top | bottom)
    if between.mean() > 0.05:
        return None
    if np.all(x[bottom] == 0) or np.ptp(x[top]) == 0:  # a switch, not a number
        return None
    lost = between.copy()
    side = top.astype(int) - bottom
    turn = np.flatnonzero(side[1:] != side[:-1])
    lost[turn] = lost[turn + 1] = True  # either neighbour of a crossing may be an interpolated value
    mended = np.where(top, x - period, x)
    return _Wrap(period, bits, mended, np.flatnonzero(top | lost), np.flatnonzero(lost))
