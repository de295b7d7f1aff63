"""A fleet on paper: cores, memory, disk and network for 1e5 and 1e7 logs a day, from unit costs measured here and now.

Where Dask's scheduler ends is measured too, in tasks a second, with tasks that do nothing.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

from _common import Judge, parser
from fleet import write_logs

from backdrive.fleet.batches import EACH, PER_BYTE, WORK
from backdrive.fleet.cluster import ENVIRONMENT, local_client
from backdrive.fleet.sources import list_logs
from backdrive.fleet.store import Store, write_rows
from backdrive.fleet.work import do_log, tag_of

DAY = 86_400.0  # [s]
WINDOW = 8 * 3600.0  # in which a day's logs are to be done [s]
SPARE = 0.7  # of a core that is used


def nothing(number: int) -> int:
    """Return a number: a task without work."""
    return number


def memory() -> int:
    """Return the resident memory of this process [B]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def scheduler(tasks: int) -> tuple[float, float]:
    """Return the time of a task that does nothing [s], and the memory that the scheduler keeps for one under way [B]."""
    with local_client(1) as client:
        client.submit(nothing, -1).result()
        before, begun = memory(), time.process_time()
        futures = client.map(nothing, range(tasks), pure=False)
        client.gather(futures)
        return (time.process_time() - begun) / tasks, max(memory() - before, 0) / tasks


def main() -> None:
    given = parser(__doc__).parse_args()
    os.environ.update(ENVIRONMENT)
    judge, count = Judge(), 10 if given.short else 60
    with tempfile.TemporaryDirectory(prefix="fleet-") as scratch:
        place = Path(scratch)
        write_logs(place / "logs", count, 20_000)
        entries = list_logs(place / "logs")
        size = sum(entry.size for entry in entries) / count
        do_log(entries[0], {})
        begun, wall = time.process_time(), time.perf_counter()
        rows = [row | {"tag": tag_of({})} for entry in entries for row in do_log(entry, {})]
        # its reader is another process, which reads while this one waits
        cost, passed = (time.process_time() - begun) / count, (time.perf_counter() - wall) / count
        store = Store.open(place / "results", make=True)
        write_rows(store.folder, "2026-01", "a", rows)
        row = sum(part.stat().st_size for part in store.parts()) / count
        many = [one | {"digest": f"{k}{one['digest']}"} for k in range(6000 // count) for one in rows]
        write_rows(store.folder, "2026-01", "a", many)
        begun = time.process_time()
        store.table()
        read = (time.process_time() - begun) / len(many)
    task, held = scheduler(300 if given.short else 3000)
    batch = max(int(WORK / (EACH + PER_BYTE * size)), 1)
    print(
        f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors; unit costs of one joint's log, 20 s at 1 kHz:"
    )
    print(
        f"  {1e3 * cost:.0f} ms of processor without its reader ({1e3 * passed:.0f} ms passed), "
        f"{size / 1e3:.0f} kB read, {row:.0f} B kept"
    )
    print(f"  {1e6 * read:.0f} us to read a row again; a batch is {batch} logs, {batch * cost:.1f} s")
    print(
        f"  a task costs the scheduler {1e3 * task:.2f} ms ({1 / task:.0f} a second at most) and {held / 1e3:.1f} kB while it waits"
    )
    for logs in (1e5, 1e7):
        cores, tasks = logs * cost / WINDOW / SPARE, logs / batch / WINDOW
        print(f"\n{logs:.0e} logs a day, done in {WINDOW / 3600:.0f} hours:")
        print(
            f"  {cores:.0f} cores, {max(cores * 0.5, 1):.0f} GB of memory (0.5 GB a worker with its reader)"
        )
        print(
            f"  {logs * size / 1e9:.0f} GB read a day, {8 * logs * size / WINDOW / 1e9:.2f} Gbit/s while it runs"
        )
        print(
            f"  {logs * row / 1e6:.0f} MB of results a day, {365 * logs * row / 1e9:.0f} GB a year; "
            f"a year is read in {365 * logs * read / 3600:.1f} h"
        )
        share = tasks * task
        print(f"  {tasks:.1f} tasks a second: {100 * share:.0f} % of one scheduler")
    ends = batch / task * DAY
    print(
        f"\nOne scheduler ends at {ends:.1e} logs a day by its tasks, and near {1 / task * batch * cost:.0f} workers."
    )
    print(
        "Beyond: `--shard i/n` with a scheduler, or none, a shard, and a results folder a plant or a month, asked one by one."
    )
    judge.that("a scheduler keeps up with 1e5 logs a day", 1e5 / batch / WINDOW * task < 0.5)
    judge.that("all logs gave a row", len(rows) == count)
    judge.end()


if __name__ == "__main__":
    main()
