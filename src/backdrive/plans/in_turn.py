"""One joint after the other, the others held."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from backdrive.errors import InvalidInput, UnknownName
from backdrive.parameters import FINITE, NOT_NEGATIVE, number
from backdrive.plans.arm import ArmPlan
from backdrive.plans.base import PlanFace, check_name, instants, settle


@dataclass(frozen=True, kw_only=True)
class Hold:
    """A joint that does not move.

    Attributes:
        joint: its name.
        position: where it is held [rad or m].
        unit: `rad` or `m`.
    """

    joint: str
    position: float
    unit: Literal["rad", "m"] = "rad"

    def __post_init__(self):
        settle(self, finite=("position",))


@dataclass(frozen=True)
class InTurn(PlanFace):
    """Plans of single joints, one after the other; the position controllers hold the other joints.

    Every plan begins and ends at rest at its `home`, where its joint waits before and after its turn.
    Arrays have one column a joint: those of the plans in order, then those that are held throughout.

    Attributes:
        plans: one a joint, all of positions or all of torques; their own `start` is replaced.
        held: joints without a turn.
        pause: rest between two turns [s].
        start: instant at which the first turn begins, on the log's clock [s].
    """

    plans: tuple[Any, ...]
    _: KW_ONLY
    held: tuple[Hold, ...] = ()
    pause: float = 0.5
    start: float = 0.0

    kind: ClassVar[str] = "in-turn"

    def __post_init__(self):
        object.__setattr__(self, "plans", tuple(self.plans))
        object.__setattr__(self, "held", tuple(self.held))
        object.__setattr__(self, "pause", number("InTurn.pause", self.pause, NOT_NEGATIVE))
        object.__setattr__(self, "start", number("InTurn.start", self.start, FINITE))
        if not self.plans or any(isinstance(p, InTurn) for p in self.plans):
            raise InvalidInput("InTurn needs plans of single joints.", remedy="Give at least one.")
        if len({p.commands for p in self.plans}) > 1:
            raise InvalidInput(
                "Some of the plans command positions and some torques.",
                remedy="Drive them one after the other as two plans.",
            )
        for name in self.joints:
            check_name(name)
        if len(set(self.joints)) < len(self.joints):
            raise InvalidInput(
                f"A joint has more than one turn: {', '.join(self.joints)}.", remedy="Give each joint one."
            )
        begin, placed = self.start, []
        for plan in self.plans:
            placed.append(replace(plan, start=begin))
            begin += plan.duration + self.pause
        object.__setattr__(self, "plans", tuple(placed))

    @property
    def commands(self) -> str:
        """What the plans command: `position` or `torque`."""
        return self.plans[0].commands

    @property
    def joints(self) -> tuple[str, ...]:
        """Joint names, in column order."""
        return (*(p.joint for p in self.plans), *(h.joint for h in self.held))

    @property
    def units(self) -> tuple[str, ...]:
        """`rad` or `m`, in column order."""
        return (*(p.unit for p in self.plans), *(h.unit for h in self.held))

    def plan_of(self, joint: str) -> Any:
        """Return the plan of one joint, its `start` on the log's clock.

        Raises:
            UnknownName: the joint has no turn.
        """
        for plan in self.plans:
            if plan.joint == joint:
                return plan
        raise UnknownName(
            f"Joint '{joint}' has no turn in this plan.",
            remedy=f"Those that have: {', '.join(p.joint for p in self.plans)}.",
        )

    @cached_property
    def home(self) -> np.ndarray:
        """Where each joint waits [rad or m], (J,)."""
        if self.commands == "torque":
            raise InvalidInput(
                "A torque plan has no positions at which the joints wait.", remedy="Use `torque(t)`."
            )
        return np.array([*(p.home for p in self.plans), *(h.position for h in self.held)])

    def _columns(self, t: Any, of: Callable[[Any, np.ndarray], np.ndarray], held: np.ndarray) -> np.ndarray:
        t = instants(t)
        result = np.empty((*t.shape, len(self.joints)))
        result[...] = held
        for column, plan in enumerate(self.plans):
            result[..., column] = of(plan, t)
        return result

    def position(self, t: Any) -> np.ndarray:
        """Return the positions [rad or m] at instants t [s], the shape of t and (J,)."""
        return self._columns(t, lambda plan, x: plan.position(x), self.home)

    def velocity(self, t: Any) -> np.ndarray:
        """Return the velocities [rad/s or m/s] at instants t [s], the shape of t and (J,)."""
        return self._columns(t, lambda plan, x: plan.velocity(x), np.zeros(len(self.joints)))

    def acceleration(self, t: Any) -> np.ndarray:
        """Return the accelerations [rad/s^2 or m/s^2] at instants t [s], the shape of t and (J,)."""
        return self._columns(t, lambda plan, x: plan.acceleration(x), np.zeros(len(self.joints)))

    def torque(self, t: Any) -> np.ndarray:
        """Return the commanded torques [N.m or N] at instants t [s], the shape of t and (J,); 0 for joints that are held."""
        if self.commands != "torque":
            raise InvalidInput("This plan commands positions, not torques.", remedy="Use `position(t)`.")
        return self._columns(t, lambda plan, x: plan.torque(x), np.zeros(len(self.joints)))

    def windows(self) -> np.ndarray:
        """Return the start and end of each joint's turn on the log's clock [s], (plans, 2)."""
        return np.array([(p.start, p.start + p.duration) for p in self.plans])

    @property
    def duration(self) -> float:
        """From the start of the first turn to the end of the last [s]."""
        return float(self.plans[-1].start + self.plans[-1].duration - self.start)


def plan_of(plan: Any, joint: str) -> Any:
    """Return the part of a plan for one joint. A plan of a single joint is returned itself, whatever the joint's name in the
    log.

    Args:
        plan: of a single joint, an `InTurn` or an `ArmPlan`.
        joint: its name in the log.

    Raises:
        UnknownName: the joint has no turn.
    """
    return plan.plan_of(joint) if isinstance(plan, (ArmPlan, InTurn)) else plan
