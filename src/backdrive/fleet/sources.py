"""The logs of a fleet, from a folder, a pattern, a manifest or an object store, with robot, type and day of each."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

from backdrive.errors import ReadError, UnknownFormat, require
from backdrive.fleet.entries import LogEntry, entry_of, local_entry, printable
from backdrive.fleet.manifests import is_manifest, read_manifest
from backdrive.logs.readers._formats import SUFFIXES

HEAD = "fleet.json"  # a folder that holds it, with this mark, holds results and no logs
MARK = b'"kind": "backdrive fleet"'


def list_logs(
    source: str | os.PathLike | Sequence[str | os.PathLike],
    *,
    shard: tuple[int, int] = (1, 1),
    remarks: list[str] | None = None,
) -> list[LogEntry]:
    """Return the logs of a source, in the order of their paths.

    A manifest is a CSV or TSV file whose header names `path` and, as far as known, `robot`, `type` and `day` (YYYY-MM-DD).
    Without a manifest, the day is a date in the path, or else the date of the file's last change. The robot is the first folder
    below the source, or else the file's name without the date, or else the name of the source's folder. Local paths are made
    absolute. Folders that hold the results of a fleet are left out.

    Args:
        source: a folder, a pattern such as `logs/*/2026-*.npz`, a manifest, or `s3://bucket/folder`; or several of them.
        shard: i of n: only every log whose path falls into this part.
        remarks: gets a sentence for each folder that cannot be read.

    Raises:
        ReadError: there is no such source, or it contains no log.
        InvalidInput: a manifest has invalid columns.
    """
    remarks = [] if remarks is None else remarks
    several = [source] if isinstance(source, (str, os.PathLike)) else list(source)
    every: dict[str, LogEntry] = {}
    for one in several:
        every.update((entry.path, entry) for entry in _of(str(one), remarks))
    if not every:
        raise UnknownFormat(
            f"{', '.join(printable(str(one)) for one in several)} holds no log. Suffixes that are looked for: "
            f"{' '.join(SUFFIXES)}." + "".join(f" {remark}" for remark in remarks),
            remedy="Name the folder that holds the robots' folders, a pattern in quotes, or a manifest.",
        )
    index, count = shard
    return [every[path] for path in sorted(every) if count == 1 or _part(path, count) == index - 1]


def _part(path: str, count: int) -> int:
    """Return which of `count` parts a path belongs to."""
    return int.from_bytes(hashlib.sha256(path.encode("utf-8", "surrogateescape")).digest()[:8]) % count


def _of(source: str, remarks: list[str]) -> Iterator[LogEntry]:
    if "://" in source:
        from backdrive.fleet.objects import folder_of, list_objects

        name = folder_of(source).rpartition("/")[2]
        yield from (entry_of(*one, source=name) for one in list_objects(source))
    elif os.path.isdir(source):
        yield from _of_folder(os.path.abspath(source), remarks)
    elif any(sign in source for sign in "*?[") and not os.path.exists(source):
        yield from _of_pattern(os.path.abspath(source))
    elif is_manifest(source):
        yield from read_manifest(source)
    elif os.path.isfile(source):
        path = os.path.abspath(source)
        yield local_entry(path, os.path.dirname(path))
    else:
        raise ReadError(f"{printable(source)} does not exist.", remedy="Check the name.")


def _of_folder(folder: str, remarks: list[str]) -> Iterator[LogEntry]:
    """Yield the logs below a folder; links to folders are not followed."""

    def unreadable(error: OSError) -> None:
        name = printable(str(error.filename))
        remarks.append(f"The folder {name} cannot be read ({error.strerror}): its logs are left out.")

    for place, folders, files in os.walk(folder, onerror=unreadable):
        if HEAD in files and _holds_results(place):
            folders[:] = []
            continue
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in files:
            if not name.startswith(".") and os.path.splitext(name)[1].lower() in SUFFIXES:
                path = os.path.join(place, name)
                if os.path.isfile(path) or (
                    os.path.islink(path) and not os.path.exists(path)
                ):  # a broken link is told
                    yield local_entry(path, folder)


def _of_pattern(pattern: str) -> Iterator[LogEntry]:
    import glob

    parts = Path(pattern).parts
    fixed = next(i for i, part in enumerate(parts) if any(sign in part for sign in "*?["))
    root = str(Path(*parts[:fixed]))
    results = cache(_holds_results)
    for path in glob.iglob(pattern, recursive=True):
        below = [place for place in Path(path).parents if len(place.parts) > fixed]
        if os.path.isfile(path) and not any(results(str(place)) for place in below):
            yield local_entry(path, root)


def _holds_results(folder: str) -> bool:
    """Return whether a folder holds the results of a fleet."""
    try:
        with open(os.path.join(folder, HEAD), "rb") as stream:
            return MARK in stream.read(200)
    except OSError:
        return False


def require_fleet() -> None:
    """Refuse what needs the extra where it is not installed.

    Raises:
        MissingExtra: it is not.
    """
    for module in ("pyarrow", "duckdb", "distributed"):
        require(module, "A fleet needs", "fleet")
