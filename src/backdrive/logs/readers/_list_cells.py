"""Tables of text whose cells hold lists: one list of positions or torques a row, as data frames write them.

A cell is a list in brackets, quoted or not: `[0.1, 0.2]`, `"[0.1 0.2]"` as numpy prints it, `"(0.1, 0.2)"` or
`"array('d', [0.1, 0.2])"` as ROS messages do. Lists of words are names of joints.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from backdrive.logs.readers import units
from backdrive.logs.readers._dialect import decode, number

_DELIMITERS = ("\t", ";", ",", "|")
_LEAST = 0.8  # share of the sampled lines that agree on what is a list [-]
_SAMPLED = 50  # lines
_LIST = re.compile(r"(?:array\((?:'\w',\s*)?)?(?:\[([^\[\]]*)\]|\(([^()]*)\))(?:,\s*dtype=\w+\))?\)?$")
_SCALAR = re.compile(r"np\.\w+\(([^()]*)\)")  # as numpy 2 prints a number in a list
_WORD = re.compile(r"'([^']*)'|\"([^\"]*)\"|([^\s,'\"]+)")
_TOKENS = {
    d: re.compile(rf'"(?:[^"]|"")*"|\[[^\[\]]*\]|[^{re.escape(d)}"\[]+|["\[]|{re.escape(d)}')
    for d in _DELIMITERS
}
_MOST_LINES = 50  # that one row is broken into


@dataclass(frozen=True, kw_only=True)
class ListTable:
    """How a table with lists in its cells is written.

    Attributes:
        encoding: of its characters.
        delimiter: between cells.
        first: number of lines before the first row.
        names: of the columns.
        units: stated by the file, by column name.
        lists: columns of lists.
    """

    encoding: str
    delimiter: str
    first: int
    names: tuple[str, ...]
    units: dict[str, str]
    lists: frozenset[int]


def sniff(raw: bytes, *, whole: bool) -> ListTable | None:
    """Return how a table with lists in its cells is written; None where its first bytes are no such table.

    Args:
        raw: the first bytes of a file.
        whole: whether they are all of it.

    Raises:
        UnknownFormat: binary.
    """
    if b"[" not in raw and b'"(' not in raw:
        return None
    encoding, text = decode(raw)
    lines = text.splitlines()
    if not whole and len(lines) > 1:
        lines.pop()
    best: tuple[int, int, str, tuple[int, ...]] = (0, 0, "", ())
    rows = list(_rows(iter(lines)))[-_SAMPLED:]
    for delimiter in _DELIMITERS:
        split = [split_cells(row, delimiter) for row in rows]
        shapes = Counter(
            (len(row), tuple(i for i, cell in enumerate(row) if _is_list(cell))) for row in split
        )
        (width, lists), count = shapes.most_common(1)[0]
        numeric = [i for i in lists if any(_has_numbers(row, i) for row in split)]
        if numeric and count >= _LEAST * (len(rows) - 1):
            best = max(best, (len(lists), width, delimiter, lists))
    count, width, delimiter, lists = best
    if not count:
        return None
    first, names = 0, [f"column_{i + 1}" for i in range(width)]
    for i, line in enumerate(lines):
        row = split_cells(line.removeprefix("#").strip(), delimiter)
        if any(_has_numbers(row, j) for j in lists) or line.count('"') % 2:
            first = i
            break
        if len(row) == width and not all(units.parse(cell.strip("[]()")) for cell in row):
            names = [cell or f"column_{j + 1}" for j, cell in enumerate(row)]
    names = [name if name not in names[:i] else f"{name}#{i + 1}" for i, name in enumerate(names)]
    stated = {name: unit for name in names if (unit := units.split(name)[1])}
    return ListTable(
        encoding=encoding,
        delimiter=delimiter,
        first=first,
        names=tuple(names),
        units=stated,
        lists=frozenset(lists),
    )


def read_cells(path: str, table: ListTable, notes: list[str]) -> list[list[str]]:
    """Return the cells of every column as text; rows of another width are dropped with a note."""
    columns: list[list[str]] = [[] for _ in table.names]
    uneven = 0
    with open(path, encoding=table.encoding, errors="replace") as stream:
        for row in _rows(islice(stream, table.first, None)):
            split = split_cells(row, table.delimiter)
            if len(split) != len(columns) or not all(_is_list(split[i]) for i in table.lists):
                uneven += 1
                continue
            for column, cell in zip(columns, split, strict=True):
                column.append(cell)
    if uneven:
        notes.append(f"{uneven} uneven or cut lines were dropped.")
    return columns


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split one line; quoted cells and lists in brackets may hold the delimiter."""
    found, parts = list[str](), list[str]()
    for token in _TOKENS[delimiter].findall(line):
        if token == delimiter:
            found.append(_bare("".join(parts)))
            parts = []
        else:
            parts.append(token)
    return [*found, _bare("".join(parts))]


def numbers_of(cells: list[str], width: int | None = None) -> np.ndarray | None:
    """Return the lists of a column, (n, k); None where they are no numbers or of different lengths.

    Args:
        cells: as text.
        width: numbers that each list has to hold; None: as many as the first one.
    """
    flat: list[float] = []
    for cell in cells:
        inner = _SCALAR.sub(r"\1", cell) if "np." in cell else cell
        match = _LIST.match(inner)
        values = (match[1] or match[2] or "").replace(",", " ").split() if match else []
        width = len(values) if width is None else width
        if len(values) != width or not width:
            return None
        try:
            flat.extend(float(value) for value in values)
        except ValueError:
            return None
    return np.array(flat).reshape(len(cells), -1) if flat else None


def words_of(cells: list[str]) -> list[list[str]]:
    """Return the lists of words of a column, in brackets or with semicolons between them."""
    known: dict[str, list[str]] = {}
    for cell in cells:
        if cell not in known:
            match = _LIST.match(cell)
            inner = (match[1] or match[2] or "") if match else cell.replace(";", ",")
            known[cell] = ["".join(groups) for groups in _WORD.findall(inner)]
    return [known[cell] for cell in cells]


def scalars(cells: list[str]) -> np.ndarray | None:
    """Return the numbers of a column, (n,); None where it holds words."""
    values = [number(cell, False) for cell in cells]
    return None if None in values else np.array([value[0] for value in values if value is not None])


def _is_list(cell: str) -> bool:
    return cell.endswith(("]", ")")) and cell.startswith(("[", "(", "array(")) and len(cell) > 2


def _has_numbers(row: list[str], column: int) -> bool:
    return column < len(row) and numbers_of([row[column]]) is not None


def _bare(cell: str) -> str:
    cell = cell.strip()
    quoted = len(cell) > 1 and cell[0] == cell[-1] == '"'
    return cell[1:-1].replace('""', '"').strip() if quoted else cell


def _rows(lines: Iterator[str]) -> Iterator[str]:
    """Yield rows that are not empty; a quoted cell may go on in the next lines, as long arrays of numpy do."""
    parts: list[str] = []
    for line in lines:
        parts.append(line.rstrip("\r\n"))
        if sum(part.count('"') for part in parts) % 2 and len(parts) < _MOST_LINES:
            continue
        row, parts = " ".join(parts), []
        if row.strip():
            yield row
    if parts and (row := " ".join(parts)).strip():
        yield row
