"""The results of a fleet: Parquet files in a folder per month, one file per batch, written atomically and read as one table.

    results/fleet.json                          schema, options, names that robots had before
    results/logs/month=2026-03/BATCH.parquet    rows of `schema.schema()`
    results/torn/                               files that were no whole Parquet, set aside

A log may have several results: from two clients at once, from a copy, or from another version. Only one of them is read: that
of the present options and version, or else the newest. Among copies, it is the one with the first path.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from backdrive._files import make_folder, read_whole, set_aside, write_whole
from backdrive.errors import InvalidInput, ModelFileError, ReadError, require
from backdrive.fleet import locks, schema

if TYPE_CHECKING:
    import pyarrow as pa

KIND = "backdrive fleet"
HEAD = "fleet.json"
MOST_HEAD = 64 << 20  # [B]


@dataclass(frozen=True)
class Store:
    """A folder of results.

    Attributes:
        folder: its path.
        tag: of the options and the version of the last run.
        options: of that run, plain values.
        version: of the package that made it.
        names: former name of a robot -> its present one.
    """

    folder: Path
    tag: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    version: str = ""
    names: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def open(cls, folder: str | os.PathLike, *, make: bool = False) -> Store:
        """Open a folder of results.

        Args:
            folder: its path.
            make: make it where it does not exist, or is empty.

        Raises:
            ReadError: there is none.
            ModelFileError: it is of a newer schema, or damaged.
            InvalidInput: it holds something else.
            WriteError: it cannot be made.
        """
        check_folder(folder)
        place = Path(folder)
        head = place / HEAD
        if not head.exists():
            if not make:
                raise ReadError(
                    f"{place} holds no results of a fleet.",
                    remedy="Name the folder that `backdrive fleet ... -o` wrote.",
                )
            make_folder(place, "-o")
            others = [
                name
                for name in os.listdir(place)
                if not name.startswith(".") and name not in ("logs", "torn")
            ]
            if others:
                raise InvalidInput(
                    f"{place} holds other things ({others[0]}), and no results of a fleet.",
                    remedy="Name an empty or a new folder with -o.",
                )
            return cls(place)
        try:
            content = json.loads(read_whole(head, MOST_HEAD))
            kind, names = content["kind"], content["names"]
            known = {str(k): content[k] for k in ("tag", "options", "version")}
            if kind != KIND or not all(isinstance(x, str) for x in [*names, *names.values(), known["tag"]]):
                raise ValueError("another kind of file")
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ModelFileError(
                f"{head} is damaged ({error}).",
                remedy="Remove it; the next run writes it again, without the recorded renames.",
            ) from error
        schema.check_version(content.get("schema"), head)
        return cls(place, names=names, **known)

    def save(self) -> None:
        """Write `fleet.json`."""
        content = {"kind": KIND, "schema": schema.VERSION, "tag": self.tag, "version": self.version}
        content |= {"options": self.options, "names": dict(sorted(self.names.items()))}
        write_whole(self.folder / HEAD, json.dumps(content, indent=1) + "\n")

    def rename(self, pairs: Mapping[str, str]) -> Store:
        """Return the store with robots under new names, chains of names followed."""
        names = dict(self.names) | dict(pairs)
        for old in list(names):
            new, steps = names[old], 0
            while new in names and steps < len(names):
                new, steps = names[new], steps + 1
            names[old] = new
        return replace(self, names={old: new for old, new in names.items() if old != new})

    def parts(self) -> list[Path]:
        """Return the files of all batches, in the order of their paths."""
        return sorted((self.folder / "logs").glob("month=*/*.parquet"))

    def read_part(self, part: Path, columns: Sequence[str] | None = None) -> pa.Table:
        """Return the rows of a batch in the current schema.

        Raises:
            ModelFileError: the file is torn, or of a newer schema.
        """
        pq = require("pyarrow.parquet", "A fleet's results need", "fleet")
        pa = require("pyarrow", "A fleet's results need", "fleet")
        try:
            file = pq.ParquetFile(part, memory_map=False)
            with file:
                stated = (file.schema_arrow.metadata or {}).get(schema.KEY, b"-1")
                version = schema.check_version(int(stated), part)
                whole = version < schema.VERSION or columns is None
                table = file.read(columns=None if whole or columns is None else list(columns))
        except (OSError, pa.ArrowException, ValueError) as error:
            if isinstance(error, ModelFileError):
                raise
            raise IncompleteResults(
                f"{part} is not a complete Parquet file ({str(error)[:200]}).",
                remedy="The next run moves it aside and identifies its logs again.",
            ) from error
        table = schema.current(table, version) if whole else table
        return table.select(list(columns)) if columns is not None else table

    def raw(self, columns: Sequence[str] | None = None) -> pa.Table:
        """Return the rows of all batches as they were written."""
        pa = require("pyarrow", "A fleet's results need", "fleet")
        tables = [self.read_part(part, columns) for part in self.parts()]
        if not tables:
            empty = schema.schema().empty_table()
            return empty.select(list(columns)) if columns is not None else empty
        return pa.concat_tables(tables)

    def table(self, *, failures: bool = False) -> pa.Table:
        """Return one row for each joint of a log, or the failures, without duplicates, with present names, sorted by robot,
        joint, day and path.
        """
        from backdrive.fleet.merging import once

        return once(self.raw(), self.tag, self.names, failures=failures)

    def set_aside_fragments(self) -> list[str]:
        """Move files that are no whole Parquet to `torn/`, and return a sentence for each."""
        sentences = []
        for part in self.parts():
            try:
                self.read_part(part, ["digest"])
            except IncompleteResults:
                folder = make_folder(self.folder / "torn", "-o")
                set_aside(part, folder)
                sentences.append(
                    f"{part.name} was incomplete: it was moved to {folder}, and its logs are identified again."
                )
        return sentences

    def drop(self, condition: Callable[[pa.Table], Any]) -> int:
        """Remove rows, file by file, each replaced whole; return how many.

        Args:
            condition: takes the table of a batch, returns True where a row goes, (n,) booleans.
        """
        import numpy as np

        count = 0

        def keep(table: pa.Table) -> pa.Table | None:
            nonlocal count
            gone = np.asarray(condition(table), dtype=bool)
            count += int(gone.sum())
            return table.filter(~gone) if gone.any() else None

        self.rewrite(keep)
        return count

    def rewrite(self, change: Callable[[pa.Table], pa.Table | None]) -> None:
        """Replace the rows of batches, file by file, each whole; a file without rows is removed.

        Args:
            change: takes the table of a batch, returns that which replaces it, or None to keep it.
        """
        for part in self.parts():
            table = change(self.read_part(part))
            if table is None:
                continue
            if table.num_rows:
                write_whole(part, encode(table))
            else:
                part.unlink()

    def forget(self, robot: str) -> int:
        """Remove a robot under all its names, and return how many rows it had.

        Raises:
            InvalidInput: there is no such robot.
        """
        import numpy as np

        names = {robot, *(old for old, new in self.names.items() if new == robot)}
        self.set_aside_fragments()
        count = self.drop(
            lambda table: np.isin(table.column("robot").to_numpy(zero_copy_only=False), list(names))
        )
        if not count:
            raise InvalidInput(
                f"There is no robot '{robot}' in {self.folder}.", remedy="See `backdrive fleet status`."
            )
        return count

    def lock(self, shard: tuple[int, int] = (1, 1)) -> AbstractContextManager[None]:
        """Lock the folder, or a shard of it, against a second run; different shards do not exclude each other. The lock ends
        with the process.

        Raises:
            InvalidInput: another run holds it.
        """
        return locks.lock(self.folder, shard)

    def editing(self) -> AbstractContextManager[None]:
        """Wait for other shards that are changing existing files, and let no other one do so meanwhile."""
        return locks.editing(self.folder)


def check_folder(folder: str | os.PathLike) -> None:
    """Refuse an address of an object store in the place of a folder.

    Raises:
        InvalidInput: it is one.
    """
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]*:/", str(folder)):  # a `Path` makes one slash of two
        raise InvalidInput(
            f"{folder} is an address; results are written to a folder.",
            remedy="Name a folder with -o, and copy it afterwards.",
        )


class IncompleteResults(ModelFileError):
    """A file of results ends before its content does."""


def encode(table: pa.Table) -> bytes:
    """Return a table as the bytes of a Parquet file, the same for the same rows."""
    pa = require("pyarrow", "A fleet's results need", "fleet")
    pq = require("pyarrow.parquet", "A fleet's results need", "fleet")
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", use_dictionary=True, write_statistics=True)
    return sink.getvalue().to_pybytes()


def write_rows(folder: Path, month: str, name: str, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write the rows of a batch as one file, whole or not at all.

    Args:
        folder: of the results.
        month: of its logs, such as `2026-03`.
        name: of the batch.
        rows: by column of the schema; what is absent is null.

    Raises:
        WriteError: the folder cannot be written, or the disk is full.
    """
    pa = require("pyarrow", "A fleet's results need", "fleet")
    place = make_folder(folder / "logs" / f"month={month}", "-o")
    return write_whole(
        place / f"{name}.parquet", encode(pa.Table.from_pylist(list(rows), schema=schema.schema()))
    )
