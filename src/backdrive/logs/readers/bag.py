"""ROS 1 joint states in a bag of format 2.0, read front to back: a file that ends early gives every complete chunk.

Layout: <http://wiki.ros.org/Bags/Format/2.0>. The index is not needed.
"""

from __future__ import annotations

import struct
from typing import BinaryIO

from backdrive.errors import ForbiddenContent, UnknownFormat
from backdrive.logs.readers._bag import Topics, read_parts
from backdrive.logs.readers._chunks import ChunkDamage
from backdrive.logs.readers._jointstate import Gatherer
from backdrive.logs.readers.columns import Columns, ReadOptions

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG_HEADER, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = b"\2", b"\3", b"\4", b"\5", b"\6", b"\7"
_U32 = struct.Struct("<I")


class _Bag:
    """Connections and joint states met so far in one file."""

    def __init__(self, topics: Topics):
        self.topics = topics
        self.wanted: dict[bytes, Gatherer] = {}

    def chunk(self, head: dict[bytes, bytes], stored: bytes) -> None:
        """Take the records of a chunk."""
        size = _U32.unpack(head[b"size"])[0]
        data = self.topics.expand(stored, head[b"compression"].decode("latin-1"), size)
        if len(data) != size:
            raise ChunkDamage(f"a chunk of {len(data)} bytes declares {size}")
        batches: dict[bytes, tuple[list[memoryview], list[int]]] = {}
        view, at = memoryview(data), 0
        while at < size:
            fields, start, end = _record(data, at)
            kind = fields.get(b"op")
            if kind == _MESSAGE and fields[b"conn"] in self.wanted:
                batch = batches.setdefault(fields[b"conn"], ([], []))
                batch[0].append(view[start:end])
                seconds, fraction = struct.unpack("<II", fields[b"time"])
                batch[1].append(seconds * 1_000_000_000 + fraction)
            elif kind == _CONNECTION:
                self.declare(fields, data[start:end])
            at = end
        for connection, (messages, received) in batches.items():
            self.wanted[connection].add(messages, received)

    def declare(self, fields: dict[bytes, bytes], content: bytes) -> None:
        """Take a connection: topic and message type."""
        topic = fields[b"topic"].decode("utf-8", "replace")
        kind = _fields(content).get(b"type", b"").decode("utf-8", "replace")
        gatherer = self.topics.declare(topic, kind, ros1=True)
        if gatherer is not None:
            self.wanted[fields[b"conn"]] = gatherer


def read(path: str, options: ReadOptions) -> Columns:
    """Read the joint states of a bag.

    Raises:
        IncompleteFile: it ends before the first complete joint state.
        MappingError: several topics hold joint states and none was chosen.
        ReadError: it holds none, or a message is malformed.
        ForbiddenContent: it is encrypted.
        MissingExtra: chunks are compressed and the decompressor is not installed.
    """
    wrong = UnknownFormat(
        "This is not a ROS 1 bag of format 2.0.", remedy="Convert it with `rosbag reindex`."
    )
    return read_parts((path,), Topics(options), MAGIC, wrong, _scan)


def _scan(stream: BinaryIO, size: int, topics: Topics) -> tuple[int | None, str]:
    """Read chunks until the index; return where and why they ended early, if they did."""
    at, bag = len(MAGIC), _Bag(topics)
    while at < size:
        lengths = stream.read(4)
        try:
            length = _U32.unpack(lengths)[0]
            if at + 8 + length > size:
                return at, "an incomplete record"
            fields = _fields(stream.read(length))
            amount = _U32.unpack(stream.read(4))[0]
            start = at + 8 + length
            if start + amount > size:
                return at, "an incomplete record"
            kind = fields.get(b"op")
            if kind == _CHUNK:
                bag.chunk(fields, stream.read(amount))
            elif kind == _BAG_HEADER:
                if fields.get(b"encryptor"):
                    raise ForbiddenContent("The bag is encrypted.", remedy="Decrypt it first.")
            elif kind == _CONNECTION:
                return None, ""  # connections after the last chunk begin the index
            elif kind not in (_INDEX, _CHUNK_INFO):
                return at, "an unknown record"
        except (ChunkDamage, struct.error, KeyError) as error:
            return at, str(error)
        at = start + amount
        stream.seek(at)
    return at, "no index"


def _record(data: bytes, at: int) -> tuple[dict[bytes, bytes], int, int]:
    """Return the header fields of a record in a chunk and where its data begin and end."""
    (length,) = _U32.unpack_from(data, at)
    if at + 8 + length > len(data):
        raise ChunkDamage("a record reaches beyond its chunk")
    fields = _fields(data[at + 4 : at + 4 + length])
    (amount,) = _U32.unpack_from(data, at + 4 + length)
    start = at + 8 + length
    if start + amount > len(data):
        raise ChunkDamage("a record reaches beyond its chunk")
    return fields, start, start + amount


def _fields(header: bytes) -> dict[bytes, bytes]:
    """Split a record header into its `name=value` fields."""
    fields: dict[bytes, bytes] = {}
    at = 0
    while at + 4 <= len(header):
        (length,) = _U32.unpack_from(header, at)
        if length == 0 or at + 4 + length > len(header):
            raise ChunkDamage("a header field reaches beyond its record")
        name, _, value = header[at + 4 : at + 4 + length].partition(b"=")
        fields[name] = value
        at += 4 + length
    return fields
