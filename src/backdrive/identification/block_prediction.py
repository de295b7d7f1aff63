"""The torque that a fit to a log's other blocks predicts for each block."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from backdrive.identification import design, regression
from backdrive.identification.delay import earlier
from backdrive.identification.motion_bins import CHUNK, bin_size
from backdrive.identification.signals import Signals

TAPS = 3  # samples to either side by which a delayed one is interpolated, and one more


def predict_blocks(
    stretches: Sequence[Signals], choice: design.Choice, delay: float, seconds: float
) -> list[np.ndarray]:
    """Return the torque of each stretch [N.m or N], (n,), with every block predicted by the fit without it.

    Args:
        stretches: of one joint.
        choice: the fit, with its coefficients without each block.
        delay: of the torque behind the motion [s].
        seconds: of the bins [s].
    """
    count = len(choice.left_out)
    block = regression.block_index(sum(bin_size(s, seconds)[1] for s in stretches), count)
    first, predicted = 0, []
    for s in stretches:
        width, bins = bin_size(s, seconds)
        of_bin = block[first : first + bins] if bins else np.zeros(1, dtype=int)
        first += bins
        of_sample = np.repeat(of_bin, width)[: s.time.size]
        of_sample = np.append(of_sample, np.full(s.time.size - of_sample.size, of_bin[-1]))
        edges = [0, *(np.flatnonzero(np.diff(of_sample)) + 1).tolist(), s.time.size]
        blocks = [slice(a, b) for a, b in pairwise(edges)]
        groups = blocks if s.time.size > CHUNK else [slice(0, s.time.size)]  # long ones fill the memory
        torques = [
            design.predict(choice.candidate, choice.left_out, _delay_rows(s, rows, delay), of_sample[rows])
            for rows in groups
        ]
        predicted.append(np.concatenate(torques) if len(torques) > 1 else torques[0])
    return predicted


def _delay_rows(s: Signals, rows: slice, delay: float) -> Signals:
    """Return the signals of some samples with motion delayed by a time [s]."""
    part, beside = s.rows(rows), math.ceil(abs(delay) * s.rate) + TAPS
    if not delay:
        return part
    begin, end = max(rows.start - beside, 0), min(rows.stop + beside, s.time.size)
    motion = {name: getattr(s, name) for name in ("velocity", "acceleration", "position")}
    late = {
        name: earlier(x[begin:end], delay * s.rate)[rows.start - begin : rows.stop - begin]
        for name, x in motion.items()
        if x is not None
    }
    return replace(part, **late)
