"""The limits of an arm's motion: violations as a smooth penalty for the search, and a strict check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.plans.arm import ArmPlan
from backdrive.plans.arm_collision import Clearance
from backdrive.plans.base import torque_unit
from backdrive.plans.limits import JointLimits
from backdrive.robot import Robot

NEAR = 0.06  # distance above the required one at which the penalty begins [m]
SHORT = 0.05  # missing distance whose penalty equals that of exceeding a limit by 100 % [m]
CHECKED = 1e-3  # longest time between the instants of a strict check [s]
MOST_CHECKED = 60_000
SIDES = 4000  # instants of the path at which distances are checked
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmBounds:
    """The limits of all joints, reduced by the margin, and the distances between links.

    Attributes:
        robot: the description.
        lower: [rad or m], (J,).
        upper: [rad or m], (J,).
        velocity: [rad/s or m/s], (J,).
        acceleration: [rad/s^2 or m/s^2], (J,).
        effort: of the actuator on the joint side [N.m or N], (J,).
        friction: expected at most, beside the rigid bodies' torque [N.m or N], (J,).
        clearance: of the links; None: not checked.
    """

    robot: Robot
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray
    friction: np.ndarray
    clearance: Clearance | None = None

    @classmethod
    def of(
        cls,
        robot: Robot,
        limits: Sequence[JointLimits],
        *,
        friction: np.ndarray,
        margin: float = 0.05,
        clearance: Clearance | None = None,
    ) -> ArmBounds:
        """Return the limits of joints with a share of each left unused: of the range, half of it at each end.

        Args:
            robot: the description.
            limits: in its order, all known.
            friction: expected at most [N.m or N], (J,).
            margin: that share [-].
            clearance: of the links.

        Raises:
            InvalidInput: the margin is no share below one half, or friction leaves a joint no torque.
        """
        if not 0.0 <= margin < 0.5:
            raise InvalidInput(f"The margin is {margin:g}.", remedy="Give a share from 0 to below 0.5.")
        lower, upper, velocity, acceleration, effort = (
            np.array([getattr(limit, name) for limit in limits], dtype=np.float64)
            for name in ("lower", "upper", "velocity", "acceleration", "effort")
        )
        room, rest = 0.5 * margin * (upper - lower), 1.0 - margin
        for limit, own in zip(limits, friction, strict=True):
            if not own < rest * limit.effort:
                raise InvalidInput(
                    f"Joint '{limit.name}': friction of {own:.4g} {torque_unit(limit.unit)} is all of its torque.",
                    remedy="Correct --friction or the torque limit.",
                )
        return cls(
            robot=robot,
            lower=lower + room,
            upper=upper - room,
            velocity=rest * velocity,
            acceleration=rest * acceleration,
            effort=rest * effort,
            friction=friction,
            clearance=clearance,
        )

    def shares(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Return every quantity over its limit, 1 where it is reached, (4, n, J): position, speed, acceleration, torque.

        Args:
            q: positions [rad or m], (n, J).
            dq: velocities [rad/s or m/s], (n, J).
            ddq: accelerations [rad/s^2 or m/s^2], (n, J).
            torque: of the rigid bodies [N.m or N], (n, J).
        """
        middle, half = 0.5 * (self.upper + self.lower), 0.5 * (self.upper - self.lower)
        return np.stack(
            [
                np.abs(q - middle) / half,
                np.abs(dq) / self.velocity,
                np.abs(ddq) / self.acceleration,
                np.abs(torque) / (self.effort - self.friction),
            ]
        )

    def penalty(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, torque: np.ndarray, by_state: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Return the sum of squares of relative limit violations, and its gradient by q, dq, ddq, (3, n, J).

        Args:
            q: positions [rad or m], (n, J).
            dq: velocities [rad/s or m/s], (n, J).
            ddq: accelerations [rad/s^2 or m/s^2], (n, J).
            torque: of the rigid bodies [N.m or N], (n, J).
            by_state: its gradient by q, dq and ddq, (3, n, J, J).
        """
        middle, half = 0.5 * (self.upper + self.lower), 0.5 * (self.upper - self.lower)
        over = np.maximum(self.shares(q, dq, ddq, torque) - 1.0, 0.0)
        total = float(np.sum(over**2))
        slope = np.empty((3, *q.shape))
        slope[0] = 2.0 * over[0] * np.sign(q - middle) / half
        slope[1] = 2.0 * over[1] * np.sign(dq) / self.velocity
        slope[2] = 2.0 * over[2] * np.sign(ddq) / self.acceleration
        pull = 2.0 * over[3] * np.sign(torque) / (self.effort - self.friction)
        slope += np.einsum("nj,snjk->snk", pull, by_state)
        if self.clearance is not None:
            near = float(self.clearance.needed.max(initial=0.0)) + NEAR
            distance, by_joint = self.clearance.gradient(q, near)
            short = np.maximum(self.clearance.needed - distance, 0.0) / SHORT
            total += float(np.sum(short**2))
            slope[0] -= np.einsum("nk,nkj->nj", 2.0 * short / SHORT, by_joint)
        return total, slope

    def violations(self, plan: ArmPlan) -> list[str]:
        """Return a sentence for every limit that a plan exceeds, or otherwise for links that come too close; checked every
        millisecond.

        Args:
            plan: of the robot's joints, in its order.
        """
        count = min(max(int(plan.duration / CHECKED), 1000), MOST_CHECKED)
        t = plan.start + np.linspace(0.0, plan.duration, count)
        q, dq, ddq = plan.position(t), plan.velocity(t), plan.acceleration(t)
        share = self.shares(q, dq, ddq, self.robot.inverse_dynamics(q, dq, ddq)).max(axis=1)
        names = ("position", "speed", "acceleration", "torque with friction")
        sentences = [
            f"Joint '{self.robot.joints[j]}': its {names[i]} reaches {100 * share[i, j]:.4g} % of the limit after the margin."
            for i, j in zip(*np.nonzero(share > 1.0 + _ROUNDING), strict=True)
        ]
        if not sentences and self.clearance is not None:
            path = plan.series(np.linspace(0.0, plan.period, SIDES, endpoint=False), 0)
            spare, links = self.clearance.narrowest(path)
            if spare < 0.0:
                sentences.append(f"{links[0]} and {links[1]} come {-1e3 * spare:.3g} mm closer than allowed.")
        return sentences
