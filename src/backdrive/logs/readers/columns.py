"""`Columns`: the columns of a file before they are mapped to channels, and their transfer through a pipe without pickle."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from backdrive._visible import visible
from backdrive.errors import ReaderCrash
from backdrive.logs.log import CHANNELS, Drive
from backdrive.logs.readers.limits import Limits

#: The only element types that may come back from the parsing process.
PLAIN = frozenset(("|b1", "|i1", "|u1", "<i2", "<u2", "<i4", "<u4", "<i8", "<u8", "<f4", "<f8"))

NAMELESS = "column_"  # begins the names of columns without a header, before their number from 1

_LAWS: dict[str, Any] = {law: law for law in ("torque", "velocity", "position", "voltage", "duty")}


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """The options of a reader.

    Attributes:
        topic: of a bag that holds several joint-state topics.
        joints: names that the person asked for, to choose among several publishers on one topic.
        parts: further files of a bag that was split.
        limits: see `Limits`.
    """

    topic: str | None = None
    joints: tuple[str, ...] = ()
    parts: tuple[str, ...] = ()
    limits: Limits = field(default_factory=Limits)


@dataclass(frozen=True, kw_only=True, eq=False)
class Columns:
    """Named numbers of a file, as the file has them.

    Attributes:
        arrays: by column name, each (n,) or (n, k) or (k, n), any real dtype; single numbers are (1,).
        units: unit that the file itself states, by column name.
        joints: joint names, where the format knows them.
        channels: what the format itself says a column is: column name to `time` or a channel of `Log`.
        drive: law behind the drive input, where the format knows it.
        notes: what the reader did, in sentences.
        origin: instant at which a column of time that is counted from its first sample begins, by column name [s since 1970].
    """

    arrays: Mapping[str, np.ndarray]
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    joints: tuple[str, ...] = ()
    channels: Mapping[str, str] = field(default_factory=dict[str, str])
    drive: Drive | None = None
    notes: tuple[str, ...] = ()
    origin: Mapping[str, float] = field(default_factory=dict[str, float])


def plain(array: np.ndarray) -> np.ndarray | None:
    """Return the array in a little-endian type of `PLAIN`, one- or two-dimensional; None if it is no such thing.

    Scalars become (1,); axes of length one are dropped from arrays of more than two dimensions.
    """
    if array.dtype.kind not in "biuf":
        return None
    if array.ndim > 2:
        array = array.squeeze()
    if array.ndim > 2:
        return None
    if array.ndim == 0:
        array = array.reshape(1)
    dtype = array.dtype.newbyteorder("<")
    if dtype.str not in PLAIN:
        dtype = np.dtype("<f8")
    return np.ascontiguousarray(array, dtype=dtype)


def frames(columns: Columns) -> Iterator[bytes | memoryview]:
    """Yield a header and then every array's bytes; each array is let go once it has been passed on."""
    arrays = {name: np.ascontiguousarray(value) for name, value in columns.arrays.items()}
    drive = columns.drive
    yield header(
        {
            "arrays": [[name, value.dtype.str, list(value.shape)] for name, value in arrays.items()],
            "units": dict(columns.units),
            "joints": list(columns.joints),
            "channels": dict(columns.channels),
            "drive": None if drive is None else {"law": drive.law, "gains": dict(drive.gains)},
            "notes": list(columns.notes),
            "origin": dict(columns.origin),
        }
    )
    del columns
    for name in list(arrays):
        value = arrays.pop(name)
        if value.size:
            yield value.reshape(-1).view(np.uint8).data


def header(content: Mapping[str, Any]) -> bytes:
    """Return a JSON document with its length in front (4 bytes, little endian)."""
    text = json.dumps(content).encode()
    return len(text).to_bytes(4, "little") + text


def unframe(content: Mapping[str, Any], receive: Callable[[memoryview], None], limits: Limits) -> Columns:
    """Rebuild columns; the sender may have parsed a malicious file, so everything it sends is checked.

    Args:
        content: the header's JSON.
        receive: fills a buffer with the next bytes of the pipe.
        limits: bounds on what is accepted.

    Raises:
        ReaderCrash: the header is not what `frames` writes.
        FileTooLarge: more arrays or bytes than the limits allow.
    """
    try:
        described = [
            (clean(n), np.dtype(_plain_dtype(d)), tuple(int(x) for x in s)) for n, d, s in content["arrays"]
        ]
        if any(len(shape) not in (1, 2) or min(shape) < 0 for _, _, shape in described):
            raise ValueError("shape")
        units = {clean(k): clean(v) for k, v in content["units"].items()}
        joints = tuple(clean(name) for name in content["joints"])
        channels = {clean(k): str(v) for k, v in content["channels"].items() if v == "time" or v in CHANNELS}
        notes = tuple(clean(note, 1000) for note in content["notes"][:200])
        origin = {clean(k): float(v) for k, v in content.get("origin", {}).items()}
        drive = content["drive"]
        if drive is not None:
            drive = Drive(
                law=_LAWS[drive["law"]], gains={str(k): float(v) for k, v in drive["gains"].items()}
            )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ReaderCrash(
            "The parsing process answered something that is not a log.",
            remedy="The file is damaged or hostile.",
        ) from error
    limits.check_count(len(described), "columns")
    total = 0
    for _, dtype, shape in described:
        count = 1
        for length in shape:
            count *= length
        total += count * dtype.itemsize
    limits.check_size(total, total, "The file")
    arrays: dict[str, np.ndarray] = {}
    for name, dtype, shape in described:
        value = np.empty(shape, dtype)
        if value.size:
            receive(value.reshape(-1).view(np.uint8).data)
        while name in arrays:
            name += "'"
        arrays[name] = value
    return Columns(
        arrays=arrays, units=units, joints=joints, channels=channels, drive=drive, notes=notes, origin=origin
    )


def describe(columns: Columns) -> str:
    """Return the columns and their shapes in words, the longest first, at most sixty; and which were left out, at most five."""
    longest = sorted(columns.arrays.items(), key=lambda item: -max(item[1].shape))
    told = [
        f"{name[:80]} {'x'.join(map(str, value.shape))}"
        + (f" [{columns.units[name]}]" if name in columns.units else "")
        for name, value in longest
    ]
    left = [note.rstrip(".") for note in columns.notes if note.endswith("left out.")][:5]
    whole = ", ".join(told[:60]) + (f" and {len(told) - 60} more" if len(told) > 60 else "")
    return "; ".join([whole or "none", *left])


def clean(text: object, longest: int = 300) -> str:
    """Return text from a file, cut to a length, with what would steer a terminal quoted."""
    return visible(str(text)[:longest])


def _plain_dtype(dtype: str) -> str:
    if dtype not in PLAIN:
        raise ValueError(dtype)
    return dtype
