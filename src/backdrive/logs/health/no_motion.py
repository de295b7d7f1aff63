"""A joint that does not move: held still, or a torque ramp below the encoder's resolution, or nothing was recorded."""

from __future__ import annotations

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check


@check("no-motion", "joints that do not move")
def find(exam: Exam) -> list[Finding]:
    """Report joints without motion: a remark while another moves or torque is applied, spoiling otherwise."""
    still = [j for j, _ in exam if not _moves(exam, j)]
    none = len(still) == len(exam.log.joints) and not any(_has_ramp(exam, j) for j in still)
    return [
        Finding(
            joint=exam.log.names[j],
            severity="spoils" if none else "note",
            sentence=f"{exam.log.names[j]} does not move in this log.",
            remedy="Choose the joints that move with --joint."
            if not none
            else "Record a motion; friction cannot be identified without one.",
            value=0.0,
        )
        for j in still
    ]


def _moves(exam: Exam, j: int) -> bool:
    """Return whether position or velocity has more than two values."""
    for channel in ("position", "velocity"):
        if exam.usable(channel, j):
            x = exam.sample(channel, j)
            if np.any((x > x.min()) & (x < x.max())):
                return True
    return not any(exam.usable(channel, j) for channel in ("position", "velocity"))


def _has_ramp(exam: Exam, j: int) -> bool:
    """Return whether torque goes up and down by more than its noise, as in a ramp below break-away."""
    if not exam.usable("torque", j):
        return False
    x = exam.sample("torque", j)
    return float(np.mean(np.diff(x) ** 2)) < 0.1 * float(np.var(x))
