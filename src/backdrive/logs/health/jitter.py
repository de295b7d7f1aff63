"""Sampling intervals that vary."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check

#: Standard deviation of the interval, divided by its mean, above which derivatives become inaccurate [1].
LIMIT = 0.10
FEWEST = 10  # least number of intervals for a jitter


def variation(exam: Exam) -> tuple[float, np.ndarray]:
    """Return the jitter of a clock, standard deviation of the intervals over their mean [1], and the intervals [s].

    Gaps and steps that do not go forward are left out; NaN with fewer than ten intervals.
    """
    steps = np.delete(exam.steps, exam.gaps - 1) if exam.gaps.size else exam.steps
    if steps.size and not steps.min() > 0:
        steps = steps[steps > 0]
    return (float(steps.std() / steps.mean()) if steps.size >= FEWEST else float("nan")), steps


@check("jitter", f"sampling intervals that vary by more than {100.0 * LIMIT:.0f} %")
def find(exam: Exam) -> Iterator[Finding]:
    """Report a standard deviation of the interval above `LIMIT` of its mean, gaps aside."""
    jitter, steps = variation(exam)
    if not jitter > LIMIT:
        return
    yield Finding(
        severity="warn",
        sentence=(
            f"The sampling interval varies by {100 * jitter:.0f} % (standard deviation over mean, "
            f"{1e3 * steps.min():.3g} to {1e3 * steps.max():.3g} ms)."
        ),
        remedy="Use the sender's clock rather than the receiver's; otherwise differentiate over a wider window.",
        value=jitter,
    )
