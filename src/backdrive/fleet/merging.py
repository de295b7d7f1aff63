"""Removal of duplicate results: one row for each joint of a log."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive.errors import require

if TYPE_CHECKING:
    import pyarrow as pa

ORDER = ("robot", "joint", "day", "path")
EARLIEST = date(2000, 1, 1)  # earlier days come from a clock that was not set


def once(table: pa.Table, tag: str, names: Mapping[str, str], *, failures: bool) -> pa.Table:
    """Return each log once: the result of the present options and version, or else the newest; of copies the first path with a
    possible day.

    Args:
        table: rows of all batches.
        tag: of the present options and version.
        names: former name of a robot -> its present one.
        failures: return the logs that failed, instead of the results.
    """
    pa = require("pyarrow", "A fleet's results need", "fleet")
    pc = require("pyarrow.compute", "A fleet's results need", "fleet")
    other = pc.cast(pc.not_equal(table.column("tag"), tag), pa.int8())
    table = table.append_column("other", other).append_column("early", is_early(table))
    keys = [("digest", "ascending"), ("other", "ascending"), ("version", "descending"), ("tag", "ascending")]
    keys += [("early", "ascending"), ("path", "ascending"), ("stamp", "ascending"), ("joint", "ascending")]
    table = table.take(pc.sort_indices(table, sort_keys=keys)).drop_columns(["other", "early"])
    n = table.num_rows
    if n:
        digest, of_tag, path, stamp, joint = (
            _codes(table.column(c)) for c in ("digest", "tag", "path", "stamp", "joint")
        )
        first = np.concatenate([[True], digest[1:] != digest[:-1]])
        head = np.maximum.accumulate(np.where(first, np.arange(n), 0))
        keep = (of_tag == of_tag[head]) & (path == path[head]) & (stamp == stamp[head])
        again = np.concatenate([[False], (joint[1:] == joint[:-1]) & ~first[1:]])
        failed = np.asarray(table.column("failure").is_valid())
        table = table.filter(keep & ~(again & keep) & (failed == failures))
    if names:
        robots = pa.array(
            [names.get(robot, robot) for robot in table.column("robot").to_pylist()], pa.string()
        )
        table = table.set_column(table.column_names.index("robot"), "robot", robots)
    return table.take(
        pc.sort_indices(table, sort_keys=[(name, "ascending") for name in ORDER])
    ).combine_chunks()


def _codes(column: Any) -> np.ndarray:
    """Return a number for every text of a column, equal for equal texts, (n,)."""
    encoded = column.combine_chunks().dictionary_encode(null_encoding="encode")
    return encoded.indices.to_numpy(zero_copy_only=False)


def is_early(table: pa.Table) -> Any:
    """Return which rows have a day that a clock that was not set gave, (n,)."""
    pa = require("pyarrow", "A fleet's results need", "fleet")
    pc = require("pyarrow.compute", "A fleet's results need", "fleet")
    early = pc.less(table.column("day"), pa.scalar(EARLIEST, pa.date32()))
    return pc.cast(pc.fill_null(early, True), pa.int8())


def copies(table: pa.Table, names: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return pairs of paths whose files have the same content: the path that is used, and its copy.

    The logs of a renamed robot are no copies of those under its former name.

    Args:
        table: rows of all batches.
        names: former name of a robot -> its present one.
    """
    columns = [table.column("digest"), is_early(table), table.column("path"), table.column("robot")]
    rows = sorted(set(zip(*(column.to_pylist() for column in columns), strict=True)))
    first: dict[str, str] = {}
    result = []
    for digest, _, path, robot in rows:
        if robot in names:
            continue
        if first.setdefault(digest, path) != path:
            result.append((first[digest], path))
    return result
