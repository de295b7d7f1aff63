"""A channel that stands still while the joint moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, Repair, check, columns_of, count_of, without_rows
from backdrive.logs.health._runs import standstill_runs
from backdrive.logs.resolution import white_noise

CHANNELS = ("position", "velocity", "torque", "drive_input", "second_encoder", "external_torque")
#: Share of the log above which frozen samples spoil a result.
_SPOILS = 0.01


@check("stuck", "a channel that stands still while the joint moves")
def find(exam: Exam) -> list[Finding]:
    """Report stretches in which a channel is frozen, and channels that never change."""
    columns = [_dead(exam, *column) or _stuck_finding(exam, *column) for column in exam.columns(*CHANNELS)]
    return [finding for finding in columns if finding is not None]


def _stuck_finding(exam: Exam, channel: str, j: int, joint: str) -> Finding | None:
    runs = standstill_runs(exam, channel, j)
    if channel in ("torque", "drive_input"):  # standing at zero is `silent-torque`
        runs = [(a, b) for a, b in runs if exam.column(channel, j)[a] != 0]
    if not runs:
        return None
    rows = np.concatenate([np.arange(a + 1, b) for a, b in runs])
    longest = max(runs, key=lambda run: run[1] - run[0])
    n = len(exam.log)
    return Finding(
        joint=joint,
        channel=channel,
        severity="spoils" if rows.size > _SPOILS * n else "warn",
        sentence=(
            f"{channel} of {joint} is frozen while the joint moves: {count_of(rows.size, 'sample')} in "
            f"{count_of(len(runs), 'place')}. The longest is from sample {longest[0]} to {longest[1] - 1}."
        ),
        remedy="Drop those samples (--repair does), and look for lost messages of that sensor.",
        value=longest[1] - longest[0],
        where=rows,
        repairable=rows.size < 0.5 * n,
    )


def _dead(exam: Exam, channel: str, j: int, joint: str) -> Finding | None:
    survey = exam.survey(channel)
    if survey.low[j] != survey.high[j]:
        return None
    level = float(survey.low[j])
    other = {"position": "velocity", "second_encoder": "position"}.get(channel, "position")
    if other not in exam.log.channels and channel != "velocity":
        other = "velocity"
    if channel in ("torque", "drive_input") and level == 0:
        return None  # `silent-torque`
    if not exam.usable(other, j) or not _goes_on(exam, other, j):
        return None
    needed = channel in ("position", "velocity", "torque")
    return Finding(
        joint=joint,
        channel=channel,
        severity="spoils" if needed else "note",
        sentence=f"{channel} of {joint} is {level:.5g} throughout, while {other} changes.",
        remedy=f"The sensor or its message is dead: map {channel} from another column (--map), or leave it out.",
        value=level,
        repairable=channel == "velocity",
    )


def _goes_on(exam: Exam, channel: str, j: int) -> bool:
    """Return whether a motion channel moves by more than a few of its steps."""
    if channel == "velocity":
        x, t = exam.column("velocity", j), exam.log.time
        path = np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(t))
        wander = 6 * np.sqrt(x.size) * exam.period * white_noise(exam.sample("velocity", j))
        return bool(np.ptp(path) > max(1e-3, wander))
    survey = exam.survey(channel)
    return bool(survey.high[j] - survey.low[j] > max(10 * exam.quantum(channel, j), 1e-3))


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Drop frozen samples; leave out a velocity that is dead."""
    log = exam.log
    for channel in sorted({str(f.channel) for f in findings if f.where is None}):
        log = log.replace(**{channel: None}).with_note(
            f"{channel} was left out: it never changes while the joint moves."
        )
    frozen = np.zeros(len(log), bool)
    for _, _, _, rows in columns_of(exam, findings):
        frozen[rows] = True
    return without_rows(log, frozen, "sample", "of frozen channels were dropped.")
