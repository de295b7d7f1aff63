"""The torque that a fit to a log's other blocks predicts for each block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from backdrive.identification import design, regression
from backdrive.identification.delay import earlier
from backdrive.identification.motion_bins import CHUNK, bin_size
from backdrive.identification.signals import Signals


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
        at_once = len(blocks) if s.time.size <= CHUNK else 1  # long stretches fill the memory
        groups = [blocks[k : k + at_once] for k in range(0, len(blocks), at_once)]
        torques = [
            design.predict(
                choice.candidate, choice.left_out, _delay_blocks(s, group, delay), of_sample[_span(group)]
            )
            for group in groups
        ]
        predicted.append(np.concatenate(torques) if len(torques) > 1 else torques[0])
    return predicted


def _span(blocks: Sequence[slice]) -> slice:
    """Return the slice of neighbouring blocks together."""
    return slice(blocks[0].start, blocks[-1].stop)


def _delay_blocks(s: Signals, blocks: Sequence[slice], delay: float) -> Signals:
    """Return the signals of neighbouring blocks with motion delayed by a time [s], each block by itself."""
    part = s.rows(_span(blocks))
    if not delay:
        return part
    motion = {name: getattr(s, name) for name in ("velocity", "acceleration", "position")}
    late = {
        name: np.concatenate([earlier(x[block], delay * s.rate) for block in blocks])
        for name, x in motion.items()
        if x is not None
    }
    return replace(part, **late)
