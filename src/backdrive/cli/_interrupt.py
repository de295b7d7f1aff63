"""Ctrl-C: within a second the command ends with 130, whatever it is about; a search keeps the best that it has found.

Python raises `KeyboardInterrupt` in the main thread, between two of its own instructions. Two things may go wrong with that: a long
compiled call lets it wait, and a callback from compiled code, as the compiler makes them, may swallow it. So a thread is told of
the signal at the moment it arrives, and after a grace for the usual way out ends the process itself.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn

GRACE = 0.5  # for the usual way out, which removes temporary files [s]
CODE = 130  # 128 and the number of the signal, as shells count

_interrupted = threading.Event()


@contextmanager
def watch() -> Iterator[None]:
    """End the process soon after a Ctrl-C within this block; elsewhere than in the main thread nothing is changed."""
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        yield
        return
    _interrupted.clear()
    ears, mouth = os.pipe()
    os.set_blocking(mouth, False)
    before = signal.set_wakeup_fd(mouth, warn_on_full_buffer=False)
    hook, sys.unraisablehook = sys.unraisablehook, _quiet(sys.unraisablehook)
    watch = threading.Thread(target=_watch, args=(ears,), daemon=True, name="interrupts")
    watch.start()
    try:
        yield
    finally:
        sys.unraisablehook = hook
        signal.set_wakeup_fd(before)
        os.close(mouth)
        watch.join()
        os.close(ears)


def _watch(ears: int) -> None:
    """Wait for signals; 0 bytes say that the block was left."""
    heard = 0
    while got := os.read(ears, 1):
        if got[0] == signal.SIGINT:
            heard += 1
            _interrupted.set()
        if heard > 1 or (heard and not _keeping()):
            time.sleep(GRACE)
            leave()


def signal_came() -> bool:
    """Return whether a signal has arrived: what fails then, as a compiler that is torn out of its work, is no fault of ours."""
    return _interrupted.wait(0.02)  # the watch has to come to it


def _keeping() -> bool:
    """Return whether a fit has something that a first Ctrl-C is to keep."""
    stopping = sys.modules.get("backdrive.identification.dynamic.stopping")
    return stopping is not None and stopping.keeping()


def leave(*, said: bool = False) -> NoReturn:
    """Say so, unless it was said, and end the process at once, its children included, without waiting for threads."""
    guard = sys.modules.get("backdrive.logs.readers.guard")
    if guard is not None:
        guard.default_guard().kill()
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    with suppress(OSError, ValueError):
        sys.stderr.flush()
    with suppress(OSError):
        show = b"\x1b[?25h" if os.isatty(2) else b""  # a progress line hides the cursor
        os.write(2, show + (b"" if said else b"Interrupted; nothing half-written was left behind.\n"))
    os._exit(CODE)


def _quiet(hook):
    """Return a hook that does not speak of an interruption that a callback has swallowed: the watch does what it asked for."""

    def unraisable(about):
        if not (about.exc_type and issubclass(about.exc_type, KeyboardInterrupt)):
            hook(about)

    return unraisable
