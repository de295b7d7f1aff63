"""Linear algebra on one thread, so that a result does not depend on how many there are.

A library that splits a product among threads adds in another order, so the last digits differ. The matrices here are small, so
more threads would not be faster. OpenBLAS (contained in the wheels of numpy and scipy), MKL and BLIS can be set while they run.
Libraries that are loaded later read environment variables.
"""

from __future__ import annotations

import functools
import os
import re
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

VARIABLES = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
_LIBRARY = re.compile(
    r"(^|[/\\])lib[^/\\]*(blas|blis|mkl_rt)[^/\\]*$", re.IGNORECASE
)  # not what links to one
#: How a library is asked for its number of threads and told it.
_CALLS = (
    *(
        (f"{prefix}openblas_get_num_threads{suffix}", f"{prefix}openblas_set_num_threads{suffix}")
        for prefix in ("", "scipy_")
        for suffix in ("", "64_", "_64_")
    ),
    ("MKL_Get_Max_Threads", "MKL_Set_Num_Threads"),
    ("bli_thread_get_num_threads", "bli_thread_set_num_threads"),
)


class _Library(NamedTuple):
    """One that is loaded: where it lies, and its two calls."""

    path: str
    threads: Callable[[], int]
    limit: Callable[[int], object]


_lock = threading.Lock()
_under_way = 0
_before: dict[str, int] = {}  # library -> threads that it had
_environment: dict[str, str | None] = {}
_known: dict[int, list[_Library]] = {}  # modules imported -> libraries loaded by then


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep linear algebra on one thread within this block, in the whole process; blocks may overlap."""
    global _under_way  # noqa: PLW0603  (the setting is the process' own)
    with _lock:
        if not _under_way:
            _before.update({library.path: library.threads() for library in _find_libraries()})
            _limit({}, 1)
            _environment.update({name: os.environ.get(name) for name in VARIABLES})
            os.environ.update(dict.fromkeys(VARIABLES, "1"))
        _under_way += 1
    try:
        yield
    finally:
        with _lock:
            _under_way -= 1
            if not _under_way:
                _restore()


def on_one_thread(function: Callable[P, R]) -> Callable[P, R]:
    """Have a function do its linear algebra on one thread."""

    @functools.wraps(function)
    def run(*arguments: P.args, **options: P.kwargs) -> R:
        with one_thread():
            return function(*arguments, **options)

    return run


def _limit(threads: dict[str, int], otherwise: int) -> None:
    for library in _find_libraries():
        library.limit(threads.get(library.path, otherwise))


def _restore() -> None:
    for name, value in _environment.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value
    _limit(
        _before, max(_before.values(), default=os.cpu_count() or 1)
    )  # one loaded in between: as the others
    _before.clear()
    _environment.clear()


def _find_libraries() -> list[_Library]:
    """Return the libraries of linear algebra; searched again only if modules were imported since, because each may bring one."""
    modules = len(sys.modules)
    if modules not in _known:
        _known.clear()
        _known[modules] = _libraries()
    return _known[modules]


def _libraries() -> list[_Library]:
    import ctypes  # a command that needs none of this loads none of it

    found = []
    for path in _paths():
        try:
            handle = ctypes.CDLL(path)
        except OSError:
            continue
        for count, limit in _CALLS:
            if hasattr(handle, count) and hasattr(handle, limit):
                found.append(_Library(path, getattr(handle, count), getattr(handle, limit)))
                break
    return found


def _paths() -> list[str]:
    """Return the libraries of linear algebra that this process has loaded."""
    try:
        with open("/proc/self/maps") as maps:
            named = {line[line.index("/") :].rstrip("\n") for line in maps if "/" in line}
        return sorted(path for path in named if _LIBRARY.search(path))
    except OSError:  # elsewhere than on Linux: what the wheels bring
        import numpy as np

        root = Path(np.__file__).parent.parent
        folders = ("numpy.libs", "scipy.libs", "numpy/.dylibs", "scipy/.dylibs")
        return sorted(
            str(p) for folder in folders for p in root.glob(f"{folder}/*") if _LIBRARY.search(p.name)
        )
