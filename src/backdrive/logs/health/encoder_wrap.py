"""A position that wraps around by one turn, or by the range of its counter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Changes, Finding, Repair, check, columns_of, count_of, with_columns
from backdrive.logs.health._jumps import Jumps, jumps

CHANNELS = ("position", "second_encoder")
#: Turns at the joint, half a turn, and turns that are still in degrees [rad or m].
_TURNS = (2 * np.pi, np.pi, 4 * np.pi, 360.0)
#: Counter sizes in steps of the channel; the smaller ones only count when the value does not come back at once.
_COUNTERS = tuple(2.0**bits for bits in range(8, 33))
_GLITCH_COUNTERS = (2.0**12, 2.0**16, 2.0**32)


@check("encoder-wrap", "a position that wraps by a turn or by its counter's range")
def find(exam: Exam) -> Iterator[Finding]:
    """Report jumps of a turn or of a counter's range."""
    for channel, j, joint in exam.columns(*CHANNELS):
        period, rows = wraps(exam, channel, j)
        if not rows.size:
            continue
        turn = " (one turn)" if abs(period - 2 * np.pi) < 0.01 and exam.log.joints[j].unit == "rad" else ""
        yield Finding(
            joint=joint,
            channel=channel,
            severity="spoils",
            sentence=(
                f"{channel} of {joint} wraps around {count_of(rows.size, 'time')} by {period:.5g} "
                f"{exam.log.joints[j].unit}{turn}, first at sample {rows[0]}."
            ),
            remedy="Unwrap the encoder (--repair does).",
            value=period,
            where=rows,
            repairable=True,
        )


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Add the period back at each wrap; a reference that wraps by the same period is unwrapped with it."""
    changes: Changes = {}
    notes: list[str] = []
    for finding, channel, j, rows in columns_of(exam, findings):
        x, period = exam.column(channel, j), finding.value
        offset = np.zeros(x.size)
        offset[rows] = np.copysign(period, x[rows] - x[rows - 1])
        changes[channel, j] = x - np.cumsum(offset)
        notes.append(
            f"{channel} of {finding.joint} was unwrapped {count_of(rows.size, 'time')} by {period:.5g}."
        )
        if channel == "position" and exam.usable("reference", j):
            reference = exam.column("reference", j)
            times = np.round(np.diff(reference) / period)
            if np.any(times):
                changes["reference", j] = reference - period * np.concatenate([[0.0], np.cumsum(times)])
                notes.append(f"reference of {finding.joint} was unwrapped like its position.")
    return Repair(with_columns(exam.log, changes, notes))


def wraps(exam: Exam, channel: str, j: int) -> tuple[float, np.ndarray]:
    """Return the period of a joint's wraps and the rows after them; (nan, none) if there are none."""
    found = jumps(exam, channel, j)
    if found is None:
        return np.nan, np.empty(0, np.intp)
    rotary = exam.log.joints[j].unit == "rad"
    glitch = found.glitch
    periods = [(p, np.ones(found.rows.size, bool)) for p in (_TURNS if rotary else ())]
    periods += [(found.resolution * c, ~glitch) for c in _COUNTERS]
    periods += [(found.resolution * c, glitch) for c in _GLITCH_COUNTERS]
    if (~glitch).sum() >= 3:  # an unknown period must be the same at all wraps
        periods.append((float(np.median(np.abs(found.sizes[~glitch]))), ~glitch))
    best, explained = np.nan, np.zeros(found.rows.size, bool)
    for period, allowed in periods:
        matches = allowed & _matches(found, period)
        if matches.sum() > explained.sum():
            best, explained = period, matches
    return best, found.rows[explained]


def _matches(found: Jumps, period: float) -> np.ndarray:
    left = np.abs(np.abs(found.sizes) - period)
    return left <= np.minimum(0.02 * period, found.slack)
