"""Joint names that a file holds itself, beside lists of numbers: `name` of a joint state, or `joint_names` of an archive."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from backdrive._documents import is_list
from backdrive.errors import ReadError
from backdrive.logs.readers.columns import clean

_NAME = re.compile(r"(?:.*[./])?(?:joint_?)?names?$", re.IGNORECASE)
MOST, LONGEST = 1000, 300  # names of a list, and characters of one
SHOWN = 20  # names in a sentence
MATCHED = "The order of the joints changes from row to row: they were matched by name."
_INDEXED = re.compile(r"(?P<stem>.*?)[\[(_.]?(?P<index>\d{1,4})[\])]?$")


def holds_names(column: str) -> bool:
    """Return whether a column by this name holds names of joints."""
    return len(column) < 200 and _NAME.match(column) is not None


def read_list(words: object, name: str, notes: list[str]) -> tuple[str, ...]:
    """Return the names that a file lists once, for all rows; none where they are no names of different joints.

    Args:
        words: as the file has them; a single word counts where it is named after a joint.
        name: of the list, for the messages.
        notes: a sentence is added where the list holds no names.
    """
    words = [words] if isinstance(words, str) and "joint" in name.lower() else words
    joints = [word.strip() for word in words if isinstance(word, str)] if is_list(words) else []
    if not is_list(words) or not joints or len(joints) < len(words) or not all(joints):
        notes.append(f"'{clean(name)}' is no list of names and was left out.")
        return ()
    return _different(joints, f"'{clean(name)}'", notes)


def _different(names: Sequence[str], place: str, notes: list[str]) -> tuple[str, ...]:
    """Return names as they may be shown; none, with a note, where two are alike."""
    joints = tuple(clean(name) for name in names)
    if len(set(joints)) < len(joints):
        listed = ", ".join(joints[:SHOWN]) + (" and more" if len(joints) > SHOWN else "")
        notes.append(f"{place} names {listed}, some of them twice, and was left out.")
        return ()
    return joints


def read_names(
    rows: Sequence[object], column: str, notes: list[str]
) -> tuple[tuple[str, ...], np.ndarray | None]:
    """Return the names of a column of lists, and where each row has them.

    Args:
        rows: one list of names a row.
        column: for the messages.
        notes: a sentence is added where the column holds no names.

    Returns:
        The names as the first row has them, none where the rows are no lists of names; and for every row the places of these
        names, (n, J), or None where all rows are alike.

    Raises:
        ReadError: the rows name different joints, so numbers cannot be assigned to joints.
    """
    first: Any = rows[0] if rows else None
    if not is_list(first) or not first or not all(isinstance(name, str) and name for name in first):
        notes.append(f"Column '{column}' is no list of names in every row and was left out.")
        return (), None
    joints = _different(first, f"Column '{column}'", notes)
    if not joints:
        return (), None
    if all(row == first for row in rows):
        return joints, None
    known: dict[tuple[str, ...], list[int]] = {}
    order = np.empty((len(rows), len(first)), dtype=np.intp)
    for i, row in enumerate(rows):
        key = tuple(row) if is_list(row) and all(isinstance(x, str) for x in row) else ()
        if key not in known:
            if sorted(key) != sorted(first):
                raise ReadError(
                    f"Row {i + 1} of '{column}': {', '.join(map(clean, key)) or 'nothing'}, but first {', '.join(joints)}.",
                    remedy="Log the same joints in every row, or leave these names out.",
                )
            known[key] = [key.index(name) for name in first]
        order[i] = known[key]
    return joints, order


def in_order(
    arrays: dict[str, np.ndarray], order: np.ndarray | None, notes: list[str]
) -> dict[str, np.ndarray]:
    """Return columns with the numbers of every row where `read_names` has found their joints, (n, J)."""
    if order is None:
        return arrays
    notes.append(MATCHED)
    return {
        name: np.take_along_axis(value, order, axis=1) if value.shape == order.shape else value
        for name, value in arrays.items()
    }


def is_indexed_name(column: str) -> bool:
    """Return whether a column is called `name[0]`, `name_1` or the like."""
    return _name_with_index(column) is not None


def _name_with_index(column: str) -> re.Match[str] | None:
    match = _INDEXED.match(column) if len(column) < 200 else None
    return match if match is not None and holds_names(match["stem"]) else None


def names_by_index(
    columns: Mapping[str, Sequence[str]], notes: list[str]
) -> tuple[tuple[str, ...], np.ndarray | None]:
    """Return the joint names of columns of words such as `name[0]`, `name[1]`, and their places as `read_names` does.

    Args:
        columns: of words, by name.
        notes: as of `read_names`.

    Raises:
        ReadError: the rows name different joints.
    """
    found: dict[int, list[str]] = {}
    for column, words in columns.items():
        match = _name_with_index(column)
        if match is not None and words and words[0].strip('" '):
            found[int(match["index"])] = [word.strip('" ') for word in words]
    if not found:
        return (), None
    rows = [list(row) for row in zip(*(found[index] for index in sorted(found)), strict=False)]
    return read_names(rows, "name[...]", notes)


def columns_in_order(
    arrays: dict[str, np.ndarray], order: np.ndarray | None, notes: list[str]
) -> dict[str, np.ndarray]:
    """Return columns such as `position[0]`, `position[1]`, (n,) each, with the numbers where `names_by_index` has found them."""
    if order is None:
        return arrays
    groups: dict[str, dict[int, str]] = {}
    for column, value in arrays.items():
        match = _INDEXED.match(column) if len(column) < 200 else None
        if match is not None and value.shape == order.shape[:1]:
            groups.setdefault(match["stem"], {})[int(match["index"])] = column
    for places in groups.values():
        if len(places) == order.shape[1]:
            columns = [places[index] for index in sorted(places)]
            both = in_order({"": np.column_stack([arrays[column] for column in columns])}, order, [])[""]
            arrays = arrays | dict(zip(columns, both.T.copy(), strict=True))
    notes.append(MATCHED)
    return arrays
