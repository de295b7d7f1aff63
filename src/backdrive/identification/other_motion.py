"""Motion of all joints of some logs, which may affect the torque of each: low-passed once, and taken at any joint's means."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from backdrive.identification.residual import Residual
from backdrive.logs import filters
from backdrive.logs.log import Joint, Log

CUTOFF = 10.0  # cutoff frequency of the low pass on the motion of other joints [Hz]
KEPT = 20.0  # least rate of what is kept, between which is interpolated [cutoff frequency]


class OtherMotion:
    """Low-passed motion of the joints of logs, computed when it is first asked for and kept for the next joint."""

    def __init__(self, logs: Sequence[Log]):
        """Remember the logs, which have the same joints."""
        self._logs = logs
        self._kept: dict[tuple[int, int], np.ndarray] = {}

    def beside(self, res: Residual, joint: str) -> Iterator[tuple[Joint, np.ndarray]]:
        """Yield each joint but one that moves, with position, velocity and acceleration at the means of a residual, (3, n)."""
        joints = self._logs[0].joints if self._logs else ()
        places: list[tuple[slice, int, np.ndarray, np.ndarray]] | None = None
        for column, about in enumerate(joints):
            if about.name == joint:
                continue
            if places is None:
                places = [(rows, k, *self._between(res.time[rows], k)) for rows, k in _spans(res, self._logs)]
            series = np.full((3, res.time.size), np.nan)
            for rows, k, at, share in places:
                motion = self._of(k, column)
                before = motion.take(at, axis=1)
                series[:, rows] = before + share * (motion.take(at + 1, axis=1) - before)
            if np.isfinite(series).all() and np.any(series[1]):
                yield about, series

    def _of(self, k: int, column: int) -> np.ndarray:
        """Return the kept position, velocity and acceleration of a joint in a log, (3, m)."""
        if (k, column) not in self._kept:
            motion = _motion(self._logs[k], column)
            self._kept[k, column] = motion[:, :: _every(self._logs[k])].copy()
        return self._kept[k, column]

    def _between(self, time: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the last kept sample of a log before each instant, and how far the instant is on the way to the next [-]."""
        kept = self._logs[k].time[:: _every(self._logs[k])]
        at = np.clip(np.searchsorted(kept, time, side="right") - 1, 0, kept.size - 2)
        return at, (time - kept[at]) / np.maximum(kept[at + 1] - kept[at], 1e-300)


def _every(log: Log) -> int:
    """Return the distance of the samples that are kept."""
    return max(1, int(1.0 / (log.period * KEPT * CUTOFF)))


def _spans(res: Residual, logs: Sequence[Log]) -> list[tuple[slice, int]]:
    """Return slices of the means with the indices of their logs; stretches are in the logs' order, each on its log's clock."""
    edges = np.flatnonzero(np.diff(res.part, prepend=-1, append=-1)).tolist()
    spans, at, last = [], 0, -np.inf
    for a, b in pairwise(edges):
        begin, end = float(res.time[a]), float(res.time[b - 1])
        at += begin <= last
        while at < len(logs) and not logs[at].time[0] <= begin <= end <= logs[at].time[-1]:
            at += 1
        if at < len(logs):
            spans.append((slice(a, b), at))
        last = end
    return spans


def _motion(log: Log, column: int) -> np.ndarray:
    """Return low-passed position, velocity and acceleration of a joint, (3, n); without a position, it is zero."""
    channel = log.position if log.position is not None else log.need("velocity")
    rate = 1.0 / log.period
    slow = filters.low_pass(channel[:, column], min(CUTOFF, 0.1 * rate), rate)
    if log.position is None:
        return np.stack([np.zeros_like(slow), slow, filters.derivative(slow, log.period)])
    velocity = filters.derivative(slow, log.period)
    return np.stack([slow, velocity, filters.derivative(velocity, log.period)])
