"""Summary of a folder of results, in numbers and sentences."""

from __future__ import annotations

import os
from collections import Counter
from datetime import UTC, date, datetime, timedelta
from typing import Any

from backdrive.fleet.history import histories
from backdrive.fleet.merging import EARLIEST, copies
from backdrive.fleet.silence import silent_joints
from backdrive.fleet.store import Store

LISTED = 5  # names in a sentence


def status(folder: str | os.PathLike) -> dict[str, Any]:
    """Return counts, failures by kind with an example of each, joints without recent results, and remarks.

    Args:
        folder: of the results.

    Raises:
        BackdriveError: there are none, or of a newer schema.
    """
    store = Store.open(folder)
    results, failures, raw = (
        store.table(),
        store.table(failures=True),
        store.raw(["digest", "path", "day", "robot"]),
    )
    robots, logs = set(results.column("robot").to_pylist()), len(set(results.column("path").to_pylist()))
    joints = set(zip(results.column("robot").to_pylist(), results.column("joint").to_pylist(), strict=True))
    days = [d for d in results.column("day").to_pylist() if d is not None]
    kinds = Counter(failures.column("failure").to_pylist())
    example = {}
    for row in failures.select(["failure", "path", "message", "remedy", "robot"]).to_pylist():
        example.setdefault(row["failure"], row)
    same = copies(raw, store.names)
    wrong = odd_days(results)
    grades = Counter(results.column("grade").to_pylist())
    sentences = [
        f"{len(robots)} robots, {len(joints)} joints, {logs} logs"
        + (f" from {min(days)} to {max(days)}." if days else ".")
    ]
    sentences += (
        [f"Grades: {', '.join(f'{n} {grade}' for grade, n in sorted(grades.items()))}."] if grades else []
    )
    sentences += [f"{failures.num_rows} logs failed."] if failures.num_rows else []
    if same:
        pairs = "; ".join(f"{copy} as {first}" for first, copy in same[:LISTED])
        are = (
            "1 log is a copy of another and counts"
            if len(same) == 1
            else f"{len(same)} logs are copies of others and count"
        )
        sentences.append(f"{are} once: {pairs}.")
    if wrong:
        names = "; ".join(f"{robot} on {day}" for robot, day in wrong[:LISTED])
        sentences.append(
            f"{len(wrong)} dates are impossible (a clock that was not set): {names}; left out of trends."
        )
    sentences += [f"Robot '{old}' is now '{new}'." for old, new in store.names.items()]
    return {
        "robots": len(robots),
        "joints": len(joints),
        "logs": logs,
        "failed": failures.num_rows,
        "copies": [list(pair) for pair in same],
        "names": dict(store.names),
        "silent": silent_joints(histories(results), failures, results),
        "failures": [
            {"kind": kind, "logs": n, **{k: example[kind][k] for k in ("path", "message", "remedy")}}
            for kind, n in kinds.most_common()
        ],
        "sentences": sentences,
    }


def odd_days(table: Any) -> list[tuple[str, date | None]]:
    """Return robots and impossible dates: before 2000, or after tomorrow."""
    latest = datetime.now(UTC).date() + timedelta(days=1)
    rows = set(zip(table.column("robot").to_pylist(), table.column("day").to_pylist(), strict=True))
    odd = [(robot, day) for robot, day in rows if day is None or not EARLIEST <= day <= latest]
    return sorted(odd, key=str)
