"""Batches of logs, each the work of one task and one file of results."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from backdrive.fleet.entries import LogEntry

WORK = 1.5  # estimated work of a batch [s]
EACH = 0.06  # of a log without a sample [s]
PER_BYTE = 6e-8  # of a log's size [s/B]; with 32 B a sample, NPZ of 20,000 samples takes 0.1 s
PER_BYTE_OF_TEXT = 2.5e-8  # the same, with about 100 B a sample [s/B]
TEXT = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log")
LOGS = 64  # in a batch at most


@dataclass(frozen=True)
class Batch:
    """Logs of one month that one task processes.

    Attributes:
        name: of its file, the same for the same logs and options.
        month: of the logs, such as `2026-03`.
        entries: the logs.
    """

    name: str
    month: str
    entries: tuple[LogEntry, ...]


def cut(entries: Sequence[LogEntry], tag: str, most: int = LOGS) -> Iterator[Batch]:
    """Yield batches of about equal work, each of one month. They depend on the logs only, not on workers or measured times.

    Args:
        entries: in the order of their paths.
        tag: of options and version.
        most: logs in a batch.
    """
    months: dict[str, list[LogEntry]] = {}
    for entry in entries:
        months.setdefault(entry.day.strftime("%Y-%m"), []).append(entry)
    for month in sorted(months):
        part: list[LogEntry] = []
        total = 0.0
        for entry in months[month]:
            own = work_of(entry)
            if part and (total + own > WORK or len(part) >= most):
                yield batch_of(month, part, tag)
                part, total = [], 0.0
            part.append(entry)
            total += own
        yield batch_of(month, part, tag)


def work_of(entry: LogEntry) -> float:
    """Return the estimated work for a log, by the size of its file [s]. A free processor takes a third of it, a busy one twice."""
    text = entry.path.lower().endswith(TEXT)
    return EACH + (PER_BYTE_OF_TEXT if text else PER_BYTE) * entry.size


def batch_of(month: str, entries: Sequence[LogEntry], tag: str) -> Batch:
    """Return a batch, named after its logs and the tag."""
    text = "\n".join([tag, *(f"{entry.path}\t{entry.stamp}" for entry in entries)])
    name = hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:24]
    return Batch(name, month, tuple(entries))
