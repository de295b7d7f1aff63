"""`Exam`: a log under examination, with cached values that several checks need."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from backdrive._memory import transpose
from backdrive.logs.health._survey import Survey, survey
from backdrive.logs.log import Log, check_period
from backdrive.logs.quantiles import median, quantile
from backdrive.logs.resolution import channel_noise, channel_step, resolution, white_noise

#: An interval this many times longer than usual is a gap.
GAP = 2.5
#: Statistics use at most this many samples, in blocks spread over the log.
_SAMPLES = 1 << 16
_BLOCKS = 32

P = ParamSpec("P")
R = TypeVar("R")


def once(function: Callable[Concatenate[Exam, P], R]) -> Callable[Concatenate[Exam, P], R]:
    """Cache the result of an exam's function for each of its arguments, since several checks need it."""

    @wraps(function)
    def answer(exam: Exam, *arguments: P.args, **options: P.kwargs) -> R:
        key = (answer, *arguments, *options.items())
        if key not in exam.shared:
            exam.shared[key] = function(exam, *arguments, **options)
        return exam.shared[key]

    return answer


class Exam:
    """A log under examination.

    Args:
        log: any log.
        plan: the motion plan it was recorded with, if known.
    """

    def __init__(self, log: Log, plan: Any = None):
        self.log = log
        self.plan = log.plan if plan is None else plan
        self._columns: dict[tuple[str, int], np.ndarray] = {}
        self.shared: dict[Any, Any] = {}

    @cached_property
    def steps(self) -> np.ndarray:
        """Intervals between neighbouring samples [s], (n - 1,)."""
        return np.diff(self.log.time)

    @cached_property
    def period(self) -> float:
        """Median interval [s]; NaN where there is none that is positive."""
        steps = self.steps[:: max(1, self.steps.size // _SAMPLES)]
        if steps.size and not steps.min() > 0:
            steps = steps[steps > 0]
        return check_period(median(steps)) if steps.size else float("nan")

    @cached_property
    def gaps(self) -> np.ndarray:
        """Rows after a gap, ascending, (m,)."""
        steps = self.steps
        if not self.period > 0:
            return np.empty(0, np.intp)
        if not np.fmax.reduce(steps) > GAP * self.period:
            return np.empty(0, np.intp)
        usual = quantile(steps[:: max(1, steps.size // _SAMPLES)], 0.9)
        return np.flatnonzero(steps > GAP * max(self.period, usual)) + 1

    @cached_property
    def segments(self) -> list[slice]:
        """Stretches without a gap, in order."""
        edges = [0, *self.gaps.tolist(), len(self.log)]
        return [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True) if b > a]

    @cached_property
    def blocks(self) -> list[slice]:
        """Contiguous pieces without a gap, at most 65 536 rows in all, spread over the log."""
        n = len(self.log)
        if n <= _SAMPLES:
            wanted = [slice(0, n)]
        else:
            length = _SAMPLES // _BLOCKS
            starts = np.linspace(0, n - length, _BLOCKS).astype(int)
            wanted = [slice(s, s + length) for s in starts.tolist()]
        pieces: list[slice] = []
        edges = self.gaps
        for block in wanted:
            inside = edges[(edges > block.start) & (edges < block.stop)].tolist()
            cuts = [block.start, *inside, block.stop]
            pieces += [slice(a, b) for a, b in zip(cuts[:-1], cuts[1:], strict=True)]
        return pieces

    @once
    def survey(self, channel: str) -> Survey:
        """Return the figures of a channel."""
        return survey(self._rows(channel).T if len(self.log) <= _SAMPLES else self.log.channels[channel])

    @once
    def _rows(self, channel: str) -> np.ndarray:
        """Return a channel of a short log with a row a joint, (J, n)."""
        return transpose(self.log.channels[channel])

    def usable(self, channel: str, joint: int) -> bool:
        """Return whether a joint's channel is there and finite throughout."""
        there = getattr(self.log, channel) is not None and len(self.log) > 1
        return there and bool(self.survey(channel).finite[joint])

    def column(self, channel: str, joint: int) -> np.ndarray:
        """Return a joint's channel, contiguous, (n,)."""
        if len(self.log) <= _SAMPLES:
            return self._rows(channel)[joint]
        key = (channel, joint)
        if key not in self._columns:
            self._columns.clear()  # of a long log, one column at a time
            self._columns[key] = np.ascontiguousarray(self.log.channels[channel][:, joint])
        return self._columns[key]

    def by_block(self, channel: str, joint: int) -> list[np.ndarray]:
        """Return a joint's channel on each of the `blocks`."""
        if len(self.log) <= _SAMPLES:
            column = self.column(channel, joint)
            return [column[b] for b in self.blocks]
        array = self.log.channels[channel]
        return [array[b, joint] for b in self.blocks]

    @once
    def sample(self, channel: str, joint: int) -> np.ndarray:
        """Return a joint's channel on the rows of `blocks`, (m,)."""
        if len(self.blocks) == 1:
            return self.column(channel, joint)
        return np.concatenate(self.by_block(channel, joint))

    @once
    def changes(self, channel: str, joint: int) -> np.ndarray:
        """Return absolute differences of neighbours on the rows of `blocks`, (m,)."""
        return np.concatenate([np.abs(np.diff(x)) for x in self.by_block(channel, joint)])

    @once
    def quantum(self, channel: str, joint: int) -> float:
        """Return the smallest step of a quantised channel, 0 if it is not quantised."""
        whole = len(self.log) <= _SAMPLES
        return channel_step(self.log, channel, joint) if whole else resolution(self.sample(channel, joint))

    @once
    def noise(self, channel: str, joint: int) -> float:
        """Return the standard deviation of a channel's sample-to-sample noise, on the rows of `blocks`."""
        whole = len(self.log) <= _SAMPLES
        return channel_noise(self.log, channel, joint) if whole else white_noise(self.sample(channel, joint))

    def columns(self, *channels: str) -> Iterator[tuple[str, int, str]]:
        """Yield channel, column and name of the joint for every column of these channels that is there and finite."""
        for channel in channels:
            for j, joint in self:
                if self.usable(channel, j):
                    yield channel, j, joint

    def __iter__(self):
        """Yield column and name of every joint."""
        return iter(enumerate(self.log.names))
