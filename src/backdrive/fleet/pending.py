"""What a run has to do: logs without results, and results that no longer hold."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput, require
from backdrive.fleet.entries import LogEntry

if TYPE_CHECKING:
    import pyarrow as pa

    from backdrive.fleet.store import Store

STATED = ("robot", "type", "day")  # columns that the source states, not the log


def check_options(identification: Mapping[str, Any]) -> None:
    """Refuse options of `identify` that no log could be identified with, before any log is listed.

    Raises:
        InvalidInput: an option makes no sense.
        UnknownName: there is no such law, method or option.
    """
    if not identification:
        return
    from backdrive.identification import dynamic, identify
    from backdrive.identification.auto import METHODS
    from backdrive.identification.options import Options

    names = dict(inspect.signature(identify).parameters)
    for name in identification:
        lookup(name, names, "known option of identify")
    own = vars(Options())
    options = Options(**{name: value for name, value in identification.items() if name in own})
    options.check()
    if options.method != "auto":
        lookup(options.method, METHODS, "method")
        options.applicable(options.method)
    if options.method == "dynamic" or (options.method == "auto" and options.law not in (None, "polyline")):
        dynamic.check(options)
    elif options.method != "auto" and options.law is not None:
        lookup(
            str(options.law), {"coulomb-viscous": "", "polyline": ""}, f"law of the method {options.method}"
        )


@dataclass(frozen=True)
class Plan:
    """What a run has to do.

    Attributes:
        logs: to be identified.
        sentences: remarks for the user.
        stamps: of every log that is listed, by path.
        robots: whose results no longer hold, by the names in the results.
        retry: results of logs that failed no longer hold.
        has_stale: there are rows that no longer hold.
    """

    logs: list[LogEntry]
    sentences: list[str]
    stamps: Mapping[str, str] = field(default_factory=dict)
    robots: frozenset[str] = frozenset()
    retry: bool = False
    has_stale: bool = False

    def is_stale(self, table: pa.Table) -> np.ndarray:
        """Return the rows that no longer hold, (n,): of files that have changed, of robots and failures to be done again."""
        columns = [table.column(name).to_pylist() for name in ("path", "stamp", "failure", "robot")]
        return np.array(
            [
                path in self.stamps
                and (
                    self.stamps[path] != stamp or robot in self.robots or (self.retry and failure is not None)
                )
                for path, stamp, failure, robot in zip(*columns, strict=True)
            ],
            dtype=bool,
        )

    def drop_stale(self, store: Store) -> None:
        """Remove the rows that no longer hold; called when the workers are there to identify their logs again."""
        if not self.has_stale:
            return
        with store.editing():
            store.drop(self.is_stale)


def pending_logs(
    store: Store, entries: Sequence[LogEntry], *, retry: bool = False, again: Sequence[str] = ()
) -> Plan:
    """Return the logs without valid results. Robots, types and days in the results are made those of the source.

    Args:
        store: the results, locked.
        entries: the logs that are listed.
        retry: try again the logs that failed.
        again: robots whose logs are identified again.

    Raises:
        InvalidInput: there is no such robot.
    """
    with store.editing():
        sentences = store.set_aside_fragments()
        robots = frozenset(_names(store, again, entries))
        known = store.raw(["path", "stamp", "failure", "tag", *STATED])
        if corrected := _correct(store, known, entries):
            sentences.append(corrected)
            known = store.raw(known.column_names)
    plan = Plan([], sentences, {entry.path: entry.stamp for entry in entries}, robots, retry)
    stale = plan.is_stale(known)
    plan = replace(plan, has_stale=bool(stale.any()))
    valid = known.filter(~stale)
    columns = (valid.column(name).to_pylist() for name in ("path", "stamp", "tag"))
    done = {
        path
        for path, stamp, tag in zip(*columns, strict=True)
        if tag == store.tag and plan.stamps.get(path) == stamp
    }
    plan.logs.extend(entry for entry in entries if entry.path not in done)
    return plan


def _names(store: Store, again: Sequence[str], entries: Sequence[LogEntry]) -> set[str]:
    """Return robots with all their former names."""
    here = {entry.robot for entry in entries} | {*store.names.values()}
    if not here.issuperset(again):
        here |= {*store.raw(["robot"]).column("robot").to_pylist()}
    for robot in again:
        if robot not in here:
            raise InvalidInput(
                f"There is no robot '{robot}' in {store.folder}.", remedy="See `backdrive fleet status`."
            )
    return {*again, *(old for old, new in store.names.items() if new in again)}


def _correct(store: Store, known: pa.Table, entries: Sequence[LogEntry]) -> str:
    """Write robot, type and day of the source into the results of the same files, as when a manifest was corrected; return a
    sentence, or nothing if all of them are right.
    """
    pyarrow = require("pyarrow", "A fleet's results need", "fleet")
    stated = {(entry.path, entry.stamp): (entry.robot, entry.type, entry.day) for entry in entries}

    def rows(table: pa.Table) -> tuple[list[Any], list[Any], list[Any]]:
        """Return the paths, and robot, type and day as they are and as they should be."""
        paths, stamps, *columns = (table.column(n).to_pylist() for n in ("path", "stamp", *STATED))
        before = list(zip(*columns, strict=True))
        keys = zip(paths, stamps, strict=True)
        return paths, before, [stated.get(key, row) for key, row in zip(keys, before, strict=True)]

    def correct(table: pa.Table) -> pa.Table | None:
        _, before, after = rows(table)
        if before == after:
            return None
        for name, values in zip(STATED, zip(*after, strict=True), strict=True):
            number = table.column_names.index(name)
            kind = table.schema.field(number)
            table = table.set_column(number, kind, pyarrow.array(list(values), kind.type))
        return table

    wrong = {path for path, old, new in zip(*rows(known), strict=True) if old != new}
    if not wrong:
        return ""
    store.rewrite(correct)
    return f"{len(wrong)} logs have another robot, type or day in the source now; their results have it too."
