"""A log that does not contain the motion of its plan."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check

#: Stroke may differ by this share; the log may be shorter than the plan by this share.
STROKE, DURATION = 0.2, 0.1


@check("plan-mismatch", "a log that does not contain the motion of its plan")
def find(exam: Exam) -> Iterator[Finding]:
    """Report a stroke that differs from the plan's, and a log that ends before the plan."""
    plan = exam.plan
    duration = getattr(plan, "duration", None)
    if duration is not None and exam.log.duration < (1 - DURATION) * duration:
        yield Finding(
            severity="warn",
            sentence=f"The log is {exam.log.duration:.1f} s long, its plan {duration:.1f} s.",
            remedy="Record the whole motion, or link the log to the plan that was run.",
            value=exam.log.duration,
        )
    stroke = getattr(plan, "stroke", None)
    if stroke is None or "position" not in exam.log.channels:
        return
    survey = exam.survey("position")
    spans = np.where(survey.finite, survey.high - survey.low, 0.0)
    nearest = int(np.argmin(np.abs(spans - stroke)))
    if abs(spans[nearest] - stroke) > STROKE * stroke:
        unit = exam.log.joints[nearest].unit
        yield Finding(
            joint=exam.log.names[nearest],
            channel="position",
            severity="warn",
            sentence=f"{exam.log.names[nearest]} moves over {spans[nearest]:.4g} {unit}, its plan over {stroke:.4g} {unit}.",
            remedy="Link the log to the plan that was run, and look for a joint limit or a lagging controller.",
            value=float(spans[nearest]),
        )
