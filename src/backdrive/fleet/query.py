"""SQL queries of the results: tables in memory, in a database without access to anything else."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from backdrive.errors import InvalidInput, require
from backdrive.fleet.store import Store

MEMORY = "2GB"


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Rows of an answer.

    Attributes:
        names: of the columns.
        rows: at most as many as were asked for.
        more: whether there are further ones.
    """

    names: tuple[str, ...]
    rows: list[tuple[Any, ...]]
    more: bool = False


def run_query(folder: str | os.PathLike, sql: str, *, most: int = 1000) -> Answer:
    """Answer one SELECT over the tables `results` and `failures`, whose columns are those of `schema.schema()`.

    The tables are loaded first; then DuckDB's access to files, network and extensions is switched off and locked.

    Args:
        folder: of the results.
        sql: the question.
        most: rows that are returned.

    Raises:
        InvalidInput: it is not a single SELECT, is invalid, or reads something outside the tables.
    """
    duckdb = require("duckdb", "SQL needs", "fleet")
    store = Store.open(folder)
    setting = {"python_enable_replacements": "false", "autoinstall_known_extensions": "false"}
    database = duckdb.connect(":memory:", config=setting | {"autoload_known_extensions": "false"})
    try:
        for name, failures in (("results", False), ("failures", True)):
            database.register("arrow_rows", store.table(failures=failures))
            database.execute(f"CREATE TABLE {name} AS SELECT * FROM arrow_rows")
            database.unregister("arrow_rows")
        for line in (
            f"SET memory_limit = '{MEMORY}'",
            "SET temp_directory = ''",
            "SET enable_external_access = false",
        ):
            database.execute(line)
        database.execute("SET lock_configuration = true")
        statements = database.extract_statements(sql)
        if len(statements) != 1 or statements[0].type != duckdb.StatementType.SELECT:
            raise InvalidInput(
                "That is not one SELECT.", remedy="Write a single SELECT; SQL cannot change the results."
            )
        cursor = database.execute(sql)
        names = tuple(column[0] for column in cursor.description or ())
        rows = cursor.fetchmany(most + 1)
    except duckdb.Error as error:
        raise InvalidInput(
            f"{type(error).__name__}: {str(error).strip()[:500]}",
            remedy="Only the tables `results` and `failures` can be queried. Instead of DESCRIBE, use: SELECT * FROM results "
            "LIMIT 1.",
        ) from error
    finally:
        database.close()
    return Answer(names=names, rows=rows[:most], more=len(rows) > most)
