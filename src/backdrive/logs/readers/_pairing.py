"""Which column is of which joint, where some channels are named by a `--map` and others by their columns' names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from backdrive.errors import MappingError
from backdrive.logs.log import CHANNELS
from backdrive.logs.readers._channels import Values, columns_of
from backdrive.logs.readers._names import Guess
from backdrive.logs.readers._tokens import INDEX


def pair_joints(values: Values, asked: Mapping[str, Any], found: Guess) -> tuple[str, ...]:
    """Bring all channels to one order of joints, as far as names tell it, and return the joints' names, if a `--map` tells them.

    A list keeps its order. Otherwise the order is that of the first channel.

    Args:
        values: channels; their columns are reordered.
        asked: sums of the channels of the `--map`.
        found: channels that the names of the columns tell.

    Raises:
        MappingError: patterns match different joints, or others than those of channels that are found by name.
    """
    if not set(asked) - {"time"}:
        return ()
    known, lists = _joints_of(values, asked, found)
    if not known:
        return ()
    main = lists[0] if lists else next(c for c in CHANNELS if c in known)
    wanted = [_key(name) for name in known[main]]
    first = next(
        (c for c in CHANNELS if c in values.labels), main
    )  # a list is what the person wants, patterns must agree
    for channel, names in known.items():
        keys = [_key(name) for name in names]
        if sorted(keys) == sorted(wanted) and len(set(keys)) == len(keys):
            if channel not in lists and keys != wanted:
                values.arrays[channel] = values.arrays[channel][:, [keys.index(key) for key in wanted]]
            elif keys != wanted:  # as the person wrote it
                values.notes.append(
                    f"By their columns' names, --map lists {main} of {', '.join(known[main])}, and {channel} of {', '.join(names)}."
                )
        elif channel not in lists and _contradicts(
            channel, against := first if main in lists else main, known, values
        ):
            raise MappingError(
                f"--map: {_how('the pattern', against, values)} names the joints {', '.join(known[against])}, "
                f"{_how('that', channel, values)} {', '.join(names)}.",
                remedy="Choose patterns that match one column of each joint, or list the columns: q=(a,b),tau=(c,d).",
            )
    return tuple(known[main]) if all(known[main]) else ()


def _joints_of(
    values: Values, asked: Mapping[str, Any], found: Guess
) -> tuple[dict[str, Sequence[str]], list[str]]:
    """Return the joints of each channel by name, in its order, and the channels that a `--map` lists."""
    joint_of = {
        column: joint
        for names in found.columns.values()
        if len(names) == len(found.joints)
        for column, joint in zip(names, found.joints, strict=True)
    }
    known: dict[str, Sequence[str]] = {}
    lists: list[str] = []
    for channel in (c for c in CHANNELS if c in values.arrays):
        width = values.arrays[channel].shape[1]
        if channel in values.labels:
            known[channel] = values.labels[channel]
        elif channel not in asked:
            if len(found.joints) == width:
                known[channel] = found.joints
        elif asked[channel] is not None:
            names = [joint_of[name] for name in _columns_in(values, asked[channel]) if name in joint_of]
            if len(names) == width:
                known[channel] = names
                lists.append(channel)
    return known, lists


def _columns_in(values: Values, sums: Any) -> list[str]:
    """Return the columns of the first term with any of each sum, by their names in the file."""
    first = [next((term for term in terms if term.columns), None) for terms in sums]
    written = columns_of([(term,) for term in first if term is not None])
    return [values.full(name) for name in written if name != INDEX]


def _contradicts(channel: str, other: str, known: Mapping[str, Sequence[str]], values: Values) -> bool:
    """Return whether two channels, of which a pattern names one at least, are of different joints, or one has a joint twice."""
    one, two = ([_key(name) for name in known[c]] for c in (channel, other))
    same = sorted(one) == sorted(two) and len(set(one)) == len(one)
    return not same and bool({channel, other} & set(values.labels))


def _how(pattern: str, channel: str, values: Values) -> str:
    return f"{pattern} of {channel}" if channel in values.labels else f"the columns' names of {channel}"


def _key(name: str) -> str:
    """Return a name as it is compared: of a path its last part, of a number the joint of that number."""
    last = name.rpartition("/")[2].strip("_. ").lower()
    return f"joint_{int(last)}" if last.isdigit() else last
