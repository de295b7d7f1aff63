"""The process that parses untrusted files: one request at a time, answers without pickle, and no other system access.

Started by `backdrive.logs.readers.guard`. It reads JSON requests from its standard input, one a line, and answers on a
private copy of its standard output. It ends when the input closes, when the kernel's alarm rings, or when killed.
"""

from __future__ import annotations

import importlib
import io
import json
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from backdrive import errors
from backdrive.logs.readers.columns import Columns, ReadOptions, frames, header
from backdrive.logs.readers.limits import Limits

#: Audit events that no log needs; a file whose parser raises one is refused.
_FORBIDDEN = ("pickle.find_class", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "subprocess.Popen", "socket.connect",
              "socket.bind", "os.remove", "os.rename", "os.truncate", "os.fork", "os.forkpty", "shutil.rmtree")  # fmt: skip

#: Not empty while a file is being parsed: imports of libraries may do what the parsing of a file may not.
_parsing: list[str] = []
_READY = header({"ready": True})


def parse(path: str, module: str, options: ReadOptions) -> Columns:
    """Read a file with one reader; whatever goes wrong comes out as a typed error.

    Raises:
        ReadError: or one of its children.
        MissingExtra: an optional dependency is not installed.
        MappingError: an option does not fit the file.
    """
    reader: Callable[[str, ReadOptions], Columns] = importlib.import_module(
        f"backdrive.logs.readers.{module}"
    ).read
    try:
        return reader(path, options)
    except errors.BackdriveError:
        raise
    except MemoryError as error:
        raise errors.FileTooLarge(
            "The file needs more memory than the limits allow.",
            remedy="If you trust the file, read it in Python with limits=Limits(max_memory=...).",
        ) from error
    except RecursionError as error:
        raise errors.ForbiddenContent(
            "The file's content is nested too deeply.", remedy="Name another file."
        ) from error
    except FileNotFoundError as error:
        raise errors.ReadError(f"{error.filename} does not exist.", remedy="Check the name.") from error
    except Exception as error:
        kind = module.strip("_")
        raise errors.ReadError(
            f"The file cannot be read as {kind} ({type(error).__name__}: {str(error)[:300]}).",
            remedy="It is damaged, or of another kind; say which: --format NAME (in Python format=).",
        ) from error


def main() -> None:
    """Answer requests until the input closes."""
    answers = stream_of(os.dup(1))
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)  # what a library prints must not end up among the answers
    quiet()
    locked = False
    for line in sys.stdin.buffer:
        request = json.loads(line)
        try:
            prepare(request)
        except errors.BackdriveError as error:
            send(answers, [failure(error)])
            continue
        if not locked:
            lock()
            locked = True
        answer(task_of(request), answers)


def stream_of(pipe: int) -> io.FileIO:
    """Return the pipe to the parent as a stream of bytes."""
    return os.fdopen(pipe, "wb", buffering=0)


def quiet() -> None:
    """Leave Ctrl-C to the parent, which then ends this process, and the alarm to the kernel, even if the parent is gone."""
    import signal

    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def prepare(request: dict[str, Any]) -> None:
    """Load what a request's reader needs, ahead of the time limit.

    Raises:
        MissingExtra: an optional dependency is not installed.
    """
    reader = importlib.import_module(f"backdrive.logs.readers.{request['module']}")
    getattr(reader, "prepare", lambda: None)()


@dataclass(frozen=True)
class Task:
    """A request as `answer` takes it.

    Attributes:
        path: of the file.
        module: reader of `backdrive.logs.readers`.
        options: of the reader.
        memory: bound of the address space, soft and hard [B]; None where the system has none.
        seconds: time limit [s].
    """

    path: str
    module: str
    options: ReadOptions
    memory: tuple[int, int] | None
    seconds: float


def task_of(request: dict[str, Any]) -> Task:
    """Return a request's task, with all that can be settled ahead of the file: after a fork, each page of memory that is
    touched costs its copy.
    """
    limits = Limits(**request["limits"])
    options = ReadOptions(
        topic=request["topic"],
        joints=tuple(request["joints"]),
        parts=tuple(request["parts"]),
        limits=limits,
    )
    memory = _memory_bound(limits.memory_for(request["size"]))
    return Task(
        request["path"], request["module"], options, memory, limits.seconds_for(request["size"]) + 1.0
    )


def answer(task: Task, answers: Any) -> None:
    """Parse a file within its limits of memory and time, and send its columns or the error."""
    import signal

    send(answers, [_READY])
    _bound_memory(task.memory)
    signal.setitimer(signal.ITIMER_REAL, task.seconds)
    _parsing.append(task.path)
    try:
        parts: Any = frames(parse(task.path, task.module, task.options))
    except errors.BackdriveError as error:
        parts = [failure(error)]
    _parsing.clear()
    send(answers, parts)
    signal.setitimer(signal.ITIMER_REAL, 0.0)


def failure(error: errors.BackdriveError) -> bytes:
    """Return an error as the parent takes it."""
    return header({"error": type(error).__name__, "message": error.message, "remedy": error.remedy})


def send(stream: Any, parts: Any) -> None:
    """Write all parts of an answer."""
    for part in parts:
        view = memoryview(part)
        while view:
            view = view[stream.write(view) :]


def lock() -> None:
    """Disable what parsing does not need: core dumps, writing files, other programs, the network."""
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    sys.dont_write_bytecode = True

    def refuse(event: str, arguments: tuple[Any, ...]) -> None:
        if _parsing and event.startswith(_FORBIDDEN):
            raise errors.ForbiddenContent(
                f"The file led its parser to {event}.", remedy="Do not use this file."
            )

    sys.addaudithook(refuse)


def _bound_memory(bound: tuple[int, int] | None) -> None:
    """Bound the address space as `_memory_bound` says."""
    if bound is not None:
        import resource

        with suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_AS, bound)


def _memory_bound(more: int) -> tuple[int, int] | None:
    """Return the bound of the address space, what is in use now and `more` bytes, and the hard one [B]; macOS has no such limit."""
    try:
        import resource

        with open("/proc/self/statm") as statm:
            used = int(statm.read().split()[0]) * resource.getpagesize()
        return used + more, resource.getrlimit(resource.RLIMIT_AS)[1]
    except (ImportError, OSError, ValueError):
        return None
