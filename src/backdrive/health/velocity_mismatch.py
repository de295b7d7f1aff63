"""A velocity that is not the derivative of the position."""

from __future__ import annotations

from collections.abc import Sequence

from backdrive.health._exam import Exam
from backdrive.health._finding import Check, Finding, Repair
from backdrive.health._velocity_fit import velocity_fit
from backdrive.health.degrees import unlike

NAME = "velocity-mismatch"
#: Scale off by more than this; residual from which velocity is another quantity [1].
SCALE, NONSENSE = 0.15, 0.4
#: A filter's delay is below this; in samples, and in seconds.
DELAY_SAMPLES, DELAY = 6.0, 0.025


def find(exam: Exam) -> list[Finding]:
    """Report a velocity of wrong sign or scale, one that lags far behind, and one that is something else."""
    findings = []
    for j, joint in exam:
        fit = velocity_fit(exam, j)
        if fit is None or unlike(exam, j) is not None:
            continue
        late = max(DELAY_SAMPLES * exam.period, DELAY)
        severity, value = "spoils", fit.scale
        if fit.residual > NONSENSE:
            value = fit.residual
            sentence = f"velocity of {joint} is not the derivative of its position: {100 * fit.residual:.0f} % of the motion is unexplained."
        elif fit.scale < 0:
            sentence = (
                f"velocity of {joint} has the opposite sign of its position's change (ratio {fit.scale:.3g})."
            )
        elif abs(fit.scale - 1) > SCALE:
            sentence = (
                f"velocity of {joint} is off by a factor: its position changes {fit.scale:.3g} times as fast."
            )
        elif abs(fit.delay) > late:
            severity, value = "warn", fit.delay
            way = "lags" if fit.delay > 0 else "leads"
            sentence = f"velocity of {joint} {way} its position by {1e3 * abs(fit.delay):.0f} ms ({abs(fit.delay) / exam.period:.0f} samples)."
        elif abs(fit.delay) > max(1.5 * exam.period, 3e-3):
            severity, value = "note", fit.delay
            sentence = (
                f"velocity of {joint} comes {1e3 * fit.delay:.1f} ms after its position, as out of a filter."
            )
        else:
            continue
        findings.append(
            Finding(
                name=NAME,
                joint=joint,
                channel="velocity",
                severity=severity,
                sentence=sentence,
                remedy="Leave velocity out, so that it is derived from position (--repair does), or correct it with --map.",
                value=value,
                repairable=severity != "note",
            )
        )
    return findings


def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Leave velocity out; of the two, position is nearer to what the encoder counted."""
    who = ", ".join(str(f.joint) for f in findings)
    return Repair(
        exam.log.replace(velocity=None).noted(f"velocity was left out: it contradicts the position of {who}.")
    )


CHECK = Check(NAME, "a velocity that is not the derivative of the position", find, repair)
