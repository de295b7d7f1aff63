"""A torque without friction: computed by a model rather than measured."""

from __future__ import annotations

from collections.abc import Iterator

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check
from backdrive.logs.health.torque_sign import friction

#: Friction significantly below this share of the torque's scatter counts as absent [1].
SHARE = 0.02


@check("no-friction", "a torque without friction")
def find(exam: Exam) -> Iterator[Finding]:
    """Report joints whose friction torque plus three standard errors is below `SHARE` of the torque's scatter."""
    for j, joint in exam:
        estimate = friction(exam, j)
        if estimate is None:
            continue
        mean, error, scatter = estimate
        if not abs(mean) + 3 * error < SHARE * scatter:
            continue
        unit = exam.log.joints[j].torque_unit
        yield Finding(
            joint=joint,
            channel="torque",
            severity="note",
            sentence=(
                f"torque of {joint} shows no friction: {mean:.2g} {unit} (standard error {error:.1g}) in a torque that "
                f"scatters by {scatter:.3g} {unit}."
            ),
            remedy="Make sure that the torque was measured, not computed from a model of the robot.",
            value=mean,
        )
