"""Common parts of the checks for NaN and for infinity: finding the samples and dropping them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Check, Finding, Repair, count_of, without_rows
from backdrive.logs.log import Log

#: Channels that cannot be replaced; other channels are left out if they are empty.
_NEEDED = ("torque",)
#: A channel with more holes than this share is empty rather than damaged.
EMPTY = 0.5


def check_holes(name: str, about: str, word: str, is_hole: Callable[[np.ndarray], np.ndarray]) -> Check:
    """Return the check for one kind of hole, in the clock and in every channel, by joint; one is enough.

    Args:
        name: of the check.
        about: what it looks for.
        word: what a hole is called in the sentence.
        is_hole: array to mask.
    """

    def search(exam: Exam) -> Iterator[Finding]:
        log = exam.log
        rows = np.flatnonzero(is_hole(log.time))
        if rows.size:
            yield Finding(
                severity="spoils",
                sentence=f"The clock is {word} at {count_of(rows.size, 'sample')}, first at sample {rows[0]}.",
                remedy="Drop those samples (--repair does), or take the time from another column with --map t=COLUMN.",
                value=rows.size,
                where=rows,
                repairable=rows.size < EMPTY * len(log),
            )
        for channel, array in log.channels.items():
            for j in np.flatnonzero(~exam.survey(channel).finite):
                rows = np.flatnonzero(is_hole(array[:, j]))
                if rows.size:
                    yield _finding(log, channel, log.names[j], word, rows)

    return Check(name, about, search, _drop_holes)


def _finding(log: Log, channel: str, joint: str, word: str, rows: np.ndarray) -> Finding:
    empty = rows.size > EMPTY * len(log)
    return Finding(
        joint=joint,
        channel=channel,
        severity="spoils",
        sentence=f"{channel} of {joint} is {word} at {rows.size} of {len(log)} samples, first at sample {rows[0]}.",
        remedy=(
            f"Leave the channel out, or map {channel} from a column that holds numbers (--map)."
            if empty
            else "Drop those samples (--repair does; the remaining parts are not joined across them)."
        ),
        value=rows.size,
        where=rows,
        repairable=not empty or _can_leave_out(log, channel),
    )


def _drop_holes(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Drop rows with holes; leave out a channel that is mostly holes and not required."""
    log, name = exam.log, findings[0].name
    n = len(log)
    empty = {str(f.channel) for f in findings if f.where is not None and f.where.size > EMPTY * n}
    # position and velocity replace one another, but one of them must stay
    if {"position", "velocity"} <= empty:
        empty -= {"position"}
    for channel in sorted(empty):
        log = log.replace(**{channel: None}).with_note(f"{channel} was left out: it is mostly {name}.")
    holes = np.zeros(n, bool)
    for finding in findings:
        if finding.channel not in empty:
            holes[finding.where] = True
    return without_rows(log, holes, "sample", f"with {name} were dropped.")


def _can_leave_out(log: Log, channel: str) -> bool:
    if channel in _NEEDED:
        return False
    if channel in ("position", "velocity"):
        return log.position is not None and log.velocity is not None
    return True
