"""ROS 2 (and ROS 1) joint states in MCAP, read front to back: a file that ends early gives every complete chunk before the cut.

Layout: MCAP format specification, <https://mcap.dev/spec>. The index at the end of the file is not needed, so it may be
missing.
"""

from __future__ import annotations

import struct
import zlib
from typing import BinaryIO

from backdrive.errors import UnknownFormat
from backdrive.logs.readers._bag import Topics, read_parts
from backdrive.logs.readers._chunks import ChunkDamage
from backdrive.logs.readers._jointstate import TYPES, Gatherer
from backdrive.logs.readers.columns import Columns, ReadOptions

MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END, _FOOTER = 3, 4, 5, 6, 15, 2
_RECORD = struct.Struct("<BQ")
_LOOSE = 1 << 24
_MESSAGE_HEAD = struct.Struct("<HIQQ")


class _Bag:
    """Schemas, channels and joint states met so far in one file."""

    def __init__(self, topics: Topics):
        self.topics = topics
        self.schemas: dict[int, str] = {}
        self.wanted: dict[int, Gatherer] = {}

    def records(self, data: bytes) -> None:
        """Take all records of a chunk's content."""
        at, end = 0, len(data)
        batches: dict[int, tuple[list[memoryview], list[int]]] = {}
        view = memoryview(data)
        while at + 9 <= end:
            kind, length = _RECORD.unpack_from(data, at)
            start, at = at + 9, at + 9 + length
            if at > end:
                raise ChunkDamage("a record reaches beyond its chunk")
            if kind == _MESSAGE and length >= 22:
                channel, _, received, _ = _MESSAGE_HEAD.unpack_from(data, start)
                if channel in self.wanted:
                    batch = batches.setdefault(channel, ([], []))
                    batch[0].append(view[start + 22 : at])
                    batch[1].append(min(received, (1 << 63) - 1))
            elif kind in (_SCHEMA, _CHANNEL):
                self.declare(kind, data[start:at])
        for channel, (messages, received) in batches.items():
            self.wanted[channel].add(messages, received)

    def declare(self, kind: int, content: bytes) -> None:
        """Take a schema or a channel."""
        if kind == _SCHEMA:
            self.schemas[int.from_bytes(content[:2], "little")] = _text(content, 2)[0]
            self.topics.options.limits.check_count(len(self.schemas), "schemas")
            return
        channel, schema = struct.unpack_from("<HH", content)
        topic, at = _text(content, 4)
        encoding, _ = _text(content, at)
        kind_name = self.schemas.get(schema, "")
        if kind_name not in TYPES or encoding not in ("cdr", "ros1"):
            kind_name = f"{kind_name or 'no schema'}, {encoding}"
        gatherer = self.topics.declare(topic, kind_name, ros1=encoding == "ros1")
        if gatherer is not None:
            self.wanted[channel] = gatherer

    def chunk(self, content: bytes) -> None:
        """Take the records of a chunk."""
        _, _, size, checksum = struct.unpack_from("<QQQI", content)
        how, at = _text(content, 28)
        (length,) = struct.unpack_from("<Q", content, at)
        stored = content[at + 8 : at + 8 + length]
        if len(stored) != length:
            raise ChunkDamage("a chunk is shorter than it declares")
        data = self.topics.expand(stored, how, size)
        if checksum and zlib.crc32(data) != checksum:
            raise ChunkDamage("a wrong checksum")
        self.records(data)


def read(path: str, options: ReadOptions) -> Columns:
    """Read the joint states of a bag.

    Raises:
        IncompleteFile: it ends before the first complete joint state.
        MappingError: several topics hold joint states and none was chosen.
        ReadError: it holds none, or a message is malformed.
        MissingExtra: chunks are compressed and the decompressor is not installed.
    """
    wrong = UnknownFormat(
        "This is not an MCAP file.", remedy="Say what it is: --format NAME (in Python format=)."
    )
    return read_parts((path, *options.parts), Topics(options), MAGIC, wrong, _scan)


def _scan(stream: BinaryIO, size: int, topics: Topics) -> tuple[int | None, str]:
    """Read records until the data end; return where and why it ended early, if it did."""
    at, bag = len(MAGIC), _Bag(topics)
    loose = bytearray()  # records outside chunks: files may also be written without any
    where, why = None, ""
    while True:
        head = stream.read(9)
        if len(head) < 9:
            where, why = at, "no end of data"
            break
        kind, length = _RECORD.unpack(head)
        if kind in (_DATA_END, _FOOTER):
            break
        if at + 9 + length > size or kind == 0 or _DATA_END < kind < 0x80:
            where, why = at, "an incomplete record"
            break
        content = b""
        if kind in (_SCHEMA, _CHANNEL, _MESSAGE):
            loose += head + stream.read(length)
        else:
            content = stream.read(length) if kind == _CHUNK else b""
            stream.seek(at + 9 + length)
        try:
            if kind == _CHUNK or len(loose) > _LOOSE:
                bag.records(bytes(loose))
                loose.clear()
            if kind == _CHUNK:
                bag.chunk(content)
        except (ChunkDamage, struct.error, UnicodeDecodeError) as error:
            return at, str(error)
        at += 9 + length
    try:
        bag.records(bytes(loose))
    except (ChunkDamage, struct.error, UnicodeDecodeError) as error:
        return at, str(error)
    return where, why


def _text(content: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", content, at)
    if at + 4 + length > len(content):
        raise struct.error("a text reaches beyond its record")
    return content[at + 4 : at + 4 + length].decode(), at + 4 + length
