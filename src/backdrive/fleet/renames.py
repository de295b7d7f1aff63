"""Robots that were renamed: recognised by their logs, or recorded by the user."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date

from backdrive.errors import InvalidInput
from backdrive.fleet.entries import LogEntry
from backdrive.fleet.store import Store
from backdrive.fleet.work import UNREAD

SHARED = 1  # days on which both names may have logs: that of the renaming


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
        gone[robot] = gone.get(robot, True) and _is_gone(path, here)
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


def _is_gone(path: str, here: set[str]) -> bool:
    """Return whether a log is neither listed now nor, if it is a local file, there at all."""
    return path not in here and ("://" in path or not os.path.exists(path))


def record_renames(store: Store, pairs: Mapping[str, str]) -> list[str]:
    """Record new names of robots, and return a sentence for each. The reverse of a recorded pair undoes it.

    Args:
        store: the results, locked.
        pairs: former name -> present one.

    Raises:
        InvalidInput: a former name is not in the results, or both names have logs on the same days.
    """
    store.set_aside_fragments()
    rows = store.raw(["robot", "day", "digest"]).to_pylist()
    sentences = []
    for old, new in pairs.items():
        if store.names.get(new) == old:
            store = replace(store, names={a: b for a, b in store.names.items() if a != new})
            sentences.append(f"{new} is no longer taken for {old}.")
            continue
        logs: dict[str, dict[date, set[str]]] = {}
        for row in rows:
            robot = store.names.get(row["robot"], row["robot"])
            logs.setdefault(robot, {}).setdefault(row["day"], set()).add(row["digest"])
        present = store.names.get(old, old)
        if present not in logs and old not in store.names.values():
            known = ", ".join(sorted(logs)[:5])
            raise InvalidInput(
                f"There is no robot '{old}' in {store.folder}.",
                remedy=f"Write OLD=NEW; robots in the results are: {known}{' ...' if len(logs) > 5 else ''}",
            )
        one, other = logs.get(present, {}), logs.get(store.names.get(new, new), {})
        both = sorted(day for day in {*one} & {*other} if day and one[day].isdisjoint(other[day]))
        if present != new and len(both) > SHARED:
            raise InvalidInput(
                f"'{old}' and '{new}' both have logs on {len(both)} days, the first {both[0]}: they are two robots.",
                remedy="Rename only a robot whose logs under the former name ended before the new name began.",
            )
        store = store.rename({old: new})
        sentences.append(f"{old} is now {new}.")
    store.save()
    return sentences
