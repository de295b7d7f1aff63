"""The progress of a run in words: logs done, their rate, and the time left."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import monotonic


@dataclass
class Tally:
    """The progress so far, for a progress line.

    Attributes:
        total: number of logs to do.
        done: of these.
        failed: of those.
        work: processor time of the workers [s].
        begun: when the workers had started, by the monotonic clock [s].
    """

    total: int
    done: int = 0
    failed: int = 0
    work: float = 0.0
    begun: float = field(default_factory=monotonic)

    def start(self) -> None:
        """Begin to count the time: the workers have started."""
        self.begun = monotonic()

    def add(self, done: int, failed: int, seconds: float = 0.0) -> None:
        """Count a batch."""
        self.done, self.failed, self.work = self.done + done, self.failed + failed, self.work + seconds

    def __str__(self) -> str:
        passed = max(monotonic() - self.begun, 1e-9)
        rate = self.done / passed
        left = (self.total - self.done) / rate if rate > 0 else float("inf")
        time = "" if left == float("inf") else f", {rate:.3g} logs/s, {_duration(left)} left"
        return f"{self.done} of {self.total} logs{time}" + (f", {self.failed} failed" if self.failed else "")


def _duration(seconds: float) -> str:
    return (
        f"{seconds:.0f} s"
        if seconds < 100
        else f"{seconds / 60:.0f} min"
        if seconds < 6000
        else f"{seconds / 3600:.1f} h"
    )
