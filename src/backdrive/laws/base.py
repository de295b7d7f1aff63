"""Base classes of all rate laws and elements: parameters with unit and bounds, and a row of float64."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, TypeVar

import numpy as np

from backdrive.errors import InvalidInput

SPEEDS = (
    1e-12,
    *np.geomspace(1e-9, 1e6, 61).tolist(),
)  # speeds at which a rate law is evaluated [rad/s or m/s]

MOST = 0xFFFF  # largest size of a law's row

R = TypeVar("R", bound="Rows")


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """Rough sizes of friction from data, before a law is fitted.

    Attributes:
        coulomb: Coulomb torque [N.m or N].
        breakaway: torque at slow motion [N.m or N].
        viscous: slope [N.m.s/rad or N.s/m].
        speed: largest [rad/s or m/s].
        stiffness: presliding stiffness [N.m/rad or N/m].
        length: over which presliding torque builds up [rad or m].
        lag: a time in which friction may settle [s].
    """

    coulomb: float
    breakaway: float
    viscous: float
    speed: float
    stiffness: float
    length: float
    lag: float

    @property
    def slow(self) -> float:
        """A slow speed, at which a Stribeck curve may have fallen [rad/s or m/s]."""
        return 0.05 * self.speed


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter of a law.

    Attributes:
        symbol: as printed in the paper.
        unit: for a rotary joint; `force` and `length` stand for N.m|N and rad|m, e.g. `force.s/length`.
        lower: smallest admissible value.
        upper: largest admissible value.
        many: the parameter is a sequence (the knots of a curve).
        typical: a value met in the literature, None where there is no typical one.
        source: where the typical value was published.
        log: whether values span orders of magnitude, so that a search should step in their logarithm.
        start: where a fit begins, a number or a function of the `Sizes` of the data.
        peak: the parameter must not exceed the largest friction in the data. If the data hold no slow motion, only this
            bound limits it.
    """

    symbol: str
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    many: bool = False
    typical: float | tuple[float, ...] | None = None
    source: str = ""
    log: bool = False
    start: float | Callable[[Sizes], float] = 0.0
    peak: bool = False

    def unit_for(self, joint_unit: str) -> str:
        """Return the SI unit for a joint measured in `rad` or `m`."""
        force = "N.m" if joint_unit == "rad" else "N"
        below = f"({force})" if joint_unit == "rad" else force
        unit = self.unit.replace("/force", f"/{below}").replace("force", force)
        return unit.replace("length", joint_unit)


@dataclass(frozen=True, kw_only=True)
class Rows:
    """Base of rate laws, elements and growth: it checks parameter values and converts them to a row for the kernels.

    NAME is used in files and commands. KIND is the integer by which kernels are selected; classes of one KIND share a kernel
    and differ in the free parameters. CLAIMS are sentences that the contract tests verify. WORDS is the name in reports if it
    differs from NAME. EXAMPLE is an instance for a joint with a friction of about 5 N.m.
    """

    NAME: ClassVar[str]
    KIND: ClassVar[int]
    PARAMETERS: ClassVar[dict[str, Parameter]]
    CLAIMS: ClassVar[tuple[str, ...]] = ()
    WORDS: ClassVar[str] = ""
    EXAMPLE: ClassVar[dict[str, Any]] = {}

    def __post_init__(self):
        for name, parameter in self.PARAMETERS.items():
            value = getattr(self, name)
            if _plain(value, parameter):
                continue
            value = np.asarray(value, dtype=np.float64)
            if value.ndim != (1 if parameter.many else 0):
                raise InvalidInput(
                    f"{self.NAME}: '{name}' must be {'a sequence of numbers' if parameter.many else 'one number'}, "
                    f"got shape {value.shape}.",
                    remedy=f"Its unit is {parameter.unit_for('rad')}.",
                )
            low, high = parameter.lower, parameter.upper
            if not np.all(np.isfinite(value)) or np.any(value < low) or np.any(value > high):
                raise InvalidInput(
                    f"{self.NAME}: '{name}' = {value.tolist()} is outside [{low}, {high}].",
                    remedy="Give a finite value inside the bounds.",
                )
            object.__setattr__(self, name, tuple(value.tolist()) if parameter.many else float(value))

    def values(self) -> dict[str, Any]:
        """Return the parameters by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def sections(self) -> int:
        """Return the number of sections over which the kernel loops, which is the first number of the row; 0 for none."""
        return 0

    def row(self) -> np.ndarray:
        """Return the parameters as the row that the kernels read, (P,)."""
        return np.array([getattr(self, name) for name in self.PARAMETERS], dtype=np.float64)


def _plain(value: float | tuple[float, ...], parameter: Parameter) -> bool:
    """Return whether a value is already a finite float within its bounds, or a tuple of such floats; otherwise it needs the
    full check.
    """
    if not parameter.many:
        return type(value) is float and parameter.lower <= value <= parameter.upper and value - value == 0.0
    low, high = parameter.lower, parameter.upper
    return type(value) is tuple and all(type(v) is float and low <= v <= high and v - v == 0.0 for v in value)


def by_name(names: Mapping[str, Any], base: type[R]) -> dict[str, type[R]]:
    """Return the laws in a module's namespace by NAME, in the order of KIND.

    Args:
        names: of the module.
        base: `Rate` or `Element`.
    """
    laws = [x for x in names.values() if isinstance(x, type) and issubclass(x, base) and x is not base]
    return {law.NAME: law for law in sorted(laws, key=lambda law: law.KIND)}


def kernels_of(classes: Iterable[type[Rows]], name: str) -> dict[int, Callable[..., Any]]:
    """Return the kernels of laws by KIND: the functions of this name in their files.

    Raises:
        ValueError: two laws with different kernels have the same number, or a number is not from 0 to 62.
    """
    kernels: dict[int, Callable[..., Any]] = {}
    for law in classes:
        kernel = getattr(sys.modules[law.__module__], name)
        if kernels.setdefault(law.KIND, kernel) is not kernel or not 0 <= law.KIND < 63:
            raise ValueError(f"KIND {law.KIND} of '{law.NAME}' is taken, or not from 0 to 62.")
    return kernels


@dataclass(frozen=True, kw_only=True)
class Rate(Rows):
    """Base of rate laws: the friction torque at a velocity.

    Attributes:
        SMOOTH: the law vanishes continuously at rest; it has no Coulomb torque that a presliding element could carry.
        SYMMETRIC: friction is equal in both directions for all parameters.
        TIES: parameters that a fit cannot separate from a constant torque. If such a torque is fitted, each
            takes the value of the parameter named here.
        NEEDS: inputs besides the velocity: `load`, `temperature`, both or none.
        RESISTS: the viscous part never drives the joint, whatever the parameters within their bounds: kernels need not look.
        MARK: fraction added to p[0], the size of the row, as a mark for the kernels.
    """

    SMOOTH: ClassVar[bool] = False
    SYMMETRIC: ClassVar[bool] = True
    MARK: ClassVar[float] = 0.0
    TIES: ClassVar[dict[str, str]] = {}
    NEEDS: ClassVar[tuple[str, ...]] = ()
    RESISTS: ClassVar[bool] = False

    def span(
        self, load: tuple[float, float] = (0.0, 0.0), temperature: float = 20.0
    ) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the extremes of a rate law over all speeds along +q and along -q, as a presliding element sees them.

        Args:
            load: motor-side and external torque [N.m or N].
            temperature: [degC].

        Returns:
            Smallest and largest Coulomb torque [N.m or N] and smallest viscous coefficient [N.m.s/rad or N.s/m], by direction.
        """
        found: list[tuple[float, float, float]] = []
        for curve in self.curves(load, temperature).values():
            bounds = [bound + min(viscous, 0.0) for _, bound, viscous in curve]
            found.append(
                (min(bounds), max(bounds), min(max(viscous, 0.0) / speed for speed, _, viscous in curve))
            )
        return found[0], found[1]

    def curves(
        self, load: tuple[float, float], temperature: float
    ) -> dict[float, list[tuple[float, float, float]]]:
        """Return speed, Coulomb and viscous torque against the motion at many speeds, by direction 1 and -1.

        Args:
            load: motor-side and external torque [N.m or N].
            temperature: [degC].
        """
        from backdrive.laws import kernels

        limits, row = kernels.of_kinds(kernels.limits, self.KIND, plain=not self.MARK), self.row()
        row = np.concatenate([[row.size + self.MARK], row])
        result: dict[float, list[tuple[float, float, float]]] = {}
        for way in (1.0, -1.0):
            result[way] = []
            for speed in SPEEDS:
                lo, hi, viscous = limits(self.KIND, row, way * speed, load, temperature)
                result[way].append((speed, float(hi if way > 0.0 else -lo), float(way * viscous)))
        return result


@dataclass(frozen=True, kw_only=True)
class Element(Rows):
    """Base of presliding elements: how the torque of a rate law builds up and relaxes at reversals.

    Attributes:
        SLIDER: the viscous part of the rate law uses the slider's velocity. Otherwise it uses the joint's; where it would
            then drive the joint (falling sections of a polyline), it narrows the bounds instead.
        DRIFTS: a vibration below break-away lets the element drift, cycle by cycle.
        STEADY: at constant velocity the torque is that of the rate law.
        ZONE: in a zone of low velocity the torque is zero, including the viscous part.
        SET_VALUED: at rest the torque balances all others; `step` returns 0 there, and `solve` holds the joint.
        STATE_ROW: the state is an array. `step(p, e, x, y, lo, hi, dp, dt) -> torque` reads it from x and writes the next to y,
            which may be x. Otherwise the state is one number z, and `step(p, e, z, lo, hi, dp, dt) -> z, torque`. With SLIDER
            or ZONE, `step` also returns the motion that the viscous part uses.

    Often most of a step does not depend on the state. The element's file may then offer for this part
    `ahead(p, e, lo, hi, dp) -> a, b` and `weight(p, e, v) -> c`, with `follow(z, a, b) -> after` and
    `torque(p, e, z, after, c, dt)`, and compose `step` from these. Loops then evaluate the first two for several ticks at once.
    """

    SLIDER: ClassVar[bool] = False
    ZONE: ClassVar[bool] = False
    DRIFTS: ClassVar[bool] = False
    STEADY: ClassVar[bool] = True
    SET_VALUED: ClassVar[bool] = False
    STATE_ROW: ClassVar[bool] = False

    def states(self) -> int:
        """Return the number of states of the element."""
        return 0

    def advice(self, rate: Rate, load: tuple[float, float] = (0.0, 0.0), temperature: float = 20.0) -> str:
        """Return a warning on this element with that rate law, or an empty string.

        Not an error: the law is defined, but it may create energy.

        Args:
            rate: the rate law.
            load: motor-side and external torque [N.m or N].
            temperature: [degC].
        """
        return ""
