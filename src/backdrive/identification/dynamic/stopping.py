"""Ctrl-C during a fit: the first one ends the search and keeps the best result, the second one ends the program.

Python may raise an interruption at any instruction, where it can be lost in a thread or corrupt a partial result. As soon as
a result exists, an interruption is therefore recorded, and raised between two evaluations of the search. Before that, it is
raised at once.
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
    """The state of the handler.

    Attributes:
        noted: a first interruption is recorded but not yet raised.
        depth: number of running fits.
        keeps: a search has a result.
    """

    noted: bool = False
    depth: int = 0
    keeps: bool = False


_state = _State()


def keep() -> None:
    """Record that there is a result, which an interruption must not lose."""
    _state.keeps = True


def keeping() -> bool:
    """Return whether a fit is running that will end with its present result at the first interruption."""
    return _state.depth > 0 and _state.keeps


def is_interrupt_pending() -> bool:
    """Return whether an interruption is pending, because it came too late to end a search."""
    return _state.noted


def check() -> None:
    """Raise a recorded interruption, once.

    Raises:
        KeyboardInterrupt: a person interrupted the fit.
    """
    if _state.noted:
        _state.noted = False
        raise KeyboardInterrupt


@contextmanager
def gently() -> Iterator[None]:
    """Record the first Ctrl-C within this block once there is a result; any other one ends the block at once."""
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
    """Return the result of a call, or None if it was interrupted."""
    try:
        check()
        return call()
    except KeyboardInterrupt:
        return None
