"""Batches of logs, each the work of one task and one file of results."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from backdrive.fleet.entries import LogEntry

BYTES = 8 << 20  # of logs in a batch, about a second and a half of work [B]
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
    """Yield batches of about equal work, each of one month. They depend on the logs only, not on the number of workers.

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
        size = 0
        for entry in months[month]:
            if part and (size + entry.size > BYTES or len(part) >= most):
                yield batch_of(month, part, tag)
                part, size = [], 0
            part.append(entry)
            size += entry.size
        yield batch_of(month, part, tag)


def batch_of(month: str, entries: Sequence[LogEntry], tag: str) -> Batch:
    """Return a batch, named after its logs and the tag."""
    text = "\n".join([tag, *(f"{entry.path}\t{entry.stamp}" for entry in entries)])
    name = hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:24]
    return Batch(name, month, tuple(entries))
