"""Many untrusted files, each parsed in a process of its own that is forked from one server, which has loaded the libraries.

No file's parsing can affect that of the next, and none waits for libraries. Each process answers through a pipe of its own;
from the server comes only how it ended.
"""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from typing import Any

from backdrive.logs.readers import guard
from backdrive.logs.readers.columns import Columns, ReadOptions

_PAUSE = 5.0  # for the server to notice and say how its child ended [s]


class ForkServer(guard.Guard):
    """A server that forks a child for every file; it starts with the first file, and again if it dies."""

    MODULE = "backdrive.logs.readers._fork_worker"

    def __init__(self):
        super().__init__()
        self._requests: socket.socket | None = None

    def _launch(self, command: list[str], **options: Any) -> subprocess.Popen[bytes]:
        """Start the server; requests go to it through a socket, since a pipe for the answer goes with each."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        with theirs:
            try:
                process = super()._launch(command, **{**options, "stdin": theirs})
            except BaseException:
                ours.close()
                raise
        self._requests = ours
        return process

    def _read(self, line: bytes, options: ReadOptions, size: int) -> Columns | dict[str, Any]:
        answers, theirs = os.pipe()
        try:
            guard.widen_pipe(answers)
            try:
                self._ask(line, theirs)
            finally:
                os.close(theirs)
            answer = self._answer(answers, options, size)
            self._status()
            return answer
        except EOFError as error:
            how = self._status()
            raise (EOFError if how is None else guard.Death(how)) from error
        finally:
            os.close(answers)

    def _write(self, line: bytes, *pipes: int) -> None:
        self.start()
        assert self._requests is not None
        socket.send_fds(self._requests, [len(line).to_bytes(4, "little")], pipes)
        self._requests.sendall(line)

    def _status(self) -> str | None:
        """Return how the child ended, and wait for that; None if the server itself died."""
        assert self._process is not None
        assert self._process.stdout is not None
        code = bytearray(4)
        with suppress(EOFError):
            receive = guard.receiver(self._process.stdout.fileno(), time.monotonic() + _PAUSE)
            receive(memoryview(code))
            return guard.end_of(int.from_bytes(code, "little", signed=True))
        return None

    def _end(self) -> str:
        self._close_requests()
        return super()._end()

    def forget(self) -> None:
        """Drop the server without ending it: after a fork it belongs to the other process."""
        self._close_requests()
        super().forget()

    def _close_requests(self) -> None:
        requests, self._requests = self._requests, None
        if requests is not None:
            requests.close()


_SHARED = ForkServer()
guard.keep(_SHARED)


@contextmanager
def child_a_file() -> Generator[ForkServer, None, None]:
    """Have this thread read every file in a child of its own; the server is kept for the whole program."""
    with guard.use(_SHARED):
        yield _SHARED
