"""Friction laws: a rate law carried by a presliding element."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from backdrive._catalog import lookup
from backdrive.laws.base import Parameter as Parameter
from backdrive.laws.base import Rows
from backdrive.laws.elements.none import Rigid as Rigid
from backdrive.laws.rates.coulomb_viscous import CoulombViscous as CoulombViscous
from backdrive.laws.rates.polyline import Polyline as Polyline

#: Every rate law by name. A law is one file, one line here and its branch in `kernels.py`.
RATES: dict[str, type[Rows]] = {c.NAME: c for c in (CoulombViscous, Polyline)}

#: Every presliding element by name.
ELEMENTS: dict[str, type[Rows]] = {c.NAME: c for c in (Rigid,)}


@dataclass(frozen=True, kw_only=True)
class Law:
    """A friction law: motion into torque.

    Attributes:
        rate: what the joint resists with at a velocity.
        element: how that torque builds up and lets go.
    """

    rate: Rows
    element: Rows = field(default_factory=Rigid)

    def row(self) -> np.ndarray:
        """Return the row that `kernels` reads, (1 + m + e,)."""
        rate = self.rate.row()
        return np.concatenate([[rate.size], rate, self.element.row()])

    def torque(self, velocity: np.ndarray | float) -> np.ndarray:
        """Return the steady friction torque at a velocity.

        Args:
            velocity: joint velocity [rad/s or m/s], any shape.

        Returns:
            Friction torque [N.m or N], the shape of `velocity`; 0 at zero velocity.
        """
        from backdrive.laws import kernels

        v = np.asarray(velocity, dtype=np.float64)
        out = np.empty(v.size)
        kernels.steady(self.rate.KIND, self.row(), np.ravel(v), np.zeros(2), np.nan, out)
        return out.reshape(v.shape)


def rate_law(name: str) -> type[Rows]:
    """Return the class of a rate law; an unknown name is answered with the known ones."""
    return lookup(name, RATES, "rate law")


def element(name: str) -> type[Rows]:
    """Return the class of a presliding element; an unknown name is answered with the known ones."""
    return lookup(name, ELEMENTS, "presliding element")
