"""The windows of a sweep's cycles in a log: from its plan, or detected in the motion.

A sweep has cycles of one stroke whose peak speeds grow by equal steps (Iwatani 2017, (2.2)-(2.4)). The turning points of the
position give the strokes. Consecutive equal strokes, of sine shape and growing speed, give the cycles. Motion before, after or
between them (lead-in, dwell, noise) does not matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.identification.signals import Signals, prepare
from backdrive.logs import filters
from backdrive.logs.log import Log

TRIED = (0.5, 0.25, 0.12, 0.06, 0.03)  # tried least strokes, relative to the whole travel [-]
EQUAL = 0.1  # largest relative difference of the strokes of one sweep [-]
# limits of the time above 0.8 of the peak speed, relative to a sine of the same stroke and peak speed [-]
SINE = (0.7, 1.3)
GROWTH = 0.12  # largest deviation of a peak speed from the line through all, relative to the step [-]
LEAST_STEP = 0.01  # least growth of the peak speed from cycle to cycle, relative to the highest one [-]
NEARLY = 1.2  # difference of two strokes of means, relative to that of two of a sweep [-]
SMOOTH = 25.0  # largest cutoff frequency of the low pass for the detection of cycles [Hz]
FOLLOWS = 0.15  # largest RMS deviation of a motion from its plan, relative to stroke or top speed [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class Windows:
    """The cycles of a sweep.

    Attributes:
        time: first and last instant of each cycle [s], (N, 2).
        peak: peak speed of each cycle: n V / N if the plan is known, or else measured [rad/s or m/s], (N,).
        from_plan: whether the windows come from the plan.
        warnings: in sentences.
    """

    time: np.ndarray
    peak: np.ndarray
    from_plan: bool
    warnings: tuple[str, ...] = ()


def windows(log: Log, joint: str | int, plan: Any, stretches: Sequence[Signals]) -> Windows:
    """Return the cycles of a sweep.

    Args:
        log: of the sweep.
        joint: name or column.
        plan: the log's `plans.Sweep`, or a `plans.InTurn` with it; otherwise the cycles are detected in the motion.
        stretches: the log's signals, from `prepare`.

    Raises:
        NotIdentifiable: no cycles are detected.
    """
    said: tuple[str, ...] = ()
    begin = getattr(plan, "start", 0.0)
    if plan is not None and plan.kind == "in-turn":
        name = log.names[log.column(joint)]
        plan = next((p for p in plan.plans if p.joint == name), None)
    if plan is not None and plan.kind == "sweep":
        for start in (0.0, float(log.time[0]) - begin):
            if _follows(plan, stretches, start):
                return Windows(time=plan.windows() + start, peak=plan.speeds, from_plan=True)
        said = (
            f"Joint '{joint}' did not follow the plan that the log is linked to: the cycles were found in its motion instead.",
        )
    time, peak = _find(stretches, joint)
    return Windows(time=time, peak=peak, from_plan=False, warnings=said)


def find_windows(log: Log, joint: str | int, least: int = 2) -> np.ndarray:
    """Detect the cycles of a sweep in a log.

    Args:
        log: with torque, and position or velocity.
        joint: name or column.
        least: number of cycles that there must be.

    Returns:
        First and last instant of each cycle [s], in order of growing speed, (N, 2).

    Raises:
        NotIdentifiable: the joint does not move in so many cycles of equal stroke and growing speed.
        InvalidInput: the log holds no torque.
    """
    return _find(prepare(log, joint), joint, least)[0]


def _follows(plan: Any, stretches: Sequence[Signals], start: float) -> bool:
    position = stretches[0].position is not None
    wanted, size = (plan.position, abs(plan.stroke)) if position else (plan.velocity, abs(plan.top_speed))
    off = [wanted(s.time - start) - (s.position if position else s.velocity) for s in stretches]
    return bool(np.sqrt(np.mean(np.concatenate(off) ** 2)) < FOLLOWS * size)


def _find(stretches: Sequence[Signals], joint: str | int, least: int = 2) -> tuple[np.ndarray, np.ndarray]:
    best: tuple[np.ndarray, np.ndarray] = (np.zeros((0, 2)), np.zeros(0))
    for s in stretches:
        x = s.position if s.position is not None else np.cumsum(s.velocity) / s.rate
        cutoff = min(SMOOTH, 0.05 * s.rate)
        if not _may_sweep(x, cutoff, s.rate, 2 * max(least, len(best[1]) + 1)):
            continue
        x = filters.low_pass(x, cutoff, s.rate)
        travel = float(np.ptp(x))
        if travel <= 0:
            continue
        turns, speed = extremes(x), None
        for share in TRIED:
            turn = turning_points(x, share * travel, turns)
            if not _equal_strokes(x[turn], 2 * max(least, len(best[1]) + 1)):
                continue
            speed = np.abs(filters.derivative(x, 1.0 / s.rate)) if speed is None else speed
            found = _cycles(s.time, x, speed, turn)
            if len(found[1]) > len(best[1]):
                best = found
    if len(best[1]) < least:
        raise NotIdentifiable(
            f"Joint '{joint}' does not move in cycles of equal stroke and growing speed.",
            remedy="Record it along `backdrive plan sweep`, link the plan, or use --method motion.",
        )
    return best


def _may_sweep(x: np.ndarray, cutoff: float, rate: float, number: int) -> bool:
    """Return whether so many strokes in a row of a position (n,) may be equal, by its low-passed means."""
    x, _ = filters.low_pass_means(x, cutoff, rate)
    turns, travel = extremes(x), float(np.ptp(x))
    every = (x[turning_points(x, share * travel, turns)] for share in TRIED)
    return any(_equal_strokes(turn, number, NEARLY * EQUAL) for turn in every)


def extremes(x: np.ndarray) -> np.ndarray:
    """Return the samples at which a signal changes its direction, with the first and the last moving sample, (k,)."""
    change = np.diff(x)
    if change.size and np.all(change):
        rises = change > 0
        return np.concatenate([[0], np.flatnonzero(rises[1:] != rises[:-1]) + 1, [change.size]])
    step = np.sign(change)
    moving = np.flatnonzero(step)
    if not moving.size:
        return np.zeros(0, dtype=int)
    turns = moving[1:][step[moving[1:]] != step[moving[:-1]]]
    return np.concatenate([[moving[0]], turns, [moving[-1] + 1]])


def turning_points(x: np.ndarray, least: float, candidates: np.ndarray | None = None) -> np.ndarray:
    """Return the turning points of a signal between strokes of at least `least`, with the first and the last point.

    Args:
        x: the signal, (n,).
        least: smallest stroke that counts [unit of x].
        candidates: extremes of the signal, if they are known, (k,).
    """
    candidates = extremes(x) if candidates is None else candidates
    if not candidates.size:
        return candidates
    values = x[candidates].tolist()
    points, low, high, direction = [], 0, 0, 0
    for i, value in enumerate(values):
        if value < values[low]:
            low = i
        if value > values[high]:
            high = i
        if direction >= 0 and value < values[high] - least:
            points.append(high)
            direction, low = -1, i
        elif direction <= 0 and value > values[low] + least:
            points.append(low)
            direction, high = 1, i
    if direction != 0:
        points.append(high if direction > 0 else low)
    return candidates[np.array(points, dtype=int)]


def _equal_strokes(turn: np.ndarray, number: int, equal: float = 1.01 * EQUAL) -> bool:
    """Return whether so many strokes in a row between turning points (k,) may be equal; without them there are no cycles."""
    stroke = np.abs(np.diff(turn))
    runs = stroke.size - number + 1
    if runs < 1:
        return False
    first, alike = stroke[:runs], np.ones(runs, dtype=bool)
    for k in range(1, number):
        alike &= np.abs(stroke[k : k + runs] - first) < equal * first
        if not alike.any():
            return False
    return True


def _cycles(
    time: np.ndarray, x: np.ndarray, speed: np.ndarray, turn: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return windows and peak speeds of the longest run of cycles between turning points."""
    stroke = np.abs(np.diff(x[turn]))
    period = float(time[1] - time[0])
    peak, sine = np.zeros(stroke.size), np.zeros(stroke.size, dtype=bool)
    if stroke.size:
        inside, first = speed[turn[0] : turn[-1]], turn[:-1] - turn[0]
        peak = np.maximum.reduceat(inside, first)
        high = inside >= np.repeat(0.8 * peak, np.diff(turn))
        above = np.add.reduceat(high, first, dtype=float) * period
        share = above * peak / np.maximum(np.arccos(0.8) * stroke, 1e-300)
        sine = (SINE[0] < share) & (share < SINE[1])
    best: tuple[np.ndarray, np.ndarray] = (np.zeros((0, 2)), np.zeros(0))
    strokes, pair = stroke.tolist(), _alike(peak) & sine[:-1] & sine[1:] if stroke.size else sine
    for first in range(stroke.size):
        pairs: list[int] = []
        for i in range(first, stroke.size - 1, 2):
            if not (pair[i] and all(abs(x / strokes[first] - 1.0) < EQUAL for x in strokes[i : i + 2])):
                break
            pairs.append(i)
            level = 0.5 * (peak[pairs] + peak[np.array(pairs) + 1])
            if not _grows(level):
                pairs.pop()
                break
        if len(pairs) > len(best[1]):
            start = np.array(pairs)
            edges = np.stack([time[turn[start]], time[turn[start + 2]]], axis=1)
            best = edges, 0.5 * (peak[start] + peak[start + 1])
    return best


def _alike(peak: np.ndarray) -> np.ndarray:
    """Return whether each peak speed nearly equals the next one, (k - 1,)."""
    return np.abs(peak[:-1] / np.maximum(peak[1:], 1e-300) - 1.0) < EQUAL


def _grows(level: np.ndarray) -> bool:
    """Return whether speeds grow by equal steps, from a first speed that is a whole number of steps."""
    if level.size == 1:
        return True
    step = (level[-1] - level[0]) / (level.size - 1)
    if step < LEAST_STEP * level[-1]:
        return False
    n = np.maximum(1.0, np.round(level[0] / step)) + np.arange(level.size)
    off = np.abs(level / step - n * np.mean(level / step / n))
    return bool(np.all(off < np.minimum(GROWTH * np.maximum(1.0, 0.2 * n), 0.4)))
