"""Tables of text: any delimiter, header or none, preamble, a line of units, decimal comma, byte-order mark.

The first lines decide the dialect. A table of plain numbers is then read in blocks (`_blocks`). A table with gaps, words or
uneven rows is read cell by cell, and a note lists what was dropped.
"""

from __future__ import annotations

import csv
from array import array
from datetime import UTC, datetime
from itertools import islice

import numpy as np

from backdrive.errors import ReadError, UnknownFormat
from backdrive.logs.readers import _arrow, _list_cells
from backdrive.logs.readers._blocks import numbers
from backdrive.logs.readers._dialect import Dialect, cells, number, sniff
from backdrive.logs.readers._labels import (
    columns_in_order,
    holds_names,
    in_order,
    is_indexed_name,
    names_by_index,
    read_names,
)
from backdrive.logs.readers.columns import Columns, ReadOptions

_SAMPLE = 1 << 16
_WORST = 0.2


def read(path: str, options: ReadOptions) -> Columns:
    """Read a table of text.

    Raises:
        UnknownFormat: it is binary, or holds no table of numbers.
        ReadError: the rows do not fit together.
    """
    with open(path, "rb") as stream:
        raw = stream.read(_SAMPLE)
    if not raw.strip(b"\r\n\t \x00"):
        raise UnknownFormat("The file is empty.", remedy="Record the log again, or name another file.")
    if (lists := _list_cells.sniff(raw, whole=len(raw) < _SAMPLE)) is not None:
        return _with_lists(path, lists, options)
    dialect = sniff(raw, whole=len(raw) < _SAMPLE)
    options.limits.check_count(dialect.width, "columns")
    notes: list[str] = []
    if dialect.headless:
        notes.append("The table has no header: its columns are called column_1, column_2 and so on.")
    table = (
        _arrow.numbers(path, dialect) or numbers(path, dialect) if dialect.regular or dialect.comma else None
    )
    words: dict[int, list[str]] = {}
    if table is None:
        rows, words = _careful(path, dialect, notes)
        table = [np.ascontiguousarray(column) for column in rows.T]
    times = {i: time for i, cells in words.items() if (time := _clock(cells)) is not None}
    joints, order = names_by_index(
        {dialect.names[i]: cells for i, cells in words.items() if i not in times}, notes
    )
    arrays: dict[str, np.ndarray] = {}
    for i, name in enumerate(dialect.names):
        if i in times:
            arrays[name] = times[i]
        elif i in dialect.text and not (joints and is_indexed_name(name)):
            example = next((cell for cell in words.get(i, ()) if cell), "")[:40]
            notes.append(f"Column '{name}' holds words or no plain numbers ('{example}') and was left out.")
        elif i not in dialect.text and (
            not name.startswith("column_") or dialect.headless or np.isfinite(table[i]).any()
        ):
            arrays[name] = table[i]
    origin = {dialect.names[i]: _begin(words[i][0]) for i in times if words[i]}
    arrays = columns_in_order(arrays, order, notes)
    return Columns(arrays=arrays, units=dialect.units, joints=joints, notes=tuple(notes), origin=origin)


def _with_lists(path: str, table: _list_cells.ListTable, options: ReadOptions) -> Columns:
    """Read a table whose cells hold lists."""
    options.limits.check_count(len(table.names), "columns")
    notes: list[str] = []
    columns = _list_cells.read_cells(path, table, notes)
    arrays: dict[str, np.ndarray] = {}
    origin: dict[str, float] = {}
    joints: tuple[str, ...] = ()
    order: np.ndarray | None = None
    for i, (name, found) in enumerate(zip(table.names, columns, strict=True)):
        value = _list_cells.numbers_of(found) if i in table.lists else _list_cells.scalars(found)
        if value is None and i not in table.lists and (value := _clock(found)) is not None:
            origin[name] = _begin(found[0])
        if value is not None:
            options.limits.check_count(value.shape[-1] if value.ndim > 1 else 1, "columns")
            arrays[name] = value
        elif holds_names(name) and not joints:
            joints, order = read_names(_list_cells.words_of(found), name, notes)
        else:
            notes.append(f"Column '{name}' holds words, or lists of different lengths, and was left out.")
    arrays = in_order(arrays, order, notes)
    return Columns(arrays=arrays, units=table.units, joints=joints, notes=tuple(notes), origin=origin)


def _careful(path: str, dialect: Dialect, notes: list[str]) -> tuple[np.ndarray, dict[int, list[str]]]:
    """Read line by line; uneven lines are dropped, words become NaN, and both are noted."""
    width = dialect.width
    flat = array("d")
    words: dict[int, list[str]] = {i: [] for i in dialect.text}
    odd: dict[int, list[str]] = {}
    uneven: list[int] = []
    last = dialect.first
    mixed = bool(dialect.commas) and not dialect.comma
    with open(path, encoding=dialect.encoding, errors="replace") as stream:
        for at, line in enumerate(islice(stream, dialect.first, None), dialect.first + 1):
            if not line.strip():
                continue
            last = at
            row = None if words or mixed else _plain(line, dialect)
            if row is not None:
                flat.extend(row)
                continue
            try:
                split = cells(line.rstrip("\r\n"), dialect.delimiter)
            except csv.Error as error:
                raise ReadError(
                    f"Line {at} is no row of cells ({error}).", remedy="Correct or remove it."
                ) from error
            while len(split) > width and not split[-1]:
                split.pop()
            if len(split) != width:
                uneven.append(at)
                continue
            for i, cell in enumerate(split):
                if i in words:
                    words[i].append(cell)
                    flat.append(np.nan)
                    continue
                value = number(cell, i in dialect.commas)
                flat.append(np.nan if value is None else value[0])
                if value is None or (value[1] and cell.strip("0123456789.eE+-, ")):
                    odd.setdefault(i, []).append(f"line {at}: '{cell[:40]}'")
    table = np.frombuffer(flat, dtype=np.float64).reshape(-1, width) if flat else np.empty((0, width))
    if len(uneven) > max(1, _WORST * (len(uneven) + len(table))):
        raise ReadError(
            f"{len(uneven)} of {len(uneven) + len(table)} lines do not have {width} cells.",
            remedy="Check the delimiter, or cut the file to the table.",
        )
    if uneven == [last]:
        notes.append("The last line is cut and was dropped.")
    elif uneven:
        told = ", ".join(str(at) for at in uneven[:5]) + (", ..." if len(uneven) > 5 else "")
        notes.append(f"{len(uneven)} uneven lines were dropped (line {told}).")
    for i, found in odd.items():
        notes.append(
            f"Column '{dialect.names[i]}' is no plain number in {len(found)} cells ({'; '.join(found[:3])})."
        )
    return table, words


def _plain(line: str, dialect: Dialect) -> list[float] | None:
    """Return a line of nothing but numbers, or None if it needs care."""
    if '"' in line or "_" in line or not line.isascii():
        return None
    line = line.replace(",", ".") if dialect.comma else line
    row = line.split(None if dialect.delimiter == " " else dialect.delimiter)
    try:
        return [float(cell) for cell in row] if len(row) == dialect.width else None
    except ValueError:
        return None


def _clock(cells: list[str]) -> np.ndarray | None:
    """Return ISO date-times as seconds since the first, or None if they are something else."""
    try:
        stamps = [datetime.fromisoformat(cell) for cell in cells]
        return np.array([(stamp - stamps[0]).total_seconds() for stamp in stamps])
    except (ValueError, TypeError, IndexError):
        return None


def _begin(cell: str) -> float:
    """Return an ISO date-time as seconds since 1970; without a zone it is taken as UTC."""
    stamp = datetime.fromisoformat(cell)
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
