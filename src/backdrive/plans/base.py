"""Common parts of all motion plans: checks of their numbers, and quantities in words."""

from __future__ import annotations

import math
from dataclasses import MISSING, dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol

import numpy as np

from backdrive._upper import Display, upper
from backdrive.errors import InvalidInput
from backdrive.parameters import FINITE, NOT_NEGATIVE, POSITIVE, number, whole

MOST_CYCLES = 10_000
#: Every plan of a single joint by its kind. A plan is one file, which is imported in `backdrive.plans`.
KINDS: dict[str, type[Plan]] = {}


class Options(Protocol):
    """Options of `backdrive plan`, in SI units."""

    def need(self, name: str) -> Any:
        """Return an option; an error where it is not given."""
        ...

    def subset(self, *names: str) -> dict[str, Any]:
        """Return those of some options that are given, by name."""
        ...


DEGREE = math.pi / 180.0


class PlanFace(Display):
    """Base class of all plans: what they show of themselves."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as the file of a plan holds them."""
        return upper("plans.plan_file", "plan_to_dict")(self)


@dataclass(frozen=True, kw_only=True)
class Plan(PlanFace):
    """Base class of the plans of one joint. Each plan has `duration` [s] and `windows()`, start and end of the parts from
    which the identification takes samples [s], (k, 2).

    Attributes:
        start: instant at which the plan begins, on the log's clock [s].
        joint: its name.
        unit: `rad` or `m`.
        kind: name of the kind of plan.
        commands: what it commands, `position` or `torque`.
        options: options of `backdrive plan` that apply to it, beside those common to all kinds.
    """

    start: float = 0.0
    joint: str = "joint"
    unit: Literal["rad", "m"] = "rad"

    kind: ClassVar[str]
    commands: ClassVar[str]
    options: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls):
        super().__init_subclass__()
        if "kind" in vars(cls):
            KINDS[cls.kind] = cls

    @classmethod
    def build(cls, options: Options, **common: Any) -> Plan:
        """Return the plan of options of the command line.

        Args:
            options: as given.
            common: fields common to all plans with the same command: joint and unit, and for a motion center and lead-in.
        """
        known = {f.name: f.default for f in fields(cls) if f.init and f.name in cls.options}
        must = {name: options.need(name) for name, default in known.items() if default is MISSING}
        return cls(**must, **options.subset(*(known.keys() - must.keys())), **common)


@dataclass(frozen=True, kw_only=True)
class MotionPlan(Plan):
    """A plan of a stroke about a center; each subclass has `_motion(t, order)`, `peak_velocity` [rad/s or m/s] and
    `peak_acceleration` [rad/s^2 or m/s^2].

    Attributes:
        stroke: full stroke, peak to peak [rad or m].
        center: middle of the stroke [rad or m].
        lead_in: duration of the motion to the start of its windows [s]; None: a gentle default.
    """

    stroke: float
    center: float = 0.0
    lead_in: float | None = None

    commands: ClassVar[str] = "position"
    if TYPE_CHECKING:

        @property
        def peak_acceleration(self) -> float:
            """Greatest acceleration [rad/s^2 or m/s^2]."""
            ...

        def _motion(self, t: np.ndarray, order: int) -> np.ndarray: ...

    def position(self, t: Any) -> np.ndarray:
        """Return the position [rad or m] at instants t [s], any shape."""
        return self._motion(instants(t), 0)[()]

    def velocity(self, t: Any) -> np.ndarray:
        """Return the velocity [rad/s or m/s] at instants t [s], any shape."""
        return self._motion(instants(t), 1)[()]

    def acceleration(self, t: Any) -> np.ndarray:
        """Return the acceleration [rad/s^2 or m/s^2] at instants t [s], any shape."""
        return self._motion(instants(t), 2)[()]

    @property
    def _lead(self) -> float:
        return self.lead_in or 0.0

    @property
    def home(self) -> float:
        """Position at which it begins and ends at rest [rad or m]."""
        return self.center

    @property
    def position_range(self) -> tuple[float, float]:
        """Bounds that the position does not leave [rad or m]."""
        return self.center - 0.5 * self.stroke, self.center + 0.5 * self.stroke

    def peak_torque(self, inertia: float, gravity: float = 0.0, friction: float = 0.0) -> float:
        """Return a torque that the plan never exceeds: the sum of the largest of each part [N.m or N].

        Args:
            inertia: about the joint [kg.m^2 or kg].
            gravity: largest gravity torque on the stroke [N.m or N].
            friction: friction torque at the highest speed [N.m or N].
        """
        return inertia * self.peak_acceleration + abs(gravity) + abs(friction)


def settle(
    plan: Any,
    *,
    positive: tuple[str, ...] = (),
    not_negative: tuple[str, ...] = (),
    finite: tuple[str, ...] = (),
) -> None:
    """Convert fields of a frozen plan to floats, and check them, the joint and the unit.

    Args:
        plan: under construction.
        positive: fields that must be above zero.
        not_negative: fields that must not be below zero.
        finite: fields that may be any finite number.

    Raises:
        InvalidInput: names the field and its value.
    """
    for names, bound in ((positive, POSITIVE), (not_negative, NOT_NEGATIVE), (finite, FINITE)):
        for name in names:
            value = number(f"{type(plan).__name__}.{name}", getattr(plan, name), bound)
            object.__setattr__(plan, name, value)
    if plan.unit not in ("rad", "m"):
        raise InvalidInput(f"The unit of a joint is '{plan.unit}'.", remedy="Give rad or m.")
    check_name(plan.joint)


def settle_count(plan: Any, name: str, most: int = MOST_CYCLES, least: int = 1) -> None:
    """Check that a field is a whole number from `least` to `most`.

    Raises:
        InvalidInput: it is not.
    """
    value = whole(f"{type(plan).__name__}.{name}", getattr(plan, name), least, most)
    object.__setattr__(plan, name, value)


def check_name(name: Any) -> None:
    """Refuse a joint name that could not be written into a table or a robot's message as it is.

    Raises:
        InvalidInput: it is empty, too long, has unprintable characters, or begins like a spreadsheet formula.
    """
    if not isinstance(name, str) or not name.strip() or len(name) > 200:
        raise InvalidInput(
            f"The joint's name is {str(name)[:40]!r}.", remedy="Give a name of 1 to 200 characters."
        )
    if not name.isprintable() or name != name.strip() or name[0] in "=+-@":
        raise InvalidInput(
            f"The joint's name is {name!r}.",
            remedy="Use printable characters, no blank around them, and begin with a letter.",
        )


def instants(t: Any) -> np.ndarray:
    """Return instants as an array of floats [s].

    Raises:
        InvalidInput: they are not finite numbers.
    """
    try:
        array = np.asarray(t, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(
            "The time holds something that is not a number.", remedy="Give seconds."
        ) from error
    if not np.all(np.isfinite(array)):
        raise InvalidInput("The time holds NaN or an infinite number.", remedy="Give finite seconds.")
    return array


def phrase(value: float, unit: str, toward: float = 0.0) -> str:
    """Return a quantity in words: rotary ones in degrees as well.

    Args:
        value: the quantity [unit].
        unit: `rad`, `rad/s`, `rad/s^2`, or any other.
        toward: +1 rounds up and -1 down, so that a limit copied from the text is valid; 0 rounds to the nearest.
    """
    text = f"{round_digits(value, toward):.4g} {unit}"
    if not unit.startswith("rad"):
        return text
    return f"{text} ({round_digits(value / DEGREE, toward):.4g} {unit.replace('rad', 'deg')})"


def between(edges: np.ndarray) -> np.ndarray:
    """Return the start and end of the intervals between neighbouring edges (k + 1,) [s], (k, 2)."""
    return np.column_stack([edges[:-1], edges[1:]])


def round_digits(value: float, toward: float) -> float:
    """Return a number to four digits, up for `toward` > 0, down for `toward` < 0."""
    if value == 0 or not math.isfinite(value) or toward == 0:
        return value
    step = 10.0 ** (math.floor(math.log10(abs(value))) - 3)
    return (math.ceil if toward > 0 else math.floor)(value / step) * step


def torque_unit(unit: str) -> str:
    """Return N.m for a rotary joint (`rad`), N for a linear one (`m`)."""
    return "N.m" if unit == "rad" else "N"
