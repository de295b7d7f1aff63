"""Standard errors of an arm's parameters: those expected from a planned motion, and those achieved by a fit.

Expected errors come from the rows that the fit would build from the motion, with white noise in place of the torque residual.
`noise` is its standard deviation below 5 Hz, the band of the fit, which contains ten independent values per second.

    Coulomb and viscous friction: least-squares line through the knots of the curve at which the joint slides, mean of both
    directions

A curve is not a straight line, and another motion covers other parts of it. The achieved errors of Coulomb and viscous
friction therefore include the scatter of the knots about the line, beside the errors of the knots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.arm_signals import ArmSignals, resting
from backdrive.identification.arm_solve import Solution, expect
from backdrive.identification.arm_terms import Regressor, Terms, build, terms_of
from backdrive.logs.log import Log
from backdrive.plans.arm import ArmPlan
from backdrive.robot import PARAMETERS, PER_LINK, Robot

RATE = 100.0  # sampling rate of a planned motion [Hz]
TOLD = 0.5  # share of a parameter's variance due to noise, below which priors determine the parameter [-]
LINE = ("coulomb", "viscous", "offset", "inertia")  # reported parameters of a joint
UNITS = ("kg", *["kg.m"] * 3, *["kg.m^2"] * 6)


@dataclass(frozen=True, kw_only=True)
class StandardError:
    """The standard error of one parameter.

    Attributes:
        name: `coulomb`, `viscous`, `offset`, `inertia` of the motor, or a base parameter of the joint's link, such as `mx`
            with the parameters grouped with it.
        joint: name of the joint.
        unit: of the parameter.
        expected: standard error from motion and noise; None: not computed.
        achieved: standard error of the fit; None: nothing was fitted.
        shows: True if the error comes mainly from noise; False if it comes from priors, since the motion hardly determines
            the parameter.
    """

    name: str
    joint: str
    unit: str
    expected: float | None
    achieved: float | None = None
    shows: bool = True

    @property
    def of_friction(self) -> bool:
        """Whether the parameter is Coulomb or viscous friction."""
        return self.name in ("coulomb", "viscous")


def signals_of(plan: ArmPlan, robot: Robot) -> ArmSignals:
    """Return the motion of a plan as signals without torque, with joints in the robot's order.

    Raises:
        InvalidInput: the joints of plan and robot differ.
    """
    if set(plan.joints) != set(robot.joints):
        raise InvalidInput(
            f"The plan moves {', '.join(plan.joints)}, the arm has {', '.join(robot.joints)}.",
            remedy="Use the plan that was made with this description.",
        )
    order = [plan.joints.index(name) for name in robot.joints]
    time = plan.start + np.arange(int(plan.duration * RATE) + 1) / RATE
    q, dq, ddq = (f(time)[:, order] for f in (plan.position, plan.velocity, plan.acceleration))
    every = np.ones(time.size, dtype=bool)
    return ArmSignals(
        time=time,
        position=q,
        velocity=dq,
        acceleration=ddq,
        torque=np.zeros_like(q),
        rate=RATE,
        fitted=every,
        held_out=~every,
    )


def forecast_errors(
    signals: Sequence[ArmSignals],
    robot: Robot,
    noise: np.ndarray,
    friction: np.ndarray,
    terms: Sequence[Terms] | None = None,
) -> list[StandardError]:
    """Return the expected standard error of every parameter.

    Args:
        signals: of the motion; without torque, that of the description is used.
        robot: the description.
        noise: expected torque residual below 5 Hz [N.m or N], (J,).
        friction: approximate friction [N.m or N], (J,).
        terms: of every joint; None: from the speeds of the motion.
    """
    own = terms or terms_along(signals, len(robot.joints))
    moved = [s if np.any(s.torque) else _with_torque(s, robot, friction) for s in signals]
    covariance, by_noise = expect(build(Regressor(robot, moved), own), robot, own, noise)
    table, names = _combinations(robot, own)
    spread = np.einsum("kp,pq,kq->k", table, covariance, table)
    told = np.einsum("kp,pq,kq->k", table, by_noise, table)
    return [
        StandardError(**name, expected=float(np.sqrt(max(v, 0.0))), shows=bool(v0 > TOLD * v))
        for name, v, v0 in zip(names, spread, told, strict=True)
    ]


def _with_torque(s: ArmSignals, robot: Robot, friction: np.ndarray) -> ArmSignals:
    """Return a planned motion with the torque that it requires according to the description."""
    torque = robot.inverse_dynamics(s.position, s.velocity, s.acceleration) + friction * np.sign(s.velocity)
    return replace(s, torque=torque)


def terms_along(signals: Sequence[ArmSignals], J: int) -> list[Terms]:
    """Return every joint's terms, from its speeds in the fitted samples."""
    top = np.max([np.quantile(np.abs(s.velocity), 0.999, axis=0) for s in signals], axis=0)
    moves = [~resting(s.velocity, top, s.rate) & s.fitted[:, None] for s in signals]
    speeds = [
        np.concatenate([np.abs(s.velocity[m[:, j], j]) for s, m in zip(signals, moves, strict=True)])
        for j in range(J)
    ]
    return [terms_of(speed) for speed in speeds]


def compare_errors(
    logs: Sequence[Log],
    signals: Sequence[ArmSignals],
    robot: Robot,
    terms: Sequence[Terms],
    solution: Solution,
) -> list[StandardError]:
    """Return expected and achieved standard errors of a fit.

    Expected errors use motion and noise of the plans. If a log has no plan of the arm, they use the logs' motion and the
    residual of the fit, taken as white noise.

    Args:
        logs: fitted logs, linked to their plans if they have any.
        signals: of these logs.
        robot: the description.
        terms: of the fit.
        solution: the fit.
    """
    noise, motion = solution.noise, list(signals)
    plans = [log.plan for log in logs]
    coupled = any(s.coupling is not None for s in signals)  # a plan describes joints, not motors
    of_arm = all(isinstance(p, ArmPlan) and p.noise and set(p.joints) == set(robot.joints) for p in plans)
    if of_arm and not coupled:
        motion = [signals_of(p, robot) for p in plans]
        noise = np.array([plans[0].noise[plans[0].joints.index(name)] for name in robot.joints])
    k = [t.knots.size for t in terms]
    friction = np.array([float(np.mean(own[: 2 * n])) for own, n in zip(solution.own, k, strict=True)])
    expected = forecast_errors(motion, robot, noise, friction, terms)
    table, _ = _combinations(robot, terms)
    variance = np.maximum(np.einsum("kp,pq,kq->k", table, solution.everything, table), 0.0)
    for j, t in enumerate(terms):
        row = robot.base.columns.size + len(LINE) * j
        variance[row : row + 2] += _lack_of_fit(t, solution.own[j], solution.covariance(j))
    achieved = np.sqrt(variance)
    return [replace(e, achieved=float(a)) for e, a in zip(expected, achieved, strict=True)]


def _lack_of_fit(t: Terms, own: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the additional variances of Coulomb and viscous friction if the curve is not a straight line, (2,).

    Args:
        t: terms of a joint.
        own: coefficients of the joint, (2 k + 3,).
        covariance: of these coefficients, (2 k + 3, 2 k + 3).
    """
    slides, k = t.sliding, t.knots.size
    left = np.count_nonzero(slides) - 2
    if left < 1:
        return np.zeros(2)
    A = np.column_stack([np.ones(left + 2), t.knots[slides]])
    mean = 0.5 * np.hstack([np.eye(k), np.eye(k)])[slides]  # of both directions
    scatter = mean - A @ (np.linalg.pinv(A) @ mean)
    power = np.sum((scatter @ own[: 2 * k]) ** 2) - np.trace(
        scatter @ covariance[: 2 * k, : 2 * k] @ scatter.T
    )
    return max(float(power), 0.0) / left * np.diag(np.linalg.inv(A.T @ A))


def _combinations(robot: Robot, terms: Sequence[Terms]) -> tuple[np.ndarray, list[dict[str, Any]]]:
    """Return the reported combinations of coefficients, (k, p), and their names, joints and units."""
    columns = robot.base.columns
    first = columns.size + np.concatenate([[0], np.cumsum([t.size for t in terms])]).astype(int)
    rows, names = [], []
    for i, column in enumerate(columns):
        row = np.zeros(first[-1])
        row[i] = 1.0
        rows.append(row)
        joint, which = robot.joints[column // PER_LINK], column % PER_LINK
        names.append({"name": PARAMETERS[which], "joint": joint, "unit": UNITS[which]})
    for j, t in enumerate(terms):
        n, newton = t.knots.size, "N.m" if robot.units[j] == "rad" else "N"
        line = np.zeros((2, n))
        line[:, t.sliding] = np.linalg.pinv(np.column_stack([np.ones(n), t.knots])[t.sliding])
        parts = (np.tile(0.5 * line[0], 2), np.tile(0.5 * line[1], 2), None, None)
        units = (
            newton,
            f"{newton}.s/{robot.units[j]}",
            newton,
            "kg.m^2" if robot.units[j] == "rad" else "kg",
        )
        for name, part, unit in zip(LINE, parts, units, strict=True):
            row = np.zeros(first[-1])
            if part is not None:
                row[first[j] : first[j] + 2 * n] = part
            else:
                row[first[j] + 2 * n + (name == "inertia")] = 1.0
            rows.append(row)
            names.append({"name": name, "joint": robot.joints[j], "unit": unit})
    return np.array(rows), names
