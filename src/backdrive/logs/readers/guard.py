"""Untrusted files are parsed in another process, so that the parent always returns columns or a typed error.

The child is started once and reused from file to file; when it dies, hangs or is interrupted it is killed and the
next file gets a new one. Many files are each read in a child of their own (`fork_server`). What comes back is JSON and plain
bytes, checked on arrival.
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
from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from backdrive import errors
from backdrive._documents import is_object

if TYPE_CHECKING:  # numpy is loaded only once the child has been started, so that both load at the same time
    from backdrive.logs.readers.columns import Columns, ReadOptions

_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from importlib import import_module; import_module(sys.argv[2]).main()"
)

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

    MODULE = "backdrive.logs.readers._worker"  # that the child runs

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
                JE_ARROW_MALLOC_CONF="background_thread:false",  # a thread would not survive a fork
                LC_ALL="C.UTF-8",
            )
            try:
                self._process = self._launch(
                    [sys.executable, "-I", "-S", "-c", _START, json.dumps(paths), self.MODULE],
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
            assert self._process.stdout is not None
            widen_pipe(self._process.stdout.fileno())

    def _launch(self, command: list[str], **options: Any) -> subprocess.Popen[bytes]:
        """Start a process."""
        return cast("subprocess.Popen[bytes]", subprocess.Popen(command, **options))

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
        limits = options.limits
        request = {"path": str(path), "module": module, "size": size, **vars(options), "limits": vars(limits)}
        line = json.dumps(request).encode() + b"\n"
        with self._lock:
            try:
                answer = self._read(line, options, size)
                if not isinstance(answer, dict):
                    return answer
            except Death as error:  # of a child of the process that this one has started
                raise _crash(str(error)) from error
            except TimeoutError:
                self._end()
                raise errors.ReaderTimeout(
                    f"Parsing took longer than {limits.seconds_for(size):.1f} s, the limit for {size} bytes.",
                    remedy="If you trust the file, read it in Python with limits=Limits(max_seconds=...).",
                ) from None
            except (EOFError, BrokenPipeError) as error:
                raise _crash(self._end()) from error
            except BaseException:  # interrupted, or an invalid answer: this child must not be used again
                self._end()
                raise
        raise _error(answer)

    def _read(self, line: bytes, options: ReadOptions, size: int) -> Columns | dict[str, Any]:
        """Send a request; return the columns, or the error that the child reported."""
        self._ask(line)
        assert self._process is not None
        assert self._process.stdout is not None
        return self._answer(self._process.stdout.fileno(), options, size)

    def _answer(self, pipe: int, options: ReadOptions, size: int) -> Columns | dict[str, Any]:
        """Receive the answer to a request."""
        from backdrive.logs.readers.columns import unframe

        answer = _receive_header(pipe, _START_SECONDS)
        if answer.get("ready"):
            until = time.monotonic() + options.limits.seconds_for(size)
            answer = _receive_header(pipe, until - time.monotonic())
            if "error" not in answer:
                return unframe(answer, receiver(pipe, until), options.limits)
        return answer

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

    def _ask(self, line: bytes, *pipes: int) -> None:
        """Send a request; a child that died while idle is replaced once."""
        try:
            self._write(line, *pipes)
        except (BrokenPipeError, ConnectionResetError):
            self._end()
            self._write(line, *pipes)

    def _write(self, line: bytes, *pipes: int) -> None:
        del pipes
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
        return end_of(code)


class Death(Exception):
    """A child that parsed a file died; the message says how."""


def end_of(code: int) -> str:
    """Return how a process ended by its exit code, negative for a signal."""
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


def widen_pipe(pipe: int) -> None:
    """Let a pipe hold more, where the system allows it: fewer turns for large arrays."""
    try:
        import fcntl

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _LARGEST_PIPE)
    except (ImportError, AttributeError, OSError):
        pass


def receiver(pipe: int, until: float) -> Callable[[memoryview], None]:
    """Return a function that fills a buffer from a pipe, or raises at `until` [s, monotonic]."""
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


def _receive_header(pipe: int, seconds: float) -> dict[str, Any]:
    receive = receiver(pipe, time.monotonic() + seconds)
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


def _crash(how: str) -> errors.ReaderCrash:
    return errors.ReaderCrash(
        f"The process that parsed the file died ({how}).",
        remedy="The file is damaged or hostile; save it again, or in another format.",
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


def keep(guard: Guard) -> Guard:
    """Keep a guard for the whole program: it is closed at the end, and a fork of the program starts one of its own."""
    _KEPT_GUARDS.append(guard)
    atexit.register(guard.close)
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=guard.forget)
    return guard


_KEPT_GUARDS: list[Guard] = []
_SHARED = keep(Guard())
_chosen: ContextVar[Guard | None] = ContextVar("guard", default=None)


def default_guard() -> Guard:
    """Return the guard that `read_log` uses: that of `use`, or one that is kept for the whole program."""
    return _chosen.get() or _SHARED


@contextmanager
def use(guard: Guard) -> Generator[None, None, None]:
    """Have this thread read files through a guard."""
    token = _chosen.set(guard)
    try:
        yield
    finally:
        _chosen.reset(token)


def kill_all() -> None:
    """Kill all children without waiting for anybody, as this process is about to end."""
    for guard in _KEPT_GUARDS:
        guard.kill()
