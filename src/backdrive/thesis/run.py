"""Run experiments and draw them, one after the other or in processes of their own."""

from __future__ import annotations

import importlib
import inspect
import signal
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from backdrive.errors import BackdriveError
from backdrive.report.pictures import canvas
from backdrive.thesis._footer import footer
from backdrive.thesis.catalog import Entry
from backdrive.thesis.ledger import disagreements, evaluate
from backdrive.thesis.outcome import Claim, Outcome

SCALE = 2.0  # pixels per point of a picture

Say = Callable[[str], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Result:
    """An experiment that was run.

    Attributes:
        entry: which.
        outcome: its claims and numbers, without the data that the picture shows; None where it broke down.
        png: its picture.
        svg: the same.
        seconds: that it took [s].
        error: why it broke down; empty otherwise.
        where: the trace of that, for whoever reports it.
        exit_code: of the error; 0 without one.
    """

    entry: Entry
    outcome: Outcome | None = None
    png: bytes = field(default=b"", repr=False)
    svg: bytes = field(default=b"", repr=False)
    seconds: float = 0.0
    error: str = ""
    where: str = field(default="", repr=False)
    exit_code: int = 0

    @property
    def holds(self) -> bool:
        """Whether it ran, all checks of this package hold, and the thesis' statements agree with the ledger."""
        if self.outcome is None:
            return False
        return not self.of(False) and not disagreements(evaluate([self.outcome]))

    def of(self, verdict: bool | None) -> list[Claim]:
        """Return the checks of our own with a verdict: True, False, or None for those that only inform."""
        if self.outcome is None:
            return []
        return [c for c in self.outcome.claims if c.holds is verdict and not c.statement]


def run_one(entry: Entry, seed: int = 0, say: Say | None = None) -> Result:
    """Run one experiment and draw it; errors are stored in the result, so that the other experiments continue.

    Args:
        entry: which.
        seed: of everything random in it.
        say: called with progress sentences by experiments that take minutes.
    """
    begun = time.perf_counter()
    try:
        experiment = importlib.import_module(entry.module)
        told = say is not None and "say" in inspect.signature(experiment.run).parameters
        outcome = experiment.run(seed=seed, say=say) if told else experiment.run(seed=seed)
        with canvas.house_style():
            figure = experiment.draw(outcome)
            footer(figure, outcome)
            pictures = canvas.content(figure, "png", SCALE), canvas.content(figure, "svg")
    except Exception as error:
        known = isinstance(error, BackdriveError)
        return Result(
            entry=entry,
            seconds=time.perf_counter() - begun,
            error=str(error) if known else f"{type(error).__name__}: {error}",
            where="" if known else traceback.format_exc(),
            exit_code=error.exit_code if known else 4,
        )
    return Result(
        entry=entry,
        outcome=replace(outcome, data={}),
        png=pictures[0],
        svg=pictures[1],
        seconds=time.perf_counter() - begun,
    )


def run_all(
    entries: Sequence[Entry], *, seed: int = 0, workers: int = 1, say: Say | None = None
) -> Iterator[Result]:
    """Run experiments and yield each as soon as it is done; the numbers do not depend on the order.

    One process is the default: an experiment plays its scenes on all cores as it is, and figures of one chapter share what
    they have in common. More processes took more time on two cores.

    Args:
        entries: which.
        seed: of everything random in them.
        workers: processes; 1: this one alone, in the order given.
        say: told what is going on, by one process.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    canvas.require_matplotlib()
    workers = min(workers, len(entries))
    if workers <= 1:
        yield from (run_one(entry, seed, say) for entry in entries)
        return
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool

    context = multiprocessing.get_context("spawn")  # a fork would take threads' locks along
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_ignore_interrupt) as pool:
        waiting = {pool.submit(run_one, entry, seed): entry for entry in entries}
        try:
            for done in as_completed(waiting):
                try:
                    result = done.result()
                except BrokenProcessPool:
                    said = "A process was ended from outside, for example for want of memory."
                    result = Result(entry=waiting[done], error=said, exit_code=4)
                yield result
        except BaseException:  # interrupted, or nobody wants the rest
            pool.shutdown(wait=False, cancel_futures=True)
            for child in multiprocessing.active_children():
                child.terminate()
            raise


def _ignore_interrupt() -> None:
    """Leave Ctrl-C to the process that collects."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
