"""Look up a name in a catalogue; the error for an unknown name lists the known ones."""

from __future__ import annotations

from collections.abc import Mapping
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
    near = get_close_matches(name, known, n=1)
    hint = f"Did you mean '{near[0]}'? " if near else ""
    raise UnknownName(f"'{name}' is not a {what}.", remedy=f"{hint}Known: {', '.join(known)}.", name=name)
