"""Dropped samples: intervals much longer than the others."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from backdrive.logs.health._exam import GAP, Exam
from backdrive.logs.health._finding import Finding, check, count_of


@check("gaps", f"intervals longer than {GAP} periods")
def find(exam: Exam) -> Iterator[Finding]:
    """Report intervals longer than `GAP` times the usual one."""
    rows = exam.gaps
    if not rows.size:
        return
    steps = exam.steps[rows - 1]
    lost = int(np.round(steps / exam.period - 1).sum())
    longest = int(np.argmax(steps))
    yield Finding(
        severity="warn",
        sentence=(
            f"{count_of(rows.size, 'gap')}, {count_of(lost, 'sample')} missing; the longest is {steps[longest]:.3g} s "
            f"before sample {rows[longest]}."
        ),
        remedy="No action is needed: the log is used in pieces and never joined across a gap. Recording without loss is better.",
        value=lost,
        where=rows,
    )
