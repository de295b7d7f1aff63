"""Locks of a folder of results, held by flock: they end with the process, for whatever reason it ends."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from backdrive.errors import InvalidInput, WriteError

try:
    import fcntl
except ImportError:  # no such locks: runs do not exclude each other
    fcntl = None


@contextmanager
def lock(folder: Path, shard: tuple[int, int] = (1, 1)) -> Iterator[None]:
    """Lock a folder, or a shard of it, against a second run; different shards do not exclude each other.

    Args:
        folder: of the results.
        shard: i of n.

    Raises:
        InvalidInput: another run holds it.
    """
    if fcntl is None:
        yield
        return
    index, count = shard
    whole = _open(folder / ".lock")
    part = _open(folder / f".lock-{index}-{count}")
    try:
        for handle, kind in ((whole, fcntl.LOCK_EX if count == 1 else fcntl.LOCK_SH), (part, fcntl.LOCK_EX)):
            try:
                fcntl.flock(handle, kind | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise InvalidInput(
                    f"Another run is using {folder}.", remedy="Wait until it ends; its results are kept."
                ) from error
        yield
    finally:
        os.close(part)
        os.close(whole)


@contextmanager
def editing(folder: Path) -> Iterator[None]:
    """Wait for other shards that are changing existing files of results, and let no other one do so meanwhile.

    Args:
        folder: of the results.
    """
    if fcntl is None:
        yield
        return
    handle = _open(folder / ".lock-edit")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _open(path: Path) -> int:
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise WriteError(
            f"Cannot write {path}: {error.strerror}.", remedy="Name a folder that can be written with -o."
        ) from error
