"""A torque known from elsewhere that is a constant, or gravity of the joint's own angle: a fit cannot tell its share from them.

The share is then taken as 1, and the offset and gravity that are fitted are what the known torque leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification.signals import Signals
from backdrive.identification.terms import estimates
from backdrive.model import JointFriction

AS_ONE = "The known torque is gravity or a constant itself, so its share is taken as 1: a fit cannot tell it from those terms."
LEFT = 0.02  # largest rest of a torque that a constant, sine and cosine explain, relative to the torque [-]


def as_gravity(
    position: Sequence[np.ndarray] | None, known: Sequence[np.ndarray]
) -> tuple[float, float, float] | None:
    """Return the constant, sine and cosine that a known torque is made of [N.m or N]; None if there is more to it.

    Args:
        position: of each stretch [rad], (n,) each; None: a constant alone is tried, and sine and cosine are 0.
        known: torque of each stretch [N.m or N], (n,) each.
    """
    angles: Sequence[np.ndarray | None] = [None] * len(known) if position is None else position
    size = 2 if position is None else 4
    gram = np.zeros((size, size))
    for q, torque in zip(angles, known, strict=True):
        pull = [] if q is None else [np.sin(q), np.cos(q)]
        rows = np.stack([np.ones_like(torque), *pull, torque])
        gram += rows @ rows.T
    power = gram[-1, -1]
    if not power > 0.0:
        return 0.0, 0.0, 0.0
    coefficients = np.linalg.lstsq(gram[:-1, :-1], gram[:-1, -1], rcond=1e-12)[0]
    rest = power - coefficients @ gram[:-1, -1]
    if not rest <= LEFT**2 * power:
        return None
    constant, *pull = coefficients.tolist()
    sine, cosine = pull or (0.0, 0.0)
    return constant, sine, cosine


def is_taken_as_one(stretches: Sequence[Signals], gravity: bool) -> bool:
    """Return whether the share of the known torque must be taken as 1.

    Args:
        stretches: of one joint.
        gravity: gravity may be fitted beside it.
    """
    known = [s.model_torque[s.moving] for s in stretches if s.model_torque is not None]
    if len(known) < len(stretches):
        return False
    positions = [s.position[s.moving] for s in stretches if s.position is not None]
    return as_gravity(positions if gravity and len(positions) == len(known) else None, known) is not None


def subtract(stretches: Sequence[Signals]) -> list[Signals]:
    """Return stretches without the known torque, which is subtracted from the measured one."""
    return [
        s if s.model_torque is None else replace(s, torque=s.torque - s.model_torque, model_torque=None)
        for s in stretches
    ]


def add(torques: Sequence[np.ndarray], stretches: Sequence[Signals]) -> list[np.ndarray]:
    """Return torques of stretches plus the known torque."""
    both = zip(torques, stretches, strict=True)
    return [torque if s.model_torque is None else torque + s.model_torque for torque, s in both]


def is_felt(stretches: Sequence[Signals]) -> bool:
    """Return whether the known torque differs from zero anywhere."""
    return any(s.model_torque is not None and bool(s.model_torque.any()) for s in stretches)


def with_share(friction: JointFriction) -> JointFriction:
    """Return a result with the known torque at a share of 1, which has no error."""
    share = estimates({"model_torque": (1.0, np.nan)}, friction.joint.unit)
    return replace(friction, dynamics={**friction.dynamics, **share})
