"""Tables of plain numbers in blocks of lines: as JSON, which is parsed ten times as fast as by numpy, or by numpy.

A block of lines becomes a JSON document by a few replacements of bytes, decimal commas included; `msgspec` rounds every number
correctly and refuses a row of another width. A block that JSON does not know (`+1`, `.5`, `nan`, an empty line) goes through
`numpy.loadtxt`. No more than a block is held beside the columns.
"""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import chain, islice
from typing import Any

import numpy as np

from backdrive.logs.readers._dialect import Dialect

_BLOCK = 1 << 16  # [B]: stays in a processor's cache
_LINE_END = re.compile(rb"\r\n|\r|\n")
_NEGATIVE_ZERO = re.compile(rb"-0(?![0-9.eE])")  # has no sign as an integer of JSON


def numbers(path: str, dialect: Dialect) -> list[np.ndarray] | None:
    """Return the columns of a table of numbers, each (n,); None if it is something else somewhere.

    Args:
        path: the file.
        dialect: how it is written.
    """
    if dialect.comma and dialect.delimiter == ",":
        return None
    import msgspec

    decode = msgspec.json.Decoder(list[tuple[(float,) * dialect.width]]).decode  # type: ignore[misc]
    return gather(_tables(path, dialect, decode), dialect.width)


def gather(tables: Iterable[Sequence[np.ndarray] | np.ndarray | None], width: int) -> list[np.ndarray] | None:
    """Return the columns of a table that comes in pieces, each (n,); None as soon as a piece is None.

    Args:
        tables: the columns of each piece, (k,).
        width: number of columns.
    """
    columns = [np.empty(0) for _ in range(width)]
    n = 0
    for table in tables:
        if table is None:
            return None
        more = len(table[0])
        if n + more > columns[0].size:
            _resize(columns, max(n + more, columns[0].size + columns[0].size // 4))
        for column, values in zip(columns, table, strict=True):
            column[n : n + more] = values
        n += more
    _resize(columns, n)
    return columns


def _tables(path: str, dialect: Dialect, decode: Any) -> Iterator[np.ndarray | None]:
    """Yield the columns of each block, (width, k); None for one that holds something else than numbers."""
    import msgspec

    for block in _blocks(path, dialect):
        try:
            rows = _by_json(block, dialect.width, decode)
        except msgspec.MsgspecError:
            rows = _by_numpy(block, dialect.width)
        yield None if rows is None else rows.T


def _blocks(path: str, dialect: Dialect) -> Iterator[bytes]:
    """Yield whole lines of the table, cells parted by commas and decimals marked by points."""
    swaps, first, parts = _swaps(dialect), dialect.first, []
    for piece in _pieces(path, dialect.encoding):
        parts.append(piece)
        if b"\n" not in piece:
            continue
        block, start = b"".join(parts), 0
        ends = _LINE_END.finditer(block) if first else iter(())
        for end in islice(ends, first):
            first, start = first - 1, end.end()
        cut = max(start, block.rfind(b"\n") + 1)
        parts = [block[cut:]]
        if cut > start:
            yield _commas(block[start:cut], swaps, dialect.delimiter)
    rest = b"".join(parts)
    if rest.strip() and not first:
        yield _commas(rest, swaps, dialect.delimiter)


def _pieces(path: str, encoding: str) -> Iterator[bytes]:
    """Yield the bytes of a file whose lines end with a line feed, in an encoding that extends ASCII."""
    with open(path, "rb") as raw:
        head = raw.read(_BLOCK)
        if encoding.startswith("utf-16") or b"\n" not in head:
            raw.seek(0)
            text = io.TextIOWrapper(raw, encoding=encoding, errors="replace")
            yield from (piece.encode() for piece in iter(partial(text.read, _BLOCK), ""))
            return
        yield head.removeprefix(codecs.BOM_UTF8)
        yield from iter(partial(raw.read, _BLOCK), b"")


def _swaps(dialect: Dialect) -> bytes | None:
    """Return the table by which bytes are replaced; None where cells and decimals are written as JSON has them."""
    of = dialect.delimiter.replace(" ", "") + ("," if dialect.comma else "")
    to = "," * len(dialect.delimiter.replace(" ", "")) + ("." if dialect.comma else "")
    return None if of == to else bytes.maketrans(of.encode(), to.encode())


def _commas(block: bytes, swaps: bytes | None, delimiter: str) -> bytes:
    block = block if swaps is None else block.translate(swaps)
    if delimiter == " ":
        return b"\n".join([b",".join(line.split()) for line in block.splitlines()]) + b"\n"
    return block


def _by_json(block: bytes, width: int, decode: Any) -> np.ndarray | None:
    """Return the rows of a block, (k, width); None if it holds something else than numbers.

    Raises:
        MsgspecError: a line is no row of JSON numbers.
    """
    if b"[" in block or b"]" in block:  # would pass for rows
        return None
    rows = decode(b"[[" + block.rstrip(b"\r\n").replace(b"\n", b"],[") + b"]]")
    values = np.fromiter(chain.from_iterable(rows), np.float64, len(rows) * width)
    if not values.all() and _NEGATIVE_ZERO.search(block):
        return _by_numpy(block, width)
    return values.reshape(-1, width)


def _by_numpy(block: bytes, width: int) -> np.ndarray | None:
    """Return the rows of a block, (k, width); None if it holds something else than numbers."""
    try:
        if not block.strip():
            return np.empty((0, width))
        lines = io.StringIO(block.decode("ascii"), newline=None)
        rows = np.loadtxt(lines, delimiter=",", comments=None, quotechar='"', ndmin=2)
    except ValueError:  # an empty or odd cell, an uneven row, a character of another encoding
        return None
    return rows if rows.shape[1] == width else None


def _resize(columns: list[np.ndarray], n: int) -> None:
    for column in columns:
        column.resize(n, refcheck=False)
