"""Health checks of logs: one check per file, with a name, a sentence with numbers, and a remedy.

Checks run in the order of `CHECKS`, each on the log as repaired by the checks before it. So one fault gives one finding: a
wrapped integer is not reported as an outlier too, nor a velocity in degrees as a wrong scale.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

from backdrive._arguments import guard_keywords
from backdrive._catalog import lookup
from backdrive._documents import is_several
from backdrive.errors import InvalidInput, UnhealthyLog
from backdrive.logs.health import few_samples, unsorted_time
from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Check, Finding, Repair, Severity
from backdrive.logs.log import Log
from backdrive.logs.tables import as_logs

__all__ = ["CHECKS", "Check", "Finding", "Repair", "Severity", "check", "gate", "mend"]

#: The checks in their order: clock, single samples, channels, consistency of channels. Each has a module and a line.
CHECKS: tuple[Check, ...] = tuple(
    import_module(f"{__name__}.{name}").find
    for name in (
        "few_samples",
        "nan",
        "infinite",
        "unsorted_time",
        "repeated_time",
        "jitter",
        "gaps",
        "integer_wrap",
        "stuck",
        "encoder_wrap",
        "silent_torque",
        "position_jump",
        "outlier",
        "saturation",
        "no_motion",
        "degrees",
        "velocity_mismatch",
        "torque_sign",
        "no_friction",
        "time_slip",
        "plan_mismatch",
    )
)


@guard_keywords
def check(logs: Log | Sequence[Log] | Any, *, plan: Any = None) -> list[Finding]:
    """Return all findings on a log, in the order of `CHECKS`; an empty list means that no fault was found.

    Args:
        logs: one log or data frame, or several, as `identify` takes them; they are not changed.
        plan: the motion plan it was recorded with, or one a log; the log's own, if None.

    Returns:
        The findings; of several logs, log by log, each with the number of its log (`Finding.log`).

    Raises:
        InvalidInput: there is no log, or something that is none.
    """
    several = as_logs(logs)
    if not several:
        raise InvalidInput(
            "There is no log to check.", remedy="Pass at least one `Log`, as `read_log` gives it."
        )
    plans = list(plan) if is_several(plan) else [plan] * len(several)
    if len(plans) != len(several):
        raise InvalidInput(
            f"{len(plans)} plans for {len(several)} logs.", remedy="Give one plan, or one for each log."
        )
    found = [_examine(log, one, frozenset())[0] for log, one in zip(several, plans, strict=True)]
    return [replace(f, log=k) if k else f for k, findings in enumerate(found) for f in findings]


def gate(log: Log, accept: Iterable[str] = (), repair: bool = False, *, plan: Any = None) -> Log:
    """Return a log that passes the checks, or raise an error; this is the first return value of `screen`."""
    return screen(log, accept, repair, plan=plan)[0]


def screen(
    log: Log, accept: Iterable[str] = (), repair: bool = False, *, plan: Any = None
) -> tuple[Log, list[Finding]]:
    """Return a log that passes the checks, with its remaining suspect findings, or raise an error.

    Args:
        log: any log.
        accept: names of checks whose findings the user accepts; they are neither repaired nor refused.
        repair: make all safe repairs; every repair is among the notes of the log returned.
        plan: the motion plan it was recorded with; the log's own, if None.

    Returns:
        The log itself, with a note for every accepted fault, or the repaired log; and the findings that warn and were neither
        accepted nor repaired.

    Raises:
        UnknownName: a name in `accept` is not a check.
        UnhealthyLog: a finding that spoils is neither accepted nor repaired; the message holds its sentence and remedy.
    """
    known = {c.name: c for c in CHECKS}
    accepted = frozenset(lookup(name, known, "health check").name for name in accept)
    findings, mended = _examine(log, plan, accepted)
    spoiling = [f for f in findings if f.severity == "spoils" and f.name not in accepted]
    if repair:
        spoiling = [f for f in spoiling if not f.repairable]
    if spoiling:
        names = sorted({f.name for f in spoiling})
        sentences = " ".join(f"[{f.name}] {f.sentence} {f.remedy}" for f in spoiling[:4])
        more = f" And {len(spoiling) - 4} more." if len(spoiling) > 4 else ""
        mend = "" if repair or not all(f.repairable for f in spoiling) else "--repair, or "
        raise UnhealthyLog(
            f"The log would spoil the result: {sentences}{more}",
            remedy=f"Use {mend}{' '.join(f'--accept {name}' for name in names)} to continue anyway.",
            findings=[f.to_dict() for f in spoiling],
        )
    result = mended if repair else log
    notes = [
        f"Accepted [{f.name}]: {f.sentence}"
        for f in findings
        if f.severity == "spoils" and f.name in accepted
    ]
    left = [
        f
        for f in findings
        if f.severity == "warn" and f.name not in accepted and not (repair and f.repairable)
    ]
    return (result.replace(notes=(*result.notes, *notes)) if notes else result), left


def mend(log: Log, accept: Iterable[str] = (), *, plan: Any = None) -> Log:
    """Return the log with all repairs that `gate` makes with `repair=True`, even if it would still be refused; its notes list
    the repairs.

    Args:
        log: any log.
        accept: names of checks whose findings are not repaired.
        plan: the motion plan it was recorded with; the log's own, if None.

    Raises:
        UnknownName: a name in `accept` is not a check.
    """
    known = {c.name: c for c in CHECKS}
    return _examine(log, plan, frozenset(lookup(name, known, "health check").name for name in accept))[1]


def _examine(log: Log, plan: Any, accepted: frozenset[str]) -> tuple[list[Finding], Log]:
    """Return the findings, with rows of the log as it was given, and the log after all repairs but the accepted ones."""
    findings: list[Finding] = []
    rows: np.ndarray | None = None
    exam = Exam(log, plan)
    with np.errstate(all="ignore"):  # a log may contain 1e308 or larger
        for item in CHECKS:
            if len(exam.log) < few_samples.FEWEST and item.name != few_samples.find.name:
                break
            if item.name == unsorted_time.find.name and not np.isfinite(exam.log.time).all():
                break  # without a clock no other check is possible
            own = item(exam)
            findings += [_with_rows_of(f, rows) for f in own]
            mendable = [f for f in own if f.repairable]
            if item.repair is None or not mendable or item.name in accepted:
                continue
            fixed = item.repair(exam, mendable)
            if fixed.rows is not None:
                rows = fixed.rows if rows is None else rows[fixed.rows]
            exam = Exam(fixed.log, plan)
    return findings, exam.log


def _with_rows_of(finding: Finding, rows: np.ndarray | None) -> Finding:
    if rows is None or finding.where is None:
        return finding
    return replace(finding, where=np.sort(rows[finding.where]))
