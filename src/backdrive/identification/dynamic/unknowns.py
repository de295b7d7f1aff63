"""The unknowns of a fit: parameters with unit and range, and the conversion from a search vector to a law.

A search uses scaled coordinates: the logarithm of a parameter that spans orders of magnitude, or else the parameter divided by
its scale. For shares of elements side by side, the coordinates are the logarithms of their ratios to the last share. Shares
thus always add up to 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.laws import ELEMENTS, FORMER, RATES, Law, rate_law
from backdrive.laws import element as element_law
from backdrive.laws.base import Element, Parameter, Rate
from backdrive.laws.direction import plain as without_direction
from backdrive.laws.elements.maxwell_slip import Parallel

WIDEST = 9.0  # largest magnitude of the logarithm of a ratio of shares
WIDE = 1e3  # a range whose ends differ by more than this factor is searched in the logarithm


@dataclass(frozen=True, kw_only=True)
class Scales:
    """Typical sizes in the data, which determine the ranges of parameters.

    Attributes:
        force: typical friction [N.m or N].
        speed: largest speed [rad/s or m/s].
        length: distance over which presliding torque builds up [rad or m].
        unit: of the joint, `rad` or `m`.
        slowest: speed of one encoder step per sample [rad/s or m/s]; 0 if unknown.
        lag: typical settling time of friction [s].
        most: largest friction in the data, for torques of a law above its sliding torque [N.m or N].
    """

    force: float
    speed: float
    length: float
    unit: str = "rad"
    slowest: float = 0.0
    lag: float = 0.01
    most: float = np.inf

    def of(self, unit: str) -> float:
        """Return the typical size of a quantity with a given unit."""
        table = {
            "force": self.force,
            "force.s/length": self.force / self.speed,
            "length/s": self.speed,
            "s/length": 1.0 / self.speed,
            "force/length": self.force / self.length,
            "length": self.length,
            "1": 1.0,
            "1/s": 20.0,
            "s": self.lag,
            "1/force": 1.0 / self.force,
            "force/s": self.force / 0.05,
            "force/degC": self.force / 50.0,
            "length/s/degC": self.speed / 50.0,
            "degC": 20.0,
            "force.(s/length)^n": self.force / self.speed**0.5,
        }
        return table[unit]


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """One estimated parameter.

    Attributes:
        name: parameter of the law, or term of the dynamics; `name[i]` in a sequence.
        unit: SI unit for this joint.
        lower: smallest value.
        upper: largest value.
        log: whether the search coordinate is the parameter's logarithm.
        scale: unit of a search coordinate that is not logarithmic [unit of the parameter].
        ratio: whether the parameter is the logarithm of a ratio of shares.
    """

    name: str
    unit: str
    lower: float
    upper: float
    log: bool = False
    scale: float = 1.0
    ratio: bool = False

    def __post_init__(self):
        if not self.lower < self.upper:
            raise InvalidInput(
                f"'{self.name}' is bounded by {self.lower:g} and {self.upper:g} [{self.unit}].",
                remedy="Give a lower bound below the upper one.",
            )

    def inward(self, value):
        """Return search coordinates of values."""
        value = np.clip(value, self.lower, self.upper)
        return np.log(value) if self.log else np.asarray(value) / self.scale

    def outward(self, u):
        """Return values of search coordinates."""
        return np.clip(np.exp(u) if self.log else np.asarray(u) * self.scale, self.lower, self.upper)

    def slope(self, value: float) -> float:
        """Return d(value)/d(search coordinate)."""
        return value if self.log else self.scale


def user_range(name: str, given: Any) -> tuple[float, float]:
    """Return a range given by the user.

    Raises:
        InvalidInput: it does not consist of two numbers.
    """
    try:
        low, high = (float(x) for x in given)
    except (TypeError, ValueError):
        raise InvalidInput(
            f"The bounds of '{name}' are {given!r}.", remedy="Give two numbers, (lower, upper), in SI units."
        ) from None
    return low, high


def unknown(
    name: str, parameter: Parameter, scales: Scales, bounds: Mapping[str, tuple[float, float]]
) -> Unknown:
    """Return the unknown of a law's parameter, with its range limited to sizes that the data can determine."""
    size = scales.of(parameter.unit)
    wide = parameter.log or (parameter.lower > 0.0 and WIDE * parameter.lower < parameter.upper < np.inf)
    if parameter.unit == "1" and np.isfinite(parameter.lower) and np.isfinite(parameter.upper):
        lower, upper = parameter.lower, parameter.upper
    elif parameter.log:
        lower, upper = max(parameter.lower, 1e-4 * size), min(parameter.upper, 1e4 * size)
    else:
        lower, upper = max(parameter.lower, -50.0 * size), min(parameter.upper, 50.0 * size)
    plain = name.partition("[")[0]
    plain = plain if plain in bounds else without_direction(plain)  # one range for both directions
    if parameter.peak:
        upper = max(min(upper, scales.most), 2.0 * lower)
    if plain in bounds:
        asked = user_range(plain, bounds[plain])
        if not asked[0] < asked[1] or asked[1] < parameter.lower or asked[0] > parameter.upper:
            raise InvalidInput(
                f"The bounds {asked[0]:g} to {asked[1]:g} of '{plain}' contradict its range "
                f"{parameter.lower:g} to {parameter.upper:g} [{parameter.unit_for(scales.unit)}].",
                remedy="Give a lower and a higher bound inside the range.",
            )
        lower, upper = max(asked[0], parameter.lower), min(asked[1], parameter.upper)
    log = wide and lower > 0.0
    return Unknown(
        name=name, unit=parameter.unit_for(scales.unit), lower=lower, upper=upper, log=log, scale=size
    )


@dataclass(frozen=True, kw_only=True)
class LawShape:
    """The shape of a law to fit: its classes, the number of elements side by side, and its fixed parameters.

    Attributes:
        rate: class of the rate law.
        element: class of the presliding element.
        count: number of elements side by side, or of knots of a curve with fixed velocities.
        fixed: values of parameters that are not estimated.
        ties: parameter that is not estimated -> parameter that it equals.
    """

    rate: type[Rate]
    element: type[Element]
    count: int = 4
    fixed: Mapping[str, Any]
    ties: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def from_name(cls, name: str, *, count: int = 4, fixed: Mapping[str, Any] | None = None) -> LawShape:
        """Return the shape of `rate`, or `rate+element`.

        Raises:
            UnknownName: no such law; the message suggests similar names.
            InvalidInput: rate law and element cannot be combined, or a fixed parameter does not belong to the law.
        """
        from backdrive.laws.examples import ELEMENT_EXAMPLES

        first, plus, second = (FORMER.get(part, part) for part in name.partition("+"))
        if not plus and first in ELEMENTS and first not in RATES:
            first, second = "stribeck-gauss", first
        shape = cls(
            rate=rate_law(first), element=element_law(second or "none"), count=count, fixed=dict(fixed or {})
        )
        rate = shape.rate(**shape.rate.EXAMPLE)
        Law(
            rate=rate, element=ELEMENT_EXAMPLES[second or "none"]
        )  # raises an error if they cannot be combined
        strange = set(shape.fixed) - set(shape.rate.PARAMETERS) - set(shape.element.PARAMETERS)
        if strange:
            raise InvalidInput(
                f"'{name}' has no {', '.join(sorted(strange))} to be held fixed.",
                remedy=f"It has {', '.join([*shape.rate.PARAMETERS, *shape.element.PARAMETERS])}.",
            )
        return shape

    @property
    def name(self) -> str:
        """Return `rate`, or `rate+element`."""
        return self.rate.NAME if self.element.NAME == "none" else f"{self.rate.NAME}+{self.element.NAME}"

    @property
    def tells_offset(self) -> bool:
        """Whether reversals separate a constant torque from Coulomb friction that differs by direction."""
        return self.rate.MARK > 0.0 and not (self.element.SET_VALUED or self.element.ZONE)

    def beside(self, terms: Sequence[str]) -> LawShape:
        """Return the shape to fit together with given terms of the dynamics.

        A constant torque cannot be separated from Coulomb friction that differs by direction. If an `offset` is fitted,
        Coulomb friction is therefore equal in both directions. Exception: for a law of two curves with presliding, reversals
        separate the two.
        """
        loose = (
            "offset" not in terms
            or self.tells_offset
            or any(name in self.fixed for name in self.rate.TIES.values())
        )
        ties = {} if loose else {a: b for a, b in self.rate.TIES.items() if a not in self.fixed}
        return replace(self, ties={**self.ties, **ties})

    def complete(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values by name, including those of tied parameters."""
        return {**values, **{a: values[b] for a, b in self.ties.items() if b in values}}

    def unknowns(
        self, scales: Scales, bounds: Mapping[str, tuple[float, float]] | None = None
    ) -> list[Unknown]:
        """Return the unknowns of the law, in the order of its parameters."""
        bounds = bounds or {}
        found = []
        for rows in (self.rate, self.element):
            for name, parameter in rows.PARAMETERS.items():
                if name in self.fixed or name in self.ties:
                    continue
                if name == "share" and issubclass(rows, Parallel):
                    for i in range(self.count - 1):
                        found.append(
                            Unknown(name=f"share[{i}]", unit="1", lower=-WIDEST, upper=WIDEST, ratio=True)
                        )
                elif parameter.many:
                    if not issubclass(rows, Parallel) and "velocity" not in self.fixed:
                        raise InvalidInput(
                            f"'{rows.NAME}' is a curve with knots, which this fit cannot choose; a sweep identifies "
                            f"it.",
                            remedy="Use `identify`, fix `velocity`, or fit stribeck-tustin or degressive.",
                        )
                    each = [f"{name}[{i}]" for i in range(self.count)]
                    found += [unknown(n, parameter, scales, bounds) for n in each if n not in self.ties]
                else:
                    found.append(unknown(name, parameter, scales, bounds))
        return found

    def law(self, values: Mapping[str, float]) -> Law:
        """Return the law with given parameter values."""
        values = self.complete(values)
        return Law(rate=self._rows(self.rate, values), element=self._rows(self.element, values))

    def _rows(self, cls, values):
        given = {}
        for name, parameter in cls.PARAMETERS.items():
            if name in self.fixed:
                given[name] = self.fixed[name]
            elif name == "share" and issubclass(cls, Parallel):
                given[name] = shares([values[f"share[{i}]"] for i in range(self.count - 1)])
            elif parameter.many:
                given[name] = tuple(values[f"{name}[{i}]"] for i in range(self.count))
            else:
                given[name] = values[name]
        return cls(**given)


def shares(ratios: Sequence[float]) -> tuple[float, ...]:
    """Return shares that add up to 1, from the logarithms of their ratios to the last share."""
    weights = np.exp(np.append(np.asarray(ratios, dtype=float), 0.0))
    return tuple((weights / weights.sum()).tolist())
