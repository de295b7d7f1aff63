"""Too few samples for any result."""

from __future__ import annotations

from collections.abc import Iterator

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check, count_of

#: Below this nothing can be identified.
FEWEST = 20


@check("few-samples", f"fewer than {FEWEST} samples")
def find(exam: Exam) -> Iterator[Finding]:
    """Report an empty log, or one below `FEWEST` samples."""
    n = len(exam.log)
    if n >= FEWEST:
        return
    what = (
        "The log is empty."
        if n == 0
        else f"The log has {count_of(n, 'sample')}; at least {FEWEST} are needed."
    )
    yield Finding(
        severity="spoils",
        sentence=what,
        remedy="Check that the recording was not cut off and that the right file or time range was chosen.",
        value=n,
    )
