"""A torque known from elsewhere that is a constant, or gravity of the joint's own angle: a fit cannot tell it from those terms.

It is then left out, and offset and gravity are fitted in its place: they come from the measured torque alone, whatever size, sign
or timing the known torque has. How much of it they are is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification.signals import Signals

# largest rest that is no constant and no gravity, and that is no constant, relative to the known torque, and to what is left of
# the measured one, friction and inertia [-]
LEFT, CHANGING = 0.02, 1e-3
LEFT_OUT = (
    "The known torque is a constant or gravity itself, which a fit cannot tell from those terms: it was left out, and they were "
    "fitted in its place."
)


def is_gravity(
    position: Sequence[np.ndarray] | None, known: Sequence[np.ndarray], torque: Sequence[np.ndarray]
) -> bool:
    """Return whether a known torque is a constant plus gravity, as far as the other torque of the joint lets that be told.

    Args:
        position: of each stretch [rad], (n,) each; None: only a constant counts.
        known: torque known from elsewhere, of each stretch [N.m or N], (n,) each.
        torque: measured torque of each stretch [N.m or N], (n,) each.
    """
    angles: Sequence[np.ndarray | None] = [None] * len(known) if position is None else position
    size = 1 if position is None else 3
    gram = np.zeros((size + 2, size + 2))
    for q, one, measured in zip(angles, known, torque, strict=True):
        pull = [] if q is None else [np.sin(q), np.cos(q)]
        rows = np.stack([np.ones_like(one), *pull, one, measured])
        gram += rows @ rows.T
    inner, moments = gram[:size, :size], gram[:size, size:]
    fitted = np.linalg.lstsq(inner, moments, rcond=1e-12)[0]
    rest = np.diag(gram)[size:] - np.einsum("ij,ij->j", fitted, moments)
    most = CHANGING if position is None else LEFT
    return bool(rest[0] <= most**2 * min(gram[size, size], max(rest[1], 0.0)))


def leave_out(
    stretches: Sequence[Signals], gravity: bool, others: Sequence[Signals] = ()
) -> list[Signals] | None:
    """Return stretches without their known torque, where offset and gravity do as well; None if it has to stay.

    Args:
        stretches: of one joint.
        gravity: gravity may be fitted.
        others: stretches on which the result is judged.
    """
    every = [*stretches, *others]
    parts = [(s, s.model_torque) for s in every if s.model_torque is not None]
    if not parts or len(parts) < len(every):
        return None
    known, torque = [k[s.moving] for s, k in parts], [s.torque[s.moving] for s, _ in parts]
    angles = [s.position[s.moving] for s in every if s.position is not None]
    told = is_gravity(angles if gravity and len(angles) == len(parts) else None, known, torque)
    return [replace(s, model_torque=None) for s in stretches] if told else None
