"""Channels that only some joints have: what is said of them, and the joints that are kept where names leave the others out."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from backdrive.logs.readers._expression import CHANNEL_OF

NONE = "No column was taken as "  # begins the sentence on a channel that is not there

_SHORT = {channel: short for short, channel in CHANNEL_OF.items()}
_PLAIN = re.compile(r"/?[^\W\d]\w*(?:[./#]+\w+)*")  # a column that a --map names without quotes
_MOST = 12  # joints that are listed


def missing(channel: str, columns: Mapping[str, str], joints: Sequence[str]) -> str:
    """Return a sentence on the joints without a column of a channel, and the options that help.

    Args:
        channel: such as `torque`.
        columns: joint to column, of the joints that have one.
        joints: all of them, in the file's order.
    """
    without = [joint for joint in joints if joint not in columns]
    who, it = ("the joint", "its column") if len(without) == 1 else ("these joints", "their columns")
    has = "has none" if len(without) == 1 else "have none"
    sums = [_spell(columns.get(joint, "COLUMN")) for joint in joints]
    option = f"{_SHORT[channel]}={','.join(sums)}"
    option = f"'{option}'" if '"' in option else option
    return (
        f"{NONE}{channel}: {_words(without)} {has} ({_words(list(columns.values()))} of {_words(list(columns))} "
        f"{'is' if len(columns) == 1 else 'are'} there). Name {it}, --map {option}, or leave {who} out, "
        f"--names {','.join(columns)}."
    )


def of_all(
    columns: Mapping[str, Mapping[str, str]],
    joints: tuple[str, ...],
    notes: list[str],
    names: Collection[str],
) -> tuple[tuple[str, ...], dict[str, tuple[str, ...]]]:
    """Return the joints and, of each channel that all of them have, its columns; a channel that some lack is noted.

    Args:
        columns: channel to joint to column.
        joints: of the file, in its order.
        notes: list to which sentences are added.
        names: joints that are kept where some lack a channel; others than the file's keep all.
    """
    if any(len(found) < len(joints) for found in columns.values()) and names and set(names) <= set(joints):
        joints = tuple(joint for joint in joints if joint in names)
    full: dict[str, tuple[str, ...]] = {}
    for channel, found in columns.items():
        own = {joint: found[joint] for joint in joints if joint in found}
        if len(own) == len(joints):
            full[channel] = tuple(own.values())
        elif own:
            notes.append(missing(channel, own, joints))
    return joints, full


def _spell(column: str) -> str:
    return column if _PLAIN.fullmatch(column) else f'"{column}"'


def _words(words: Sequence[str]) -> str:
    return ", ".join(words[:_MOST]) + (f" and {len(words) - _MOST} more" if len(words) > _MOST else "")
