"""Whether a law of the velocity alone holds through reversals, and the stretches without them where it does not.

About a reversal a joint sticks, bends what is elastic in it, and breaks away. A law that knows the velocity alone has none of
it: fitted there, it takes the lag for less Coulomb and more viscous friction, or for a break-away torque near zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification.delay import earlier
from backdrive.identification.dynamic.fit import Fit
from backdrive.identification.dynamic.torque import Stretch
from backdrive.identification.remark import EARLY
from backdrive.identification.signals import spans
from backdrive.laws.direction import BACKWARD

ENOUGH = 0.3  # share of the samples that has to be sliding for only that to count [-]
LESS = 2.0  # standard errors by which friction about reversals has to be less for these not to count [-]
FEWEST_TURNS = 6  # and so many of them


def sliding(stretches: Sequence[Stretch], late: float = 0.0) -> list[Stretch]:
    """Return stretches of which only sliding counts, where that leaves enough; otherwise as they are.

    Args:
        stretches: of one joint.
        late: delay of the torque behind the motion [s].
    """
    slid = [
        replace(
            s,
            judged=s.judged & (earlier(s.sliding.astype(float), float(round(late / s.dt))) > 0.5),
            only_sliding=True,
        )
        for s in stretches
    ]
    before, after = (sum(int(np.count_nonzero(s.judged)) for s in each) for each in (stretches, slid))
    return slid if after > ENOUGH * before else list(stretches)


def sliding_only(fit: Fit, stretches: Sequence[Stretch]) -> list[Stretch]:
    """Return stretches of which only sliding counts where a law was fitted to that alone; otherwise as they are."""
    fitted: Sequence[Stretch] = getattr(fit.problem, "stretches", ())
    if not any(s.only_sliding for s in fitted):
        return list(stretches)
    return sliding(stretches, fit.values.get("delay", 0.0))


def lags_behind(
    stretches: Sequence[Stretch], slid: Sequence[Stretch], misses: Sequence[np.ndarray], late: float
) -> bool:
    """Say whether friction about reversals is less than a fit has it, as where a joint sticks and bends before it slides.

    Args:
        stretches: of one joint.
        slid: the same of which only sliding counts.
        misses: of the fit, measured less predicted torque of each [N.m or N], (n,).
        late: delay of the torque behind the motion [s].
    """
    means = []
    for s, only, miss in zip(stretches, slid, misses, strict=True):
        along = miss * np.sign(earlier(s.velocity, late / s.dt))
        means += [float(np.mean(along[a:b])) for a, b in spans(s.judged & ~only.judged)]
    if len(means) < FEWEST_TURNS:
        return False
    return bool(np.mean(means) < -LESS * np.std(means) / np.sqrt(len(means)))


def slips_too_early(values: Mapping[str, float]) -> bool:
    """Say whether a law breaks away far below the Coulomb friction that it slides with, one way or the other.

    Args:
        values: of the law, by name [SI].
    """
    return any(values[rest] < EARLY * values[slide] for rest, slide in _pairs(values))


def possible(values: Mapping[str, float], line: float) -> dict[str, tuple[float, float]]:
    """Return bounds in which friction falls from rest to sliding: the Coulomb friction of a line lies between the two.

    Args:
        values: of the law, by name [SI].
        line: Coulomb friction of a line through all sliding [N.m or N].
    """
    bounds = {}
    for rest, slide in _pairs(values):
        bounds |= {rest: (line, np.inf), slide: (0.0, line)}
    return bounds


def is_bounded(bounds: Mapping[str, object]) -> bool:
    """Say whether a person bounds break-away or Coulomb friction: then the law stays as it was fitted, and is graded."""
    return any(name.removesuffix(BACKWARD) in ("breakaway", "coulomb") for name in bounds)


def _pairs(values: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the names of break-away and Coulomb friction, of each direction that has numbers of its own."""
    names = [("breakaway" + way, "coulomb" + way) for way in ("", BACKWARD)]
    return [pair for pair in names if all(name in values for name in pair)]
