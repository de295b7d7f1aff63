"""SQL queries of the results: tables in memory, in a database without access to anything else."""

from __future__ import annotations

import os
from dataclasses import dataclass
from threading import Timer
from typing import Any

from backdrive.errors import InvalidInput, require
from backdrive.fleet.store import Store

MEMORY = "2GB"
LONGEST = 30.0  # time for an answer [s]


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


def run_query(folder: str | os.PathLike, sql: str, *, most: int = 1000, seconds: float = LONGEST) -> Answer:
    """Answer one SELECT over the tables `results` and `failures`, whose columns are those of `schema.schema()`.

    The tables are loaded first; then DuckDB's access to files, network and extensions is switched off and locked.

    Args:
        folder: of the results.
        sql: the question.
        most: rows that are returned.
        seconds: after which a query is given up [s].

    Raises:
        InvalidInput: it is not a single SELECT, is invalid, takes too long, or reads something outside the tables.
    """
    duckdb = require("duckdb", "SQL needs", "fleet")
    store = Store.open(folder)
    setting = {"python_enable_replacements": "false", "autoinstall_known_extensions": "false"}
    database = duckdb.connect(":memory:", config=setting | {"autoload_known_extensions": "false"})
    limit = Timer(seconds, database.interrupt)
    limit.daemon = True
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
        limit.start()
        cursor = database.execute(sql)
        names = tuple(column[0] for column in cursor.description or ())
        rows = cursor.fetchmany(most + 1)
    except duckdb.InterruptException as error:
        raise InvalidInput(
            f"No answer within {seconds:g} s.", remedy="Ask for less: join on digest and joint, or count."
        ) from error
    except duckdb.Error as error:
        first, *_ = str(error).strip().split("\n")
        raise InvalidInput(
            f"{type(error).__name__}: {first[:500]}",
            remedy="Only the tables `results` and `failures` can be queried. Instead of DESCRIBE, use: SELECT * FROM results "
            "LIMIT 1.",
        ) from error
    finally:
        limit.cancel()
        database.close()
    return Answer(names=names, rows=rows[:most], more=len(rows) > most)
