"""Joined files: columns of one file interpolated onto the clock of another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from backdrive.errors import MappingError
from backdrive.logs.readers import _expression
from backdrive.logs.readers._automatic import automatic, length
from backdrive.logs.readers._channels import Values, columns_of
from backdrive.logs.readers._map_parts import parts_of, without_channels
from backdrive.logs.readers._shapes import orient
from backdrive.logs.readers._tokens import INDEX, Names
from backdrive.logs.readers.columns import NAMELESS, Columns, describe

GAP = 2.5  # an interval this many times longer than usual is a gap, and nothing is interpolated across [-]
FEWEST = 2  # samples that must be left
UNITS = 3.0, 6.0, 9.0  # powers of ten between s and ms, us, ns
NEAR_UNIT, ALIKE = (
    0.3,
    1.0,
)  # distance from such a power, and largest ratio of the numbers of samples [power of ten]
TIME = "t", "time"  # as a --map spells it


def side_by_side(
    first: Columns, others: Sequence[tuple[str, Columns]], map: str | Mapping[str, str] | None = None
) -> tuple[Columns, str | Mapping[str, str] | None]:
    """Return the columns of a file and, interpolated onto its clock, those of others; and what of the map is left to do.

    Rows of the first file before, after or within a gap of another's clock are left out, and noted.

    Args:
        first: gives the clock.
        others: path and columns of each file to join.
        map: as in `--map`; its time column is used for every file that contains it, and there may be one a file, in their
            order where columns have the same name; the others' is told by its name. In a joined file without a header the first
            column is the time if it increases.

    Raises:
        MappingError: a file has no recognizable time, the clocks do not overlap, or no file contains a time column.
    """
    files = (first, *(columns for _, columns in others))
    names = list(dict.fromkeys(name for columns in files for name in columns.arrays))
    rest, times = _times_apart(map, names)
    asked = _expression.parse(rest, names) if rest is not None else {}
    own = [_own_time(columns, times) for columns in files]
    if len(times) == len(files) and all(_holds(*both) for both in zip(files, times, strict=True)):
        own = list(times)  # of equal names each file has its own, in the files' order
    for text, _ in times:
        if text not in [of_file for of_file, _ in own]:
            raise MappingError(
                f"--map {text}: it is the time of no file.",
                remedy="Name one time a file, by columns of that file; where the columns' names tell the time, none. Columns: "
                + "; ".join(describe(columns) for columns in files)
                + ".",
            )
    for (path, other), (_, sums) in zip(others, own[1:], strict=True):
        first = join(first, other, path, asked | _as_time(own[0][1]), asked | _as_time(sums))
    if not times:
        return first, map
    text = own[0][0]
    if isinstance(map, Mapping):
        return first, map if text else {k: v for k, v in map.items() if k not in TIME} or None
    return first, ",".join(part for part in (text, rest) if part) or None


def _times_apart(
    map: str | Mapping[str, str] | None, names: Sequence[str]
) -> tuple[str | None, list[tuple[str, Any]]]:
    """Return a map without its times, and those as they are written, each with its sums."""
    text = ",".join(f"{c}={value}" for c, value in map.items()) if isinstance(map, Mapping) else map
    if text is None:
        return None, []
    times = [part for channel, part in parts_of(text) if channel in TIME]
    parsed = [(part, _expression.parse(part, names)["time"]) for part in times]
    return without_channels(text, TIME), [(part, sums) for part, sums in parsed if sums is not None]


def _own_time(columns: Columns, times: Sequence[tuple[str, Any]]) -> tuple[str, Any]:
    """Return the first of several times that a file can have, as written and as sums; nothing where it can have none."""
    return next((time for time in times if _holds(columns, time)), ("", None))


def _holds(columns: Columns, time: tuple[str, Any]) -> bool:
    return all(_has(columns, name) for name in columns_of(time[1]))


def _as_time(sums: Any) -> dict[str, Any]:
    return {} if sums is None else {"time": sums}


def _has(columns: Columns, name: str) -> bool:
    return name == INDEX or name in Names(tuple(columns.arrays))


def join(
    first: Columns,
    other: Columns,
    path: str,
    asked: Mapping[str, Any],
    of_other: Mapping[str, Any],
    *,
    apart: bool = True,
) -> Columns:
    """Return the columns of a file and, interpolated onto its clock, those of another.

    Args:
        first: gives the clock.
        other: is joined.
        path: of the other, for what is said.
        asked: sums of a `--map`, for the first file.
        of_other: the same for the other.
        apart: the other is a file of its own, whose clock may have begun at another instant.

    Raises:
        MappingError: a file has no recognizable time, or the clocks do not overlap.
    """
    clock, _ = clock_of(first, asked, "The first file")
    notes: list[str] = []
    theirs, of_time = _clock_without_header(other, of_other, path, notes) or clock_of(other, of_other, path)
    usable = np.flatnonzero(np.isfinite(theirs))
    stamps, where = np.unique(theirs[usable], return_index=True)
    rows = usable[where]
    if rows.size < theirs.size:
        notes.append(
            f"{theirs.size - rows.size} samples of {path} without a stamp of their own were left out."
        )
    if rows.size < FEWEST:
        raise MappingError(
            f"{path} has {rows.size} usable instants.", remedy="Check its time: --map t=COLUMN."
        )
    inside = (clock >= stamps[0]) & (clock <= stamps[-1])
    steps = np.diff(stamps)
    usual = GAP * float(np.quantile(steps, 0.9))
    after = np.clip(np.searchsorted(stamps, clock), 1, stamps.size - 1)
    across = inside & (steps[after - 1] > usual) & (stamps[after] != clock) & (stamps[after - 1] != clock)
    keep = inside & ~across
    if np.count_nonzero(keep) < FEWEST:
        raise MappingError(
            f"{path} does not overlap the first file in time: {_span(stamps)}, and {_span(clock[np.isfinite(clock)])}.",
            remedy="Join files of one recording, on one clock; shift one of them with --map t=COLUMN-SECONDS where it has a "
            "column of its own.",
        )
    if _in_another_unit(clock, stamps):
        raise MappingError(
            f"{path} and the first file have times of different units: {_span(stamps)}, and {_span(clock[np.isfinite(clock)])}.",
            remedy="Name both times in seconds; one in ms is --map t=0.001*COLUMN. Where they differ, name one a file, in the "
            "files' order: t=COLUMN,t=0.001*COLUMN.",
        )
    if not keep.all():
        notes.append(f"{np.count_nonzero(~keep)} samples before, after or in a gap of {path} were left out.")
    rates = (
        1.0 / float(np.median(np.diff(np.sort(clock[np.isfinite(clock)])))),
        1.0 / float(np.median(steps)),
    )
    notes.append(
        f"{path} was joined by time: from {rates[1]:.6g} Hz onto {rates[0]:.6g} Hz, by straight lines."
    )
    if apart and clock[0] == theirs[0] == 0.0:
        notes.append(f"Both clocks begin at 0, so {path} is assumed to begin at the same instant.")
    arrays = {name: _rows(value, clock.size, keep) for name, value in first.arrays.items()}
    units, named = dict(first.units), dict[str, str]()
    for name, value in other.arrays.items():
        lying = orient(value, theirs.size)
        if name in of_time or lying is None:
            continue
        label = name if name not in arrays else f"{Path(path).stem}/{name}"
        named[name] = label
        arrays[label] = np.column_stack(
            [
                cast("np.ndarray", np.interp(clock[keep], stamps, column[rows].astype(float)))
                for column in lying.T
            ]
        )
        if arrays[label].shape[1] == 1:
            arrays[label] = arrays[label][:, 0]
        if name in other.units:
            units[label] = other.units[name]
    channels = dict(first.channels)
    for name, channel in other.channels.items():
        if first.channels and channel != "time" and name in named and channel not in channels.values():
            channels[named[name]] = channel
    if first.channels and not other.channels:
        notes.append(f"The first file's format identifies its columns, but {path} needs --map.")
    return replace(
        first,
        arrays=arrays,
        units=units,
        joints=first.joints or other.joints,
        channels=channels,
        notes=(*first.notes, *other.notes, *notes),
    )


def _in_another_unit(clock: np.ndarray, stamps: np.ndarray) -> bool:
    """Return whether two clocks of about as many samples last a thousand or a million times as long as each other."""
    lasts, other = float(np.nanmax(clock) - np.nanmin(clock)), float(stamps[-1] - stamps[0])
    if not (lasts > 0.0 and other > 0.0) or abs(np.log10(clock.size / stamps.size)) > ALIKE:
        return False
    return bool(np.min(np.abs(abs(np.log10(lasts / other)) - np.array(UNITS))) < NEAR_UNIT)


def _clock_without_header(
    columns: Columns, asked: Mapping[str, Any], path: str, notes: list[str]
) -> tuple[np.ndarray, list[str]] | None:
    """Return the first column of a file without a header, and its name, if it can be the time and the map names no other."""
    named = any(_has(columns, name) for name in columns_of(asked.get("time") or ()))
    names = list(columns.arrays)
    if named or names != [f"{NAMELESS}{i + 1}" for i in range(len(names))]:
        return None
    time = columns.arrays[names[0]]
    if time.ndim > 1 or time.size < FEWEST or not (np.diff(time) > 0.0).all():
        return None
    notes.append(f"{path} has no header: its first column increases, and was taken as the time [s].")
    return time.astype(float), names[:1]


def clock_of(columns: Columns, asked: Mapping[str, Any], path: str) -> tuple[np.ndarray, list[str]]:
    """Return the instants of a file on its own clock [s], (n,), and the columns that they are of."""
    sums = asked.get("time")
    of_time = columns_of(sums) if sums else []
    own = {"time": sums} if of_time and all(_has(columns, name) for name in of_time) else {}
    try:
        found = automatic(columns, own)
        values = Values(columns, found.units, length(columns, own, found))
        if sums and own:
            values.add_sums("time", sums)
            of_time = [name if name == INDEX else values.full(name) for name in of_time]
        else:
            of_time = list(found.columns["time"])
            values.add_columns("time", of_time)
    except MappingError as error:
        raise MappingError(f"{path}: {error.message}", remedy=error.remedy) from error
    return values.arrays["time"][:, 0] + values.origin, of_time


def _rows(value: np.ndarray, n: int, keep: np.ndarray) -> np.ndarray:
    lying = orient(value, n)
    if lying is None:
        return value
    return lying[keep] if value.ndim > 1 else value[keep]


def _span(clock: np.ndarray) -> str:
    return f"{clock.min():.10g} to {clock.max():.10g} s" if clock.size else "no instants"
