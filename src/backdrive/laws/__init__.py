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

    def coulomb(self) -> tuple[float, float]:
        """Return F_p and F_n of Iwatani 2017, (3.1): friction at the slowest motion along +q and along -q [N.m or N]."""
        from backdrive.laws import kernels

        lo, hi, _ = kernels.limits(self.rate.KIND, self.row(), 0.0, np.zeros(2), np.nan)
        return float(hi), float(-lo)

    def phi(self, velocity: np.ndarray | float) -> np.ndarray:
        """Return Phi(v) of Iwatani 2017, (3.1): what friction has beyond F_p or F_n; continuous, 0 at rest.

        Args:
            velocity: joint velocity [rad/s or m/s], any shape.

        Returns:
            Torque of the sign of its effect [N.m or N], the shape of `velocity`.
        """
        v = np.asarray(velocity, dtype=np.float64)
        forwards, backwards = self.coulomb()
        return self.torque(v) - np.where(v > 0.0, forwards, np.where(v < 0.0, -backwards, 0.0))


def rate_law(name: str) -> type[Rows]:
    """Return the class of a rate law; an unknown name is answered with the known ones."""
    return lookup(name, RATES, "rate law")


def element(name: str) -> type[Rows]:
    """Return the class of a presliding element; an unknown name is answered with the known ones."""
    return lookup(name, ELEMENTS, "presliding element")
