"""Checks of an arm's result: inverted torque, insufficient motion, terms at a bound."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.arm_signals import ArmSignals
from backdrive.identification.arm_solve import Solution, correlation_length
from backdrive.identification.arm_terms import Rows, Terms
from backdrive.identification.evidence import sentences
from backdrive.robot import PER_LINK, Range, Robot

TELLING = 0.05  # least friction that determines the torque's sign, relative to a joint's torque [-]
ILL = 1000.0  # condition number above which the motion is poor [-]
GUESSED = 0.5  # reduction of a base parameter's prior variance below which it counts as undetermined [-]
SLOW = 0.02  # least top speed without a remark, relative to the fastest joint of the same unit [-]
SURE = 3.0  # distance of a free estimate beyond a bound above which there is a remark [standard error]
ONE_WAY = 0.1  # least time in each direction without a remark, relative to the moving time [-]
BEYOND = 0.05  # tolerance of a joint's range for inexact encoder zeros, relative to the range [-]
SPAN = 25.0  # stroke that most joints of an arm cannot have [rad]
LARGE_OFFSET = 0.3  # largest offset without a remark, relative to the mean friction [-]


def refuse_inversion(rows: Rows, robot: Robot, terms: Sequence[Terms]) -> None:
    """Raise an error if friction would drive a joint, which shows that the torque's sign is inverted.

    Each joint is fitted alone, with bodies of either sign, so that a joint with inverted torque does not affect the check of
    the others. If the motion is too poor for that fit, no joint is refused.

    Args:
        rows: filtered and thinned.
        robot: the description.
        terms: of every joint.

    Raises:
        NotIdentifiable: names the joints.
    """
    inverted = []
    for j, t in enumerate(terms):
        k = t.knots.size
        used = rows.weight[:, j] > 0
        if np.count_nonzero(used) < 4 * rows.bodies.shape[2]:
            continue
        own, torque = rows.friction[j][used], rows.torque[used, j]
        coulomb = own[:, : 2 * k].sum(axis=1)
        viscous = own[:, :k] @ t.knots + own[:, k : 2 * k] @ t.knots
        columns = np.column_stack([coulomb, viscous, own[:, 2 * k : 2 * k + 2], rows.bodies[used, j]])
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        theta, _, rank, _ = np.linalg.lstsq(columns / size, torque, rcond=1e-6)
        error = torque - columns @ (theta / size)
        freedom = error.size / correlation_length(error, rows.rate) - rank
        friction = (columns / size)[:, :2] @ theta[:2]
        along = np.zeros(theta.size)  # friction @ coulomb = along @ theta
        along[:2] = coulomb @ (columns / size)[:, :2]
        doubt = np.linalg.norm(np.linalg.lstsq((columns / size).T, along, rcond=1e-6)[0])
        doubt *= np.linalg.norm(error) / np.sqrt(max(freedom, 1.0))
        if friction @ coulomb < -SURE * doubt and np.linalg.norm(friction) > TELLING * np.linalg.norm(torque):
            inverted.append(robot.joints[j])
    if inverted:
        raise NotIdentifiable(
            f"Friction would push instead of brake in {', '.join(inverted)}: the torque's sign is inverted.",
            remedy="Turn it round, for example --map tau=-COLUMN, or correct the direction of the joint.",
            joints=inverted,
        )


def refuse_degrees(robot: Robot, stretches: Sequence[ArmSignals]) -> None:
    """Refuse positions in degrees: most of the arm's rotary joints move further than any do in radians.

    Raises:
        InvalidInput: names the joint that moves furthest, and the way out.
    """
    low = np.min([s.position.min(axis=0) for s in stretches], axis=0)
    high = np.max([s.position.max(axis=0) for s in stretches], axis=0)
    rotary = np.flatnonzero(np.array(robot.units) == "rad")
    span = (high - low)[rotary]
    if rotary.size > 1 and np.count_nonzero(span > SPAN) > 0.5 * rotary.size:
        furthest = robot.joints[rotary[int(np.argmax(span))]]
        raise InvalidInput(
            f"Joint '{furthest}' moves over {span.max():.4g} rad, and most joints that far: the positions look like degrees.",
            remedy="State the factor in the map, for example --map q=deg*q1..q6, or --unit deg where no map names the column.",
        )


def joints_at_zero(robot: Robot, whole: Robot) -> tuple[str, ...]:
    """Return remarks on joints of the description that the log does not hold, and on what the description cannot mean."""
    names = [name for name in whole.joints if name not in robot.joints]
    verb = "is not in the log: it is" if len(names) == 1 else "are not in the log: they are"
    doubts = [
        line
        for line in whole.remarks
        if line.startswith(("Joint ", "An <equality>", "No body has"))
        and not any(f" {n} " in line for n in names)
    ]
    return (
        *sentences((names, f"{', '.join(names)} {verb} held at 0, part of the last link of the log.")),
        *doubts,
    )


def impossible(distance: float) -> tuple[str, ...]:
    """Return a warning if no physical bodies have base parameters within the errors of the fitted ones.

    Args:
        distance: squared distance of the nearest physical base parameters, divided by that which contains 95 % of all errors
            [-].
    """
    sentence = (
        f"No bodies of positive mass give the arm's torques (the nearest ones deviate by {np.sqrt(distance):.1f} "
        f"times the errors). The model lacks a term, such as frictional lag or a delay of the torque. Predicted "
        f"torques are still those of the best fit; single masses and inertias have no meaning."
    )
    return sentences((distance > 1.0, sentence))


def beyond_range(robot: Robot, stretches: Sequence[ArmSignals]) -> list[tuple[str, ...]]:
    """Return a warning for every joint that leaves the range of its description, for example because of another unit."""
    low = np.min([s.position.min(axis=0) for s in stretches], axis=0)
    high = np.max([s.position.max(axis=0) for s in stretches], axis=0)
    warnings = []
    for j, one in enumerate(robot.ranges or [Range()] * len(robot.joints)):
        slack = BEYOND * (one.upper - one.lower) if np.isfinite(one.upper - one.lower) else np.inf
        sentence = (
            f"In the log it moves from {low[j]:.3g} to {high[j]:.3g} {robot.units[j]}, beyond its range of {one.lower:.3g} to "
            f"{one.upper:.3g} in the description. Check the order of the joints (--names), the unit (degrees), the encoder's "
            "zero, and that the log is of this robot."
        )
        warnings.append(sentences((low[j] < one.lower - slack or high[j] > one.upper + slack, sentence)))
    return warnings


def remarks(robot: Robot, terms: Sequence[Terms], rows: Rows, solution: Solution) -> list[tuple[str, ...]]:
    """Return every joint's warnings, in the robot's order."""
    return [_remarks_of(robot, terms, rows, solution, j) for j in range(len(terms))]


def _remarks_of(
    robot: Robot, terms: Sequence[Terms], rows: Rows, solution: Solution, j: int
) -> tuple[str, ...]:
    used = rows.weight[:, j] > 0
    if not used.any():
        return ("It never moves: its friction is unknown and set to zero.",)
    unit, top, k = robot.units[j], terms[j].top, terms[j].knots.size
    fastest = max(o.top for o, other in zip(terms, robot.units, strict=True) if other == unit)
    ways = np.array([rows.friction[j][used, :k].sum(), -rows.friction[j][used, k : 2 * k].sum()])
    own, pushed = solution.own[j], solution.pushed[j]
    mean, offset = float(np.mean(own[: 2 * k])), own[2 * k]
    columns = robot.base.columns // PER_LINK == j
    bodiless = not robot.parameters[PER_LINK * j : PER_LINK * (j + 1)].any()
    guessed = int(np.sum(solution.told[columns] < GUESSED))
    return sentences(
        (top < SLOW * fastest, f"It moves at no more than {top:.2g} {unit}/s: the curve ends there."),
        (
            ways.min() < ONE_WAY * ways.sum(),
            "It moves almost only in one direction: the curve of the other direction was copied from that one.",
        ),
        (
            np.any(pushed[: 2 * k] > SURE),
            "Its friction is zero at some speed: another term may have absorbed it.",
        ),
        (
            pushed[2 * k + 1] > SURE,
            "The motor's inertia was estimated as zero: frictional lag or a delay of the torque may hide it.",
        ),
        (
            abs(offset) > LARGE_OFFSET * mean,
            f"The torque is offset by {offset:.2g}, not small beside the friction of {mean:.2g}: a sensor's offset, or friction "
            "that differs between the directions.",
        ),
        (
            bodiless,
            "The description gives its link no mass or inertia: values that the motion does not determine were set "
            "to zero.",
        ),
        (
            guessed,
            f"{guessed} of {int(columns.sum())} base parameters of its link are hardly determined and stay near the URDF's.",
        ),
        (
            solution.condition > ILL and j == 0,
            f"The motion excites the bodies poorly (condition number {solution.condition:.0f}): record a motion "
            f"with larger accelerations and more postures.",
        ),
        (own[-1] >= 1.0, "Load friction reached its bound of 100 %: check the torque's unit and the URDF."),
    )
