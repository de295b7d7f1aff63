"""What the thesis says its figures and tables show, sentence by sentence, and what came of it here.

Counted are the sentences of the results sections that name a figure or table or point at one ("it can be seen"), as far as they
say more than what is drawn; captions count where they state a result. An experiment
computes each one (`Claim.statement`); the verdict written here has to be what it computes, whatever the seed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from backdrive.thesis.ledger_chapter_2 import CHAPTER_2
from backdrive.thesis.ledger_chapter_3 import CHAPTER_3
from backdrive.thesis.ledger_chapter_4 import CHAPTER_4
from backdrive.thesis.outcome import Outcome
from backdrive.thesis.statement import UNJUDGED, VERDICTS, Statement

#: Every statement, in the order of the thesis.
STATEMENTS: tuple[Statement, ...] = (*CHAPTER_2, *CHAPTER_3, *CHAPTER_4)


def of(experiment: str) -> tuple[Statement, ...]:
    """Return the statements of an experiment, `fig-3.8`."""
    return tuple(s for s in STATEMENTS if s.experiment == experiment)


def evaluate(outcomes: Iterable[Outcome]) -> dict[str, bool]:
    """Return whether each statement that was computed comes out: all claims that bear its name hold."""
    result: dict[str, bool] = {}
    for outcome in outcomes:
        for claim in outcome.claims:
            if claim.statement:
                result[claim.statement] = result.get(claim.statement, True) and claim.holds is True
    return result


def disagreements(came_out: Mapping[str, bool]) -> tuple[str, ...]:
    """Return the statements that come out otherwise than the ledger says, and names that it does not have.

    Args:
        came_out: of `evaluate`.
    """
    known = {s.name: s for s in STATEMENTS}
    return tuple(
        name for name, holds in came_out.items() if name not in known or not known[name].agrees(holds)
    )


def missing(experiments: Iterable[str], came_out: Mapping[str, bool]) -> tuple[str, ...]:
    """Return the statements of some experiments that have a verdict and were not computed."""
    ran = set(experiments)
    return tuple(
        s.name for s in STATEMENTS if s.experiment in ran and s.verdict != UNJUDGED and s.name not in came_out
    )


def counts(statements: Iterable[Statement]) -> dict[str, int]:
    """Return how many statements have each verdict."""
    listed = list(statements)
    return {verdict: sum(s.verdict == verdict for s in listed) for verdict in VERDICTS}


def headline(statements: Iterable[Statement]) -> str:
    """Return the count of all four verdicts in a sentence, empty without a statement."""
    listed = list(statements)
    if not listed:
        return ""
    parts = ", ".join(f"{n} {verdict}" for verdict, n in counts(listed).items())
    return f"Of {len(listed)} statements of the thesis: {parts}."
