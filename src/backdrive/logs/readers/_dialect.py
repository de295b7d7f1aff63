"""The dialect of a text table, determined from its first lines."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

from backdrive.errors import UnknownFormat
from backdrive.logs.readers import units

_DELIMITERS = ("\t", ";", ",", "|", " ")
# Written so that no digit can be matched in two ways: a cell of many digits must not take quadratic time.
_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?$", re.ASCII)
_COMMA_NUMBER = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?$", re.ASCII)
# A comma or a blank before a digit is a decimal sign, or parts thousands or cells: what stands before it is not the number.
_COMMENTED = re.compile(
    r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?(?=\s{0,8}[#/]|\s{0,8}[,;](?!\d)|\s{1,8}(?![\d\s]))",
    re.ASCII,
)
_THOUSANDS = re.compile(
    r"[+-]?[1-9]\d{0,2},\d{3}$", re.ASCII
)  # or a decimal comma: a single one leaves it open
_EMPTY = frozenset(
    ("", "nan", "na", "n/a", "none", "null", "-", "inf", "+inf", "-inf", "-nan", "1.#qnan", "#n/a")
)
_TAIL = 60


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How a text table is written.

    Attributes:
        encoding: of its characters.
        delimiter: between cells; a blank stands for any run of white space.
        comma: whether the decimal sign is a comma throughout.
        commas: columns in which it is one.
        width: cells in a row.
        first: number of lines before the first row.
        names: of the columns.
        units: stated by the file, by column name.
        text: columns whose cells are words, not numbers.
        regular: whether the sampled rows are plain numbers throughout.
        headless: whether the names are made up.
    """

    encoding: str
    delimiter: str
    comma: bool
    commas: frozenset[int] = frozenset()
    width: int
    first: int
    names: tuple[str, ...]
    units: dict[str, str]
    text: frozenset[int]
    regular: bool
    headless: bool


def sniff(raw: bytes, *, whole: bool) -> Dialect:
    """Decide the dialect from the first bytes of a file.

    Args:
        raw: the first bytes.
        whole: whether they are all of it.

    Raises:
        UnknownFormat: binary, or no table of numbers.
    """
    encoding, text = decode(raw)
    lines = re.split(r"\r\n|\r|\n", text)
    if not whole and len(lines) > 1:
        lines.pop()
    filled = [line for line in lines if line.strip()]
    tail, best = filled, _NOTHING
    for share in (2, 4, 8, 16):  # the lower half is used, unless a long preamble is followed by a short table
        tail = filled[-max(1, min(_TAIL, len(filled) // share)) :]
        best = max((_judge(tail, delimiter) for delimiter in _DELIMITERS), key=lambda judged: judged.score)
        if best.score > 0:
            break
    delimiter, width, comma, commas, numeric = (
        best.delimiter,
        best.width,
        best.comma,
        best.commas,
        best.numeric,
    )
    if best.score <= 0:
        raise UnknownFormat(
            "The text holds no table of numbers.",
            remedy="Name the right file, or say what it is: --format NAME (in Python format=).",
        )

    def is_row(line: str) -> bool:
        row = cells(line, delimiter)
        if len(row) < width or any(row[width:]):
            return False
        kinds = [_kind(row[i], i in commas) for i in numeric]
        return "text" not in kinds and any(kind in ("number", "commented") for kind in kinds)

    rows = [i for i, line in enumerate(lines) if line.strip() and is_row(line)]
    # A lone numeric line in the preamble must not pass for the table: the next filled line has to be a row too.
    following = {a: b for a, b in zip(rows, rows[1:], strict=False)}
    first = next(
        (i for i in rows if _next_non_empty(lines, i) == following.get(i, -1)), rows[0] if rows else None
    )
    if first is None:
        raise UnknownFormat("The text holds no table of numbers.", remedy="Name the right file.")
    # a word among the numbers of the first rows makes no header of them
    above = [i for i in range(first) if lines[i].strip()]
    while above and _begins_as_row(cells(lines[above[-1]], delimiter), width, commas, numeric):
        first = above.pop()
    names, stated, headless = _header(
        [line for line in lines[:first] if line.strip()], delimiter, width, comma, best.blank
    )
    kinds = [_kind(cell, False) for line in tail for cell in cells(line, delimiter)[:width]]
    return Dialect(
        encoding=encoding,
        delimiter=delimiter,
        comma=comma,
        commas=commas,
        width=width,
        first=first,
        names=names,
        units=stated,
        text=frozenset(range(width)) - frozenset(numeric),
        regular=all(kind == "number" for kind in kinds) and not commas,
        headless=headless,
    )


def cells(line: str, delimiter: str) -> list[str]:
    """Split one line; quoted cells may hold the delimiter."""
    if delimiter == " ":
        row = (
            line.split()
            if '"' not in line
            else next(csv.reader([line.strip()], delimiter=" ", skipinitialspace=True))
        )
    elif '"' in line:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), list[str]())
    else:
        row = line.split(delimiter)
    return [cell.strip() for cell in row]


def number(cell: str, comma: bool) -> tuple[float, bool] | None:
    """Return a cell's value and whether a comment follows it; None for words; NaN for an empty cell."""
    kind = _kind(cell, comma)
    if kind == "number":
        return float(cell.replace(",", ".") if comma else cell), False
    if kind == "empty":
        return (float(cell.lower()) if "inf" in cell.lower() else float("nan")), False
    if kind == "commented":
        match = _COMMENTED.match(cell)
        return (float(match[0]), True) if match else None
    return None


def _kind(cell: str, comma: bool) -> str:
    if _NUMBER.match(cell) or (comma and _COMMA_NUMBER.match(cell)):
        return "number"
    if cell.lower() in _EMPTY:
        return "empty"
    return "commented" if _COMMENTED.match(cell) else "text"


class _Score(NamedTuple):
    """A delimiter with its score: numbers a row, in the share of lines that agree on a width; and what it makes of the rows."""

    score: float
    delimiter: str
    width: int = 0
    comma: bool = False
    commas: frozenset[int] = frozenset()
    numeric: tuple[int, ...] = ()
    blank: int = 0


_NOTHING = _Score(0.0, "")


def _judge(lines: list[str], delimiter: str) -> _Score:
    try:
        table = [cells(line, delimiter) for line in lines]
    except csv.Error:
        return _Score(0.0, delimiter)
    widths = Counter(len(row) for row in table)
    width, lines_so_wide = max(widths.items(), key=lambda item: (item[1], item[0])) if widths else (0, 0)
    rows = [row for row in table if len(row) == width]
    blank = next((k for k in range(width) if any(row[width - 1 - k] for row in rows)), width)
    comma, commas = _decimal_commas(rows, width)
    weight = {"number": 1.0, "commented": 0.4, "empty": 0.1, "text": 0.0}
    numeric: list[int] = []
    score = 0.0
    for i in range(width):
        kinds = [_kind(row[i], i in commas) for row in rows]
        if kinds.count("text") < 0.5 * len(kinds):
            numeric.append(i)
            if any(kind != "empty" for kind in kinds):
                score += sum(weight[kind] for kind in kinds) / len(kinds)
    score *= lines_so_wide / max(len(lines), 1)
    return _Score(score, delimiter, width, comma, commas, tuple(numeric), blank)


def _decimal_commas(rows: list[list[str]], width: int) -> tuple[bool, frozenset[int]]:
    """Return whether the decimal sign is a comma throughout, and the columns in which it is one.

    Beside columns with points, commas of which all are like 1,970 may part thousands: they are no decimal signs.
    """
    dotted = [any("." in row[i] and _NUMBER.match(row[i]) for row in rows) for i in range(width)]
    written = {
        i: [row[i] for row in rows if _COMMA_NUMBER.match(row[i])] for i in range(width) if not dotted[i]
    }
    if not any(dotted):
        return any(written.values()), frozenset(range(width) if any(written.values()) else ())
    clear = any(not _THOUSANDS.match(cell) for column in written.values() for cell in column)
    return False, frozenset(i for i, column in written.items() if column and clear)


def _begins_as_row(row: list[str], width: int, commas: frozenset[int], numeric: tuple[int, ...]) -> bool:
    """Return whether a line has the width of a row, a number in its first column of numbers, and numbers in half of them."""
    if len(row) < width or any(row[width:]):
        return False
    numbers = [_kind(row[i], i in commas) in ("number", "commented") for i in numeric]
    return numbers[0] and 2 * sum(numbers) >= len(numbers)


def _next_non_empty(lines: list[str], at: int) -> int | None:
    return next((i for i in range(at + 1, len(lines)) if lines[i].strip()), None)


def _header(
    above: list[str], delimiter: str, width: int, comma: bool, blank: int
) -> tuple[tuple[str, ...], dict[str, str], bool]:
    """Find names and units in the lines before the first row, nearest last."""
    row = _as_row(above[-1], delimiter, width, blank) if above else None
    line_of_units: list[str] | None = None
    if row is not None and len(above) > 1 and all(not cell or units.parse(cell) for cell in row):
        names_above = _as_row(above[-2], delimiter, width, blank)
        if names_above is not None and any(_kind(cell, comma) == "text" for cell in names_above):
            line_of_units, row = [cell.strip("[]() ") for cell in row], names_above
    if row is None or not any(_kind(cell, comma) in ("text", "commented") for cell in row):
        return tuple(f"column_{i + 1}" for i in range(width)), {}, True
    names: list[str] = []
    stated: dict[str, str] = {}
    for i, cell in enumerate(row):
        unit = line_of_units[i] if line_of_units else units.split(cell)[1]
        known = units.parse(unit) if unit else None
        name = cell or ("time" if known is not None and known.kind == "time" else f"column_{i + 1}")
        count = sum(1 for other in row[:i] if other == cell)
        name = f"{name}#{count + 1}" if cell and count else name
        names.append(name)
        if unit:
            stated[name] = unit
    return tuple(names), stated, False


def _as_row(line: str, delimiter: str, width: int, blank: int) -> list[str] | None:
    """Split a header line, which may be commented out, delimited otherwise than the rows, or without their last blank cells."""
    for text in (line, re.sub(r"^\s*(#|%|//)+\s?", "", line)):
        for candidate in (delimiter, *_DELIMITERS):
            row = cells(text, candidate)
            while len(row) > width and not row[-1].strip(", "):
                row.pop()
            row += [""] * (width - len(row) if 0 < width - len(row) <= blank else 0)
            if len(row) == width and not row[0].startswith(("#", "%", "//")):
                return [cell.rstrip(",").strip() if candidate != "," else cell for cell in row]
    return None


def decode(raw: bytes) -> tuple[str, str]:
    """Return the encoding and the text of a file's first bytes.

    Raises:
        UnknownFormat: binary.
    """
    for mark, encoding in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if raw.startswith(mark):
            return encoding, codecs.getincrementaldecoder(encoding)("replace").decode(raw)
    if raw[1::2].count(0) > 0.4 * (len(raw) // 2):
        encoding = "utf-16-le"
    elif 0 in raw:
        raise UnknownFormat(
            "The file is binary, not a table of text.",
            remedy="Say what it is: --format NAME (in Python format=).",
        )
    else:
        encoding = "utf-8"
    try:
        text = codecs.getincrementaldecoder(encoding)("strict").decode(raw)
    except UnicodeDecodeError:
        encoding, text = "latin-1", raw.decode("latin-1")
    odd = sum(1 for character in text if ord(character) < 32 and character not in "\t\r\n\f")
    if odd > 0.005 * len(text):
        raise UnknownFormat(
            "The file is binary, not a table of text.",
            remedy="Say what it is: --format NAME (in Python format=).",
        )
    return encoding, text
