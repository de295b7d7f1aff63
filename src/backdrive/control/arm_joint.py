"""Settings of one joint of an arm and of its motor: compensation, admittance and limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from backdrive.control.admittance import Admittance
from backdrive.control.joint_loop import JointLoop
from backdrive.errors import InvalidInput
from backdrive.parameters import FINITE, NOT_NEGATIVE, Bound, WithBounds
from backdrive.plans.limits import JointLimits

MARGIN = {"rad": 0.15, "m": 0.05}  # default depth of a wall
NARROW = 0.1  # largest default depth, as a share of the range
DAMPING = 1.0  # damping ratio of a joint against its wall
STIFFEST = 50.0  # largest angular frequency of a joint on its wall [rad/s]
SAMPLED = 0.06  # the same, times the period [-]
EFFORT = Bound(1e-6, 1e5, "N.m or N")


@dataclass(frozen=True, kw_only=True)
class ArmJoint(WithBounds):
    """Settings of one joint of an arm: compensation, admittance and limits.

    If motors are coupled, `loop`, `inertia`, `gravity` and the `effort` of the limits are settings of the motor with the same
    number. The other settings belong to the joint.

    Attributes:
        loop: compensation of friction within its own limits.
        limits: range of the joint, and the largest total torque of its motor (`effort`).
        inertia: inertia of the motor, added to the rigid bodies [kg.m^2 or kg].
        offset: constant torque beside gravity, compensated together with it [N.m or N].
        admittance: virtual mass that the estimated external torque moves; None: a hand guides the joint.
        threshold: external torque that does not move the virtual mass [N.m or N].
        margin: depth of the soft walls before the ends of the range [rad or m]; None: 0.15 rad or 0.05 m, at most a tenth of the
            range.
        gravity: largest torque against gravity [N.m or N]; None: a quarter above the largest in 300 postures.
        wall: largest torque of walls and admittance [N.m or N]; None: `effort` minus `gravity` and compensation.

    Raises:
        InvalidInput: a setting or the effort is out of bounds, or the two walls together cover the range.
    """

    BOUNDS: ClassVar = dict.fromkeys(("inertia", "threshold", "margin", "gravity", "wall"), NOT_NEGATIVE) | {
        "offset": FINITE
    }

    loop: JointLoop
    limits: JointLimits
    inertia: float = 0.0
    offset: float = 0.0
    admittance: Admittance | None = None
    threshold: float = 0.0
    margin: float | None = None
    gravity: float | None = None
    wall: float | None = None

    def __post_init__(self):
        super().__post_init__()
        if not EFFORT.holds(self.limits.effort):
            raise InvalidInput(
                f"Joint '{self.limits.name}': the largest torque of the motor is {self.limits.effort:g}.",
                remedy=f"Give `JointLimits(effort=...)`, a number {EFFORT} {EFFORT.unit}.",
            )
        if 2.0 * self.depth >= self.limits.upper - self.limits.lower:
            raise InvalidInput(
                f"Joint '{self.limits.name}': walls of {self.depth:g} {self.limits.unit} take all of the range from "
                f"{self.limits.lower:g} to {self.limits.upper:g}.",
                remedy="Give a smaller `margin`.",
            )

    @property
    def depth(self) -> float:
        """Depth of the walls [rad or m]."""
        if self.margin is not None:
            return self.margin
        usual = MARGIN[self.limits.unit]
        size = self.limits.upper - self.limits.lower
        return min(usual, NARROW * size) if math.isfinite(size) else usual

    def walls(
        self, gravity: float, inertia: tuple[float, float], interval: float
    ) -> tuple[float, float, float]:
        """Return the largest torque of walls and admittance, and stiffness and lead time of the walls.

        The stiffness of a wall follows from its torque and depth. It is limited to the value at which a sampled spring is
        stable against the least inertia.

        Args:
            gravity: largest torque against gravity [N.m or N].
            inertia: least and largest of the joint with its motor [kg.m^2 or kg].
            interval: period [s].

        Returns:
            Limit [N.m or N], stiffness [N.m/rad or N/m], lead time [s].

        Raises:
            InvalidInput: at the end of the range a wall's torque does not exceed the limit of the compensation, so that the
                wall could not stop the joint.
        """
        left = self.limits.effort - gravity - self.loop.limit
        limit = left if self.wall is None else self.wall
        fastest = min(STIFFEST, SAMPLED / interval)
        stiffness = min(max(limit, 0.0) / max(self.depth, 1e-9), inertia[0] * fastest**2)
        bounded = math.isfinite(self.limits.lower) or math.isfinite(self.limits.upper)
        if limit < 0.0 or (bounded and stiffness * self.depth <= self.loop.limit):
            raise InvalidInput(
                f"Joint '{self.limits.name}': of {self.limits.effort:g} N.m or N, gravity takes up to {gravity:.4g} and the "
                f"compensation of friction {self.loop.limit:.4g}; walls of {max(stiffness * self.depth, 0.0):.4g} would not hold "
                "against that.",
                remedy="Give a smaller limit of compensation, walls that are stronger (`wall`) or deeper (`margin`), or the "
                "motor's `inertia`.",
            )
        lead = 2.0 * DAMPING * math.sqrt(inertia[1] / stiffness) if stiffness > 0.0 else 0.0
        return limit, stiffness, lead
