"""Too few samples to say anything."""

from __future__ import annotations

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Check, Finding, counted

#: Below this nothing can be identified.
FEWEST = 20

NAME = "few-samples"


def find(exam: Exam) -> list[Finding]:
    """Report an empty log, or one below `FEWEST` samples."""
    n = len(exam.log)
    if n >= FEWEST:
        return []
    what = (
        "The log is empty."
        if n == 0
        else f"The log has {counted(n, 'sample')}; at least {FEWEST} are needed."
    )
    return [
        Finding(
            name=NAME,
            severity="spoils",
            sentence=what,
            remedy="Check that the recording was not cut off and that the right file or time range was chosen.",
            value=n,
        )
    ]


CHECK = Check(NAME, f"fewer than {FEWEST} samples", find)
