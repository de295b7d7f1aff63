"""A velocity that is not the derivative of the position."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, Repair, Severity, check
from backdrive.logs.health._velocity_fit import VelocityFit, velocity_fit
from backdrive.logs.health.degrees import unlike

#: Largest error of the scale; residual above which velocity is another quantity [1].
SCALE, NONSENSE = 0.15, 0.4
#: Error of the scale above which it is reported, if it exceeds this many standard errors [1].
CLOCK, SURE = 0.02, 3.0
#: A filter's delay is below this; in samples, and in seconds.
DELAY_SAMPLES, DELAY = 6.0, 0.025
#: And the delay explains what position and velocity do not share: without it this many times as much is left.
_HELPS = 1.5
BY_HAND = (
    "Compare the clock and both scales with the machine; correct one with --map, or do not map the velocity."
)


@check("velocity-mismatch", "a velocity that is not the derivative of the position")
def find(exam: Exam) -> Iterator[Finding]:
    """Report a velocity of wrong sign or scale, one that lags far behind, and one that is something else."""
    for j, joint in exam:
        fit = velocity_fit(exam, j)
        if fit is None or unlike(exam, j) is not None:
            continue
        said = _say(fit, exam.period, f"velocity of {joint}")
        if said is None:
            continue
        severity, quantity, value, sentence = said
        mend = "Leave velocity out, so that it is derived from position (--repair does), or correct it with --map."
        mend = BY_HAND if _clock(fit) else mend
        keep = "No action is needed. To avoid the delay, leave velocity out, so that it is derived from position."
        yield Finding(
            joint=joint,
            channel="velocity",
            severity=severity,
            sentence=sentence,
            remedy=keep if severity == "note" else mend,
            value=value,
            quantity=quantity,
            repairable=severity != "note" and not _clock(fit),
        )


def _say(fit: VelocityFit, period: float, what: str) -> tuple[Severity, str, float, str] | None:
    """Return severity, quantity, value and sentence of the gravest fault; None if there is none."""
    if fit.residual > NONSENSE:
        share = f"{100 * fit.residual:.0f} % of the motion is unexplained"
        return "spoils", "residual", fit.residual, f"{what} is not the derivative of its position: {share}."
    if fit.scale < 0:
        return (
            "spoils",
            "scale",
            fit.scale,
            f"{what} has the opposite sign of its position's change (ratio {fit.scale:.3g}).",
        )
    if abs(fit.scale - 1) > SCALE:
        return (
            "spoils",
            "scale",
            fit.scale,
            f"{what} is off by a factor: its position changes {fit.scale:.3g} times as fast.",
        )
    if _clock(fit):
        return (
            "warn",
            "scale",
            fit.scale,
            f"{what} and the change of its position differ by a factor of {fit.scale:.3g} ± {fit.error:.1g}: the clock, or the "
            "scale of one of them, is wrong.",
        )
    way = "lags" if fit.delay > 0 else "leads"
    by = f"{1e3 * abs(fit.delay):.3g} ms ({abs(fit.delay) / period:.1f} samples)"
    if abs(fit.delay) > max(DELAY_SAMPLES * period, DELAY) and fit.plain > _HELPS * fit.residual:
        return "warn", "delay", fit.delay, f"{what} {way} its position by {by}."
    if abs(fit.delay) > max(1.5 * period, 3e-3):
        return "note", "delay", fit.delay, f"{what} {way} its position by {by}, as a filter does."
    return None


def _clock(fit: VelocityFit) -> bool:
    """Return whether the scale has a small but significant error."""
    return max(CLOCK, SURE * fit.error) < abs(fit.scale - 1.0) <= SCALE and fit.residual < NONSENSE


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Leave velocity out; position is closer to the encoder's counts."""
    who = ", ".join(str(f.joint) for f in findings)
    return Repair(
        exam.log.replace(velocity=None).with_note(
            f"velocity was left out: it contradicts the position of {who}."
        )
    )
