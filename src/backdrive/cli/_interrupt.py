"""Ctrl-C ends every command with exit code 130 within a second; a search keeps the best result found so far.

Python raises `KeyboardInterrupt` in the main thread, between two of its own instructions. A long compiled call delays it, and
a callback from compiled code may swallow it. So a second thread receives the signal at once. It ends the process itself if
the usual exit takes longer than a grace period.
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

GRACE = 0.5  # time for the usual exit, which removes temporary files [s]
CODE = 130  # 128 plus the number of the signal, as in shells

_interrupted = threading.Event()


@contextmanager
def watch() -> Iterator[None]:
    """End the process soon after a Ctrl-C within this block. Outside the main thread this does nothing."""
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
    """Wait for signals until the pipe closes, which marks the end of the block."""
    heard = 0
    while got := os.read(ears, 1):
        if got[0] == signal.SIGINT:
            heard += 1
            _interrupted.set()
        if heard > 1 or (heard and not _keeping()):
            time.sleep(GRACE)
            leave()


def signal_came() -> bool:
    """Return whether a signal has arrived. An error after it, such as that of an interrupted compiler, is not a fault of this
    package.
    """
    return _interrupted.wait(0.02)  # gives the watching thread time to see the signal


def _keeping() -> bool:
    """Return whether a fit is running whose best result a first Ctrl-C keeps."""
    stopping = sys.modules.get("backdrive.identification.dynamic.stopping")
    return stopping is not None and stopping.keeping()


def leave(*, said: bool = False) -> NoReturn:
    """Report the interruption, unless it was reported, and end the process and its children at once, without waiting for
    threads.
    """
    guard = sys.modules.get("backdrive.logs.readers.guard")
    if guard is not None:
        guard.kill_all()
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    with suppress(OSError, ValueError):
        sys.stderr.flush()
    with suppress(OSError):
        show = b"\x1b[?25h" if os.isatty(2) else b""  # a progress line hides the cursor
        os.write(2, show + (b"" if said else b"Interrupted; nothing half-written was left behind.\n"))
    os._exit(CODE)


def _quiet(hook):
    """Return a hook that ignores a `KeyboardInterrupt` that a callback has swallowed: the watching thread ends the process
    anyway.
    """

    def unraisable(about):
        if not (about.exc_type and issubclass(about.exc_type, KeyboardInterrupt)):
            hook(about)

    return unraisable
