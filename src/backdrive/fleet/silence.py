"""Joints that have no results any more: their logs stopped, or all of them fail or give poor results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive.fleet.history import History, date_of

if TYPE_CHECKING:
    import pyarrow as pa

LEAST = 3.0  # days without a result that are no silence [day]
SPACINGS = 3.0  # usual distances between a joint's days that are none


def silent_joints(
    joints: Sequence[History], failures: pa.Table, results: pa.Table | None = None
) -> dict[str, str]:
    """Return a sentence for each joint whose last result is older than the fleet's newest by more than three days, and more
    than three times the usual distance of its days; by `ROBOT/JOINT`.

    Args:
        joints: their histories.
        failures: of `Store.table(failures=True)`.
        results: of `Store.table`, from which poor ones count; None: they are not distinguished from absent logs.
    """
    if not joints:
        return {}
    newest = max(float(one.day[-1]) for one in joints)
    failed: dict[str, list[tuple[date, str]]] = {}
    for robot, day, kind in _rows(failures, "robot", "day", "failure"):
        failed.setdefault(robot, []).append((day, kind))
    days: dict[str, list[date]] = {}
    for robot, joint, day in [] if results is None else _rows(results, "robot", "joint", "day"):
        days.setdefault(f"{robot}/{joint}", []).append(day)
    latest = date_of(newest + 1.0)  # later days come from a wrong clock
    result = {}
    for one in joints:
        last = float(one.day[-1])
        usual = float(np.median(np.diff(one.day))) if one.day.size > 1 else 1.0
        if newest - last <= max(LEAST, SPACINGS * usual):
            continue
        day = date_of(last)
        kinds = Counter(kind for other, kind in failed.get(one.robot, []) if other and day < other <= latest)
        poor = sum(day < other <= latest for other in days.get(one.name, []) if other)
        why = [f"{kinds.total()} later logs failed ({kinds.most_common(1)[0][0]})"] if kinds else []
        why += [f"{poor} later results are poor"] if poor else []
        result[one.name] = f"no result since {day}: {', '.join(why) or 'no later logs'}"
    return result


def _rows(table: pa.Table, *names: str) -> Iterator[tuple[Any, ...]]:
    return zip(*(table.column(name).to_pylist() for name in names), strict=True)
