"""Options of the command line as keyword arguments: what a remedy names, in the terms of a caller in Python."""

from __future__ import annotations

import re

#: An option with the value that may follow it, or a whole command, which stays as it is typed.
_OPTION = re.compile(
    r"`backdrive [^`]*`|(?<![\w-])(?P<quote>`?)--(?P<name>[a-z][a-z0-9-]*)(?:[ =](?P<value>[\w.+*/:=,-]*[\w*/]))?(?P=quote)"
)
_PLACEHOLDER = re.compile(r"[A-Z][A-Z_]*")
_NUMBER = re.compile(r"[-+]?[0-9.]+(e[-+]?[0-9]+)?")
_CHOICES = frozenset({"method", "law", "goal", "accept"})  # options whose value is a lower-case word


def as_arguments(text: str) -> str:
    """Return a text with the options of the command line written as keyword arguments.

    `--stiffness LOW:HIGH` becomes `stiffness=(LOW, HIGH)`, and `--top-speed` becomes `top_speed` between grave accents. A
    whole command between grave accents stays.
    """
    return _OPTION.sub(_argument, text)


def _argument(match: re.Match[str]) -> str:
    name, value = match["name"], match["value"]
    if name is None:
        return match[0]
    argument = name.replace("-", "_")
    if not value:
        return f"`{argument}`"
    if not (name in _CHOICES or re.search(r"[A-Z0-9=:,]", value)):
        return f"`{argument}` {value}"  # the next word of the sentence
    return f"{argument}={_value(value)}"


def _value(value: str) -> str:
    several = re.split("[:,]", value)
    if len(several) > 1 and all(map(_simple, several)) and not (":" in value and "," in value):
        return f"({', '.join(several)})"
    return value if _simple(value) else f'"{value}"'


def _simple(value: str) -> bool:
    return bool(_PLACEHOLDER.fullmatch(value) or _NUMBER.fullmatch(value))
