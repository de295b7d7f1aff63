"""A torque that is exactly zero while the joint moves: effort was not sent, or the drive was off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check, count_of
from backdrive.logs.health._runs import standstill_runs


@check("silent-torque", "a torque that is exactly zero while the joint moves")
def find(exam: Exam) -> Iterator[Finding]:
    """Report torques and drive inputs that are zero throughout, and stretches of zeros during motion."""
    for channel, j, joint in exam.columns("torque", "drive_input"):
        survey = exam.survey(channel)
        if survey.low[j] == 0 == survey.high[j]:
            yield Finding(
                joint=joint,
                channel=channel,
                severity="spoils" if channel == "torque" else "warn",
                sentence=f"{channel} of {joint} is zero throughout.",
                remedy="The driver did not send it: record effort or motor current, and map it with --map tau=COLUMN.",
                value=0.0,
            )
        runs = [(a, b) for a, b in standstill_runs(exam, channel, j) if exam.column(channel, j)[a] == 0]
        if not runs:
            continue
        rows = np.concatenate([np.arange(a, b) for a, b in runs])
        yield Finding(
            joint=joint,
            channel=channel,
            severity="warn",
            sentence=(
                f"{channel} of {joint} is exactly zero at {count_of(rows.size, 'sample')} while the joint moves, "
                f"first at sample {rows[0]}. Either the drive was off, or the value was not sent."
            ),
            remedy="If the drive was off, the zeros are true. Otherwise cut the log to the part with measured torque.",
            value=rows.size,
            where=rows,
        )
