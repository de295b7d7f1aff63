"""A clock that goes backwards: samples out of order, or runs joined one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from backdrive.logs.health._exam import GAP, Exam
from backdrive.logs.health._finding import Finding, Repair, check, count_of, keep_rows
from backdrive.logs.log import Log

#: A clock that goes back more often than this is unordered, not a series of joined runs.
_MOST_RUNS = 200


@check("unsorted-time", "a clock that goes backwards")
def find(exam: Exam) -> Iterator[Finding]:
    """Report every sample that is stamped earlier than one before it."""
    time = exam.log.time
    if not exam.steps.size or exam.steps.min() >= 0:
        return
    late = np.flatnonzero(time < np.maximum.accumulate(time))
    back = -float(exam.steps.min())
    restarts = _restarts(exam)
    if restarts.size:
        sentence = (
            f"The clock jumps back by up to {back:.3g} s, at sample {', '.join(map(str, restarts[:5]))}: "
            f"{count_of(restarts.size + 1, 'run')} were joined, or the clock was set."
        )
        remedy = (
            "Give each run its own file, or use --repair. It shifts each run to the end of the run before, with a gap if the "
            "motion is not continuous."
        )
    else:
        sentence = f"{count_of(late.size, 'sample')} are out of order, by up to {back:.3g} s, first at sample {late[0]}."
        remedy = "Sort by time (--repair does)."
    yield Finding(
        severity="spoils",
        sentence=sentence,
        remedy=remedy,
        value=back,
        where=restarts if restarts.size else late,
        repairable=exam.period > 0,
    )


def in_order(log: Log) -> Log:
    """Return a log with its samples in the order that the repair gives them, without those that have no stamp."""
    exam = Exam(log if np.isfinite(log.time).all() else log.rows(np.flatnonzero(np.isfinite(log.time))))
    findings = find(exam)
    return repair(exam, findings).log if findings else exam.log


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Move joined runs one behind the other; then sort what is merely out of order."""
    del findings
    log, restarts = exam.log, _restarts(exam)
    time = np.array(log.time)
    notes: list[str] = []
    if restarts.size:
        for start, stop in zip(restarts, [*restarts[1:], time.size], strict=False):
            run = time[start:stop]
            # where the motion does not go on, four times what counts as a gap, so that no filter reaches across
            pause = 1.0 if _goes_on(exam, start) else 4 * GAP
            time[start:stop] = run - run.min() + time[:start].max() + pause * exam.period
        notes.append(
            f"{count_of(restarts.size, 'run')} with a restarted clock were moved behind the run before."
        )
    order = np.argsort(time, kind="stable")
    moved = int(np.count_nonzero(order != np.arange(order.size)))
    if moved:
        notes.append(f"{count_of(moved, 'sample')} out of order were sorted by time.")
    return keep_rows(log.replace(time=time), order, " ".join(notes))


def _goes_on(exam: Exam, row: int) -> bool:
    """Return whether the motion before a row goes on after it: then only the clock was set back."""
    for channel in ("position", "velocity"):
        array = exam.log.channels.get(channel)
        if array is None:
            continue
        around = np.abs(np.diff(array[max(0, row - 6) : row + 6], axis=0))
        seam = min(row, 6) - 1
        others = np.delete(around, seam, axis=0)
        if others.size and np.any(around[seam] > 3 * others.max(axis=0) + 1e-9):
            return False
    return True


def _restarts(exam: Exam) -> np.ndarray:
    """Return the rows at which a new run begins, where sorting would interleave two runs."""
    time = exam.log.time
    descents = np.flatnonzero(exam.steps < 0) + 1
    if descents.size > _MOST_RUNS:
        return np.empty(0, np.intp)
    found: list[np.intp] = []
    begin = 0
    for k, stop in zip(descents, [*descents[1:], time.size], strict=False):
        before, after = time[begin:k], time[k:stop]
        low, high = after[0], min(before.max(), after[-1])
        both = np.count_nonzero((before >= low) & (before <= high)) + np.count_nonzero(after <= high)
        expected = (high - low) / exam.period + 1
        if both > 4 and both > 1.5 * expected + 1:
            found.append(k)
            begin = k
    return np.array(found, np.intp)
