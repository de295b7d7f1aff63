"""One log of a fleet: its file, and its robot and day, by what is stated or by its path."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path, PurePosixPath

DATE = re.compile(r"(?<!\d)((?:19|20)\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])(?!\d)")


@dataclass(frozen=True, slots=True)
class LogEntry:
    """A log to be identified.

    Attributes:
        path: of the file, or its address in an object store, as it is stored: bytes that are not UTF-8 are escaped.
        size: of it [B].
        stamp: changes with the file: size and time of change, or the store's tag.
        robot: whose log it is.
        type: of the robot; robots of one type are siblings.
        day: on which it was recorded.
        fault: why there is nothing to identify; empty for a log.
        file: path by which it is opened, where that differs from `path`.
    """

    path: str
    size: int
    stamp: str
    robot: str
    type: str
    day: date
    fault: str = ""
    file: str = ""

    @property
    def place(self) -> str:
        """Path or address by which the log is opened."""
        return self.file or self.path


def printable(text: str) -> str:
    r"""Return text whose bytes that are not UTF-8 are escaped as \xe9, since they can be neither stored nor printed."""
    try:
        return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    except UnicodeEncodeError:  # surrogates that stand for no byte
        return text.encode("utf-8", "backslashreplace").decode("utf-8")


def local_entry(path: str, root: str, *, where: str = "", **known: str) -> LogEntry:
    """Return the entry of a local file; one with a fault if it cannot be read, or if its day is no date.

    Args:
        path: absolute path of the file.
        root: folder of the source, absolute.
        where: the line of a manifest that names it.
        known: robot, type and day, as far as known.
    """
    inside = os.path.relpath(path, root)
    name = os.path.basename(root)
    try:
        state = os.stat(path)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        return fault_of(path, inside, f"{where}Cannot read {path}: {reason}.", source=name, **known)
    stamp = f"{state.st_size}:{state.st_mtime_ns}"
    return entry_of(path, state.st_size, stamp, state.st_mtime, inside, source=name, where=where, **known)


def fault_of(path: str, inside: str, fault: str, **known: str) -> LogEntry:
    """Return the entry of a log that cannot be identified, with the reason; a corrected one has another stamp."""
    given = {name: value for name, value in known.items() if name != "day" or _date(value)}
    return entry_of(path, 0, f"fault:{printable(fault)}", 0.0, inside, fault=printable(fault), **given)


def entry_of(  # noqa: PLR0913  (fields of an entry)
    path: str,
    size: int,
    stamp: str,
    changed: float,
    inside: str,
    *,
    robot: str = "",
    type: str = "",
    day: str = "",
    source: str = "",
    where: str = "",
    fault: str = "",
) -> LogEntry:
    """Return an entry; unknown fields follow from its path below the source, or from the time of its last change.

    Args:
        path: of the file, or its address.
        size: of it [B].
        stamp: of it.
        changed: time of its last change [s since 1970].
        inside: its path below the source.
        robot: its robot, if stated.
        type: of the robot, if stated.
        day: of the log, if stated.
        source: name of the source's folder.
        where: the line of a manifest that names it.
        fault: why there is nothing to identify.
    """
    if day and _date(day) is None:
        wrong = f"{where}The day '{day}' is no date."
        return fault_of(path, inside, wrong, robot=robot, type=type, source=source)
    inside = printable(inside).replace(os.sep, "/")
    when = _date(day) if day else None
    for match in [*DATE.finditer(inside)][-1:]:  # the last one counts: folders may name the year before
        when = when or _date("-".join(match.groups()))
    if when is None:
        when = datetime.fromtimestamp(max(changed, 0.0), UTC).date()
    shown = printable(path)
    robot = robot or _robot(inside, printable(source))
    return LogEntry(shown, size, stamp, robot, type, when, fault, path if path != shown else "")


def _robot(inside: str, source: str) -> str:
    """Return the first folder below the source that is not only a date, or else the file's name without its date, or else
    the name of the source's folder.
    """
    *folders, file = PurePosixPath(inside).parts
    stem = Path(file).stem
    names = [name for name in folders if name != ".." and _without_date(name)][:1]
    return names[0] if names else _without_date(stem) or source or stem


def _without_date(name: str) -> str:
    return DATE.sub("", name).strip("-_. T")


def _date(text: str) -> date | None:
    try:
        return date.fromisoformat(text.strip()[:10])
    except ValueError:  # as the 31st of June
        return None
