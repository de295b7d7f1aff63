"""The definition of a method of the external-force estimator; each is defined beside its kernel and imported in `external`.

And what stands for an estimator where there is none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from backdrive._jit import leaf

if TYPE_CHECKING:
    from backdrive.control.estimators.external import ExternalForce


@leaf
def no_friction(c, i, p, x, s, j, dp, dt, load, temp):
    """Return no friction: `external.friction_of` where no joint has an estimator."""
    return 0.0


@leaf
def no_force(c, i, s, j, q, dp, dt, u, known, tau_f):
    """Return no force: `external.force` where no joint has an estimator."""
    return 0.0


@dataclass(frozen=True)
class Method:
    """A method to estimate the external force.

    Attributes:
        name: its name in settings and commands.
        kernel: `kernel(c, i, s, j, q, dp, T, n)`, the external force of a tick: `c[i:]` row, `s[j:]` state, q encoder, dp its
            increment, T length of the tick, n what motor, gravity and friction leave [N.m or N].
        gains: function of estimator and sampling time [s]: three gains of its row, and the bandwidth that belongs to them.
        places: the state at OBSERVER is a position.
        speed: place of the velocity in the state; 0 where it has none.
        of_mass: the state contains the momentum instead of the velocity.
    """

    name: str
    kernel: Callable
    gains: Callable[[ExternalForce, float], tuple[float, float, float, float]] | None = None
    places: bool = False
    speed: int = 0
    of_mass: bool = False
