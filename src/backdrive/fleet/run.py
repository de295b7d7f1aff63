"""A run over a fleet: new logs are cut into batches, processed by workers and reported; existing results are kept."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from time import monotonic
from typing import Any

from backdrive.errors import BackdriveError, InvalidInput, WriteError, require
from backdrive.fleet import cluster as clusters
from backdrive.fleet.renames import recognise_renames
from backdrive.fleet.sources import LogEntry, list_logs, require_fleet
from backdrive.fleet.store import Store, write_rows
from backdrive.fleet.work import Batch, do_batch, failure, tag_of

BYTES = 8 << 20  # of logs in a batch, about a second and a half of work [B]
LOGS = 64  # in a batch at most
IN_FLIGHT = 4  # batches in flight: so many per worker, and as many more
NOBODY = clusters.Credentials()


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a run.

    Attributes:
        logs: that the source holds.
        done: of them in this run.
        failed: of those.
        kept: logs with results from earlier runs.
        seconds: wall time [s].
        work: processor time of the workers in batches [s].
        sentences: remarks for the user.
    """

    logs: int
    done: int
    failed: int
    kept: int
    seconds: float
    work: float
    sentences: tuple[str, ...] = ()


@dataclass
class Tally:
    """The progress so far, for a progress line."""

    total: int
    done: int = 0
    failed: int = 0
    work: float = 0.0
    begun: float = field(default_factory=monotonic)

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


def run_fleet(  # noqa: PLR0913  (its options are given by keyword)
    source: str | os.PathLike | Sequence[str | os.PathLike],
    output: str | os.PathLike,
    *,
    reading: Mapping[str, Any] | None = None,
    identification: Mapping[str, Any] | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    credentials: clusters.Credentials = NOBODY,
    insecure: bool = False,
    shard: tuple[int, int] = (1, 1),
    batch: int = LOGS,
    retry: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Outcome:
    """Identify every log of a fleet that is not done yet.

    Args:
        source: see `list_logs`.
        output: folder of the results.
        reading: options of `read_log`.
        identification: options of `identify`.
        workers: processes on this machine, a thread each; None: one a processor.
        cluster: address of a scheduler to use instead; its workers must see the same folders.
        credentials: for that.
        insecure: allow plain tcp to another host.
        shard: i of n: only this part of the logs, for job arrays.
        batch: largest number of logs in one task.
        retry: try again the logs that failed.
        progress: called with a sentence now and then.

    Raises:
        BackdriveError: source, output, options or cluster cannot be used; finished results are kept.
    """
    say = progress or (lambda sentence: None)
    begun = monotonic()
    require_fleet()
    index, count = shard
    if batch < 1:
        raise InvalidInput(f"{batch} logs in a batch.", remedy="Give at least one.")
    if not 1 <= index <= count:
        raise InvalidInput(f"Shard {index}/{count}.", remedy="Give i/n with 1 <= i <= n.")
    if cluster is not None:
        clusters.check_address(cluster, insecure=insecure)
    options = {"reading": dict(reading or {}), "identification": dict(identification or {})}
    say("Listing the logs")
    entries = list_logs(source, shard=shard)
    store = replace(Store.open(output, make=True), tag=tag_of(options), options=options, version=_version())
    with ExitStack() as stack:
        stack.enter_context(store.lock(shard))
        store.save()
        sentences = store.set_aside_fragments() if count == 1 else []
        pending = _pending(store, entries, retry)
        batches = list(cut(pending, store.tag, batch))
        tally = Tally(len(pending))
        if batches:
            say(f"{len(pending)} of {len(entries)} logs to do; starting the workers")
            if cluster is not None:
                client = stack.enter_context(clusters.remote_client(cluster, credentials, insecure=insecure))
                clusters.check_workers(client, store.folder)
            else:
                number = workers if workers is not None else len(os.sched_getaffinity(0))
                client = stack.enter_context(clusters.local_client(min(number, len(batches))))
            _work(client, batches, options, store, tally, say)
        if count == 1:
            store, more = recognise_renames(store, entries)
            sentences += more
    return Outcome(
        logs=len(entries),
        done=tally.done,
        failed=tally.failed,
        kept=len(entries) - len(pending),
        seconds=monotonic() - begun,
        work=tally.work,
        sentences=tuple(sentences),
    )


def _version() -> str:
    from backdrive import __version__

    return __version__


def cut(entries: Sequence[LogEntry], tag: str, most: int = LOGS) -> Iterator[Batch]:
    """Yield batches of about equal work, each of one month. They depend on the logs only, not on the number of workers.

    Args:
        entries: in the order of their paths.
        tag: of options and version.
        most: logs in a batch.
    """
    months: dict[str, list[LogEntry]] = {}
    for entry in entries:
        months.setdefault(entry.day.strftime("%Y-%m"), []).append(entry)
    for month in sorted(months):
        part: list[LogEntry] = []
        size = 0
        for entry in months[month]:
            if part and (size + entry.size > BYTES or len(part) >= most):
                yield _batch(month, part, tag)
                part, size = [], 0
            part.append(entry)
            size += entry.size
        yield _batch(month, part, tag)


def _batch(month: str, entries: Sequence[LogEntry], tag: str) -> Batch:
    text = "\n".join([tag, *(f"{entry.path}\t{entry.stamp}" for entry in entries)])
    name = hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:24]
    return Batch(name, month, tuple(entries))


def _pending(store: Store, entries: Sequence[LogEntry], retry: bool) -> list[LogEntry]:
    """Return the logs without results; rows of a file that has changed since are removed."""
    import numpy as np

    stamps = {entry.path: entry.stamp for entry in entries}

    def stale(table: Any) -> np.ndarray:
        columns = [table.column(name).to_pylist() for name in ("path", "stamp", "failure")]
        return np.array(
            [
                p in stamps and (stamps[p] != s or (retry and f is not None))
                for p, s, f in zip(*columns, strict=True)
            ],
            dtype=bool,
        )

    known = store.raw(["path", "stamp", "failure", "tag"])
    if stale(known).any():
        store.drop(stale)
        known = store.raw(["path", "stamp", "failure", "tag"])
    done = set()
    for path, stamp, tag in zip(
        *(known.column(name).to_pylist() for name in ("path", "stamp", "tag")), strict=True
    ):
        if tag == store.tag and stamps.get(path) == stamp:
            done.add(path)
    return [entry for entry in entries if entry.path not in done]


def _work(
    client: Any,
    batches: Sequence[Batch],
    options: Mapping[str, Any],
    store: Store,
    tally: Tally,
    say: Callable[[str], None],
) -> None:
    """Process the batches, with a limited number in flight. A batch that kills its worker is repeated log by log, and the log
    at fault is named.
    """
    distributed = require("distributed", "A fleet needs", "fleet")
    folder = str(store.folder.resolve())
    queue = iter(batches)
    under_way: dict[str, tuple[Any, Batch]] = {}
    events = distributed.as_completed(with_results=False)

    def submit(batch: Batch) -> None:
        future = client.submit(
            do_batch, batch, options, folder, key=f"backdrive-{batch.name}", pure=False, retries=0
        )
        under_way[future.key] = (future, batch)
        events.add(future)

    most = 2 * IN_FLIGHT * max(1, len(client.ncores()))

    def fill() -> None:
        while len(under_way) < most and (batch := next(queue, None)) is not None:
            submit(batch)

    fill()
    while under_way:
        future = next(events)
        _, batch = under_way.pop(future.key)
        if future.status == "finished":
            tally.add(**_counts(future.result()))
        elif future.status == "error":
            _again(future.exception(), batch, store, tally, submit)
        else:  # cancelled or lost
            raise InvalidInput(
                "The scheduler is gone, or has forgotten its work.",
                remedy="Run again: finished results are kept.",
            )
        future.release()
        say(str(tally))
        fill()


def _counts(result: Mapping[str, Any]) -> dict[str, Any]:
    return {"done": result["done"], "failed": result["failed"], "seconds": result["seconds"]}


def _again(
    error: BaseException, batch: Batch, store: Store, tally: Tally, submit: Callable[[Batch], None]
) -> None:
    """Handle a batch that failed as a whole.

    Its logs are repeated one by one. For a single log, a row with the reason is written.

    Raises:
        WriteError: nothing can be written any more.
    """
    if isinstance(error, (WriteError, KeyboardInterrupt)):
        raise error
    if len(batch.entries) > 1:
        for entry in batch.entries:
            submit(_batch(batch.month, [entry], store.tag))
        return
    entry = next(iter(batch.entries))
    killed = type(error).__name__ == "KilledWorker"
    kind = (
        "WorkerKilled"
        if killed
        else type(error).__name__
        if isinstance(error, BackdriveError)
        else "InternalError"
    )
    message = "The process that identified it died." if killed else f"{type(error).__name__}: {error}"
    row = failure(entry, kind, message, "Identify it alone, with `backdrive identify`.")
    write_rows(store.folder, batch.month, batch.name, [row | {"tag": store.tag}])
    tally.add(1, 1)
