"""What is asked of a fit, and what it gives for one joint."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from backdrive.fitting.choice import Choice
from backdrive.fitting.intervals import Method

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
    """

    friction: JointFriction
    evidence: JointEvidence
    choice: Choice
    intervals: Intervals
