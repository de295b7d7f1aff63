"""Common parts of the bag readers: topics, size limits of chunks, and truncated files."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import BinaryIO

from backdrive.errors import FileTooLarge, IncompleteFile, MappingError, ReadError, UnknownFormat
from backdrive.logs.readers._chunks import expand
from backdrive.logs.readers._jointstate import TYPES, Gatherer
from backdrive.logs.readers.columns import Columns, ReadOptions


class Topics:
    """The topics of a bag met so far: those with joint states, and the types of the others.

    Attributes:
        options: what the person said.
        notes: what became of the bag, in sentences.
        expanded: what the chunks of one file hold so far [B].
    """

    def __init__(self, options: ReadOptions):
        self.options = options
        self.gathered: dict[str, Gatherer] = {}
        self.others: dict[str, str] = {}
        self.notes: list[str] = []
        self.expanded = 0

    @property
    def count(self) -> int:
        """Joint states so far."""
        return sum(gatherer.count for gatherer in self.gathered.values())

    def declare(self, topic: str, kind: str, *, ros1: bool, known: bool = True) -> Gatherer | None:
        """Register a topic and return the collector of its messages; None if they are not joint states.

        Args:
            topic: its name.
            kind: type of its messages, as the message will say it.
            ros1: serialised as ROS 1 does.
            known: its serialisation is one of those that can be read.

        Raises:
            FileTooLarge: there are more topics than the limits allow.
        """
        gatherer = None
        if known and kind in TYPES:
            gatherer = self.gathered.setdefault(topic, Gatherer(ros1=ros1))
        else:
            self.others[topic] = kind
        self.options.limits.check_count(len(self.others) + len(self.gathered), "topics")
        return gatherer

    def expand(self, stored: bytes, how: str, size: int) -> bytes:
        """Return the content of the next chunk of a file; see `_chunks.expand`.

        Raises:
            FileTooLarge: all its chunks together hold more than the limit.
        """
        self.expanded += size
        if self.expanded > self.options.limits.max_bytes:
            raise FileTooLarge(
                "The chunks hold more than the limit.",
                remedy="Read it in Python with limits=Limits(max_bytes=...).",
            )
        return expand(stored, how, size, self.options.limits)

    def columns(self) -> Columns:
        """Return the joint states of the one topic that is meant.

        Raises:
            MappingError: several topics hold joint states and none was chosen.
            ReadError: there is none.
        """
        return self._choose().columns(self.options, self.notes)

    def _choose(self) -> Gatherer:
        filled = {topic: gatherer for topic, gatherer in self.gathered.items() if gatherer.count}
        topic = self.options.topic
        if topic is not None:
            if topic in filled:
                return filled[topic]
            names = ", ".join(filled) or "none"
            raise MappingError(
                f"The bag has no joint states on '{topic}'.", remedy=f"Topics with some: {names}."
            )
        if len(filled) == 1:
            return next(iter(filled.values()))
        if filled:
            names = ", ".join(f"{topic} ({gatherer.count})" for topic, gatherer in filled.items())
            raise MappingError(
                f"Several topics hold joint states: {names}.",
                remedy="Choose one: --topic NAME (in Python topic=).",
            )
        names = ", ".join(f"{topic} ({kind})" for topic, kind in list(self.others.items())[:20]) or "none"
        raise ReadError(
            f"The bag holds no sensor_msgs/JointState message. Topics: {names}.",
            remedy="Record joint states.",
        )


def read_parts(
    parts: tuple[str, ...],
    topics: Topics,
    magic: bytes,
    wrong: UnknownFormat,
    scan: Callable[[BinaryIO, int, Topics], tuple[int | None, str]],
) -> Columns:
    """Read the files of a bag in order; of a truncated file, all complete chunks are read.

    Args:
        parts: paths.
        topics: takes what is in them.
        magic: first bytes of each.
        wrong: the error where a file begins otherwise.
        scan: reads an open file of so many bytes; returns where and why it ended early, if it did.

    Raises:
        IncompleteFile: there is no complete joint state before the file ends.
    """
    cut: IncompleteFile | None = None
    for part in parts:
        size, topics.expanded = os.path.getsize(part), 0
        with open(part, "rb") as stream:
            if stream.read(len(magic)) != magic:
                raise wrong
            where, why = scan(stream, size, topics)
        if where is not None:
            place = f"The file is cut or damaged at byte {where} of {size}"
            topics.notes.append(
                f"{place} ({why}): the {topics.count} joint states in the complete chunks before it were read."
            )
            cut = IncompleteFile(
                f"{place}, before its first complete joint state.",
                remedy="Copy it again, or record it again.",
            )
    if cut is not None and not topics.count:
        raise cut
    return topics.columns()
