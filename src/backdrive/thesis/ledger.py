"""The thesis' statements on its figures and tables, sentence by sentence, with the results of the simulation.

The ledger contains the sentences of the results sections that refer to a figure or table ("it can be seen") and state more
than its content; captions count if they state a result. An experiment evaluates each statement (`Claim.statement`). The
verdict written here has to agree with the evaluation for every seed.
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
    """Return whether each evaluated statement is reproduced, that is, whether all claims with its name hold."""
    result: dict[str, bool] = {}
    for outcome in outcomes:
        for claim in outcome.claims:
            if claim.statement:
                result[claim.statement] = result.get(claim.statement, True) and claim.holds is True
    return result


def disagreements(came_out: Mapping[str, bool]) -> tuple[str, ...]:
    """Return the statements whose results differ from the ledger, and names that are not in the ledger.

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
