"""Friction laws: a rate law (torque at a velocity) and a presliding element (how it builds up at reversals)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.laws.base import Element, Rate, Rows, by_name
from backdrive.laws.base import Parameter as Parameter
from backdrive.laws.direction import BEHIND, law_by_direction
from backdrive.laws.direction import by_direction as by_direction
from backdrive.laws.elements.bliman_sorine import BlimanSorine as BlimanSorine
from backdrive.laws.elements.dahl import Dahl as Dahl
from backdrive.laws.elements.dead_zone import DeadZone as DeadZone
from backdrive.laws.elements.decaying import Decaying as Decaying
from backdrive.laws.elements.elastoplastic import Elastoplastic as Elastoplastic
from backdrive.laws.elements.gms import GMS as GMS
from backdrive.laws.elements.hayward_armstrong import HaywardArmstrong as HaywardArmstrong
from backdrive.laws.elements.leuven import Leuven as Leuven
from backdrive.laws.elements.lugre import LuGre as LuGre
from backdrive.laws.elements.maxwell_slip import MaxwellSlip as MaxwellSlip
from backdrive.laws.elements.none import Rigid as Rigid
from backdrive.laws.elements.reset_integrator import ResetIntegrator as ResetIntegrator
from backdrive.laws.elements.smoothed_maxwell_slip import SmoothedMaxwellSlip as SmoothedMaxwellSlip
from backdrive.laws.elements.visco_elastoplastic import ViscoElastoplastic as ViscoElastoplastic
from backdrive.laws.elements.xiong_kikuuwe import XiongKikuuwe as XiongKikuuwe
from backdrive.laws.elements.xiong_kikuuwe import XiongKikuuweMulti as XiongKikuuweMulti
from backdrive.laws.growth import MARK, pairs
from backdrive.laws.growth import Growth as Growth
from backdrive.laws.rates.coulomb_viscous import Coulomb as Coulomb
from backdrive.laws.rates.coulomb_viscous import CoulombViscous as CoulombViscous
from backdrive.laws.rates.degressive import Degressive as Degressive
from backdrive.laws.rates.gear_load import GearLoad as GearLoad
from backdrive.laws.rates.load_dependent import M1 as M1
from backdrive.laws.rates.load_dependent import M2 as M2
from backdrive.laws.rates.load_dependent import M3 as M3
from backdrive.laws.rates.load_dependent import M4 as M4
from backdrive.laws.rates.load_dependent import M5 as M5
from backdrive.laws.rates.load_dependent import M6 as M6
from backdrive.laws.rates.load_temperature import LoadTemperature as LoadTemperature
from backdrive.laws.rates.lorentz import StribeckLorentz as StribeckLorentz
from backdrive.laws.rates.makkar import Makkar as Makkar
from backdrive.laws.rates.polyline import Polyline as Polyline
from backdrive.laws.rates.sigmoid import Sigmoid as Sigmoid
from backdrive.laws.rates.stribeck import StribeckTustin as StribeckTustin
from backdrive.laws.rates.stribeck_gauss import StribeckGauss as StribeckGauss

#: Every rate law and every presliding element by name. To add one, write its file and import it above.
RATES: dict[str, type[Rate]] = by_name(globals(), Rate)
ELEMENTS: dict[str, type[Element]] = by_name(globals(), Element)

#: Former name of an element -> its present name, so that older models and commands keep working.
FORMER = {"smoothed-gms": "smoothed-maxwell-slip"}
SmoothedGMS = SmoothedMaxwellSlip

REFERENCE = 20.0  # degC, for curves evaluated without a temperature


@dataclass(frozen=True, kw_only=True)
class Law:
    """A friction law: the friction torque for a given motion.

    Attributes:
        rate: the friction torque at a velocity.
        element: how that torque builds up and relaxes at reversals.
        growth: growth of friction with the joint's load, for rate laws that do not depend on load; None without growth.
    """

    rate: Rate
    element: Element = field(default_factory=Rigid)
    growth: Growth | None = None

    def __post_init__(self):
        if not isinstance(self.rate, Rate):  # pyright: ignore[reportUnnecessaryIsInstance]  (a person gives it)
            raise InvalidInput(
                f"The rate of a law is a {type(self.rate).__name__}.",
                remedy="Give a rate law, such as StribeckGauss(...); a presliding element belongs to `element`.",
            )
        if not isinstance(self.element, Element):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise InvalidInput(
                f"The element of a law is a {type(self.element).__name__}.",
                remedy="Give a presliding element, such as LuGre(...), or leave it out.",
            )
        if self.rate.SMOOTH and not isinstance(self.element, Rigid):
            raise InvalidInput(
                f"'{self.rate.NAME}' cannot be carried by '{self.element.NAME}': it is continuous and zero at rest, so it has "
                f"no Coulomb torque for a presliding element.",
                remedy="Use element 'none' with it, or a Stribeck rate law with this element.",
            )
        if self.growth is None:
            return
        if not isinstance(self.growth, Growth):  # pyright: ignore[reportUnnecessaryIsInstance]  (a person gives it)
            what = type(self.growth).__name__
            raise InvalidInput(
                f"The growth of a law is a {what}.",
                remedy="Give Growth(load_driving=..., load_driven=..., load_carried=...).",
            )
        if "load" in self.rate.NEEDS:
            raise InvalidInput(
                f"'{self.rate.NAME}' grows with the load by itself.",
                remedy="Leave `growth` out, or use a rate law without load.",
            )

    @property
    def name(self) -> str:
        """Return `rate`, or `rate+element` where there is presliding."""
        return self.rate.NAME if isinstance(self.element, Rigid) else f"{self.rate.NAME}+{self.element.NAME}"

    @property
    def parts(self) -> tuple[Rows, ...]:
        """Return the parts with the law's parameters: rate law, element, and growth if there is one."""
        return (self.rate, self.element) if self.growth is None else (self.rate, self.element, self.growth)

    def state(self) -> np.ndarray:
        """Return the state of a joint at rest and relaxed, and behind it as many zeros as work space for `solve`, (2 S,)."""
        return np.zeros(2 * max(self.element.states(), 1))

    def row(self) -> np.ndarray:
        """Return the row that `kernels` reads, (1 + m + e,)."""
        rate = self.rate.row()
        if self.growth is None:
            return np.concatenate([[rate.size + self.rate.MARK], rate, self.element.row()])
        grown = self.growth.row()
        size = rate.size + grown.size + MARK + self.rate.MARK
        return np.concatenate([[size], rate, grown, self.element.row()])

    @property
    def plain(self) -> bool:
        """Whether the law neither grows with the load nor differs by direction, so that shorter kernels do."""
        return self.growth is None and not self.rate.MARK

    @property
    def usual_load(self) -> tuple[float, float]:
        """Return the default pair of loads: zeros, or (0, NaN) for a law that grows.

        NaN stands for the load under which its curve was identified.
        """
        return (0.0, 0.0) if self.growth is None else (0.0, float("nan"))

    def torque(
        self,
        velocity: np.ndarray | float,
        load: np.ndarray | float | None = None,
        temperature: np.ndarray | float | None = None,
    ) -> np.ndarray:
        """Return the steady friction torque of the rate law at a velocity.

        Args:
            velocity: joint velocity [rad/s or m/s], any shape.
            load: load of the joint [N.m or N]: one number, the shape of `velocity`, or pairs of motor-side and external torque
                with a last axis of two. None: no load; if the law grows, the load under which its curve was identified.
            temperature: [degC], one number or the shape of `velocity`; None: 20.

        Returns:
            Friction torque [N.m or N], the shape of `velocity`; 0 at zero velocity.

        Raises:
            InvalidInput: shapes do not match.
        """
        from backdrive.laws import kernels

        v = np.asarray(velocity, dtype=np.float64)
        try:
            loads = pairs(load, v.shape)
            temps = None if temperature is None else np.broadcast_to(np.asarray(temperature, float), v.shape)
        except ValueError as error:
            raise InvalidInput(
                f"Load or temperature do not have the shape of the velocities, {v.shape}: {error}.",
                remedy="Give one number, or one for each velocity.",
            ) from error
        loads = np.array([self.usual_load] if loads is None else loads.reshape(-1, 2))
        temps = np.array([REFERENCE] if temps is None else np.ravel(temps))
        out = np.empty(v.size)
        steady = kernels.of_kinds(kernels.steady, self.rate.KIND, plain=self.plain)
        steady(self.rate.KIND, self.row(), np.ravel(v), loads, temps, out)
        return out.reshape(v.shape)

    @property
    def scalar(self) -> Callable[[np.ndarray, float], float]:
        """Return the compiled steady torque of the rate law at one velocity: f(row, velocity), without a load and at 20 degC."""
        from backdrive.laws import kernels

        return kernels.steady_of(self.rate.KIND, self.plain)

    def coulomb(self) -> tuple[float, float]:
        """Return F_p and F_n of Iwatani 2017, (3.1): friction at the slowest motion along +q and along -q [N.m or N]."""
        from backdrive.laws import kernels

        limits = kernels.of_kinds(kernels.limits, self.rate.KIND, plain=self.plain)
        lo, hi, _ = limits(self.rate.KIND, self.row(), 0.0, self.usual_load, REFERENCE)
        return float(hi), float(-lo)

    def phi(self, velocity: np.ndarray | float) -> np.ndarray:
        """Return Phi(v) of Iwatani 2017, (3.1): friction minus F_p or F_n; continuous, 0 at rest.

        Args:
            velocity: joint velocity [rad/s or m/s], any shape.

        Returns:
            Torque with the sign of tau_f [N.m or N], the shape of `velocity`.
        """
        v = np.asarray(velocity, dtype=np.float64)
        forwards, backwards = self.coulomb()
        return self.torque(v) - np.where(v > 0.0, forwards, np.where(v < 0.0, -backwards, 0.0))


def with_element(law: Rate | Law, element: Element) -> Law:
    """Return a law with this presliding element, and with the rate law and the growth that are given."""
    return replace(law, element=element) if isinstance(law, Law) else Law(rate=law, element=element)


def rate_law(name: str) -> type[Rate]:
    """Return the class of a rate law; `NAME-by-direction` is the class with separate parameters for each direction.

    Raises:
        UnknownName: no such law; the message names the known ones.
        InvalidInput: the law already has parameters for each direction.
    """
    if name.endswith(BEHIND):
        return law_by_direction(lookup(name.removesuffix(BEHIND), RATES, "rate law"))
    return lookup(name, RATES, "rate law")


def element(name: str) -> type[Element]:
    """Return the class of a presliding element; the error for an unknown name lists the known ones."""
    return lookup(FORMER.get(name, name), ELEMENTS, "presliding element")
