"""Several samples with the same time stamp: sent twice, or a clock coarser than the sampling."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, Repair, check, count_of, keep_rows

#: Above this share of repeated stamps the clock is too coarse; below, samples were sent twice.
COARSE = 0.2


@check("repeated-time", "several samples with one stamp")
def find(exam: Exam) -> Iterator[Finding]:
    """Report every sample that has the stamp of the one before."""
    rows = np.flatnonzero(exam.steps == 0) + 1
    if not rows.size:
        return
    n = len(exam.log)
    if rows.size > COARSE * n:
        sentence = (
            f"{rows.size} of {n} samples repeat the stamp before: the clock is coarser than the sampling."
        )
        remedy = "Take a finer clock (--map t=COLUMN), or use --repair: it spreads the samples evenly."
    else:
        sentence = f"{count_of(rows.size, 'sample')} repeat the stamp before, first at sample {rows[0]}."
        remedy = "Drop the repetitions (--repair keeps the first of each)."
    yield Finding(
        severity="spoils",
        sentence=sentence,
        remedy=remedy,
        value=rows.size,
        where=rows,
        repairable=exam.period > 0,
    )


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Keep the first sample of each stamp, or spread the samples of a coarse clock."""
    rows = findings[0].where
    assert rows is not None
    log = exam.log
    n = len(log)
    keep = np.ones(n, bool)
    keep[rows] = False
    if rows.size <= COARSE * n:
        return keep_rows(log, keep, f"{count_of(rows.size, 'sample')} that repeat a stamp were dropped.")
    first = np.flatnonzero(keep)
    slope, start = cast("np.ndarray", np.polyfit(first, log.time[first] - log.time[0], 1))
    regular = log.time[0] + start + slope * np.arange(n)
    tick = float(np.median(np.diff(log.time[first])))
    if np.abs(regular[first] - log.time[first]).max() < 1.2 * tick:
        return Repair(
            log.replace(time=regular).with_note(
                f"{rows.size} repeated stamps were replaced by a regular clock of {slope:.6g} s."
            )
        )
    # the last stamp has no successor; its samples follow at the mean interval
    interval = (log.time[first[-1]] - log.time[0]) / first[-1]
    knots = np.append(first, n)
    stamps = np.append(log.time[first], log.time[first[-1]] + (n - first[-1]) * interval)
    time = np.interp(np.arange(n), knots, stamps)
    return Repair(
        log.replace(time=time).with_note(
            f"{rows.size} repeated stamps were spread evenly between their neighbours."
        )
    )
