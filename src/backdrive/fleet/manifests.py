"""Manifests: tables that name the logs of a fleet, with robot, type and day of each."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from backdrive._files import read_whole
from backdrive.errors import InvalidInput, ReadError
from backdrive.fleet.entries import LogEntry, entry_of, fault_of, local_entry

#: Columns of a manifest; `path` must be there.
COLUMNS = ("path", "robot", "type", "day")
FILES = {"file", "filename", "file_name", "log", "logfile"}  # other names for `path`, which are refused
SUFFIXES = (".csv", ".tsv", ".manifest")
MOST = 4 << 30  # of a manifest [B]


def is_manifest(path: str) -> bool:
    """Return whether a table's header has a column `path`, or columns for robot and file; another table is a log."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES or suffix == ".manifest":
        return suffix in SUFFIXES and os.path.isfile(path)
    try:
        with open(path, encoding="utf-8-sig", errors="replace") as stream:
            head = stream.readline(10_000)
    except OSError:
        return False
    names = re.split(r"[,\t;\s]+", head.strip().lower().replace('"', ""))
    return "path" in names or ("robot" in names and not FILES.isdisjoint(names))


def read_manifest(manifest: str) -> Iterator[LogEntry]:
    """Yield the logs of a manifest. A line whose file is missing or whose day is no date gives an entry with a fault.

    Args:
        manifest: path of the table: its columns are separated by commas, semicolons or tabs.

    Raises:
        ReadError: the manifest cannot be read, or an object store does not answer.
        InvalidInput: columns are unknown, or a line has another number of cells.
    """
    text = read_whole(manifest, MOST).decode("utf-8-sig", errors="replace")
    head = text.partition("\n")[0]
    rows = csv.reader(io.StringIO(text), delimiter=next((sign for sign in "\t;" if sign in head), ","))
    header = [name.strip().lower() for name in next(rows, [])]
    unknown = [name for name in header if name not in COLUMNS]
    if unknown or "path" not in header or len(set(header)) < len(header):
        what = (
            f"has the unknown columns {', '.join(unknown)}" if unknown else "names no path, or a column twice"
        )
        raise InvalidInput(
            f"The manifest {manifest} {what}.",
            remedy=f"Its header may name: {', '.join(COLUMNS)}; `path` once.",
        )
    root = os.path.dirname(os.path.abspath(manifest))
    for number, cells in enumerate(rows, start=2):
        if not any(cells):
            continue
        where = f"{manifest}, line {number}"
        if len(cells) != len(header):
            raise InvalidInput(
                f"{where}: {len(cells)} cells under {len(header)} columns.",
                remedy="Give every column a cell; it may be empty.",
            )
        row = {name: cell.strip() for name, cell in zip(header, cells, strict=False)}
        path = row.pop("path")
        if "://" in path:
            yield _object(path, f"{where}: ", row)
        else:
            yield local_entry(os.path.abspath(os.path.join(root, path)), root, where=f"{where}: ", **row)


def _object(address: str, where: str, row: dict[str, str]) -> LogEntry:
    """Return the entry of an object; one with a fault where the store answers that there is none."""
    from backdrive.fleet.objects import describe

    try:
        return entry_of(*describe(address), where=where, **row)
    except ReadError as error:
        if not isinstance(error.__cause__, FileNotFoundError):
            raise
        return fault_of(address, PurePosixPath(address).name, f"{where}{address} does not exist.", **row)
