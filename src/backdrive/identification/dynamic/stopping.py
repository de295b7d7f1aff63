"""Ctrl-C during a fit: the first one ends the search and keeps the best result, the second one ends the program.

Python may raise an interruption at any instruction, where it can be lost in a thread or corrupt a partial result. So once a
result exists, the interruption is only noted, and raised between two evaluations of the search. Before that, it is raised at
once.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

T = TypeVar("T")


@dataclass
class _State:
    """What has happened so far.

    Attributes:
        noted: a first interruption waits to be raised.
        depth: fits under way.
        keeps: a search has found something.
    """

    noted: bool = False
    depth: int = 0
    keeps: bool = False


_state = _State()


def keep() -> None:
    """Note that there is a result now, which an interruption has to keep."""
    _state.keeps = True


def keeping() -> bool:
    """Return whether a fit is running that ends with its present result at a first interruption."""
    return _state.depth > 0 and _state.keeps


def is_interrupt_pending() -> bool:
    """Return whether an interruption is still pending that came too late to end a search."""
    return _state.noted


def check() -> None:
    """Raise the interruption that was noted, once.

    Raises:
        KeyboardInterrupt: a person asked for the end.
    """
    if _state.noted:
        _state.noted = False
        raise KeyboardInterrupt


@contextmanager
def gently() -> Iterator[None]:
    """Note the first Ctrl-C within this block; the second one, and any where signals cannot be caught, ends it at once."""
    plain = signal.default_int_handler
    if (
        _state.depth
        or threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not plain
    ):
        yield
        return

    def note(number, frame):
        if _state.noted or not _state.keeps:
            raise KeyboardInterrupt
        _state.noted = True

    _state.noted, _state.depth, _state.keeps = False, 1, False
    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, plain)
        _state.depth = 0


def result_or_none(call: Callable[[], T]) -> T | None:
    """Return what a call gives, or None where it was interrupted."""
    try:
        check()
        return call()
    except KeyboardInterrupt:
        return None
