"""`sensor_msgs/JointState` decoded by its known layout; message definitions inside a bag are never compiled or run.

Messages of one driver usually have the same length and the same bytes except for stamps and numbers. Such a batch is read as
one matrix with the numbers at fixed places. Otherwise each message is decoded, and joints are matched by name.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.errors import ReadError
from backdrive.logs.readers.columns import Columns, ReadOptions

#: What the three message systems call the type.
TYPES = frozenset(
    ("sensor_msgs/msg/JointState", "sensor_msgs/JointState", "sensor_msgs::msg::dds_::JointState_")
)

_CHANNELS = ("position", "velocity", "effort")
_LARGEST = 1 << 20


@dataclass(frozen=True)
class _Layout:
    """The places of the parts of one message."""

    order: str
    ros1: bool
    stamp: int
    stamp_ns: int
    names: tuple[str, ...]
    spans: tuple[tuple[int, int], ...]  # (offset, count) of position, velocity, effort


class Gatherer:
    """Collects the messages of one topic.

    Attributes:
        count: messages taken so far.
    """

    def __init__(self, *, ros1: bool):
        self._ros1 = ros1
        self._batches: dict[frozenset[str], list[_Batch]] = {}
        self._names: dict[frozenset[str], tuple[str, ...]] = {}
        self.count = 0

    def add(self, messages: Sequence[bytes | memoryview], received: Sequence[int]) -> None:
        """Take messages in the order of the file.

        Args:
            messages: serialised, at least one.
            received: time at which each was recorded [ns].

        Raises:
            ReadError: a message is not a joint state, or its arrays differ in length.
        """
        if not messages:
            return
        self.count += len(messages)
        layout = _layout(messages[0], self._ros1)
        fixed = _fixed(messages, layout)
        if fixed is not None:
            self._keep(layout.names, _Batch(fixed[0], np.array(received, dtype=np.int64), fixed[1]))
            return
        for message, at in zip(messages, received, strict=True):
            layout = _layout(message, self._ros1)
            numbers = tuple(
                np.frombuffer(message, layout.order + "f8", count, offset)[None, :] if count else None
                for offset, count in layout.spans
            )
            stamp = np.array([layout.stamp_ns], dtype=np.int64)
            self._keep(layout.names, _Batch(stamp, np.array([at], dtype=np.int64), numbers))

    def _keep(self, names: tuple[str, ...], batch: _Batch) -> None:
        key = frozenset(names)
        if len(key) < len(names):
            raise ReadError(
                f"A message names a joint twice: {', '.join(names)}.", remedy="Correct the driver."
            )
        known = self._names.setdefault(key, names)
        if names != known:
            order = [names.index(name) for name in known]
            batch = _Batch(
                batch.stamp,
                batch.received,
                tuple(v if v is None else v[:, order] for v in batch.numbers),
                True,
            )
        self._batches.setdefault(key, []).append(batch)

    def columns(self, options: ReadOptions, notes: list[str]) -> Columns:
        """Return what was gathered; joints in the order of the first message.

        Raises:
            ReadError: the messages name no joints.
        """
        key = self._choose(options, notes)
        names, batches = self._names[key], self._batches[key]
        if any(batch.reordered for batch in batches):
            notes.append(
                "The order of the joints changes from message to message: they were matched by name."
            )
        arrays: dict[str, np.ndarray] = {}
        total = sum(len(batch.stamp) for batch in batches)
        for i, channel in enumerate(_CHANNELS):
            filled = sum(len(batch.stamp) for batch in batches if batch.numbers[i] is not None)
            if not filled:
                continue
            if filled < total:
                notes.append(f"{total - filled} of {total} messages have no {channel}: NaN there.")
            value = np.full((total, len(names)), np.nan) if filled < total else np.empty((total, len(names)))
            at = 0
            for batch in batches:
                part = batch.numbers[i]
                if part is not None:
                    value[at : at + len(batch.stamp)] = part
                at += len(batch.stamp)
            arrays[channel] = value
        stamp = np.concatenate([batch.stamp for batch in batches])
        if not stamp.any():
            stamp = np.concatenate([batch.received for batch in batches])
            notes.append("The messages carry no time stamp: the time of recording was used, which jitters.")
        notes.append(f"Time is counted from {stamp[0] / 1e9:.3f} s since 1970 (header stamps).")
        arrays = {"time": (stamp - stamp[0]) / 1e9, **arrays}
        if not arrays.keys() & {"position", "velocity"}:
            raise ReadError(
                "The messages hold neither position nor velocity.", remedy="Record another topic."
            )
        return Columns(
            arrays=arrays,
            units={"time": "s"},
            joints=names,
            channels={name: "torque" if name == "effort" else name for name in arrays},
            notes=tuple(notes),
            origin={"time": float(stamp[0]) / 1e9},
        )

    def _choose(self, options: ReadOptions, notes: list[str]) -> frozenset[str]:
        """Choose among the publishers of a topic, told apart by the joints they name."""
        groups = {key: sum(len(b.stamp) for b in batches) for key, batches in self._batches.items() if key}
        if not groups:
            raise ReadError(
                "The messages name no joints.", remedy="Joints are matched by name: correct the driver."
            )
        wanted = frozenset(options.joints)
        key = max(groups, key=lambda k: (bool(wanted) and wanted <= k, len(k) * groups[k]))
        others = [k for k in self._batches if k != key]
        if others:
            told = "; ".join(
                f"{', '.join(self._names[k]) or 'none'} ({sum(len(b.stamp) for b in self._batches[k])})"
                for k in others
            )
            notes.append(f"Other messages of this topic name other joints and were left out: {told[:500]}.")
        return key


@dataclass(frozen=True)
class _Batch:
    stamp: np.ndarray
    received: np.ndarray
    numbers: tuple[np.ndarray | None, ...]
    reordered: bool = False


def _fixed(
    messages: Sequence[Any], layout: _Layout
) -> tuple[np.ndarray, tuple[np.ndarray | None, ...]] | None:
    """Read all messages as one matrix, or return None if they differ in more than stamps and numbers."""
    length = len(messages[0])
    if any(len(message) != length for message in messages):
        return None
    matrix = np.frombuffer(b"".join(messages), np.uint8).reshape(len(messages), length)
    at = 4 if layout.ros1 else 0  # ROS 1 counts messages in the first four bytes
    for offset, size in ((layout.stamp, 8), *((offset, 8 * count) for offset, count in layout.spans)):
        if not (matrix[:, at:offset] == matrix[0, at:offset]).all():
            return None
        at = offset + size

    def part(offset: int, size: int, dtype: str) -> np.ndarray:
        return np.ascontiguousarray(matrix[:, offset : offset + size]).view(layout.order + dtype)

    seconds, fraction = part(layout.stamp, 8, "u4" if layout.ros1 else "i4").astype(np.int64).T
    numbers = tuple(part(offset, 8 * count, "f8") if count else None for offset, count in layout.spans)
    return seconds * 1_000_000_000 + fraction, numbers


def _layout(message: bytes | memoryview, ros1: bool) -> _Layout:
    """Find the parts of a message: CDR (OMG DDS-XTypes 1.3, 7.4.1: plain, version 1) or ROS 1.

    Raises:
        ReadError: it is not a joint state, or its arrays differ in length.
    """
    if len(message) > _LARGEST:
        raise ReadError(
            f"A message has {len(message)} bytes, too many for a joint state.", remedy="Record it again."
        )
    try:
        layout = _walk(bytes(message), ros1)
    except (struct.error, UnicodeDecodeError, IndexError, ValueError) as error:
        raise ReadError(
            f"A message is no joint state ({error}).", remedy="The bag is damaged; record it again."
        ) from error
    for channel, (_, count) in zip(_CHANNELS, layout.spans, strict=True):
        if count not in (0, len(layout.names)):
            raise ReadError(
                f"A message has {len(layout.names)} names and {count} numbers of {channel}.",
                remedy="Correct the driver: arrays of a joint state are of one length, or empty.",
            )
    return layout


def _walk(raw: bytes, ros1: bool) -> _Layout:
    base, order, stamp, pad = 0, "<", 4, 1
    if not ros1:
        if len(raw) < 4 or raw[:2] not in (b"\x00\x01", b"\x00\x00"):
            raise ValueError(f"encapsulation {raw[:2].hex()}")
        base, order, stamp, pad = 4, "<" if raw[1] else ">", 4, 4
    at = stamp + 8

    def whole() -> int:
        nonlocal at
        at += -(at - base) % pad
        (value,) = struct.unpack_from(order + "I", raw, at)
        at += 4
        return value

    def text() -> str:
        nonlocal at
        length = whole()
        value = raw[at : at + length]
        at += length  # beyond the end of a cut message, where nothing more can be read
        return (value if ros1 else value.rstrip(b"\x00")).decode()

    seconds, fraction = struct.unpack_from(order + ("II" if ros1 else "iI"), raw, stamp)
    text()
    names = tuple(text() for _ in range(whole()))
    spans: list[tuple[int, int]] = []
    for _ in _CHANNELS:
        count = whole()
        if count and not ros1:
            at += -(at - base) % 8
        if at + 8 * count > len(raw):
            raise ValueError("cut numbers")
        spans.append((at, count))
        at += 8 * count
    return _Layout(order, ros1, stamp, seconds * 1_000_000_000 + fraction, names, tuple(spans))
