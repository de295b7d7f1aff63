"""What is asked of a fit, and what it gives for one joint."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.choice import Candidate, Choice, shape_of
from backdrive.identification.dynamic.intervals import Method

if TYPE_CHECKING:
    from backdrive.engine import DriveModel
    from backdrive.identification.result import JointEvidence
    from backdrive.model import JointFriction

Intervals = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class Request:
    """What is asked; see `fitting.fit` for the meaning of what is not told here.

    Attributes:
        law: `auto`, a law, or several.
        gravity: seek gravity; None: where the joint turns.
        delay: seek the delay.
        bounds: ranges of what is sought, by name [SI].
        cutoff: low pass of the motion [Hz].
        loss: `linear`, `huber` or `absolute`.
        interval: kind of the intervals.
        seed: of the starts.
        drive: what turns the drive's input into torque; None: as the logs say.
        known: what is not sought, by name [SI].
        step: longest integration step of a fit given the drive's input [s]; None: as the drive's quickness asks for.
        say: called with a sentence before every step that may take long.
    """

    law: str | Sequence[str]
    gravity: bool | None = None
    delay: bool = True
    bounds: Mapping[str, tuple[float, float]] | None = None
    cutoff: float | None = None
    loss: str = "huber"
    interval: Method = "covariance"
    seed: int = 0
    drive: DriveModel | None = None
    known: Mapping[str, float] = field(default_factory=dict)
    step: float | None = None
    say: Callable[[str], None] = lambda sentence: None

    def ticker(self, joint: str) -> Callable[[str, int, float], None]:
        """Return what a search calls: a sentence every fifth step."""
        return lambda stage, i, cost: self.say(f"{joint}: fitting {stage}, step {i}") if i % 5 == 0 else None


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
