"""A statement of the thesis about one of its figures or tables, and one of four verdicts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["reproduced", "not reproduced and explained", "contradicted", "cannot be judged here"]
REPRODUCED: Verdict = "reproduced"
EXPLAINED: Verdict = "not reproduced and explained"
CONTRADICTED: Verdict = "contradicted"
UNJUDGED: Verdict = "cannot be judged here"
VERDICTS: tuple[Verdict, ...] = (REPRODUCED, EXPLAINED, CONTRADICTED, UNJUDGED)


@dataclass(frozen=True, kw_only=True)
class Statement:
    """A sentence of the thesis.

    Attributes:
        name: `3.8-smallest`; claims that bear on it carry it.
        section: of the thesis, `3.5.1`.
        experiment: that judges it, `fig-3.8`.
        text: the sentence, shortened to what it states.
        verdict: one of `VERDICTS`.
        why: what explains a verdict other than reproduced.
    """

    name: str
    section: str
    experiment: str
    text: str
    verdict: Verdict
    why: str = ""

    def agrees(self, holds: bool | None) -> bool:
        """Return whether the verdict is what was computed: None for a statement that nothing computes."""
        if holds is None:
            return self.verdict == UNJUDGED
        return holds == (self.verdict == REPRODUCED) and self.verdict != UNJUDGED
