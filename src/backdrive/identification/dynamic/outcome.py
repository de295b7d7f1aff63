"""What a search gives for one joint, and what stands in its way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.choice import Candidate, Choice, shape_of

if TYPE_CHECKING:
    from backdrive.identification.result import JointEvidence
    from backdrive.model import JointFriction

Intervals = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class JointFit:
    """The outcome for one joint.

    Attributes:
        friction: for the model.
        evidence: for the report.
        choice: the laws that were tried.
        intervals: of every number that was sought in the end [SI].
        stopped: a person interrupted it; this is what had been found.
        notes: what was done to the data, in sentences.
        settings: that the fit chose, for the model's options.
    """

    friction: JointFriction
    evidence: JointEvidence
    choice: Choice
    intervals: Intervals
    stopped: bool = False
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)


def check_bounds(bounds: Mapping[str, Any] | None, laws: Sequence[str], others: Sequence[str]) -> None:
    """Refuse a bound that nothing would heed.

    Args:
        bounds: of what is sought, by name.
        laws: that are fitted.
        others: names beyond those of the laws.

    Raises:
        InvalidInput: neither a law nor the joint has such a number.
    """
    names: dict[str, None] = {}
    for law in laws:
        shape = shape_of(law)
        names |= dict.fromkeys((*shape.rate.PARAMETERS, *shape.element.PARAMETERS))
    for name in bounds or {}:
        if name.partition("[")[0] not in {*names, *others}:
            raise InvalidInput(
                f"'{name}' is bounded, and neither {', '.join(laws)} nor the joint has it.",
                remedy=f"There is {', '.join(names)}; and {', '.join(others)}.",
            )


def interruption(listed: Sequence[str], candidates: Sequence[Candidate], done: bool) -> str:
    """Return what is to be said of a fit that was interrupted.

    Args:
        listed: laws that were to be fitted.
        candidates: that were.
        done: the intervals asked for were found.
    """
    left = [shape_of(name).name for name in listed[len(candidates) :]]
    said = "The fit was interrupted; this is the best that had been found."
    said += f" Not tried: {', '.join(left)}." if left else ""
    return said + ("" if done else " Intervals that were not reached are those of the covariance.")
