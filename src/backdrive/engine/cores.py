"""Distribution of compiled work over the cores by threads, since kernels release the interpreter's lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from backdrive.parameters import whole


def available() -> int:
    """Return the number of cores that this process may use."""
    try:
        return max(1, len(os.sched_getaffinity(0)))
    except AttributeError:  # not on every system
        return max(1, os.cpu_count() or 1)


def spread(work: Callable[[int, int], None], count: int, workers: int | None = None) -> None:
    """Call `work(first, last)` on pieces of range(count) that together cover it, several at a time.

    The result does not depend on the number of workers, as long as each item has its own place to write to.

    Args:
        work: a function that spends its time in compiled code.
        count: number of items.
        workers: threads; None: one per core.

    Raises:
        InvalidInput: `workers` is not positive.
    """
    workers = available() if workers is None else whole("workers", workers)
    workers = min(workers, count)
    if workers <= 1:
        if count > 0:
            work(0, count)
        return
    pieces = min(count, 4 * workers)  # several for each worker, since items may take different times
    edges = [count * i // pieces for i in range(pieces + 1)]
    pool, wait = ThreadPoolExecutor(workers), True
    try:
        for done in [pool.submit(work, a, b) for a, b in zip(edges, edges[1:], strict=False)]:
            done.result()
    except KeyboardInterrupt:  # running pieces finish and fill arrays that nobody reads any more
        wait = False
        raise
    finally:
        pool.shutdown(wait=wait, cancel_futures=True)
