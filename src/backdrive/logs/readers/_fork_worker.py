"""The server that `backdrive.logs.readers.fork_server` starts: it loads readers, and forks a child for every file.

It holds one thread and parses nothing. Its children end with it, and it ends with the process that started it.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import select
import signal
import socket
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

from backdrive import errors
from backdrive.logs.readers import _worker

_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux
_C_LIBRARY = ctypes.CDLL(None)
_POLL = 0.005  # between looks at a child where the system has no descriptor of a process [s]


def main() -> None:
    """Answer requests until the socket closes."""
    _worker.quiet()
    status, requests = os.dup(1), socket.socket(fileno=os.dup(0))
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 0)
    os.dup2(nowhere, 1)  # what a library prints must not end up among the answers
    locked = False
    while (received := _receive(requests)) is not None:
        request, pipe = received
        with _worker.stream_of(pipe) as answers:
            try:
                _worker.prepare(request)
                _check_threads()
                task = _worker.task_of(request)
            except errors.BackdriveError as error:
                _worker.send(answers, [_worker.failure(error)])
                os.write(status, _bytes(0))
                continue
            if not locked:
                _worker.lock()
                gc.freeze()  # so that children share these pages for good
                locked = True
            server = os.getpid()
            child = os.fork()
            if child == 0:
                requests.close()
                os.close(status)
                _parse(task, answers, server)
        os.write(status, _bytes(_wait(child, requests)))


def _check_threads() -> None:
    """Refuse to fork beside threads, which may hold locks that nobody in the child would release.

    Raises:
        ReaderCrash: a library has started one.
    """
    with suppress(OSError):
        names = [Path(f"/proc/self/task/{n}/comm").read_text().strip() for n in os.listdir("/proc/self/task")]
        if len(names) > 1:
            raise errors.ReaderCrash(
                f"The parsing process cannot be forked beside its threads {', '.join(names[1:])}.",
                remedy="Read the files one by one.",
            )


def _parse(task: _worker.Task, answers: Any, server: int) -> NoReturn:
    """Parse one file in the child, which ends with that."""
    code = 1
    try:
        if sys.platform == "linux":
            _C_LIBRARY.prctl(_DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() == server:
            _worker.answer(task, answers)
            code = 0
    finally:
        os._exit(code)


def _wait(child: int, requests: socket.socket) -> int:
    """Return how a child ended, negative by a signal; it is killed when nobody waits for its answer any more."""
    poll = select.poll()
    poll.register(requests, select.POLLRDHUP if hasattr(select, "POLLRDHUP") else select.POLLHUP)
    with _Descriptor(child) as descriptor:
        if descriptor is not None:
            poll.register(descriptor, select.POLLIN)
        while True:
            ready = poll.poll(None if descriptor is not None else 1e3 * _POLL)
            if any(number == requests.fileno() for number, _ in ready):
                os.kill(child, signal.SIGKILL)
            done, end = os.waitpid(child, os.WNOHANG)
            if done:
                return os.waitstatus_to_exitcode(end)
            if ready and descriptor is None:
                time.sleep(_POLL)


class _Descriptor:
    """A descriptor that is readable when a process has ended; None where the system has none."""

    def __init__(self, process: int):
        try:
            self._number = os.pidfd_open(process)
        except (AttributeError, OSError):
            self._number = None

    def __enter__(self) -> int | None:
        return self._number

    def __exit__(self, *exception: object) -> None:
        if self._number is not None:
            os.close(self._number)


def _receive(requests: socket.socket) -> tuple[dict[str, Any], int] | None:
    """Return a request and the pipe for its answer; None when the socket has closed."""
    try:
        head, pipes, _, _ = socket.recv_fds(requests, 4, 1)
        if len(head) < 4 or not pipes:
            return None
        line = bytearray(int.from_bytes(head, "little"))
        view = memoryview(line)
        while view:
            count = requests.recv_into(view)
            if not count:
                return None
            view = view[count:]
        return json.loads(line), pipes[0]
    except OSError:
        return None


def _bytes(code: int) -> bytes:
    return code.to_bytes(4, "little", signed=True)
