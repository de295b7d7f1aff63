"""How well a model explains measured torque, in numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from backdrive.errors import InvalidInput
from backdrive.parameters import NOT_NEGATIVE, Bounds, WithBounds, whole

LONGEST = 5000  # verdict [characters]


@dataclass(frozen=True, kw_only=True)
class Quality:
    """How well measured torque is explained.

    Attributes:
        residual: 100 |tau - tau_hat| / |tau|, both low-passed at 5 Hz where the sampling allows [%].
        residual_raw: the same without the low pass [%].
        rms: root mean square of tau - tau_hat, raw [N.m or N].
        samples: number of samples judged.
    """

    residual: float
    residual_raw: float
    rms: float
    samples: int


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The identification's own assessment of its result.

    Attributes:
        grade: in a word for programs.
        text: in some sentences for a person.
    """

    grade: Literal["good", "care", "poor", "unknown"]
    text: str

    def __post_init__(self):
        if len(self.text) > LONGEST:
            raise InvalidInput(f"A verdict has {len(self.text)} characters.", remedy=f"At most {LONGEST}.")


@dataclass(frozen=True, kw_only=True)
class Band(WithBounds):
    """A band about the predicted torque that contained 95 % of the measured torque.

    Attributes:
        half_width: of it [N.m or N].
        samples: that it was taken from.
    """

    BOUNDS: ClassVar[Bounds] = {"half_width": NOT_NEGATIVE}

    half_width: float
    samples: int

    def __post_init__(self):
        super().__post_init__()
        whole("samples", self.samples)


@dataclass(frozen=True, kw_only=True)
class Bands:
    """The band of each state of motion; None where the data did not show it.

    Attributes:
        moving: in motion, away from reversals.
        reversing: close to a change of direction.
        rest: at rest for a while, where friction is undetermined within its break-away torque.
    """

    moving: Band | None = None
    reversing: Band | None = None
    rest: Band | None = None
