"""Samples that are infinite."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Check, Finding, Repair
from backdrive.logs.health._holes import drop_holes, find_holes

NAME = "infinite"


def find(exam: Exam) -> list[Finding]:
    """Report infinities in the clock and in every channel; one is enough."""
    return find_holes(exam, NAME, "infinite", np.isinf)


def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Drop the samples, or leave out a channel that is mostly infinite."""
    return drop_holes(exam, findings)


CHECK = Check(NAME, "infinite values", find, repair)
