"""Samples that are not a number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Check, Finding, Repair
from backdrive.logs.health._holes import drop_holes, find_holes

NAME = "nan"


def find(exam: Exam) -> list[Finding]:
    """Report NaN in the clock and in every channel; one is enough."""
    return find_holes(exam, NAME, "NaN", np.isnan)


def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Drop the samples, or leave out a channel that is mostly NaN."""
    return drop_holes(exam, findings)


CHECK = Check(NAME, "values that are not a number", find, repair)
