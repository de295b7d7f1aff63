"""The comparison of a joint's log with its prior, as the model file keeps it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from backdrive.errors import InvalidInput
from backdrive.parameters import NOT_NEGATIVE, Bound, Bounds, WithBounds

MOST = 200  # numbers of a comparison
MOST_LOGS = 100_000  # of a prior


@dataclass(frozen=True, kw_only=True)
class PriorNumber:
    """A number of the friction curve by the log alone, by the prior, and by both.

    Attributes:
        name: such as `constant`.
        unit: SI.
        log: by the log alone [unit].
        log_error: its standard error [unit].
        prior: by the prior [unit].
        prior_error: its standard deviation [unit].
        combined: by both [unit].
        combined_error: its standard error [unit].
    """

    name: str
    unit: str
    log: float
    log_error: float
    prior: float
    prior_error: float
    combined: float
    combined_error: float


@dataclass(frozen=True, kw_only=True)
class PriorComparison(WithBounds):
    """The comparison of a joint's log with its prior.

    Attributes:
        source: of the prior, in words.
        applied: the joint's numbers are the combination; False: log and prior contradict each other, and the numbers are the
            log's alone.
        distance: of log and prior (Mahalanobis) [-].
        degrees: of freedom of the distance.
        p: probability of a larger distance by chance [-].
        numbers: of the friction curve that the prior states.
        log_alone: value and standard error of the joint's parameters and terms by the log alone, by row of the covariance;
            empty where the prior was not applied.
        logs: SHA-256 of the log files of the former model, which the numbers hold as well; empty for a population, and where
            the prior was not applied.
    """

    BOUNDS: ClassVar[Bounds] = {"p": Bound(0.0, 1.0), "distance": NOT_NEGATIVE}

    source: str
    applied: bool
    distance: float
    degrees: int
    p: float
    numbers: tuple[PriorNumber, ...]
    log_alone: Mapping[str, tuple[float, float]] = field(default_factory=dict[str, tuple[float, float]])
    logs: tuple[str, ...] = ()

    def __post_init__(self):
        super().__post_init__()
        if len(self.logs) > MOST_LOGS:
            raise InvalidInput(f"A prior is from {len(self.logs)} logs.", remedy=f"At most {MOST_LOGS}.")
        for what in (self.numbers, self.log_alone):
            if len(what) > MOST:
                raise InvalidInput(f"A prior has {len(what)} numbers.", remedy=f"At most {MOST}.")

    @property
    def sentence(self) -> str:
        """Log, prior and combination in words."""
        each = "; ".join(
            f"{n.name} {n.log:.4g} ± {n.log_error:.2g} {n.unit} by the log, {n.prior:.4g} ± {n.prior_error:.2g} by the prior, "
            f"{n.combined:.4g} ± {n.combined_error:.2g} by both"
            for n in self.numbers[:4]
        )
        use = "The numbers are those of both." if self.applied else "The numbers are the log's alone."
        return f"Prior ({self.source}): {each}. Distance {self.distance:.2g}, p = {self.p:.2g}. {use}"
