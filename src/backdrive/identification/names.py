"""Matching of joints by name. Default names, given in column order, identify only the order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from backdrive.errors import InvalidInput
from backdrive.logs.log import Joint


def same_names(first: Iterable[Joint], second: Iterable[Joint], *sides: str) -> list[str]:
    """Return a remark if joints are matched by default names, that is, by their order.

    Args:
        first: joints of one side.
        second: joints of the other side.
        sides: names of the two sides.

    Raises:
        InvalidInput: a side has default names and the names of the sides differ, so that their order is not reliable either.
    """
    mine, theirs = (list(dict.fromkeys((j.name, j.named) for j in side)) for side in (first, second))
    if all(named is not False for _, named in (*mine, *theirs)):
        return []
    left, right = (list(dict.fromkeys(name for name, _ in side)) for side in (mine, theirs))
    listed = f"{sides[0]}: {', '.join(left)}; {sides[1]}: {', '.join(right)}"
    if set(left) != set(right):
        raise InvalidInput(
            f"Joints cannot be matched: names are missing in the data, and the default names differ ({listed}).",
            remedy="Name the joints (--names when reading, or --rename A=B).",
        )
    return (
        []
        if len(left) == 1
        else [f"Names are missing in the data; joints were matched by their order ({listed})."]
    )


def rename_joints(joints: Sequence[Joint], pairs: Sequence[str]) -> tuple[Joint, ...]:
    """Return joints with new names.

    Args:
        joints: of one side.
        pairs: any number of OLD=NEW.

    Raises:
        InvalidInput: a pair has another form or names no joint, or two joints get one name.
    """
    names = {joint.name: joint.name for joint in joints}
    for pair in pairs:
        old, _, new = (part.strip() for part in pair.partition("="))
        if old not in names or not new:
            raise InvalidInput(
                f"--rename {pair}: not A=B with a joint A of {', '.join(names)}.",
                remedy=f"For example --rename {next(iter(names))}=elbow.",
            )
        names[old] = new
    if len(set(names.values())) != len(names):
        raise InvalidInput(
            f"--rename {', --rename '.join(pairs)}: two joints would have one name.",
            remedy=f"Name each once; the joints are {', '.join(names)}.",
        )
    return tuple(
        joint if names[joint.name] == joint.name else replace(joint, name=names[joint.name], named=True)
        for joint in joints
    )
