"""Logs from data in memory: arrays, and tables of pandas, polars or pyarrow."""

from __future__ import annotations

import inspect
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Real
from typing import Any, cast

import numpy as np

from backdrive._arguments import check_keywords
from backdrive._catalog import did_you_mean
from backdrive._documents import as_list, is_several
from backdrive.errors import InvalidInput, MappingError, UnknownName, check_type
from backdrive.logs.joint import Joint, as_joints
from backdrive.logs.log import CHANNELS, Log

ARGUMENTS = ("time", "rate", "joints", "unit")  # of `Log.from_arrays`, beside the channels
DEGREES = ("position", "velocity", "reference", "second_encoder")  # channels that may be in degrees


def log_of_arrays(
    time: Any = None,
    *,
    rate: float | None = None,
    joints: str | Joint | Sequence[str | Joint] | None = None,
    unit: Any = "rad",
    channels: Mapping[str, Any],
) -> Log:
    """Return a log of arrays.

    Args:
        time: sampling instants [s], (n,); None: by `rate`.
        rate: samples a second [Hz].
        joints: names; None: joint_1, joint_2, ...
        unit: `rad`, `m`, or `deg` (positions and velocities are then converted), for all joints or one each.
        channels: by name, (n,) or (n, J), any number of them None.

    Raises:
        UnknownName: there is no such channel.
        InvalidInput: an array is no array of numbers, shapes do not fit, or time and rate are both there or both absent.
    """
    for name in channels:
        if name not in CHANNELS:
            near = did_you_mean(name, (*CHANNELS, *ARGUMENTS))
            raise UnknownName(
                f"A log has no channel '{name}'.",
                remedy=f"{near}Channels are {', '.join(CHANNELS)}; other arguments {', '.join(ARGUMENTS)}.",
                name=name,
            )
    given: dict[str, Any] = {
        name: _array(name, value) for name, value in channels.items() if value is not None
    }
    if not given:
        raise InvalidInput("There are no channels.", remedy="Give position and torque, (n,) or (n, J).")
    first = next(iter(given.values()))
    n, J = len(first), 1 if first.ndim == 1 else first.shape[1]
    if (time is None) == (rate is None):
        raise InvalidInput(
            "Give exactly one of `time` and `rate`.",
            remedy="Give instants [s], or samples a second [Hz].",
        )
    if rate is not None:
        if not isinstance(rate, Real) or not 0.0 < rate < np.inf:
            raise InvalidInput(f"rate = {rate!r} Hz.", remedy="Give samples a second, one positive number.")
        time = np.arange(n) / float(rate)
    units = [unit] * J if isinstance(unit, str) else as_list(unit)
    known = _joints(joints, ["rad" if one == "deg" else one for one in units], J)
    turned = [one == "deg" for one in units]
    done = [name for name in DEGREES if name in given and any(turned)]
    for name in done:
        factor = np.where(turned, np.pi / 180.0, 1.0)
        given[name] = given[name] * (factor if given[name].ndim == 2 else factor[0])
    notes = (f"Converted from degrees, as asked: {', '.join(done)}.",) if done else ()
    return Log(time=_array("time", time), joints=known, notes=notes, **given)


def log_of_frame(frame: Any, **options: Any) -> Log:
    """Return a log of a table in memory; its columns are recognized by their names, as those of a file are.

    Args:
        frame: of pandas, polars (a lazy one is collected) or pyarrow, or a mapping from names to arrays; units may stand in the
            names (`q [deg]`). An index of pandas that has a name, or holds instants, is a column too.
        options: `map`, `names`, `units`, `gear`, `counts`, `motor_side`, `coupling`, `coupling_side`, as `read_log` takes them.

    Raises:
        MappingError: the columns do not say what they are; the message lists them.
        InvalidInput: it is no table, it has no rows, or an option does not fit.
    """
    from backdrive.logs.readers._labels import holds_names, in_order, read_names
    from backdrive.logs.readers.columns import Columns, plain
    from backdrive.logs.readers.mapping import to_log
    from backdrive.logs.readers.units import split

    known = list(inspect.signature(to_log).parameters)
    check_keywords("from_frame", options, known[1 : known.index("sources")])
    arrays: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    notes: list[str] = []
    columns = _columns(frame)
    if columns and not any(value.size for value in columns.values()):
        raise InvalidInput(
            f"The table has no rows; its columns are {', '.join(columns)}.",
            remedy="Give one with samples: a filter may have left none.",
        )
    joints: tuple[str, ...] = ()
    order: np.ndarray | None = None
    for name, value in columns.items():
        if not joints and holds_names(str(name)) and value.dtype.kind in "OU" and value.size:
            rows: list[object] = [list(row) if np.ndim(row) else row for row in value]
            joints, order = read_names(rows, str(name), notes)
            continue
        array = _seconds(value)
        array = plain(array) if array is not None else None
        if array is None:
            notes.append(f"Column '{name}' holds no numbers and was left out.")
        else:
            arrays[str(name)] = array
            if value.dtype.kind not in "mM" and (unit := split(str(name))[1]):
                units[str(name)] = unit
    if not arrays:
        raise InvalidInput(
            "The table has no column of numbers.", remedy="Give one a channel, and one of time."
        )
    try:
        arrays = in_order(arrays, order, notes)
        return to_log(Columns(arrays=arrays, units=units, joints=joints, notes=tuple(notes)), **options)
    except MappingError as error:
        if not notes:
            raise
        raise MappingError(error.message, remedy=" ".join([error.remedy, *notes])) from error


def is_table(value: Any) -> bool:
    """Return whether something is a table that `log_of_frame` takes."""
    return _is_lazy(value) or hasattr(value, "columns") or hasattr(value, "column_names")


def _is_lazy(value: Any) -> bool:
    """Return whether something is a lazy frame of polars, whose columns are known once it is collected."""
    return type(value).__name__ == "LazyFrame" and hasattr(value, "collect")


def as_logs(logs: Any) -> list[Log]:
    """Return one log, several, or data frames as logs.

    Raises:
        InvalidInput: there is something else.
    """
    several: list[Any] = list(logs) if is_several(logs) else [logs]
    several = [Log.from_frame(log) if is_table(log) else log for log in several]
    for log in several:
        if not isinstance(log, Log):
            file = isinstance(log, (str, os.PathLike))
            ways = "`Log.from_arrays`, `Log.from_frame`"
            remedy = f"Pass a `Log` ({'`read_log` makes one of a file' if file else f'`read_log`, {ways}'}), or several."
            check_type(log, Log, "log", remedy)
    return several


def _columns(frame: Any) -> dict[str, Any]:
    """Return the columns of a table by name."""
    frame = frame.collect() if _is_lazy(frame) else frame
    if isinstance(frame, Mapping):
        table = cast("Mapping[Any, Any]", frame)
        return {str(name): np.asarray(value) for name, value in table.items()}
    if hasattr(frame, "column_names") and hasattr(frame, "column"):  # pyarrow
        return {name: frame.column(name).to_numpy() for name in frame.column_names}
    if not is_table(frame):
        check_type(frame, Mapping, "table", "Give a data frame, or a mapping from names to arrays.")
    columns = {str(name): np.asarray(frame[name]) for name in frame.columns}
    if len(columns) != len(list(frame.columns)):
        raise InvalidInput("Two columns have the same name.", remedy="Rename one of them.")
    index = getattr(frame, "index", None)
    if index is not None and getattr(index, "name", None) is None and np.asarray(index).dtype.kind in "mM":
        columns.setdefault("time", np.asarray(index))
    elif index is not None and getattr(index, "name", None) is not None:
        columns.setdefault(str(index.name), np.asarray(index))
    return columns


def _seconds(value: np.ndarray) -> np.ndarray | None:
    """Return a column as numbers, instants and durations in seconds from the first; None if it holds none."""
    if value.dtype.kind in "mM":
        from_first = (value - value[0]) if value.size else value.astype("m8[ns]")
        return from_first / np.timedelta64(1, "s")
    if value.dtype.kind == "O" and value.size and isinstance(value[0], (list, tuple, np.ndarray)):
        try:
            value = np.array([np.asarray(row, dtype=np.float64) for row in value])
        except (TypeError, ValueError):
            return None
    if value.dtype.kind == "O":
        try:
            value = value.astype(np.float64)
        except (TypeError, ValueError):
            return None
    return value if value.dtype.kind in "biuf" else None


def _array(name: str, value: Any) -> np.ndarray:
    """Return something as an array of one or two dimensions."""
    try:
        array = np.asarray(value)
        array = array.astype(np.float64) if array.dtype.kind in "biufO" else array
    except Exception as error:  # what other libraries raise may be of any class
        raise InvalidInput(
            f"`{name}` cannot be taken as an array: {str(error)[:200]}.",
            remedy="Give numbers, (n,) or (n, J).",
        ) from error
    if array.dtype.kind != "f" or array.ndim not in (1, 2):
        what = "an array of complex numbers" if array.dtype.kind == "c" else f"a {type(value).__name__}"
        what = f"of shape {array.shape}" if array.dtype.kind == "f" else what
        raise InvalidInput(f"`{name}` is {what}.", remedy="Give an array of numbers, (n,) or (n, J).")
    return array


def _joints(joints: Any, units: list[Any], J: int) -> tuple[Joint, ...]:
    """Return the joints of J columns."""
    names = [f"joint_{j + 1}" for j in range(J)] if joints is None else joints
    known = as_joints(names)
    if len(known) != J or len(units) != J:
        raise InvalidInput(
            f"There are {J} columns, {len(known)} joints and {len(units)} units.",
            remedy="Name one joint a column.",
        )
    given = [names] if isinstance(names, (str, Joint)) else list(names)
    return tuple(
        joint if isinstance(name, Joint) else replace(joint, unit=u, named=joints is not None)
        for joint, name, u in zip(known, given, units, strict=True)
    )
