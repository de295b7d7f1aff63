"""Logs in object stores, through fsspec: listed by address, and copied one by one to a local file for the guarded reader."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import Any

from backdrive.errors import FileTooLarge, MissingExtra, ReadError, require
from backdrive.logs.readers._formats import SUFFIXES

#: Accepted protocols; chained or caching protocols of fsspec (`simplecache::`, `zip::`, `reference::`) are refused.
PROTOCOLS = ("s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "memory")
BLOCK = 1 << 20  # read at once [B]


def filesystem(address: str) -> tuple[Any, str]:
    """Return the file system of an address, and the path in it.

    Raises:
        ReadError: the protocol is none of an object store.
        MissingExtra: fsspec, or the client of the store, is not installed.
    """
    fsspec = require("fsspec", "An object store needs", "fleet")
    protocol, _, path = address.partition("://")
    if protocol not in PROTOCOLS or "::" in address:
        raise ReadError(
            f"{address}: '{protocol}' is no object store that logs are read from.",
            remedy=f"Use one of {', '.join(PROTOCOLS)}, or a local folder.",
        )
    try:
        return fsspec.filesystem(protocol), path
    except ImportError as error:
        raise MissingExtra(
            f"{address}: {error}.", remedy="Install the client that it names with pip."
        ) from error


def list_objects(address: str) -> Iterator[tuple[str, int, str, float, str]]:
    """Yield address, size [B], stamp, time of change [s since 1970] and path below the source of every log.

    Args:
        address: of a folder, an object or a pattern.

    Raises:
        ReadError: the store does not answer, or there is nothing.
    """
    system, path = filesystem(address)
    protocol = address.partition("://")[0]
    pattern, root = any(sign in path for sign in "*?["), folder_of(address)
    with _explain_errors(address):
        infos = system.glob(path, detail=True) if pattern else system.find(path, detail=True)
    for name, info in infos.items():
        if info.get("type") == "file" and PurePosixPath(name).suffix.lower() in SUFFIXES:
            inside = (
                name.strip("/").removeprefix(root.strip("/")).strip("/")
                if name != root
                else PurePosixPath(name).name
            )
            yield _metadata(protocol, name, info, inside or PurePosixPath(name).name)


def folder_of(address: str) -> str:
    """Return the path of an address, without its protocol; of a pattern, the folder above its first sign."""
    path = address.partition("://")[2]
    signs = [path.find(sign) for sign in "*?[" if sign in path]
    return path[: min(signs)].rpartition("/")[0] if signs else path.rstrip("/")


def describe(address: str) -> tuple[str, int, str, float, str]:
    """Return the same of one object.

    Raises:
        ReadError: it is not there.
    """
    system, path = filesystem(address)
    with _explain_errors(address):
        info = system.info(path)
    return _metadata(address.partition("://")[0], info["name"], info, PurePosixPath(path).name)


def _metadata(protocol: str, name: str, info: Any, inside: str) -> tuple[str, int, str, float, str]:
    when = info.get("LastModified") or info.get("created") or info.get("mtime") or 0.0
    changed = when.timestamp() if isinstance(when, datetime) else float(when)
    size = int(info.get("size") or 0)
    tag = str(info.get("ETag") or info.get("etag") or changed).strip('"')
    return f"{protocol}://{name.lstrip('/')}", size, f"{size}:{tag}", changed, inside


@contextlib.contextmanager
def fetch(address: str, most: int) -> Iterator[Path]:
    """Yield a local copy of an object, gone afterwards.

    Args:
        address: of it.
        most: size beyond which it is refused [B].

    Raises:
        ReadError: it cannot be read.
        FileTooLarge: it is larger than `most`.
    """
    system, path = filesystem(address)
    folder = tempfile.mkdtemp(prefix="backdrive-")
    try:
        copy = Path(folder) / PurePosixPath(path).name
        with _explain_errors(address), system.open(path, "rb") as source, open(copy, "wb") as target:
            size = 0
            while block := source.read(BLOCK):
                size += len(block)
                if size > most:
                    raise FileTooLarge(f"{address} is larger than {most} bytes.", remedy="Name another one.")
                target.write(block)
        yield copy
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def _explain_errors(address: str) -> Iterator[None]:
    """Convert errors of a store's client, which may be of any class, into one error that names the address."""
    try:
        yield
    except (ReadError, FileTooLarge, MemoryError):
        raise
    except Exception as error:
        remedy = "Check the address, the credentials and the network"
        remedy += f" ({os.environ['AWS_ENDPOINT_URL']})." if "AWS_ENDPOINT_URL" in os.environ else "."
        raise ReadError(f"{address}: {type(error).__name__}: {str(error)[:300]}.", remedy=remedy) from error
