"""Robots that were renamed, recognised by their logs."""

from __future__ import annotations

from collections.abc import Sequence

from backdrive.fleet.sources import LogEntry
from backdrive.fleet.store import Store
from backdrive.fleet.work import UNREAD


def recognise_renames(store: Store, entries: Sequence[LogEntry]) -> tuple[Store, list[str]]:
    """Recognise robots that were renamed: all their logs exist under a new name, and none under the former one."""
    known = store.raw(["digest", "path", "robot"])
    here = {entry.path for entry in entries}
    owners: dict[str, set[tuple[str, bool]]] = {}
    logs: dict[str, set[str]] = {}
    gone: dict[str, bool] = {}
    for digest, path, robot in zip(
        *(known.column(name).to_pylist() for name in known.column_names), strict=True
    ):
        owners.setdefault(digest, set()).add((robot, path in here))
        if not digest.startswith(UNREAD):
            logs.setdefault(robot, set()).add(digest)
        gone[robot] = gone.get(robot, True) and path not in here
    names = {}
    for old, digests in logs.items():
        if not gone[old] or old in store.names:
            continue
        new = set.intersection(*({robot for robot, present in owners[d] if present} for d in digests))
        if len(new) == 1:
            names[old] = new.pop()
    if not names:
        return store, []
    store = store.rename(names)
    store.save()
    return store, [
        f"Robot '{old}' is called '{new}' now: its logs are the same." for old, new in sorted(names.items())
    ]
