"""The result of a health check, `Finding`, and the definition of a check, `Check`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from backdrive.logs.log import Log

if TYPE_CHECKING:
    from backdrive.logs.health._exam import Exam

#: `note`: harmless. `warn`: the result is less accurate. `spoils`: the result would be wrong.
Severity = Literal["note", "warn", "spoils"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """One fault of a log.

    Attributes:
        name: of the check, as `--accept NAME` takes it; the check fills it in.
        joint: name of the joint; None when the whole log is meant.
        channel: name of the channel, such as `torque`; None when the clock or the whole log is meant.
        severity: `note`, `warn` or `spoils`.
        sentence: what was found, with its numbers.
        remedy: what to do about it.
        value: the size of the fault, in the unit that the sentence names [any].
        quantity: what the value is, where a check finds several things, such as `scale` or `delay`; empty otherwise.
        where: rows of the log that was checked, ascending, (m,); None when all rows are meant.
        repairable: a safe repair exists, which `gate(..., repair=True)` makes.
        log: number of the log among those that were checked together, from 0.
    """

    name: str = ""
    severity: Severity
    sentence: str
    remedy: str
    value: float
    quantity: str = ""
    joint: str | None = None
    channel: str | None = None
    where: np.ndarray | None = None
    repairable: bool = False
    log: int = 0

    def to_dict(self) -> dict[str, object]:
        """Return plain values for JSON; at most a thousand rows are listed, all are counted."""
        return {
            "name": self.name,
            "joint": self.joint,
            "channel": self.channel,
            "severity": self.severity,
            "sentence": self.sentence,
            "remedy": self.remedy,
            "value": float(self.value),
            "count": None if self.where is None else int(self.where.size),
            "where": None if self.where is None else [int(k) for k in self.where[:1000]],
            "repairable": self.repairable,
        }


@dataclass(frozen=True, eq=False)
class Repair:
    """A log after a repair.

    Attributes:
        log: the repaired log, with a note of what was done.
        rows: former index of each row, (m,); None when no row moved.
    """

    log: Log
    rows: np.ndarray | None = None


Mend = Callable[["Exam", Sequence[Finding]], Repair]
Changes = dict[tuple[str, int], np.ndarray]  # of joints' columns, by channel and column


@dataclass(eq=False)
class Check:
    """A check for one kind of fault; called with an exam it returns its findings.

    Attributes:
        name: stable, kebab-case.
        about: what it looks for, in half a sentence.
        search: looks at an `Exam` and yields findings, which need not say the name.
        repair: repairs those of its findings that are repairable; None when there is no safe repair.
    """

    name: str
    about: str
    search: Callable[[Exam], Iterable[Finding]]
    repair: Mend | None = None

    def __call__(self, exam: Exam) -> list[Finding]:
        """Return the findings."""
        return [replace(finding, name=self.name) for finding in self.search(exam)]

    def mend_with(self, repair: Mend) -> Mend:
        """Register a function that repairs the check's findings."""
        self.repair = repair
        return repair


def check(name: str, about: str) -> Callable[[Callable[[Exam], Iterable[Finding]]], Check]:
    """Turn a function that yields findings into a check."""
    return lambda search: Check(name, about, search)


def columns_of(exam: Exam, findings: Sequence[Finding]) -> Iterator[tuple[Finding, str, int, np.ndarray]]:
    """Yield each finding with its channel, the column of its joint and its rows, (m,)."""
    for finding in findings:
        rows = np.empty(0, np.intp) if finding.where is None else finding.where
        yield finding, str(finding.channel), exam.log.names.index(str(finding.joint)), rows


def keep_rows(log: Log, rows: np.ndarray, sentence: str) -> Repair:
    """Return the repair that keeps the rows of an index array or mask, in that order, with a note."""
    rows = np.flatnonzero(rows) if rows.dtype == bool else rows
    return Repair(log.rows(rows).with_note(sentence), rows)


def without_rows(log: Log, rows: np.ndarray, noun: str, reason: str) -> Repair:
    """Return the repair that drops the rows of a mask (n,), if any, with a note such as `2 samples with NaN were dropped.`"""
    if not rows.any():
        return Repair(log)
    return keep_rows(log, ~rows, f"{count_of(int(rows.sum()), noun)} {reason}")


def with_columns(log: Log, changes: Changes, sentences: Sequence[str]) -> Log:
    """Return the log with some joints' columns (n,) replaced, given by channel and column, with notes."""
    arrays = {channel: np.array(log.channels[channel]) for channel in {channel for channel, _ in changes}}
    for (channel, column), values in changes.items():
        arrays[channel][:, column] = values
    return log.replace(notes=(*log.notes, *sentences), **arrays)


def count_of(number: int, noun: str) -> str:
    """Return `1 sample`, `2 samples`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
