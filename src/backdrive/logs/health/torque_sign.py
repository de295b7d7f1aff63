"""A torque of inverted sign: its friction would drive the joint instead of braking it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from backdrive.logs.health._exam import Exam, once
from backdrive.logs.health._finding import Changes, Finding, Repair, check, columns_of, with_columns
from backdrive.logs.health._motion import jackknife, motion, normal_equations, solvable
from backdrive.logs.health.time_slip import REACH
from backdrive.logs.quantiles import quantile

#: The friction must be this many of its standard errors below zero, and this share of the torque's scatter.
SURE, SHARE = 4.0, 0.05
#: Each direction must have this share of the samples, above this share of the top speed.
_BOTH, _MOVING = 0.1, 0.05


@check("torque-sign", "a torque of inverted sign (friction must dissipate)")
def find(exam: Exam) -> list[Finding]:
    """Report joints whose friction torque, mean over the motion, is clearly negative.

    The torque is regressed on acceleration, sign of velocity, velocity, one and position. The second and third terms give the
    friction: their dissipated power divided by the mean speed. Its standard error comes from leaving out one stretch of the
    log at a time, so an unmodelled torque counts as uncertainty.
    """
    estimates = {j: friction(exam, j) for j, _ in exam}
    inverted = {j for j, estimate in estimates.items() if estimate and _certain(estimate, -1)}
    right = {j for j, estimate in estimates.items() if estimate and _certain(estimate, 1)}
    return [
        _finding(exam, j, joint, estimates[j], j in inverted)
        for j, joint in exam
        if j in inverted
        # a driver has one sign for all joints: if all joints with a clear sign are inverted, the others are inverted too
        or (len(inverted) > 1 and not right and exam.usable("torque", j) and not _positive(estimates[j]))
    ]


def _certain(estimate: tuple[float, float, float], sign: int) -> bool:
    mean, error, scatter = estimate
    return sign * mean > max(SURE * error, SHARE * scatter)


def _positive(estimate: tuple[float, float, float] | None) -> bool:
    return estimate is not None and estimate[0] > 0


def _finding(
    exam: Exam, j: int, joint: str, estimate: tuple[float, float, float] | None, certain: bool
) -> Finding:
    mean, error, _ = estimate or (np.nan, np.nan, np.nan)
    push = f"friction would drive it with {-mean:.3g} {exam.log.joints[j].torque_unit} (standard error {error:.2g})"
    if certain:
        why = f"has the opposite sign of its motion: {push}"
    elif estimate is not None:
        why = f"has the opposite sign like the other joints', though less surely: {push}"
    else:
        why = "is assumed to have the opposite sign like the other joints'; its own motion does not show it"
    return Finding(
        joint=joint,
        channel="torque",
        severity="spoils",
        sentence=f"torque of {joint} {why}.",
        remedy="Turn the torque's sign (--repair does, or --map tau=-COLUMN); or position and velocity, if it is they.",
        value=mean,
        repairable=True,
    )


@once
def friction(exam: Exam, j: int) -> tuple[float, float, float] | None:
    """Return mean friction torque, its standard error and the torque's standard deviation [N.m or N]; None if undetermined."""
    m = motion(exam, j, REACH)
    if m is None:
        return None
    moving = np.abs(m.velocity) > _MOVING * quantile(np.abs(m.velocity), 0.99)
    if moving.sum() < 60 or not _BOTH < np.mean(m.velocity[moving] > 0) < 1 - _BOTH:
        return None
    x = m.terms[moving, : m.plain]
    y = m.torque[:, REACH : REACH + 1][moving]
    gram, cross, _ = normal_equations(x, y, m.fold[moving])
    if gram.shape[0] < 4:
        return None
    v = m.velocity[moving]
    # power of a column of friction per mean speed: E[column * v] / E|v|
    weight = np.zeros(x.shape[1])
    weight[1], weight[2] = np.mean(x[:, 1] * v), np.mean(x[:, 2] * v)
    weight /= np.mean(np.abs(v))
    total, right = solvable(gram.sum(axis=0)), cross.sum(axis=0)
    whole = cast("np.ndarray", np.linalg.solve(total, right))
    mean = float(weight @ whole[:, 0])
    without = cast("np.ndarray", np.linalg.solve(total - gram, right - cross))
    left = without[:, :, 0] @ weight
    return mean, jackknife(left), float(np.std(y))


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Turn the sign of the torque, and of a model torque only if it goes with it."""
    changes: Changes = {}
    notes: list[str] = []
    for finding, _, j, _ in columns_of(exam, findings):
        changes["torque", j] = -exam.column("torque", j)
        notes.append(f"torque of {finding.joint} was multiplied by -1.")
    return Repair(with_columns(exam.log, changes, notes))
