"""Windows of a long log, for a first look that need not see every sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, Self, TypeVar

import numpy as np

COUNT = 6  # number of windows
SHORTEST = 50  # least number of samples of a window's part that lies in one stretch


class Samples(Protocol):
    """A stretch of samples: signals of a joint, or what is made of them."""

    @property
    def torque(self) -> Any:
        """Measured, one a sample."""
        ...

    def rows(self, part: slice) -> Self:
        """Return some of the samples."""
        ...


S = TypeVar("S", bound=Samples)


def windows_of(stretches: Sequence[S], enough: int) -> list[S] | None:
    """Return windows spread evenly over many samples, together `enough`; None if there are no more than that.

    Args:
        stretches: of one joint.
        enough: number of samples.
    """
    whole, length = sum(len(s.torque) for s in stretches), enough // COUNT
    if whole <= enough:
        return None
    begins, before, part = np.linspace(0, whole - length, COUNT).astype(int).tolist(), 0, []
    for s in stretches:
        n = len(s.torque)
        spans = [(max(begin - before, 0), min(begin + length - before, n)) for begin in begins]
        part += [s.rows(slice(first, last)) for first, last in spans if last - first >= SHORTEST]
        before += n
    return part
