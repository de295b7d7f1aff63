"""The safe region of a tuning that was made without one."""

from __future__ import annotations

from typing import Any

from backdrive._blas import on_one_thread
from backdrive.errors import InvalidInput
from backdrive.tuning.goals import goal_of
from backdrive.tuning.margins import region
from backdrive.tuning.tuning import Tuning


@on_one_thread
def region_of(tuning: Tuning) -> dict[str, Any]:
    """Return the safe region of a tuning, as `margins.region` does.

    Args:
        tuning: for `backdrive` or `track`, with the data of its joint.

    Raises:
        InvalidInput: it is for another goal, or was read from a file, which does not hold these data.
    """
    if tuning.goal not in ("backdrive", "track"):
        raise InvalidInput(
            f"There is no picture of '{tuning.joint}' for '{tuning.goal}'.",
            remedy="The safe region is that of the goals backdrive and track; `summary()` shows the numbers.",
        )
    if tuning.facts is None:
        raise InvalidInput(
            f"The tuning of '{tuning.joint}' was read from a file that does not hold its safe region.",
            remedy="Tune again with draw=True, and save that.",
        )
    chosen, thesis = (tuning.scores["rows"][row]["numbers"] for row in ("chosen", "thesis"))
    goal = goal_of(tuning.goal, tuning.facts, tuning.stroke, chosen, tuning.scores["wish"])
    return region(tuning.facts, chosen, goal, thesis)
