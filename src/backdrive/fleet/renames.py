"""Robots that were renamed, recognised by their logs."""

from __future__ import annotations

from collections.abc import Sequence

from backdrive.fleet.sources import LogEntry
from backdrive.fleet.store import Store


def recognise_renames(store: Store, entries: Sequence[LogEntry]) -> tuple[Store, list[str]]:
    """Recognise robots that were renamed: all their logs exist under a new name, and none under the former one."""
    known = store.raw(["digest", "path", "robot"])
    here = {entry.path for entry in entries}
    owners: dict[str, set[tuple[str, bool]]] = {}
    gone: dict[str, bool] = {}
    for digest, path, robot in zip(
        *(known.column(name).to_pylist() for name in known.column_names), strict=True
    ):
        owners.setdefault(digest, set()).add((robot, path in here))
        gone[robot] = gone.get(robot, True) and path not in here
    pairs: dict[str, set[str]] = {}
    for shared in owners.values():
        for old in {robot for robot, _ in shared if gone[robot]}:
            pairs.setdefault(old, set()).update(
                robot for robot, present in shared if present and robot != old
            )
    names = {old: new.pop() for old, new in pairs.items() if len(new) == 1 and old not in store.names}
    if not names:
        return store, []
    store = store.rename(names)
    store.save()
    return store, [
        f"Robot '{old}' is called '{new}' now: its logs are the same." for old, new in sorted(names.items())
    ]
