"""What the checks for NaN and for infinity share: finding the samples, and doing without them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, Repair, counted, keep_rows
from backdrive.logs.log import Log

#: Channels that nothing can replace; of the others an empty one is left out.
_NEEDED = ("torque",)
#: A channel with more holes than this share is empty rather than damaged.
EMPTY = 0.5


def find_holes(
    exam: Exam, name: str, word: str, is_hole: Callable[[np.ndarray], np.ndarray]
) -> list[Finding]:
    """Report holes in the clock and in every channel, by joint.

    Args:
        exam: the log.
        name: of the check.
        word: what a hole is called in the sentence.
        is_hole: array to mask.
    """
    log = exam.log
    findings = []
    rows = np.flatnonzero(is_hole(log.time))
    if rows.size:
        findings.append(
            Finding(
                name=name,
                severity="spoils",
                sentence=f"The clock is {word} at {counted(rows.size, 'sample')}, first at sample {rows[0]}.",
                remedy="Drop those samples (--repair does), or take the time from another column with --map t=COLUMN.",
                value=rows.size,
                where=rows,
                repairable=rows.size < EMPTY * len(log),
            )
        )
    for channel, array in log.channels.items():
        finite = exam.survey(channel).finite
        for j in np.flatnonzero(~finite):
            rows = np.flatnonzero(is_hole(array[:, j]))
            if not rows.size:
                continue
            empty = rows.size > EMPTY * len(log)
            part = f"{rows.size} of {len(log)} samples, first at sample {rows[0]}"
            findings.append(
                Finding(
                    name=name,
                    joint=log.names[j],
                    channel=channel,
                    severity="spoils",
                    sentence=f"{channel} of {log.names[j]} is {word} at {part}.",
                    remedy=(
                        f"Leave the channel out, or map {channel} from a column that holds numbers (--map)."
                        if empty
                        else "Drop those samples (--repair does; what is left is never joined across them)."
                    ),
                    value=rows.size,
                    where=rows,
                    repairable=not empty or _can_leave_out(log, channel),
                )
            )
    return findings


def drop_holes(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Drop rows with holes; leave out a channel that is mostly holes and can be done without."""
    log = exam.log
    n = len(log)
    empty = {str(f.channel) for f in findings if f.where is not None and f.where.size > EMPTY * n}
    # position and velocity replace one another, but one of them must stay
    if {"position", "velocity"} <= empty:
        empty -= {"position"}
    for channel in sorted(empty):
        log = log.replace(**{channel: None}).noted(
            f"{channel} was left out: it is mostly {findings[0].name}."
        )
    keep = np.ones(n, bool)
    for finding in findings:
        if finding.channel not in empty and finding.where is not None:
            keep[finding.where] = False
    if keep.all():
        return Repair(log)
    return keep_rows(
        log, keep, f"{counted(int((~keep).sum()), 'sample')} with {findings[0].name} were dropped."
    )


def _can_leave_out(log: Log, channel: str) -> bool:
    if channel in _NEEDED:
        return False
    if channel in ("position", "velocity"):
        return log.position is not None and log.velocity is not None
    return True
