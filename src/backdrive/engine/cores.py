"""Distribution of compiled work over the cores by threads, since kernels release the interpreter's lock."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from itertools import pairwise
from threading import Thread

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
    pieces = min(count, 2 * workers)  # more than one for each worker, since items may take different times
    edges = [count * i // pieces for i in range(pieces + 1)]
    left, failures = deque(pairwise(edges)), list[BaseException]()

    def serve() -> None:
        while left:
            try:
                first, last = left.popleft()
            except IndexError:  # another thread was faster
                return
            work(first, last)

    def serve_beside() -> None:
        try:
            serve()
        except BaseException as failure:  # it is raised in the caller's thread
            failures.append(failure)
            left.clear()

    beside = [Thread(target=serve_beside, daemon=True) for _ in range(workers - 1)]
    try:  # the caller's thread works too: it already has a core, and systems are slow to place new threads
        for thread in beside:
            thread.start()
        serve()
        for thread in beside:
            thread.join()
    except KeyboardInterrupt:  # running pieces finish and fill arrays that nobody reads any more
        left.clear()
        raise
    except BaseException:
        left.clear()
        for thread in beside:
            if thread.is_alive():
                thread.join()
        raise
    if failures:
        raise failures[0]
