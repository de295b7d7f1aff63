"""Look up a name in a catalogue; the error for an unknown name lists the known ones."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from typing import TypeVar

from backdrive.errors import UnknownName

T = TypeVar("T")


def lookup(name: str, known: Mapping[str, T], what: str) -> T:
    """Return `known[name]`.

    Args:
        name: what the person wrote.
        known: the catalogue.
        what: the noun for the message, such as "friction law".

    Raises:
        UnknownName: names the entry and lists the catalogue, nearest name first.
    """
    if name in known:
        return known[name]
    raise UnknownName(
        f"'{name}' is not a {what}.",
        remedy=f"{did_you_mean(name, known)}Known: {', '.join(known)}.",
        name=name,
    )


def did_you_mean(name: str, known: Collection[str]) -> str:
    """Return the question whether the nearest name was meant, with a blank after it; empty where none is near.

    Args:
        name: what the person wrote.
        known: the names that there are; one that contains what was written is near too (`noise`, `torque_noise`).
    """
    near = get_close_matches(name, known, n=1)
    near = near or [
        one for one in known if len(name) > 2 and (name in one.split("_") or one in name.split("_"))
    ]
    return f"Did you mean '{near[0]}'? " if near else ""
