"""Motion of all joints of some logs, which may affect the torque of each: low-passed once, and taken at any joint's means."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from backdrive.identification.clock import EVEN, between_gaps, uniform
from backdrive.identification.residual import Residual
from backdrive.identification.signals import SHORTEST
from backdrive.logs import filters
from backdrive.logs.log import Joint, Log

CUTOFF = 10.0  # cutoff frequency of the low pass on the motion of other joints [Hz]
KEPT = 20.0  # least rate of what is kept, between which is interpolated [cutoff frequency]


@dataclass(frozen=True, kw_only=True, eq=False)
class Instants:
    """Instants of a log that are kept, in stretches without a gap.

    Attributes:
        time: [s], ascending, (m,).
        first: number of the first one of each stretch, and at last m, (s + 1,).
        end: end of each stretch, of which the last samples need not be kept [s], (s,).
    """

    time: np.ndarray
    first: np.ndarray
    end: np.ndarray

    def between(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the last kept instant before each of some, and how far each is on the way to the next [-]; NaN in a gap.

        Args:
            time: [s], (n,).
        """
        at = np.searchsorted(self.time, time, side="right") - 1
        stretch = np.searchsorted(self.first[1:-1], at, side="right")
        begin = self.first[stretch]
        at = np.clip(at, begin, self.first[stretch + 1] - 2)
        share = (time - self.time[at]) / np.maximum(self.time[at + 1] - self.time[at], 1e-300)
        return at, np.where((time >= self.time[begin]) & (time <= self.end[stretch]), share, np.nan)


class OtherMotion:
    """Low-passed motion of the joints of logs, computed when it is first asked for and kept for the next joint."""

    def __init__(self, logs: Sequence[Log]):
        """Remember the logs, which have the same joints."""
        self._logs = logs
        self._kept: dict[tuple[int, int], tuple[Instants, np.ndarray]] = {}
        self._clock: dict[int, Instants] = {}

    def beside(self, res: Residual, joint: str) -> Iterator[tuple[Joint, Residual, np.ndarray]]:
        """Yield each joint but one that moves, the means of a residual where its motion is known, and this motion.

        The motion is position, velocity and acceleration at these means, (3, n). It is unknown in held-out logs, in gaps, and
        where the other joint has no finite sample.
        """
        spans = _spans(res, len(self._logs))
        places: dict[int, tuple[Instants, np.ndarray, np.ndarray]] = {}
        mask, means = np.ones(res.time.size, dtype=bool), res
        for column, about in enumerate(self._logs[0].joints if self._logs else ()):
            if about.name == joint:
                continue
            series = np.full((3, res.time.size), np.nan)
            for rows, k in spans:
                kept, motion = self._of(k, column)
                if not kept.end.size:
                    continue
                if rows.start not in places or places[rows.start][0] is not kept:
                    places[rows.start] = kept, *kept.between(res.time[rows])
                _, at, share = places[rows.start]
                before = motion.take(at, axis=1)
                series[:, rows] = before + share * (motion.take(at + 1, axis=1) - before)
            known = np.isfinite(series.sum(axis=0))
            if not np.array_equal(known, mask):
                mask, means = known, res if known.all() else res.where(known)
            series = series if means is res else series[:, known]
            if np.any(series[1]):
                yield about, means, series

    def _of(self, k: int, column: int) -> tuple[Instants, np.ndarray]:
        """Return the kept instants of a joint in a log, the same ones where they are alike, and its motion there, (3, m)."""
        if (k, column) not in self._kept:
            kept, motion = _motion(self._logs[k], column)
            last = self._clock.setdefault(k, kept)
            alike = np.array_equal(kept.time, last.time) and np.array_equal(kept.first, last.first)
            self._kept[k, column] = last if alike else kept, motion
        return self._kept[k, column]


def _spans(res: Residual, count: int) -> list[tuple[slice, int]]:
    """Return slices of the means with the number of their log, of as many logs as `count`; those of no such log are left out."""
    edges = np.flatnonzero(np.diff(res.part, prepend=-1, append=-1)).tolist()
    spans = [(slice(a, b), res.log_of[res.part[a]]) for a, b in pairwise(edges)]
    return [(rows, k) for rows, k in spans if 0 <= k < count]


def _motion(log: Log, column: int) -> tuple[Instants, np.ndarray]:
    """Return the kept instants of a joint, and low-passed position, velocity and acceleration there, (3, m).

    Without a position, it is zero.
    """
    measured = log.position if log.position is not None else log.need("velocity")
    time, channel = log.time, measured[:, column]
    if not (good := np.isfinite(channel) & np.isfinite(time)).all():
        time, channel = time[good], channel[good]
    every = max(1, int(1.0 / (log.period * KEPT * CUTOFF)))
    times, series, ends = [np.zeros(0)], [np.zeros((3, 0))], list[float]()
    for rows in between_gaps(time, log.period, max(SHORTEST, 2 * every)):
        clock, motion = _stretch(log, column, time[rows], channel[rows])
        times.append(clock[::every])
        series.append(motion[:, ::every])
        ends.append(float(clock[-1]) + 0.5 * log.period)
    first = np.cumsum([x.size for x in times])
    return Instants(time=np.concatenate(times), first=first, end=np.array(ends)), np.concatenate(
        series, axis=1
    )


def _stretch(log: Log, column: int, time: np.ndarray, channel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return an even clock, (n,), and low-passed position, velocity and acceleration there, (3, n), between two gaps."""
    period, name = log.period, "velocity" if log.position is None else "position"
    given: dict[str, Any] = {name: channel}
    clock, one = uniform(Log(time=time, joints=log.joints[column : column + 1], **given), period)
    mean = float(clock[-1] - clock[0]) / (clock.size - 1)
    period = mean if abs(mean - period) > EVEN * period else period
    rate = 1.0 / period
    slow = filters.low_pass(one.need(name)[:, 0], min(CUTOFF, 0.1 * rate), rate)
    if log.position is None:
        return clock, np.stack([np.zeros_like(slow), slow, filters.derivative(slow, period)])
    velocity = filters.derivative(slow, period)
    return clock, np.stack([slow, velocity, filters.derivative(velocity, period)])
