"""Untrusted files are parsed in another process, so that the parent always returns columns or a typed error.

The child is started once and reused from file to file; when it dies, hangs or is interrupted it is killed and the
next file gets a new one. What it sends back is JSON and plain bytes, checked on arrival.
"""

from __future__ import annotations

import atexit
import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from backdrive import errors
from backdrive._documents import is_object

if TYPE_CHECKING:  # numpy is loaded only once the child has been started, so that both load at the same time
    from backdrive.logs.readers.columns import Columns, ReadOptions

_START = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from backdrive.logs.readers._worker import main; main()"

#: Time for a child to start and import its libraries, on a machine that is busy with other things [s].
_START_SECONDS = 60.0

_KEPT = ("PATH", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "TMPDIR", "SYSTEMROOT")
_LARGEST_HEADER = 1 << 26
_LARGEST_PIPE = 1 << 20


class Guard:
    """A child process that parses files, restarted when it dies.

    Use it as a context manager, or let `default_guard()` keep one for the whole program. Safe to use from several threads,
    one file at a time.
    """

    def __init__(self):
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.RLock()
        self.restarts = 0

    def __enter__(self) -> Guard:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def pid(self) -> int | None:
        """Process id of the child, if one is running."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Start the child ahead of the first file, so that it loads while the caller does something else.

        Raises:
            ReaderCrash: it cannot be started.
        """
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                return
            self.close()
            if not hasattr(select, "poll"):
                raise errors.ReaderCrash(
                    "This system cannot wait for a process with a time limit.",
                    remedy="If you trust the file, read it in Python with guarded=False.",
                )
            home = str(Path(errors.__file__).parents[1])
            paths = [path for path in sys.path if path]  # in their order: of two installed, the same one
            paths += [] if home in paths else [home]
            environment = {name: os.environ[name] for name in _KEPT if name in os.environ}
            environment.update(
                {name: "1" for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")},
                ARROW_DEFAULT_MEMORY_POOL="system",
                LC_ALL="C.UTF-8",
            )
            try:
                self._process = subprocess.Popen(
                    [sys.executable, "-I", "-S", "-c", _START, json.dumps(paths)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=None if os.environ.get("BACKDRIVE_TRACEBACK") else subprocess.DEVNULL,
                    env=environment,
                    bufsize=0,
                )
            except OSError as error:
                raise errors.ReaderCrash(
                    f"The parsing process cannot be started: {error}.",
                    remedy="If you trust the file, read it in Python with guarded=False.",
                ) from error
            self.restarts += 1
            try:  # Linux: fewer turns for large arrays
                import fcntl

                assert self._process.stdout is not None
                fcntl.fcntl(self._process.stdout.fileno(), fcntl.F_SETPIPE_SZ, _LARGEST_PIPE)
            except (ImportError, AttributeError, OSError):
                pass

    def read(self, path: str | Path, module: str, options: ReadOptions, *, size: int) -> Columns:
        """Parse one file in the child.

        Args:
            path: the file (or folder of a bag).
            module: reader of `backdrive.logs.readers`.
            options: what the person said.
            size: bytes of the file, from which time and memory are reckoned [B].

        Raises:
            ReadError: or one of its children; always within the time limit.
            MissingExtra: an optional dependency is not installed.
        """
        from backdrive.logs.readers.columns import unframe

        limits = options.limits
        request = {"path": str(path), "module": module, "size": size, **asdict(options)}
        line = json.dumps(request).encode() + b"\n"
        with self._lock:
            try:
                self._ask(line)
                answer = self._receive_header(_START_SECONDS)
                if answer.get("ready"):
                    until = time.monotonic() + limits.seconds_for(size)
                    answer = self._receive_header(until - time.monotonic())
                    if "error" not in answer:
                        return unframe(answer, self._receiver(until), limits)
            except TimeoutError:
                self._end()
                raise errors.ReaderTimeout(
                    f"Parsing took longer than {limits.seconds_for(size):.1f} s, the limit for {size} bytes.",
                    remedy="If you trust the file, read it in Python with limits=Limits(max_seconds=...).",
                ) from None
            except (EOFError, BrokenPipeError) as error:
                raise errors.ReaderCrash(
                    f"The process that parsed the file died ({self._end()}).",
                    remedy="The file is damaged or hostile; save it again, or in another format.",
                ) from error
            except BaseException:  # interrupted, or an invalid answer: this child must not be used again
                self._end()
                raise
        raise _error(answer)

    def close(self) -> None:
        """End the child."""
        with self._lock:
            self._end()

    def kill(self) -> None:
        """Kill the child without waiting for anybody, as this process is about to end."""
        process = self._process
        if process is not None:
            process.kill()

    def forget(self) -> None:
        """Drop the child without ending it: after a fork it belongs to the other process."""
        process, self._process, self._lock = self._process, None, threading.RLock()
        if process is not None:
            process.returncode = 0
            for stream in (process.stdin, process.stdout):
                if stream is not None:
                    stream.close()

    def _ask(self, line: bytes) -> None:
        """Send a request; a child that died while idle is replaced once."""
        try:
            self._write(line)
        except BrokenPipeError:
            self._end()
            self._write(line)

    def _write(self, line: bytes) -> None:
        self.start()
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(line)

    def _end(self) -> str:
        """Kill the child, wait for it, close its pipes; return how it ended."""
        process, self._process = self._process, None
        if process is None:
            return "it never started"
        # A dying child closes its pipes a moment before its exit status is there: ask for its own first.
        try:
            code = process.wait(0.2) if process.stdout is not None and _hung_up(process.stdout) else None
        except subprocess.TimeoutExpired:
            code = None
        if code is None:
            process.kill()
            code = process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                stream.close()
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"

    def _receiver(self, until: float) -> Callable[[memoryview], None]:
        """Return a function that fills a buffer from the pipe, or raises at `until` [s, monotonic]."""
        assert self._process is not None
        assert self._process.stdout is not None
        pipe = self._process.stdout.fileno()
        poll = select.poll()
        poll.register(pipe, select.POLLIN)

        def receive(view: memoryview) -> None:
            while view:
                if not poll.poll(max(0.0, until - time.monotonic()) * 1000):
                    raise TimeoutError
                got = os.readv(pipe, [view])
                if not got:
                    raise EOFError
                view = view[got:]

        return receive

    def _receive_header(self, seconds: float) -> dict[str, Any]:
        receive = self._receiver(time.monotonic() + seconds)
        length = bytearray(4)
        receive(memoryview(length))
        size = int.from_bytes(length, "little")
        if size > _LARGEST_HEADER:
            raise errors.ReaderCrash(
                "The parsing process answered nonsense.", remedy="The file is damaged or hostile."
            )
        text = bytearray(size)
        receive(memoryview(text))
        try:
            answer = json.loads(text)
            if is_object(answer):
                return answer
        except (ValueError, RecursionError):
            pass
        raise errors.ReaderCrash(
            "The parsing process answered nonsense.", remedy="The file is damaged or hostile."
        )


def _hung_up(stream: Any) -> bool:
    poll = select.poll()
    poll.register(stream.fileno(), select.POLLIN)
    return any(flags & select.POLLHUP for _, flags in poll.poll(0))


def _error(answer: dict[str, Any]) -> errors.BackdriveError:
    """Return the typed error that the child reported; only known classes are made."""
    from backdrive.logs.readers.columns import clean

    cls = getattr(errors, str(answer.get("error")), None)
    if not (
        isinstance(cls, type)
        and issubclass(cls, (errors.ReadError, errors.MissingExtra, errors.InvalidInput))
    ):
        cls = errors.ReadError
    return cls(clean(answer.get("message"), 2000), remedy=clean(answer.get("remedy", ""), 2000))


_SHARED = Guard()
atexit.register(_SHARED.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_SHARED.forget)


def default_guard() -> Guard:
    """Return the guard that `read_log` keeps for the whole program."""
    return _SHARED
