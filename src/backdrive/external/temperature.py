"""The temperature along a log for a law that depends on it: from the log's channel, or a default."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.identification.signals import Signals
from backdrive.laws import REFERENCE
from backdrive.model import JointFriction


def along_stretches(
    friction: JointFriction, stretches: Sequence[Signals], remarks: list[str]
) -> list[np.ndarray | None]:
    """Return the temperature of every stretch [degC], (n,); None for a law that does not depend on it.

    Holes in the channel are interpolated. Without a channel it is the middle of the model's temperature range, or 20 degC.

    Args:
        friction: of a model.
        stretches: of the log.
        remarks: list to which a sentence is added if a temperature is assumed, or leaves the model's range.
    """
    if "temperature" not in friction.law.rate.NEEDS:
        return [None] * len(stretches)
    name, covered = friction.joint.name, friction.validity.temperature
    usual = REFERENCE if covered is None else 0.5 * (covered[0] + covered[1])
    series, without = [], 0
    for s in stretches:
        warmth = np.full(s.time.size, np.nan) if s.temperature is None else s.temperature
        known = np.isfinite(warmth)
        if known.any():
            series.append(np.interp(s.time, s.time[known], warmth[known]))
        else:
            without += s.time.size
            series.append(np.full(s.time.size, usual))
    if without:
        source = (
            "although the temperature of the identification is unknown"
            if covered is None
            else "at which it was identified"
        )
        remarks.append(
            f"Joint '{name}': its friction depends on the temperature, and the log holds none: {usual:.3g} degC is assumed, "
            f"{source}. Map it (--map temp=COLUMN)."
        )
    every = np.concatenate(series)
    if covered is not None and (every.min() < covered[0] or every.max() > covered[1]):
        remarks.append(
            f"Joint '{name}': the log's temperature goes from {every.min():.3g} to {every.max():.3g} degC, the model's from "
            f"{covered[0]:.3g} to {covered[1]:.3g} degC; beyond it extrapolates."
        )
    return series
