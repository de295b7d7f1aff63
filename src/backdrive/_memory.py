"""Freed memory that a process keeps for its next arrays, and copies in the order in which it is read."""

from __future__ import annotations

import ctypes
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

LARGEST = 1 << 23  # size of the largest array whose memory is always kept [byte]
BY_ITSELF = 1 << 25  # size of the largest array whose memory glibc learns to keep, unasked [byte]
MOST = 1 << 29  # size of the largest array whose memory is kept for a long log [byte]
MOST_RESULT = 1 << 27  # size of the largest result whose memory is kept for the next one [byte]
TIMES = 4  # size of the largest array that is made of a log, by that of one channel [-]
PIECE, ROWS = (
    1 << 12,
    32,
)  # numbers that are transposed at once, for a first-level cache, and the fewest rows [-]
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # of mallopt(3)

P = ParamSpec("P")
R = TypeVar("R")


def with_free_memory(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function of logs, so that the C library keeps the memory of freed arrays for the next ones.

    Otherwise glibc returns that of each array above 128 kB to the system, which hands it out again page by page, emptied. For
    arrays of up to 8 MB it goes on to keep it afterwards, at most twice as much without use; what was kept for longer logs is
    returned. Where the C library is another one, this has no effect.
    """

    @wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        _keep_small()
        with _keep_large(8 * _longest(args[0] if args else kwargs.get("logs"))):
            return function(*args, **kwargs)

    return run


@cache
def _keep_small() -> None:
    """Let the C library keep the memory of freed arrays of up to 8 MB.

    Once a larger piece was freed, glibc keeps pieces of up to that size (`M_MMAP_THRESHOLD` in mallopt(3)). The piece is never
    written, so it takes no memory itself.
    """
    np.empty(LARGEST, dtype=np.uint8)


@contextmanager
def _keep_large(channel: int) -> Iterator[None]:
    """Let glibc keep the memory of freed arrays, and return it in the end, if the largest is above what it keeps by itself."""
    library = _glibc() if TIMES * channel > BY_ITSELF else None
    if library is None:
        yield
        return
    size = min(TIMES * channel, MOST)
    _keep(library, size, 2 * size)
    try:
        yield
    finally:
        _keep(library, BY_ITSELF, 2 * BY_ITSELF)  # it no longer learns by itself what to keep
        library.malloc_trim(0)


def empty(shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return an array as `np.empty` does, whose memory the C library keeps for the next one when it is freed, up to 128 MB.

    It is for results that a caller asks for again and again: the system would empty the memory of each before it is written.
    Where the C library is another one than glibc, this has no effect.
    """
    size = 8 * math.prod(shape)
    if _kept[0] < size <= MOST_RESULT and (library := _glibc()) is not None:
        _keep(library, size + size // 8, size + BY_ITSELF)
    return np.empty(shape)


def transpose(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an array (n, J) with a contiguous row for each of its columns, (J, n); of a single column, which is one, a view.

    A copy in pieces fetches each line of the cache once, where one of a column at a time fetches it for every column.
    """
    n, columns = array.shape
    if columns == 1:
        return np.ascontiguousarray(array.T)
    rows, size = np.empty((columns, n)), max(PIECE // max(columns, 1), ROWS)
    for first in range(0, n, size):
        rows[:, first : first + size] = array[first : first + size].T
    return rows


def _keep(library: Any, size: int, unused: int) -> None:
    """Let glibc keep the memory of freed arrays up to a size, and so much of it without use [byte]."""
    if library.mallopt(MMAP_THRESHOLD, size):  # older ones refuse
        library.mallopt(TRIM_THRESHOLD, unused)
    _kept[0] = size


_kept = [BY_ITSELF]  # size up to which glibc keeps memory, as told last [byte]


@cache
def _glibc() -> Any:
    """Return the C library if it is glibc, else None."""
    if sys.platform != "linux":
        return None
    library = ctypes.CDLL(None)
    return library if hasattr(library, "mallopt") and hasattr(library, "malloc_trim") else None


def _longest(logs: Any) -> int:
    """Return the number of samples of the longest log; 0 for what holds none."""
    times = [getattr(log, "time", None) for log in (logs if isinstance(logs, (list, tuple)) else [logs])]
    return max((time.size for time in times if isinstance(time, np.ndarray)), default=0)
