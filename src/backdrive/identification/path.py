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

from backdrive.identification.signals import Signals
from backdrive.identification.terms import GRAVITY
from backdrive.model import Covariance, JointFriction

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


def without_gravity(friction: JointFriction) -> tuple[JointFriction, str]:
    """Return a result without gravity that was fitted along a path, and a sentence that says so; as it is, and "", without any.

    Args:
        friction: the result.
    """
    pulls = [friction.dynamics[name].value for name in GRAVITY if name in friction.dynamics]
    if not pulls:
        return friction, ""
    covariance = friction.covariance
    if covariance is not None:
        kept = [i for i, name in enumerate(covariance.names) if name not in GRAVITY]
        names = [covariance.names[i] for i in kept]
        covariance = Covariance.of(names, covariance.array()[np.ix_(kept, kept)]) if kept else None
    dynamics = {name: term for name, term in friction.dynamics.items() if name not in GRAVITY}
    sentence = (
        f"The log has no position: gravity of up to {math.hypot(*pulls):.3g} {friction.joint.torque_unit} was fitted along the "
        "integrated velocity, and the model leaves it out, since it does not know the angle. A log with positions gives both."
    )
    return replace(friction, dynamics=dynamics, covariance=covariance), sentence
