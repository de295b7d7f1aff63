"""Single samples far from both their neighbours.

The measure is the excess of a sample over both its neighbours. Noise, steps (Coulomb friction at a reversal), quantisation
and the peaks of a derivative controller each have a typical excess. An outlier is rare, and exceeds both a multiple of the
largest typical excess and the variation around it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from backdrive.logs.health._exam import Exam
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
from backdrive.logs.health._jumps import jumps
from backdrive.logs.health._survey import excess
from backdrive.logs.health.encoder_wrap import CHANNELS as POSITIONS
from backdrive.logs.health.encoder_wrap import wraps
from backdrive.logs.quantiles import median

CHANNELS = ("position", "velocity", "torque", "drive_input", "second_encoder", "external_torque", "load")
#: Times the largest usual excess; times the differences around it, or times what a smooth signal leaves around it; steps of the
#: channel; share of the channel's range.
_USUAL, _LOCAL, _SMOOTH, _STEPS, _RANGE = 2.5, 3.0, 8.0, 4.0, 1e-2
#: An outlier this many times as far away as the range of all other samples would dominate a least-squares fit.
_SPOILS = 2.0
#: A joint starts or stops where it moves, in this time [s], less than this share of the usual way.
_MOMENT, _AT_REST = 0.04, 0.5
_GLANCE = 4096  # number of samples that are looked at first


@check("outlier", "single samples far from both their neighbours")
def find(exam: Exam) -> Iterator[Finding]:
    """Report single-sample outliers of every channel."""
    for channel, j, joint in exam.columns(*CHANNELS):
        rows = _outliers(exam, channel, j)
        if not rows.size:
            continue
        x = exam.column(channel, j)
        away = np.abs(x[rows] - _between(x, rows))
        worst = int(np.argmax(away))
        wild = away[worst] > _SPOILS * np.ptp(np.delete(x, rows))
        yield Finding(
            joint=joint,
            channel=channel,
            severity="spoils" if wild else "warn",
            sentence=(
                f"{channel} of {joint} has {count_of(rows.size, 'single-sample outlier')}; the largest is "
                f"{x[rows[worst]]:.5g} at sample {rows[worst]}, {away[worst]:.3g} off its neighbours."
            ),
            remedy="Replace them by the mean of their neighbours (--repair does).",
            value=float(away[worst]),
            where=rows,
            repairable=True,
        )


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Replace outliers by the mean of their neighbours; drop those at the ends of the log."""
    n = len(exam.log)
    changes: Changes = {}
    notes: list[str] = []
    drop = np.zeros(n, bool)
    for finding, channel, j, rows in columns_of(exam, findings):
        x = np.array(exam.column(channel, j))
        ends = (rows == 0) | (rows == n - 1)
        drop[rows[ends]] = True
        x[rows] = _between(x, rows)
        changes[channel, j] = x
        inside = int((~ends).sum())
        if inside:
            notes.append(
                f"{channel} of {finding.joint}: {count_of(inside, 'outlier')} replaced by the mean of the neighbours."
            )
    return without_rows(
        with_columns(exam.log, changes, notes), drop, "outlier", "at the end of the log dropped."
    )


def _between(x: np.ndarray, rows: np.ndarray) -> np.ndarray:
    last = x.size - 1
    before = np.where(rows == 0, 1, rows - 1)
    after = np.where(rows == last, last - 1, rows + 1)
    return 0.5 * (x[before] + x[after])


def _outliers(exam: Exam, channel: str, j: int) -> np.ndarray:
    none = np.empty(0, np.intp)
    if len(exam.log) < 10:
        return none
    survey = exam.survey(channel)
    ends = _ends(exam, channel, j)
    spike, least = survey.spike[j], _STEPS * exam.quantum(channel, j)
    if spike <= least:
        return ends
    usual, count = _usual_excess(exam, channel, j, spike / _USUAL)
    bound = max(_USUAL * usual, least)
    if spike <= bound:
        return ends
    x = exam.column(channel, j)
    rows = np.flatnonzero(excess(np.diff(x)) > bound) + 1
    rows = np.setdiff1d(rows, np.concatenate([exam.gaps, exam.gaps - 1]))
    if rows.size > 2 * count:
        return ends
    change = np.abs(np.diff(x))
    size = np.minimum(change[rows - 1], change[rows])
    across = np.abs(x[rows + 1] - x[rows - 1])
    # excludes the effect of a second outlier nearby
    local = np.maximum(across, np.sort(_around(change, rows - 1, (-3, -2, -1, 2, 3, 4)), axis=1)[:, -2])
    # in fast smooth motion the steps are long, but what is left of a cubic is small
    bend = np.abs(np.diff(x, 4))
    smooth = np.sort(_around(bend, rows - 2, (-7, -6, -5, -4, -3, 3, 4, 5, 6, 7)), axis=1)[:, -2]
    beside, here = _around(bend, rows - 2, (-1, 1)).max(axis=1), _around(bend, rows - 2, (0,))[:, 0]
    far = size > _LOCAL * local
    if channel in ("position", "second_encoder"):  # a step leaves as much beside it, an outlier two thirds
        far |= (here > _SMOOTH * smooth) & (here > 1.3 * beside)
    rest = np.ptp(np.delete(x, rows))
    rows = rows[far & (size > _RANGE * rest)]
    if channel == "velocity" and exam.usable("position", j):
        rows = rows[~_ticks(exam, j, x, rows)]
    return np.union1d(rows, ends)


def _around(x: np.ndarray, rows: np.ndarray, offsets: tuple[int, ...]) -> np.ndarray:
    """Return x (n,) at offsets from rows, (m, k); zero beyond the ends, where nothing happens."""
    at = rows[:, None] + np.array(offsets)
    inside = (at >= 0) & (at < x.size)
    return np.where(inside, x[np.clip(at, 0, x.size - 1)], 0.0)


def _ticks(exam: Exam, j: int, v: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return which peaks of a velocity are single counts of the encoder, differentiated at 1 kHz or faster than the log."""
    q, count = exam.column("position", j), exam.quantum("position", j)
    near = q[np.maximum(rows[:, None] + np.array([-2, -1, 0, 1]), 0)]
    moved = np.ptp(near, axis=1)
    small = np.abs(v[rows] - _between(v, rows)) < 2 * count / min(exam.period, 1e-3)
    return small & (moved > 0) & (moved < 1.5 * count)


def _usual_excess(exam: Exam, channel: str, j: int, enough: float) -> tuple[float, int]:
    """Return the excess that only a few samples exceed, or infinity if it is larger than `enough`, and how many they are."""
    blocks = exam.by_block(channel, j)
    total = sum(max(x.size - 2, 0) for x in blocks)
    count = int(10 + 0.001 * total)
    rank = min(count + 1, total)
    if np.count_nonzero(excess(np.diff(blocks[0][:_GLANCE])) > enough) >= rank:
        return np.inf, count  # most often, a part of the samples tells
    every = np.concatenate([excess(np.diff(x)) for x in blocks])
    if np.count_nonzero(every > enough) >= rank:
        return np.inf, count
    some = every[every > 0.0]  # a partition takes long where most numbers are zero
    return (float(np.partition(some, -rank)[-rank]) if some.size >= rank else 0.0), count


def _ends(exam: Exam, channel: str, j: int) -> np.ndarray:
    """Return the first and last row where they lie outside the range of all others by more than that range, or a position jumps.

    At a start from rest, and at a stop, torque and velocity differ from all others by up to their size, and are sound.
    """
    x, survey = exam.log.channels[channel][:, j], exam.survey(channel)
    found: list[int] = []
    may_rest = channel not in POSITIONS
    for end, row, rest in ((0, 0, x[1:]), (1, x.size - 1, x[:-1])):
        if x[row] not in (survey.low[j], survey.high[j]):
            continue
        low, high = float(rest.min()), float(rest.max())
        away = max(low - x[row], x[row] - high)
        if not away > max(high - low, 4 * exam.quantum(channel, j)):
            continue
        if not (may_rest and away <= max(-low, high) and _resting_ends(exam, j)[end]):
            found.append(row)
    if not may_rest and (far := jumps(exam, channel, j)) is not None:
        rows = np.setdiff1d(far.rows, wraps(exam, channel, j)[1])
        found += [
            row for row, step in ((0, 1), (x.size - 1, x.size - 1)) if step in rows and row not in found
        ]
    return np.array(sorted(found), np.intp)


def _resting_ends(exam: Exam, j: int) -> tuple[bool, bool]:
    """Return whether a joint that mostly moves starts from rest, and whether it stops at the end."""
    n = len(exam.log)
    if exam.usable("position", j) and exam.period > 0:
        step = max(2, round(_MOMENT / exam.period))
        if step >= n:
            return False, False
        q = exam.column("position", j)
        moved = np.abs(q[step:] - q[:-step])
    elif exam.usable("velocity", j):
        moved = np.abs(exam.column("velocity", j))
    else:
        return False, False
    usual = _AT_REST * median(moved)
    return bool(moved[0] < usual), bool(moved[-1] < usual)
