"""Sampling intervals that vary."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check

#: Standard deviation of the interval over its mean from which on derivatives suffer [1].
LIMIT = 0.10


@check("jitter", f"sampling intervals that vary by more than {LIMIT:.0%}")
def find(exam: Exam) -> Iterator[Finding]:
    """Report a standard deviation of the interval above `LIMIT` of its mean, gaps aside."""
    steps = np.delete(exam.steps, exam.gaps - 1)
    steps = steps[steps > 0]
    if steps.size < 10:
        return
    mean, spread = float(steps.mean()), float(steps.std())
    if spread <= LIMIT * mean:
        return
    yield Finding(
        severity="warn",
        sentence=(
            f"The sampling interval varies by {100 * spread / mean:.0f} % (standard deviation over mean, "
            f"{1e3 * steps.min():.3g} to {1e3 * steps.max():.3g} ms)."
        ),
        remedy="Use the sender's clock rather than the receiver's; otherwise differentiate over a wider window.",
        value=spread / mean,
    )
