"""A torque that is flat at its extreme: the drive or the sensor is at its limit."""

from __future__ import annotations

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check
from backdrive.logs.health._runs import moves

CHANNELS = ("torque", "drive_input")
#: Fewest samples at the limit; fewest in a row; how many times more than just below it.
_COUNT, _ROW, _MORE = 10, 5, 4.0
#: Or: this many in a row at the limit, where neighbours differ by this many steps of the channel.
_LONG_ROW, _LIVELY = 8, 1.5
#: What counts as just below: this share of the range, or this many steps.
_BAND, _STEPS = 0.02, 3.5


@check("saturation", "a torque that is flat at its extreme")
def find(exam: Exam) -> list[Finding]:
    """Report limits that are reached often, in a row, and far more often than the values just below them."""
    sides = [_side(exam, *column, side) for column in exam.columns(*CHANNELS) for side in (1.0, -1.0)]
    return [finding for finding in sides if finding is not None]


def _side(exam: Exam, channel: str, j: int, joint: str, side: float) -> Finding | None:
    survey = exam.survey(channel)
    span = float(survey.high[j] - survey.low[j])
    if not span > 0 or not survey.equal[j] > 0:
        return None
    limit = float(survey.high[j] if side > 0 else survey.low[j])
    x = exam.column(channel, j)
    at = x == limit
    count = int(np.count_nonzero(at))
    if count < _COUNT or limit == 0:
        return None
    lively = np.std(np.diff(exam.sample(channel, j))) > _LIVELY * exam.quantum(channel, j)
    start, stop = _longest(at)
    # a noisy value is never constant; that of a joint at rest may be
    if lively and stop - start >= _LONG_ROW and moves(exam, channel, j, start, stop):
        return _finding(exam, channel, j, joint, side, limit, at)
    inner = limit - side * max(_BAND * span, _STEPS * exam.quantum(channel, j))
    below = int(np.count_nonzero((x > inner) if side > 0 else (x < inner))) - count
    if count < _MORE * below or stop - start < _ROW:
        return None
    return _finding(exam, channel, j, joint, side, limit, at)


def _finding(
    exam: Exam, channel: str, j: int, joint: str, side: float, limit: float, at: np.ndarray
) -> Finding:
    unit = exam.log.joints[j].torque_unit if channel == "torque" else "of the drive input's unit"
    return Finding(
        joint=joint,
        channel=channel,
        severity="warn",
        sentence=(
            f"{channel} of {joint} is flat at its {'upper' if side > 0 else 'lower'} end, {limit:.4g} {unit}, for "
            f"{np.count_nonzero(at)} samples."
        ),
        remedy="If the motor is at its limit, the values are true. If the sensor is at its limit, they are wrong: move slower, "
        "or leave those samples out.",
        value=limit,
        where=np.flatnonzero(at),
    )


def _longest(at: np.ndarray) -> tuple[int, int]:
    """Return the longest run [start, stop) of a mask that holds somewhere."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    k = int(np.argmax(stops - starts))
    return int(starts[k]), int(stops[k])
