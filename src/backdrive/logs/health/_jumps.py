"""Jumps of a position that are physically impossible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from backdrive.logs.health._exam import Exam, once
from backdrive.logs.quantiles import quantile

#: A jump is this many times longer than nearly all other steps, and than its neighbours.
_FAR, _FAR_LOCAL = 3.0, 8.0


@dataclass(frozen=True, eq=False)
class Jumps:
    """Jumps of one position channel.

    Attributes:
        rows: first row after each jump, (m,).
        sizes: signed jump without the motion expected in that step [rad or m], (m,).
        slack: uncertainty of each size, from the scatter of the steps around it, (m,) [rad or m].
        resolution: smallest step of the channel, 0 if unknown [rad or m].
        glitch: the jump is one side of a single wrong value, (m,).
    """

    rows: np.ndarray
    sizes: np.ndarray
    slack: np.ndarray
    resolution: float
    glitch: np.ndarray


@once
def jumps(exam: Exam, channel: str, j: int) -> Jumps | None:
    """Return the jumps of a joint's position channel, None if there are none."""
    if not exam.usable(channel, j):
        return None
    largest = exam.survey(channel).step[j]
    steps = exam.changes(channel, j)
    # a fast joint in a slow log wraps so often that its longest steps are the wraps
    brisk, usual = (quantile(steps, share) for share in (0.9, 0.995))
    usual = min(usual, 4 * brisk) if brisk > 0 else usual
    resolution = exam.quantum(channel, j)
    far = max(_FAR * usual, 6 * resolution)
    if largest <= far or not usual > 0:
        return None
    x = exam.column(channel, j)
    change = np.diff(x)
    rows = np.flatnonzero(np.abs(change) > far) + 1
    rows = np.setdiff1d(rows, exam.gaps)
    # against its own surroundings: a fast stretch in a slow log is no jump
    before, after = rows[:, None] + np.array([-7, -6, -5, -4]), rows[:, None] + np.array([2, 3, 4, 5])
    ends = (
        before[:, :1] < 0,
        after[:, -1:] >= change.size,
    )  # where one side is beyond an end, more of the other counts
    before, after = np.where(ends[0], after + 4, before), np.where(ends[1], before - 4, after)
    around = np.clip(np.hstack([before, after]), 0, change.size - 1)
    local = np.median(change[around], axis=1)
    spread = np.median(np.abs(change[around]), axis=1)
    slack = np.ptp(change[around], axis=1) + 2 * resolution
    sizes = change[rows - 1] - local
    real = np.abs(sizes) > _FAR_LOCAL * np.maximum(spread, resolution)
    if not real.any():
        return None
    beside = change[np.clip(rows[:, None] + np.array([-2, 0]), 0, change.size - 1)] - local[:, None]
    back = (beside * sizes[:, None] < 0) & (np.abs(beside) > 0.5 * np.abs(sizes[:, None]))
    returns = np.asarray(np.any(back, axis=1))
    return Jumps(rows[real], sizes[real], slack[real], resolution, returns[real])
