"""Runs of equal samples that a working sensor cannot give while the joint moves."""

from __future__ import annotations

import numpy as np

from backdrive.logs.health._exam import Exam, once
from backdrive.logs.health._survey import RUN
from backdrive.logs.health._velocity_fit import velocity_fit
from backdrive.logs.resolution import white_noise

#: A run counts as frozen if by chance it occurs in fewer than one log in a million.
_CHANCE = 1e-6
#: The same for a smooth signal, which changes more slowly at its peaks.
_CHANCE_SMOOTH = 1e-9
#: At most this many of the longest runs are checked.
_MOST = 200
#: A velocity without a position must stand for so many samples.
_ALONE = 100
#: Drives differentiate at this period or a shorter one [s].
_TICK = 1e-3
#: A frozen velocity is wrong by this share of the top speed at least [1].
_WRONG = 0.05


@once
def standstill_runs(exam: Exam, channel: str, j: int) -> list[tuple[int, int]]:
    """Return stretches [start, stop) in which a channel stands still although the joint moves.

    A quantised channel always has equal neighbours, so a run counts only if it is impossible. Cases: a constant position with
    nonzero velocity; a constant velocity while the position leaves the straight line; noise that stops; a jump at the end of
    the run.
    """
    if not exam.usable(channel, j) or not exam.survey(channel).long_run[j]:
        return []
    survey = exam.survey(channel)
    if survey.low[j] == survey.high[j]:
        return []  # a dead channel is found by another check
    x = exam.column(channel, j)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(x)) + 1, [x.size]])
    lengths = np.diff(edges)
    long = np.flatnonzero(lengths >= RUN)
    if long.size > _MOST:
        long = np.sort(long[np.argsort(lengths[long])[-_MOST:]])
    decide = {"position": _position_froze, "second_encoder": _position_froze}.get(channel, _signal_froze)
    runs = [(int(edges[k]), int(edges[k + 1])) for k in long]
    return [(start, stop) for start, stop in runs if decide(exam, channel, j, x, start, stop)]


def _position_froze(exam: Exam, channel: str, j: int, x: np.ndarray, start: int, stop: int) -> bool:
    resolution = exam.quantum(channel, j)
    release = abs(x[stop] - x[stop - 1]) if stop < x.size else np.inf
    if _agree(exam, j):
        v, t = exam.column("velocity", j)[start:stop], exam.log.time[start:stop]
        moved = abs(np.sum(0.5 * (v[1:] + v[:-1]) * np.diff(t)))
        # a filtered velocity decays slowly after a stop, so it must be nonzero until the end
        late = abs(np.median(v[v.size // 2 :])) * (t[-1] - t[0])
        # a sum of noise is no motion, and neither is a velocity that never quite comes to zero
        wander = 6 * np.sqrt(v.size) * exam.period * white_noise(exam.sample("velocity", j))
        creep = max(0.1 * _top_speed(exam, j), 3 * exam.quantum("velocity", j)) * (t[-1] - t[0])
        least = max(5 * resolution, 4 * _noise(x, start, stop), wander, creep)
        return bool(min(moved, late) > least and release > 0.4 * moved)
    # without a velocity, the position must come back to where the motion before and after leads
    lead = _mean_step(x[max(0, start - 6) : start + 1]) + _mean_step(x[stop : stop + 7])
    led = 0.5 * (stop - start) * abs(lead)
    return max(6 * resolution, 8 * _noise(x, start, stop)) < release and 0.3 * led < release < 3 * led


def _signal_froze(exam: Exam, channel: str, j: int, x: np.ndarray, start: int, stop: int) -> bool:
    if not moves(exam, channel, j, start, stop):
        return False
    survey = exam.survey(channel)
    resolution = exam.quantum(channel, j)
    if channel in ("torque", "drive_input") and x[start] != 0 and x[start] in (survey.low[j], survey.high[j]):
        return False  # saturation
    release = abs(x[stop] - x[stop - 1]) if stop < x.size else 0.0
    around = np.concatenate([np.diff(x[max(0, start - 100) : start]), np.diff(x[stop : stop + 100])])
    if around.size >= 20:
        alive = around[around != 0]
        turns = np.mean(alive[1:] * alive[:-1] < 0) if alive.size > 10 else 0.0
        equal = max(np.count_nonzero(around == 0) / around.size, 0.02)
        # the chance that noise repeats a value this often in a log this long; noise of a step or less repeats by nature
        lively = np.std(around) > 2 * resolution
        rare = survey.equal[j] * x.size - (stop - start - 1) < 0.02 * x.size
        if resolution == 0 and rare and equal < 0.03:
            return True  # a signal that is not rounded never repeats itself
        chance = x.size * equal ** (stop - start - 1)
        if lively and turns > 0.15 and chance < _CHANCE:
            return True
        if channel == "velocity" and not exam.usable("position", j):
            return False  # a constant part cannot be distinguished from a frozen one
        # a smooth signal may have a level stretch, but comes out of it as it went in
        if (
            lively
            and chance < _CHANCE_SMOOTH
            and release > max(6 * resolution, 4 * np.median(np.abs(around)))
        ):
            return True
    if (
        x[start] == 0 and start > 0
    ):  # a value that is no longer sent becomes zero, a frozen one keeps its value
        release = max(release, abs(x[start] - x[start - 1]))
    return bool(release > max(6 * resolution, 4 * _noise(x, start, stop)))


def _agree(exam: Exam, j: int) -> bool:
    """Return whether position and velocity agree on the whole, so that one can be used to check the other."""
    fit = velocity_fit(exam, j)
    if fit is None or not abs(fit.scale - 1) < 0.15 or not fit.residual < 0.3:
        return False
    return abs(fit.delay) < max(6 * exam.period, 0.03)


def _mean_step(x: np.ndarray) -> float:
    return float((x[-1] - x[0]) / (x.size - 1)) if x.size > 1 else 0.0


def _top_speed(exam: Exam, j: int) -> float:
    return float(np.quantile(np.abs(exam.sample("velocity", j)), 0.99))


def _noise(x: np.ndarray, start: int, stop: int) -> float:
    """Return the largest step shortly before and after a run; infinity where there are none."""
    around = np.concatenate([np.diff(x[max(0, start - 12) : start]), np.diff(x[stop : stop + 12])])
    return float(np.abs(around).max()) if around.size else np.inf


def moves(exam: Exam, channel: str, j: int, start: int, stop: int) -> bool:
    """Return whether the joint moves through all of a run, as the other channels have it."""
    if exam.usable("position", j):
        q = exam.column("position", j)[start:stop]
        thirds = np.array_split(q, 3)
        # the last, for a joint that never moves
        least = max(2 * exam.quantum("position", j), 1e-4 * float(np.ptp(exam.sample("position", j))), 1e-12)
        if channel == "velocity":
            if not _agree(exam, j):
                return False
            # a constant velocity is no fault: the position must leave the straight line that it predicts
            t = exam.log.time[start:stop]
            left = np.abs(q - q[0] - exam.column("velocity", j)[start] * (t - t[0])).max()
            if np.abs(np.diff(q)).max() > 0.5 * left:
                return False  # it is the position that jumps
            own = exam.quantum("velocity", j) * (t[-1] - t[0])
            # a drive that differentiates a coarse encoder may repeat itself when its ticks and the counts fall in step
            step = exam.quantum("position", j) / min(exam.period, _TICK)
            slack = max(_WRONG * _top_speed(exam, j), 0.5 * step) * (t[-1] - t[0])
            # and the joint must move at all: some servos report one step of velocity at rest
            return bool(min(left, np.ptp(q)) > max(3 * own, slack))
        return all(np.ptp(part) >= least for part in thirds)
    if channel != "velocity" and exam.usable("velocity", j):
        v = np.abs(exam.column("velocity", j)[start:stop])
        return bool(np.quantile(v, 0.1) > 0.05 * _top_speed(exam, j))
    # no other channel shows motion; a controller with a coarse encoder may be constant at one speed for some time
    fast = channel == "velocity" and abs(exam.column(channel, j)[start]) > _WRONG * _top_speed(exam, j)
    return fast and stop - start >= _ALONE
