"""A run over a fleet: new logs are cut into batches, processed by workers and reported; existing results are kept."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from time import monotonic
from typing import Any

from backdrive.errors import BackdriveError, InvalidInput, WriteError, require
from backdrive.fleet import cluster as clusters
from backdrive.fleet.batches import LOGS, Batch, batch_of, cut
from backdrive.fleet.pending import check_options, pending_logs
from backdrive.fleet.renames import recognise_renames
from backdrive.fleet.sources import list_logs, require_fleet
from backdrive.fleet.store import Store, check_folder, write_rows
from backdrive.fleet.tally import Tally
from backdrive.fleet.work import do_batch, failure, tag_of

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
    again: Sequence[str] = (),
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
        again: robots whose logs are identified again.
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
    check_folder(output)
    check_options(options["identification"])
    say("Listing the logs")
    remarks: list[str] = []
    entries = list_logs(source, shard=shard, remarks=remarks)
    store = replace(Store.open(output, make=True), tag=tag_of(options), options=options, version=_version())
    with ExitStack() as stack:
        stack.enter_context(store.lock(shard))
        store.save()
        plan = pending_logs(store, entries, retry=retry, again=again)
        sentences = [*remarks, *plan.sentences]
        pending = plan.logs
        batches = list(cut(pending, store.tag, batch))
        tally = Tally(len(pending))
        if batches:
            say(f"Starting the workers for {len(pending)} logs")
            client = stack.enter_context(
                _client(cluster, credentials, insecure, workers, len(batches), store)
            )
            plan.drop_stale(store)
            tally.start()
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


@contextmanager
def _client(
    cluster: str | None,
    credentials: clusters.Credentials,
    insecure: bool,
    workers: int | None,
    batches: int,
    store: Store,
) -> Iterator[Any]:
    """Connect to the scheduler that is named, or start workers here."""
    if cluster is not None:
        with clusters.remote_client(cluster, credentials, insecure=insecure) as client:
            clusters.check_workers(client, store.folder)
            yield client
    else:
        number = workers if workers is not None else len(os.sched_getaffinity(0))
        with clusters.local_client(min(number, batches)) as client:
            yield client


def _version() -> str:
    from backdrive import __version__

    return __version__


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
            submit(batch_of(batch.month, [entry], store.tag))
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
