"""Joints that have no results any more: their logs stopped, or all of them fail."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from backdrive.fleet.history import History, date_of

if TYPE_CHECKING:
    import pyarrow as pa

LEAST = 3.0  # days without a result that are no silence [day]
SPACINGS = 3.0  # usual distances between a joint's days that are none


def silent_joints(joints: Sequence[History], failures: pa.Table) -> dict[str, str]:
    """Return a sentence for each joint whose last result is older than the fleet's newest by more than three days, and more
    than three times the usual distance of its days; by `ROBOT/JOINT`.

    Args:
        joints: their histories.
        failures: of `Store.table(failures=True)`.
    """
    if not joints:
        return {}
    newest = max(float(one.day[-1]) for one in joints)
    rows = failures.select(["robot", "day", "failure"]).to_pylist()
    result = {}
    for one in joints:
        last = float(one.day[-1])
        usual = float(np.median(np.diff(one.day))) if one.day.size > 1 else 1.0
        if newest - last <= max(LEAST, SPACINGS * usual):
            continue
        day = date_of(last)
        kinds = Counter(
            row["failure"] for row in rows if row["robot"] == one.robot and row["day"] and row["day"] > day
        )
        why = (
            f"{kinds.total()} later logs failed ({kinds.most_common(1)[0][0]})" if kinds else "no later logs"
        )
        result[one.name] = f"no result since {day}: {why}"
    return result
