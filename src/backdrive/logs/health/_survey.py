"""One pass over a channel: a few numbers per joint that decide whether detailed checks are needed.

A healthy log is read once per channel, in pieces that fit the processor's cache. Only joints with a suspicious number are
checked sample by sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Numbers a piece, whose seven copies then fit a second-level cache; and the fewest rows.
_PIECE, _ROWS = 1 << 15, 1 << 10
#: A run of this many equal samples is checked in detail.
RUN = 20


@dataclass(frozen=True, eq=False)
class Survey:
    """Per-joint figures of one channel, each (J,), in the channel's unit.

    Attributes:
        finite: no NaN, no infinity.
        low: smallest value.
        high: largest value.
        step: largest difference between neighbours.
        equal: share of neighbours that are equal [1].
        long_run: there are at least `RUN` equal samples in a row.
        spike: largest excess of a sample over both its neighbours.
    """

    finite: np.ndarray
    low: np.ndarray
    high: np.ndarray
    step: np.ndarray
    equal: np.ndarray
    long_run: np.ndarray
    spike: np.ndarray


def survey(array: np.ndarray) -> Survey:
    """Return the survey of a channel (n, J); n may be 0."""
    n, joints = array.shape
    finite, long_run = np.ones(joints, bool), np.zeros(joints, bool)
    low, high = np.full(joints, np.inf), np.full(joints, -np.inf)
    step, spike, equal = np.zeros(joints), np.zeros(joints), np.zeros(joints)
    rows = max(_PIECE // max(joints, 1), _ROWS)
    for start in range(0, n, rows):
        piece = np.ascontiguousarray(array[start : start + rows + RUN].T)  # a row a joint: long rows are fast
        finite &= np.isfinite(piece).all(axis=1)
        np.fmin(low, np.fmin.reduce(piece, axis=1), out=low)
        np.fmax(high, np.fmax.reduce(piece, axis=1), out=high)
        change = piece[:, 1:] - piece[:, :-1]
        if not change.size:
            continue
        if not change.any():  # a level channel
            equal += min(change.shape[1], rows)
            long_run |= change.shape[1] >= RUN - 1
            continue
        same = change == 0
        equal += np.count_nonzero(same[:, :rows], axis=1)
        if same.any():
            count = np.cumsum(same, axis=1, dtype=np.int32)
            window = count[:, RUN - 2 :].copy()
            window[:, 1:] -= count[:, : -(RUN - 1)]
            long_run |= (window == RUN - 1).any(axis=1)
        out = excess(change.T).T
        np.fmax(step, np.fmax.reduce(np.abs(change), axis=1), out=step)
        if out.size:
            np.fmax(spike, np.fmax.reduce(out, axis=1), out=spike)
    return Survey(finite, low, high, step, equal / max(n - 1, 1), long_run, spike)


def excess(change: np.ndarray) -> np.ndarray:
    """Return by how much each sample exceeds both its neighbours, up or down, (n - 2, ...); 0 where it does not.

    Args:
        change: from sample to sample, (n - 1, ...).
    """
    into, away = change[:-1], -change[1:]
    return np.maximum(np.maximum(np.minimum(into, away), -np.maximum(into, away)), 0.0)
