"""The logs of a fleet, from a folder, a pattern, a manifest or an object store, with robot, type and day of each."""

from __future__ import annotations

import csv
import hashlib
import io
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path, PurePosixPath

from backdrive._files import read_whole
from backdrive.errors import InvalidInput, ReadError, UnknownFormat, require
from backdrive.logs.readers._formats import SUFFIXES

DATE = re.compile(r"(?<!\d)((?:19|20)\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])(?!\d)")
#: Columns of a manifest; `path` must be there.
COLUMNS = ("path", "robot", "type", "day")
MANIFESTS = (".csv", ".tsv", ".manifest")
MOST_MANIFEST = 4 << 30  # [B]


@dataclass(frozen=True, slots=True)
class LogEntry:
    """A log to be identified.

    Attributes:
        path: of the file, or its address in an object store.
        size: of it [B].
        stamp: changes with the file: size and time of change, or the store's tag.
        robot: whose log it is.
        type: of the robot; robots of one type are siblings.
        day: on which it was recorded.
    """

    path: str
    size: int
    stamp: str
    robot: str
    type: str
    day: date


def list_logs(
    source: str | os.PathLike | Sequence[str | os.PathLike], *, shard: tuple[int, int] = (1, 1)
) -> list[LogEntry]:
    """Return the logs of a source, in the order of their paths.

    A manifest is a CSV or TSV file whose header names `path` and, as far as known, `robot`, `type` and `day` (YYYY-MM-DD).
    Without a manifest, the day is a date in the path, or else the date of the file's last change. The robot is the first folder
    below the source, or else the file's name without the date.

    Args:
        source: a folder, a pattern such as `logs/*/2026-*.npz`, a manifest, or `s3://bucket/folder`; or several of them.
        shard: i of n: only every log whose path falls into this part.

    Raises:
        ReadError: there is no such source, it contains no log, or a manifest names a missing file.
        InvalidInput: a manifest has invalid columns or cells.
    """
    several = [source] if isinstance(source, (str, os.PathLike)) else list(source)
    every: dict[str, LogEntry] = {}
    for one in several:
        every.update((entry.path, entry) for entry in _of(str(one)))
    if not every:
        raise UnknownFormat(
            f"{', '.join(map(str, several))} holds no log. Suffixes that are looked for: {' '.join(SUFFIXES)}.",
            remedy="Name the folder that holds the robots' folders, a pattern in quotes, or a manifest.",
        )
    index, count = shard
    return [every[path] for path in sorted(every) if count == 1 or _part(path, count) == index - 1]


def _part(path: str, count: int) -> int:
    """Return which of `count` parts a path belongs to."""
    return int.from_bytes(hashlib.sha256(path.encode("utf-8", "surrogateescape")).digest()[:8]) % count


def _of(source: str) -> Iterator[LogEntry]:
    if "://" in source:
        from backdrive.fleet.objects import list_objects

        yield from (_entry(*one) for one in list_objects(source))
    elif os.path.isdir(source):
        yield from _of_folder(source)
    elif any(sign in source for sign in "*?[") and not os.path.exists(source):
        yield from _of_pattern(source)
    elif Path(source).suffix.lower() in MANIFESTS and _is_manifest(source):
        yield from _of_manifest(source)
    elif os.path.isfile(source):
        yield _local(source, str(Path(source).parent))
    else:
        raise ReadError(f"{source} does not exist.", remedy="Check the name.")


def _of_folder(folder: str) -> Iterator[LogEntry]:
    """Yield the logs below a folder; links to folders are not followed."""
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in files:
            if not name.startswith(".") and os.path.splitext(name)[1].lower() in SUFFIXES:
                path = os.path.join(place, name)
                if os.path.isfile(path):
                    yield _local(path, folder)


def _of_pattern(pattern: str) -> Iterator[LogEntry]:
    import glob

    parts = Path(pattern).parts
    fixed = next(i for i, part in enumerate(parts) if any(sign in part for sign in "*?["))
    root = str(Path(*parts[:fixed])) if fixed else "."
    for path in glob.iglob(pattern, recursive=True):
        if os.path.isfile(path):
            yield _local(path, root)


def _local(path: str, root: str, **known: str) -> LogEntry:
    try:
        state = os.stat(path)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ReadError(f"Cannot read {path}: {reason}.", remedy="Check the path.") from error
    stamp = f"{state.st_size}:{state.st_mtime_ns}"
    return _entry(path, state.st_size, stamp, state.st_mtime, os.path.relpath(path, root), **known)


def _entry(
    path: str,
    size: int,
    stamp: str,
    changed: float,
    inside: str,
    robot: str = "",
    type: str = "",
    day: str = "",
) -> LogEntry:
    """Return an entry; unknown fields follow from its path below the source, or from the time of its last change."""
    parts = PurePosixPath(inside.replace(os.sep, "/")).parts
    dates = [*DATE.finditer(inside)]  # the last one counts: folders may name the year before
    if not robot:
        stem = PurePosixPath(parts[-1]).stem
        robot = parts[0] if len(parts) > 1 else DATE.sub("", stem).strip("-_. T") or stem
    when = _day(day, path) if day else None
    if when is None and dates:
        try:
            when = date(*map(int, dates[-1].groups()))
        except ValueError:  # the 31st of June
            when = None
    if when is None:
        when = datetime.fromtimestamp(max(changed, 0.0), UTC).date()
    return LogEntry(path, size, stamp, robot, type, when)


def _day(text: str, place: str) -> date:
    try:
        return date.fromisoformat(text.strip()[:10])
    except ValueError as error:
        raise InvalidInput(
            f"{place}: the day '{text}' is no date.", remedy="Write days as 2026-03-31."
        ) from error


def _is_manifest(path: str) -> bool:
    """Return whether a table's header has a column `path`; a table without one is a log."""
    if Path(path).suffix.lower() == ".manifest":
        return True
    try:
        with open(path, encoding="utf-8-sig", errors="replace") as stream:
            head = stream.readline(10_000)
    except OSError:
        return False
    return "path" in re.split(r"[,\t;\s]+", head.strip())


def _of_manifest(manifest: str) -> Iterator[LogEntry]:
    text = read_whole(manifest, MOST_MANIFEST).decode("utf-8-sig", errors="replace")
    rows = csv.reader(io.StringIO(text), delimiter="\t" if "\t" in text.partition("\n")[0] else ",")
    header = [name.strip() for name in next(rows, [])]
    unknown = [name for name in header if name not in COLUMNS]
    if unknown or "path" not in header or len(set(header)) < len(header):
        what = (
            f"has the unknown columns {', '.join(unknown)}" if unknown else "names no path, or a column twice"
        )
        raise InvalidInput(
            f"The manifest {manifest} {what}.",
            remedy=f"Its header may name: {', '.join(COLUMNS)}; `path` once.",
        )
    root = Path(manifest).parent
    for number, cells in enumerate(rows, start=2):
        if not any(cells):
            continue
        if len(cells) != len(header):
            raise InvalidInput(
                f"{manifest}, line {number}: {len(cells)} cells under {len(header)} columns.",
                remedy="Give every column a cell; it may be empty.",
            )
        row = {name: cell.strip() for name, cell in zip(header, cells, strict=False)}
        path = row.pop("path")
        if "://" in path:
            from backdrive.fleet.objects import describe

            yield _entry(*describe(path), **row)
        else:
            yield _local(str(root / path), str(root), **row)


def require_fleet() -> None:
    """Refuse what needs the extra where it is not installed.

    Raises:
        MissingExtra: it is not.
    """
    for module in ("pyarrow", "duckdb", "distributed"):
        require(module, "A fleet needs", "fleet")
