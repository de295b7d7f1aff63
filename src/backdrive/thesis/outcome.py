"""The outcome of an experiment: its data and its judged claims."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One statement, and whether it holds here.

    Attributes:
        what: the statement, in a sentence.
        thesis: the thesis' statement, in its own numbers; empty for a check of this package.
        ours: what was found.
        gate: what is required.
        holds: the verdict; None for information.
        why: explanation if it holds, or comment on information.
        why_not: explanation if it does not hold; printed only then.
        statement: name of the thesis' statement in the ledger (`ledger.STATEMENTS`); empty for a check of our own.
    """

    what: str
    thesis: str = ""
    ours: str
    gate: str = ""
    holds: bool | None
    why: str = ""
    why_not: str = ""
    statement: str = ""

    @property
    def explanation(self) -> str:
        """The sentence that goes with what came out, empty without one."""
        return self.why_not if self.holds is False else self.why


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """The outcome of an experiment.

    Attributes:
        name: of the experiment, `fig-3.8`.
        title: what the figure shows.
        setting: joints, parameters and hand, in sentences.
        claims: judged.
        data: numbers and arrays that the figure draws, by name.
        numbers: what a table shows, by name: the same numbers for the same seed.
    """

    name: str
    title: str
    setting: str
    claims: tuple[Claim, ...]
    data: Mapping[str, Any] = field(default_factory=dict, repr=False)
    numbers: Mapping[str, float] = field(default_factory=dict)

    @property
    def holds(self) -> bool:
        """Whether every claim that is judged holds."""
        return all(claim.holds is not False for claim in self.claims)
