"""Channels of a file without a `--map`: by its format, or by unambiguous names; and the number of samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from backdrive.errors import MappingError
from backdrive.logs.readers import _names
from backdrive.logs.readers._channels import Values, columns_of
from backdrive.logs.readers._shapes import extent
from backdrive.logs.readers._tokens import INDEX
from backdrive.logs.readers.columns import Columns, describe


def automatic(
    columns: Columns, asked: Mapping[str, Any], names: str | Sequence[str] | None = None
) -> _names.Guess:
    """Return what the format, or else the names, say about the columns that fit the time.

    Names of joints leave out those that lack a channel, unless a `--map` says what the joints are.
    """
    if columns.channels:
        return _names.Guess(
            columns={
                channel: (name,) for name, channel in columns.channels.items() if name in columns.arrays
            },
            joints=columns.joints,
        )
    wanted = () if names is None or set(asked) - {"time"} else name_list(names)
    shapes = {name: value.shape for name, value in columns.arrays.items() if value.size > 1}
    found = _names.guess(
        {name: min(shape) if len(shape) == 2 else 1 for name, shape in shapes.items()}, columns.units, asked
    )
    n = length(columns, asked, found)
    fitting = {name: extent(shape, n) for name, shape in shapes.items()}
    fitting = {name: width for name, width in fitting.items() if width}
    return _names.guess(fitting, columns.units, asked, wanted, columns.joints)


def length(columns: Columns, asked: Mapping[str, Any], found: _names.Guess) -> int:
    """Return the number of samples: that of the time, or of what moves where time is counted with `index`."""
    sums = asked.get("time")
    if sums is None and "time" in asked:
        raise MappingError("--map t=none: a log needs a time.", remedy="Write for example t=0.001*index.")
    of_time = columns_of(sums) if sums else list(found.columns.get("time", ()))
    moving = [name for c in ("position", "velocity") for name in columns_of(asked.get(c) or ())]
    moving += [name for c in ("position", "velocity") for name in found.columns.get(c, ())]
    counted = bool(sums) and all(name == INDEX for name in of_time)
    for name in moving if counted else of_time:
        if name in columns.arrays:
            return max(columns.arrays[name].shape)
        if sums or counted:
            shape = Values(columns, {}, 0).find(name).shape
            return max(shape)
    raise MappingError(
        "No column has a name that means time.",
        remedy=f"Name it with --map t=COLUMN, or t=0.001*index for a 1 kHz log. Columns: {describe(columns)}.",
    )


def name_list(names: str | Sequence[str]) -> list[str]:
    """Return names that stand in a list or between commas."""
    return [str(name).strip() for name in (names.split(",") if isinstance(names, str) else names)]
