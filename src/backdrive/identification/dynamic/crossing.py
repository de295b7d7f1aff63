"""Check whether a law of velocity alone is valid through reversals; otherwise they are left out of the fit.

At a reversal a joint sticks, deflects elastically, and breaks away. A law of velocity alone cannot describe this. A fit
through reversals gives too little Coulomb and too much viscous friction, or a break-away torque near zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification.delay import earlier
from backdrive.identification.dynamic.fit import Fit
from backdrive.identification.dynamic.stretch import Stretch
from backdrive.identification.remark import EARLY
from backdrive.identification.settling import SHARES
from backdrive.identification.signals import SLOW, since_reversal, spans
from backdrive.laws.direction import BACKWARD

ENOUGH = 0.3  # least share of sliding samples for a fit to sliding alone [-]
LESS = 2.0  # least significance of lower friction at reversals for which they are left out [standard error]
SMALL = 0.005  # least decrease of friction at reversals, relative to the RMS torque [-]
BOTH = 0.05  # least share of the top speed that counts as motion in both directions [-]
FEWEST_TURNS = 6  # least number of reversals for the test


def sliding(stretches: Sequence[Stretch], late: float = 0.0) -> list[Stretch]:
    """Return stretches in which only sliding samples count, if these are enough; otherwise the stretches unchanged.

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


def fast(stretches: Sequence[Stretch], slid: Sequence[Stretch], late: float = 0.0) -> list[Stretch]:
    """Return stretches of sliding in which slow samples do not count, if the others are enough; otherwise `slid` unchanged.

    Friction that changes its sign over a range of speeds, or that has a Stribeck peak, bends a straight line there.

    Args:
        stretches: of one joint.
        slid: the same stretches, in which only sliding counts.
        late: delay of the torque behind the motion [s].
    """
    ways = np.concatenate([s.velocity[s.judged] for s in stretches])
    ends = -float(ways.min()), float(ways.max())
    least = SLOW * (min(ends) if min(ends) > BOTH * max(ends) else max(ends))
    quick = [replace(s, judged=s.judged & (np.abs(earlier(s.velocity, late / s.dt)) >= least)) for s in slid]
    before, after = (sum(int(np.count_nonzero(s.judged)) for s in each) for each in (stretches, quick))
    return quick if after > ENOUGH * before else list(slid)


def without_build_up(
    stretches: Sequence[Stretch], misses: Sequence[np.ndarray], late: float
) -> list[Stretch]:
    """Return stretches in which samples do not count while friction still builds up after reversals; unchanged without such.

    Args:
        stretches: of one joint, in which only sliding counts.
        misses: measured minus predicted torque of each stretch [N.m or N], (n,).
        late: delay of the torque behind the motion [s].
    """
    since = [since_reversal(earlier(s.velocity, late / s.dt), 1.0 / s.dt) for s in stretches]
    ways, middle = [way for way, _ in since], float(np.median([each for _, each in since]))
    kept, before = list(stretches), 0.0
    for share in SHARES:
        bands = [(way >= before) & (way < share * middle) for way in ways]
        rest = [replace(s, judged=s.judged & ~band) for s, band in zip(kept, bands, strict=True)]
        if lags_behind(kept, rest, misses, late):
            kept = [
                replace(s, judged=s.judged & (way >= share * middle))
                for s, way in zip(stretches, ways, strict=True)
            ]
        before = share * middle
    count, left = (sum(int(np.count_nonzero(s.judged)) for s in each) for each in (stretches, kept))
    return kept if left > ENOUGH * count else list(stretches)


def sliding_only(fit: Fit, stretches: Sequence[Stretch]) -> list[Stretch]:
    """Return stretches in which only sliding samples count, if the law was fitted to sliding alone; otherwise unchanged."""
    if not of_sliding(fit):
        return list(stretches)
    return sliding(stretches, fit.values.get("delay", 0.0))


def of_sliding(fit: Fit) -> bool:
    """Return whether a law was fitted to sliding alone, in a part of the records at least."""
    fitted: Sequence[Stretch] = getattr(fit.problem, "stretches", ())
    return any(s.only_sliding for s in fitted)


def lags_behind(
    stretches: Sequence[Stretch], slid: Sequence[Stretch], misses: Sequence[np.ndarray], late: float
) -> bool:
    """Return whether friction near reversals is lower than the fit predicts, because the joint sticks and deflects there.

    Args:
        stretches: of one joint.
        slid: the same stretches, in which only sliding counts.
        misses: measured minus predicted torque of each stretch [N.m or N], (n,).
        late: delay of the torque behind the motion [s].
    """
    means = []
    for s, only, miss in zip(stretches, slid, misses, strict=True):
        along = miss * np.sign(earlier(s.velocity, late / s.dt))
        means += [float(np.mean(along[a:b])) for a, b in spans(s.judged & ~only.judged)]
    if len(means) < FEWEST_TURNS:
        return False
    torque = np.concatenate([s.torque[s.judged] for s in stretches])
    small = SMALL * float(np.sqrt(np.mean(torque**2)))
    return bool(np.mean(means) < -max(LESS * float(np.std(means)) / np.sqrt(len(means)), small))


def slips_too_early(values: Mapping[str, float]) -> bool:
    """Return whether a law's break-away torque is far below its Coulomb friction, in either direction.

    Args:
        values: parameters of the law, by name [SI].
    """
    return any(values[rest] < EARLY * values[slide] for rest, slide in _pairs(values))


def possible(values: Mapping[str, float], line: float) -> dict[str, tuple[float, float]]:
    """Return bounds that keep break-away torque above, and Coulomb friction below, the Coulomb friction of a straight line.

    Args:
        values: parameters of the law, by name [SI].
        line: Coulomb friction of a straight line fitted to all sliding [N.m or N].
    """
    bounds = {}
    for rest, slide in _pairs(values):
        bounds |= {rest: (line, np.inf), slide: (0.0, line)}
    return bounds


def is_bounded(bounds: Mapping[str, object]) -> bool:
    """Return whether the user bounds break-away or Coulomb friction; then the fitted law is kept and graded."""
    return any(name.removesuffix(BACKWARD) in ("breakaway", "coulomb") for name in bounds)


def _pairs(values: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the names of break-away and Coulomb friction, for each direction that has its own parameters."""
    names = [("breakaway" + way, "coulomb" + way) for way in ("", BACKWARD)]
    return [pair for pair in names if all(name in values for name in pair)]
