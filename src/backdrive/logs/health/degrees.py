"""Degrees in a channel declared as radians, or millimetres in one declared as metres."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Changes, Finding, Repair, check, columns_of, with_columns
from backdrive.logs.health._velocity_fit import velocity_fit

#: How far a ratio may be from the ratio of two units [1].
TOLERANCE = 0.12
#: A stroke above this suggests another unit [rad or m].
SPAN = 25.0
#: A top speed above this, of a joint that turns back, suggests it too, by unit [rad/s, m/s].
SPEED = {"rad": 50.0, "m": 20.0}
_DEGREE = 180 / np.pi
_TEN = 10  # samples over which a speed is taken


@check("degrees", "degrees where radians are claimed")
def find(exam: Exam) -> Iterator[Finding]:
    """Report a position and a velocity in different units, and strokes that no joint has."""
    for j, joint in exam:
        unit = exam.log.joints[j].unit
        factor, small, large = (_DEGREE, "rad", "degrees") if unit == "rad" else (1000.0, "m", "millimetres")
        channel = unlike(exam, j)
        if channel is not None:
            fit = velocity_fit(exam, j)
            assert fit is not None
            yield Finding(
                joint=joint,
                channel=channel,
                severity="spoils",
                sentence=(
                    f"{channel} of {joint} is in {large}: position changes {fit.scale:.4g} times as fast as its velocity "
                    f"channel, and {large} over {small} are {factor if channel == 'position' else 1 / factor:.4g}."
                ),
                remedy=f"State the unit (--unit, or --map with a factor), or use --repair: it turns {channel} into {small}.",
                value=factor,
                repairable=True,
            )
            continue
        wide, fast = _wide(exam, j), _fast(exam, j)
        if wide > SPAN:
            value, does, so = wide, f"goes to and fro over {wide:.4g} {unit}", "far"
        elif fast > SPEED[unit]:
            value, does, so = fast, f"moves at {fast:.4g} {unit}/s and turns back", "fast"
        else:
            continue
        yield Finding(
            joint=joint,
            channel="position",
            severity="warn",
            sentence=f"{joint} {does}: that looks like {large}.",
            remedy=f"If it is in {large}, state that with --unit or --map. If the joint really moves that {so}, no action is "
            f"needed.",
            value=value,
        )


def unlike(exam: Exam, j: int) -> str | None:
    """Return the channel that is in the larger unit when position and velocity differ by it."""
    fit = velocity_fit(exam, j)
    if fit is None or not fit.residual < 0.4:
        return None
    factor = _DEGREE if exam.log.joints[j].unit == "rad" else 1000.0
    for channel, ratio in (("position", factor), ("velocity", 1 / factor)):
        if abs(abs(fit.scale) / ratio - 1) < TOLERANCE:
            return channel
    return None


def _wide(exam: Exam, j: int) -> float:
    """Return the stroke of a joint that turns back, in the unit of its position; 0 if it does not."""
    if not exam.usable("position", j) or not _turns_back(exam, j):
        return 0.0
    survey = exam.survey("position")
    return float(survey.high[j] - survey.low[j])


def _fast(exam: Exam, j: int) -> float:
    """Return the top speed of a joint that turns back, in the unit of its position per second; 0 if it does not.

    It is taken over ten samples, so that steps of an encoder do not count.
    """
    unit = exam.log.joints[j].unit
    if not exam.usable("position", j) or not exam.survey("position").step[j] > SPEED[unit] * exam.period:
        return 0.0
    if not _turns_back(exam, j):
        return 0.0
    parts = exam.by_block("position", j)
    speeds = [np.abs(part[_TEN:] - part[:-_TEN]) for part in parts if part.size > _TEN]
    return float(np.quantile(np.concatenate(speeds), 0.99)) / (_TEN * exam.period) if speeds else 0.0


def _turns_back(exam: Exam, j: int) -> bool:
    """Return whether a joint moves to and fro; a spindle that turns on and on may count as many turns as it likes."""
    change = np.diff(exam.sample("position", j))
    forth, back = float(np.maximum(change, 0).sum()), float(np.maximum(-change, 0).sum())
    return min(forth, back) > 0.2 * max(forth, back)


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Turn the channel that is certainly in the larger unit into SI, with its reference and second encoder if position."""
    changes: Changes = {}
    notes: list[str] = []
    for finding, large, j, _ in columns_of(exam, findings):
        alike = ("position", "reference", "second_encoder") if large == "position" else (large,)
        span = np.ptp(exam.sample(large, j))
        for channel in alike:
            # a reference that was converted already has another span
            if channel in exam.log.channels and 0.2 * span < np.ptp(exam.sample(channel, j)) < 5 * span:
                changes[channel, j] = exam.column(channel, j) / finding.value
                notes.append(f"{channel} of {finding.joint} was divided by {finding.value:.6g}.")
    return Repair(with_columns(exam.log, changes, notes))
