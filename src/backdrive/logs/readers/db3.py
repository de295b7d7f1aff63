"""ROS 2 joint states in a bag's SQLite file, opened read-only and with nothing of its schema trusted."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from backdrive.errors import IncompleteFile, ReadError
from backdrive.logs.readers._bag import Topics
from backdrive.logs.readers.columns import Columns, ReadOptions

_BATCH = 4096
_ALLOWED = frozenset((sqlite3.SQLITE_READ, sqlite3.SQLITE_SELECT))
_ZSTD = b"\x28\xb5\x2f\xfd"


def read(path: str, options: ReadOptions) -> Columns:
    """Read the joint states of a bag.

    Raises:
        IncompleteFile: the database is cut or damaged.
        MappingError: several topics hold joint states and none was chosen.
        ReadError: it holds none, or is a database of another kind.
    """
    topics = Topics(options)
    for part in (path, *options.parts):
        try:
            with closing(sqlite3.connect(f"{Path(part).as_uri()}?mode=ro&immutable=1", uri=True)) as base:
                _gather(base, topics)
        except (sqlite3.Error, OverflowError) as error:
            if not topics.count:
                raise IncompleteFile(
                    f"The database is damaged ({error}).", remedy="Copy or record it again."
                ) from error
            topics.notes.append(
                f"The database is damaged ({error}): the {topics.count} joint states before that were read."
            )
            break
    return topics.columns()


def _allow(action: int, *_: str | None) -> int:
    """Allow to read, and nothing else."""
    return sqlite3.SQLITE_OK if action in _ALLOWED else sqlite3.SQLITE_DENY


def _gather(base: sqlite3.Connection, topics: Topics) -> None:
    base.execute("PRAGMA trusted_schema=OFF")
    base.execute("PRAGMA cell_size_check=ON")
    base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 1 << 27)
    tables = {
        name
        for (name,) in base.execute(
            "SELECT name FROM sqlite_master WHERE type='table' AND sql NOT LIKE '%VIRTUAL%'"
        )
    }
    if not {"topics", "messages"} <= tables:
        raise ReadError(
            "The database is not a ROS 2 bag: it has no tables of topics and messages.", remedy="Name a bag."
        )
    base.set_authorizer(_allow)
    declared = base.execute("SELECT id, name, type, serialization_format FROM topics").fetchmany(
        topics.options.limits.max_columns
    )
    for key, name, kind, encoding in declared:
        gatherer = topics.declare(str(name), str(kind), ros1=False, known=encoding == "cdr")
        if gatherer is None:
            continue
        rows = base.execute(
            "SELECT timestamp, data FROM messages WHERE topic_id=? ORDER BY timestamp, id", (key,)
        )
        while batch := rows.fetchmany(_BATCH):
            messages = [data for _, data in batch]
            if not all(isinstance(data, bytes) for data in messages):
                raise ReadError("A message is not bytes.", remedy="The bag is damaged; record it again.")
            if messages[0].startswith(_ZSTD):
                raise ReadError(
                    "Messages are compressed one by one.", remedy="Convert it with `ros2 bag convert`."
                )
            gatherer.add(messages, [int(at) for at, _ in batch])
