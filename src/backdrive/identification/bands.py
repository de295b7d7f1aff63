"""Deviation of measured from predicted torque: bands by state of motion, and the noise of long means."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.identification.regression import long_run
from backdrive.identification.signals import Signals, turns
from backdrive.logs.quantiles import quantile
from backdrive.model import Band, Bands

Part = tuple[Signals, np.ndarray, np.ndarray, bool]  # as `evidence` takes it

SHARE = 0.95  # share of the samples within a band [-]
REVERSAL = 0.05  # length of a reversal on each side of the velocity's change of sign [s]
LEAST = 20  # least number of samples for a band


def bands_of(parts: Sequence[Part]) -> Bands:
    """Return the bands, from held-out samples if there are any.

    Args:
        parts: signals, measured friction, predicted torque [N.m or N] and whether they were fitted.
    """
    judged = [part for part in parts if not part[3]] or parts
    error = np.concatenate([np.abs(s.torque - predicted) for s, _, predicted, _ in judged])
    state = np.concatenate([states(s) for s, *_ in judged])
    bands: dict[str, Band] = {}
    known = np.isfinite(error)
    if not known.all():
        error, state = error[known], state[known]
    for i, name in enumerate(("moving", "reversing", "rest")):
        errors = error[state == i]
        if errors.size >= LEAST:
            bands[name] = Band(half_width=quantile(errors, SHARE), samples=errors.size)
    return Bands(**bands)


def states(
    s: Signals, before: float = REVERSAL, after: float = REVERSAL, creep: float | None = None
) -> np.ndarray:
    """Return the state of every sample, 0 moving, 1 reversing, 2 at rest, (n,).

    Args:
        s: motion.
        before: length of a reversal before the velocity changes sign [s].
        after: length of a reversal after the velocity changes sign [s].
        creep: speed below which starts, stops and slow motion count as reversing [rad/s or m/s]; None: they count as moving.
    """
    middle = turns(s.velocity)
    if creep is not None:
        slow = (np.diff(s.moving) != 0) | (np.abs(s.velocity[1:]) < creep)
        middle = np.union1d(middle, np.flatnonzero(slow))
    edges = np.zeros(s.velocity.size + 1, dtype=np.int32)
    np.add.at(edges, np.maximum(middle + 1 - round(before * s.rate), 0), 1)
    np.add.at(edges, np.minimum(middle + 1 + round(after * s.rate), s.velocity.size), -1)
    reversing = np.cumsum(edges, dtype=np.int32)[:-1] > 0
    return np.where(s.moving, reversing.view(np.int8), np.int8(2))


def long_run_of(parts: Sequence[Part]) -> float | None:
    """Return the standard deviation of the residual's mean over one second [N.m or N]; None without motion.

    Args:
        parts: as in `bands_of`.
    """
    total, duration = 0.0, 0.0
    for s, _, predicted, _ in parts:
        left = (s.torque - predicted)[s.moving]
        left = left[np.isfinite(left)]
        if left.size >= LEAST:
            total += float(long_run(left[None])[0, 0]) / s.rate**2
            duration += left.size / s.rate
    return float(np.sqrt(total / duration)) if duration > 0.0 else None
