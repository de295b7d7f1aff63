"""Gravity in a log without positions: fitted along the integrated velocity, then left out of the model, which knows no angle.

A position that begins anywhere gives gravity too, for a sin q + b cos q has two free numbers. Without them its torque spoils the
inertia, which is of the same frequency. What is found holds from where the log began, so a model cannot use it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from backdrive.identification.bands import bands_of, long_run_of
from backdrive.identification.evidence import parts_of
from backdrive.identification.result import JointEvidence
from backdrive.identification.signals import Signals
from backdrive.identification.terms import GRAVITY, estimates
from backdrive.model import JointFriction

APART = "What it explains counts gravity along the integrated velocity, which is no part of the model."
PAUSE = 0.1  # longest gap between two stretches over which the velocity is integrated [s]


def along_path(stretches: Sequence[Signals], alone: bool) -> list[Signals]:
    """Return stretches of which each has a position; unchanged where they have one, or where it cannot be integrated.

    Args:
        stretches: of one joint, in order.
        alone: they are of one rotary joint's only log.
    """
    known = any(s.position is not None or s.model_torque is not None for s in stretches)
    gaps = [float(b.time[0] - a.time[-1]) for a, b in pairwise(stretches)]
    if not alone or known or max(gaps, default=0.0) > PAUSE:
        return list(stretches)
    result, begin = [], 0.0
    for s, gap, after in zip(stretches, [*gaps, 0.0], [*stretches[1:], None], strict=True):
        steps = 0.5 * (s.velocity[1:] + s.velocity[:-1]) / s.rate
        path = begin + np.concatenate([[0.0], np.cumsum(steps)])
        result.append(replace(s, position=path))
        if after is not None:
            begin = float(path[-1] + 0.5 * (s.velocity[-1] + after.velocity[0]) * gap)
    return result


def without_gravity(
    friction: JointFriction, evidence: JointEvidence, stretches: Sequence[Signals]
) -> tuple[JointFriction, JointEvidence]:
    """Return a result without gravity that was fitted along a path, whose mean stays as an offset, and what it leaves open.

    The evidence keeps the residual of the fit, and gets the bands of the torque that the model without gravity predicts.

    Args:
        friction: the result.
        evidence: of it.
        stretches: those that were fitted.
    """
    sine, cosine = (friction.dynamics[name].value if name in friction.dynamics else 0.0 for name in GRAVITY)
    if not (sine or cosine):
        return friction, evidence
    positions = np.concatenate([s.position for s in stretches if s.position is not None])
    mean = float(np.mean(sine * np.sin(positions) + cosine * np.cos(positions)))
    before = friction.dynamics["offset"].value if "offset" in friction.dynamics else 0.0
    kept = {name: term for name, term in friction.dynamics.items() if name not in (*GRAVITY, "offset")}
    left = replace(friction, dynamics=kept)  # its covariance loses their rows
    left = replace(
        left, dynamics=kept | estimates({"offset": (before + mean, math.nan)}, friction.joint.unit)
    )
    parts = parts_of(left, stretches, True)
    return left, replace(
        evidence,
        bands=bands_of(parts),
        long_run=long_run_of(parts),
        unplaced=math.hypot(sine, cosine),
        verdict=f"{evidence.verdict} {APART}",
    )
