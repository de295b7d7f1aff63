"""Parquet tables: plain columns, and lists of a fixed length (as LeRobot writes states), footer checked first."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from backdrive.errors import IncompleteFile, ReadError, require
from backdrive.logs.readers._labels import holds_names, in_order, read_names
from backdrive.logs.readers.columns import Columns, ReadOptions

if TYPE_CHECKING:
    import pyarrow as pa

_WIDEST = 8


def prepare() -> None:
    """Load what reading needs, ahead of the time limit.

    Raises:
        MissingExtra: pyarrow is not installed.
    """
    require("pyarrow.parquet", "Reading Parquet needs", "table")
    import pyarrow as pa

    pa.array(
        [0.0]
    ).to_numpy()  # the first conversion loads pandas where it is installed, which takes longer than most files


def read(path: str, options: ReadOptions) -> Columns:
    """Read every numeric column, row group by row group.

    Raises:
        IncompleteFile: the footer is missing or a page is cut.
        FileTooLarge: the footer declares more than the limits allow.
        MissingExtra: pyarrow is not installed.
    """
    prepare()
    import pyarrow as pa
    from pyarrow import parquet

    limits, size = options.limits, os.path.getsize(path)
    try:
        file = parquet.ParquetFile(path, memory_map=False, pre_buffer=False)
    except (pa.ArrowInvalid, OSError) as error:
        raise IncompleteFile(
            f"The footer cannot be read ({_first_line(error)}).", remedy="Save the file again."
        ) from error
    with file:
        meta = file.metadata
        limits.check_count(meta.num_columns, "columns")
        limits.check_size(max(meta.num_rows, 0) * max(meta.num_columns, 1) * _WIDEST, size, "The table")
        groups = [meta.row_group(i) for i in range(meta.num_row_groups)]
        declared = sum(g.column(i).total_uncompressed_size for g in groups for i in range(g.num_columns))
        limits.check_size(declared, size, "The table")
        try:
            table = file.read(use_threads=False)
        except (pa.ArrowInvalid, pa.ArrowNotImplementedError, OSError) as error:
            raise IncompleteFile(
                f"A page is damaged ({_first_line(error)}).", remedy="Save the file again."
            ) from error
    if table.num_rows == 0:
        raise ReadError("The table has no rows.", remedy="Record the log again.")
    arrays: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    origin: dict[str, float] = {}
    notes: list[str] = []
    joints: tuple[str, ...] = ()
    order: np.ndarray | None = None
    for i, field in enumerate(table.schema):
        name = field.name if field.name not in arrays else f"{field.name}#{i + 1}"
        if not joints and holds_names(field.name) and _of_text(field.type):
            joints, order = read_names(table.column(i).to_pylist(), field.name, notes)
            if joints:
                continue
        value, unit = _numbers(table.column(i))
        if value is None:
            notes.append(f"Column '{field.name}' ({str(field.type)[:60]}) is not numbers and was left out.")
            continue
        arrays[name] = value
        if unit:
            units[name] = unit
            origin[name] = _begin(table.column(i))
    arrays = in_order(arrays, order, notes)
    return Columns(arrays=arrays, units=units, joints=joints, notes=tuple(notes), origin=origin)


def _of_text(kind: pa.DataType) -> bool:
    import pyarrow as pa

    lists = pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    return lists and (pa.types.is_string(kind.value_type) or pa.types.is_large_string(kind.value_type))


def _numbers(column: pa.ChunkedArray) -> tuple[np.ndarray | None, str]:
    """Return a column as (n,) or (n, k) and the unit its type states."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        counts = column.cast(pa.int64())
        start = next((value.as_py() for value in counts if value.is_valid), 0)
        numbers = (counts.fill_null(start).to_numpy() - start).astype(
            np.float64
        )  # exact: floats hold no ns since 1970
        numbers[counts.is_null().to_numpy()] = np.nan
        return numbers, kind.unit
    if (
        pa.types.is_boolean(kind)
        or pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_decimal(kind)
    ):
        return _flat(column), ""
    if pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
        if column.null_count:
            return None, ""
        joined = column.combine_chunks()
        if isinstance(joined, pa.ChunkedArray):
            joined = pa.concat_arrays(joined.chunks)
        flat = joined.flatten()
        if len(flat) % len(column) or not (pa.types.is_integer(flat.type) or pa.types.is_floating(flat.type)):
            return None, ""
        width = len(flat) // len(column)
        if not pa.types.is_fixed_size_list(kind) and not _equal_lengths(joined, width):
            return None, ""
        return _flat(flat).reshape(len(column), width), ""
    return None, ""


def _begin(column: pa.ChunkedArray) -> float:
    """Return the first instant of a column of time [s], as it is stored."""
    import pyarrow as pa

    start = next((value.as_py() for value in column.cast(pa.int64()) if value.is_valid), 0)
    return start * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[column.type.unit]


def _flat(column: pa.ChunkedArray | pa.Array) -> np.ndarray:
    import pyarrow as pa

    if pa.types.is_decimal(column.type) or column.null_count:
        column = column.cast(pa.float64())
    return np.array(
        column.to_numpy(zero_copy_only=False) if isinstance(column, pa.Array) else column.to_numpy()
    )


def _equal_lengths(lists: pa.Array, width: int) -> bool:
    offsets = np.asarray(lists.offsets.to_numpy(zero_copy_only=False))
    return bool((np.diff(offsets) == width).all())


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
