"""A position that jumps and stays there: a slipped encoder, a new zero, another file's continuation."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check, count_of
from backdrive.logs.health._jumps import jumps
from backdrive.logs.health.encoder_wrap import CHANNELS, wraps


@check("position-jump", "a position that jumps and stays there")
def find(exam: Exam) -> Iterator[Finding]:
    """Report jumps that are neither a wrap nor a single wrong sample."""
    for channel, j, joint in exam.columns(*CHANNELS):
        found = jumps(exam, channel, j)
        if found is None:
            continue
        stays = ~found.glitch & ~np.isin(found.rows, wraps(exam, channel, j)[1])
        stays &= (found.rows > 1) & (found.rows < len(exam.log) - 1)
        if not stays.any():
            continue
        rows, sizes = found.rows[stays], found.sizes[stays]
        size = float(sizes[np.argmax(np.abs(sizes))])
        yield Finding(
            joint=joint,
            channel=channel,
            severity="spoils",
            sentence=(
                f"{channel} of {joint} jumps {count_of(rows.size, 'time')}, by up to {size:.4g} {exam.log.joints[j].unit}, "
                f"first at sample {rows[0]}: no joint moves so fast."
            ),
            remedy="Cut the log there and use the pieces as separate logs.",
            value=abs(size),
            where=rows,
        )
