"""Tables whose rows are of several clocks: each row holds the columns of one topic, and the others are empty.

PlotJuggler writes topics so. Columns of other clocks are brought onto that of the positions, as those of a joined file are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.errors import MappingError
from backdrive.logs.log import CHANNELS
from backdrive.logs.readers._channels import Values, columns_of
from backdrive.logs.readers._join import GAP, clock_of, join
from backdrive.logs.readers._tokens import INDEX
from backdrive.logs.readers.columns import Columns

FEWEST = 20  # samples of a clock
ABSENT = 0.25  # least share of one clock's rows at which a column of another is empty [-]
SHARED = 0.1  # largest share of rows with both, if a column is of another clock whatever its intervals [-]
STEADY = 0.3  # largest variation of a clock's intervals; samples lost at random vary more [-]


def on_one_clock(columns: Columns, asked: Mapping[str, Any], found: Mapping[str, Sequence[str]]) -> Columns:
    """Return columns on the clock of the positions, or else the velocities; the same ones where all are on one clock.

    Args:
        columns: of the file.
        asked: sums of a `--map`.
        found: channel to columns, by their names.
    """
    used = {
        c: columns_of(asked[c] or ()) if c in asked else list(found.get(c, ())) for c in (*CHANNELS, "wrench")
    }
    values = Values(columns, {}, 0)
    names = [name for of in used.values() for name in of if name != INDEX or INDEX in columns.arrays]
    try:
        names = list(dict.fromkeys(values.full(name) for name in names))
    except MappingError:  # told where the column is looked up
        return columns
    there = {name: _there(columns.arrays[name]) for name in names}
    if all(mask is None for mask in there.values()):
        return columns
    time, of_time = clock_of(columns, asked, "The file")
    own = next((name for c in ("position", "velocity") for name in used[c]), None)
    if own is None or INDEX in of_time or any(columns.arrays[name].shape != time.shape for name in names):
        return columns
    every = np.ones(time.size, dtype=bool)
    base = _or(there[values.full(own)], every)
    others = {name: _or(there[name], every) for name in names}
    others = {name: mask for name, mask in others.items() if _is_apart(time, base, mask)}
    thin = _is_steady(time[base]) and _ratio(time[base], time) > 1.0 + ABSENT
    if not others and not thin:
        return columns
    what, without = "position" if used["position"] else "velocity", time.size - np.count_nonzero(base)
    note = "The rows are of several clocks, as PlotJuggler writes topics"
    note += f": {without} of {time.size} hold no {what} and were left out." if without else "."
    first = _rows(columns, [name for name in columns.arrays if name not in others], base)
    first = replace(first, notes=(*columns.notes, note))
    alike: dict[bytes, list[str]] = {}
    for name, mask in others.items():
        alike.setdefault(mask.tobytes(), []).append(name)
    for group in alike.values():
        told = f"'{group[0]}'" if len(group) == 1 else f"'{group[0]}' to '{group[-1]}'"
        part = _rows(columns, [*of_time, *group], others[group[0]])
        first = join(first, part, told, asked, asked, apart=False)
    return first


def _there(value: np.ndarray) -> np.ndarray | None:
    """Return where a column holds numbers, (n,); None if everywhere."""
    if value.ndim > 1 or value.dtype.kind != "f" or not value.size or not np.isnan(np.min(value)):
        return None
    return ~np.isnan(value)


def _or(mask: np.ndarray | None, other: np.ndarray) -> np.ndarray:
    return other if mask is None else mask


def _is_apart(time: np.ndarray, base: np.ndarray, mask: np.ndarray) -> bool:
    """Return whether a column's samples are of another clock than those of the base, both as masks of rows."""
    both, own, of_base = (int(np.count_nonzero(m)) for m in (base & mask, mask, base))
    if min(own, of_base) < FEWEST or both > (1.0 - ABSENT) * of_base:
        return False
    if both < SHARED * min(own, of_base):
        return True
    ratio = _ratio(time[mask], time[base])
    return _is_steady(time[mask]) and max(ratio, 1.0 / max(ratio, 1e-9)) > 1.0 + ABSENT


def _ratio(time: np.ndarray, other: np.ndarray) -> float:
    """Return how many times as long the usual interval of some instants is as that of others."""
    steps, others = (float(np.median(np.diff(np.sort(each)))) for each in (time, other))
    return steps / others if others > 0.0 else 0.0


def _is_steady(time: np.ndarray) -> bool:
    """Return whether instants follow each other evenly, gaps aside."""
    if time.size < FEWEST:
        return False
    steps = np.diff(np.sort(time))
    steps = steps[steps <= GAP * np.quantile(steps, 0.9)]
    return bool(steps.std() <= STEADY * steps.mean())


def _rows(columns: Columns, names: Sequence[str], mask: np.ndarray) -> Columns:
    """Return some columns in the rows of a mask; those of another length whole."""
    arrays = {name: columns.arrays[name] for name in names}
    return replace(
        columns,
        arrays={name: value[mask] if len(value) == mask.size else value for name, value in arrays.items()},
        notes=(),
    )
