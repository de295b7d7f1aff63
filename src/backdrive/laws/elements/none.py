"""No presliding: the set-valued friction of a rigid contact.

    tau_f in gsgn(lo, v, hi) + viscous(v)

At v = 0 the torque may be anything in [lo, hi]; `step`, which sees only motion, gives 0 there, and `solve` gives the
velocity of a mass that this friction holds or lets slide (true stiction, no chatter). The viscous part sees the joint's
velocity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from backdrive._jit import jit
from backdrive.laws.base import Parameter, Rows


@jit
def step(lo, hi, viscous, dp):
    """Torque of one tick from the limits at its velocity and its increment dp."""
    if dp > 0.0:
        return hi + viscous
    if dp < 0.0:
        return lo + viscous
    return 0.0 * dp + viscous


@dataclass(frozen=True, kw_only=True)
class Rigid(Rows):
    """No presliding; there is nothing to set."""

    NAME: ClassVar[str] = "none"
    KIND: ClassVar[int] = 0
    PARAMETERS: ClassVar[dict[str, Parameter]] = {}
