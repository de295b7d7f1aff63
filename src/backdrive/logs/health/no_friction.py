"""A torque without friction: computed by a model rather than measured, or of a joint that sticks and yields like a spring."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check
from backdrive.logs.health.torque_sign import friction

#: Friction significantly below this share of the torque's scatter counts as absent [1].
SHARE = 0.02
#: Least part of the torque's variance that a straight line over the position explains where the joint sticks [1].
STRAIGHT = 0.99
STICKS = (
    "Torque ramps of a joint that sticks look like this, and --method ramp reads its stiffness and a bound of its friction from "
    "them. Of other motion, make sure that the torque was measured, not computed from a model of the robot."
)


@check("no-friction", "a torque without friction")
def find(exam: Exam) -> Iterator[Finding]:
    """Report joints whose friction torque plus three standard errors is below `SHARE` of the torque's scatter.

    Torque ramps below break-away have none either: the joint sticks, and its torque rises with the position like a spring's.
    """
    for j, joint in exam:
        estimate = friction(exam, j)
        if estimate is None:
            continue
        mean, error, scatter = estimate
        if not abs(mean) + 3 * error < SHARE * scatter:
            continue
        about = exam.log.joints[j]
        unit, stiffness = about.torque_unit, _spring(exam, j)
        spring = f" It rises with the position like a spring of {stiffness:.3g} {unit}/{about.unit}."
        yield Finding(
            joint=joint,
            channel="torque",
            severity="note",
            sentence=(
                f"torque of {joint} shows no friction: {mean:.2g} {unit} (standard error {error:.1g}) in a torque that "
                f"scatters by {scatter:.3g} {unit}.{spring if stiffness else ''}"
            ),
            remedy=STICKS
            if stiffness
            else "Make sure that the torque was measured, not computed from a model of the robot.",
            value=mean,
        )


def _spring(exam: Exam, j: int) -> float:
    """Return the slope of a torque that is a rising straight line over the position [N.m/rad or N/m]; 0 where it is none."""
    if not exam.usable("position", j):
        return 0.0
    q, u = exam.sample("position", j), exam.sample("torque", j)
    q, u = q - q.mean(), u - u.mean()
    moment, size = float(q @ u), float(np.sqrt((q @ q) * (u @ u)))
    return moment / float(q @ q) if moment > 0.0 and moment > np.sqrt(STRAIGHT) * size else 0.0
