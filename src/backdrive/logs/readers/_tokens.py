"""Words of a `--map`. The columns of the file decide: `a/2` is a column if the file has one of that name, otherwise a division."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import NoReturn

from backdrive.errors import MappingError
from backdrive.logs.readers import units

#: Factors by name [SI/unit].
CONSTANTS = {"deg": math.pi / 180, "rpm": 2 * math.pi / 60, "turn": 2 * math.pi}

#: Stands for the sample number.
INDEX = "index"

MOST_STARS = 3

_TOKEN = re.compile(
    r"""(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w.])
      |(?P<quoted>"[^"]*")
      |(?P<name>[^\W\d][\w]*(?:[./#]+\w+)*)
      |(?P<sign>\.\.|[-+*/=,:()\[\]])""",
    re.VERBOSE,
)
_GLOB = re.compile(r"(?:/?[^\W\d][\w./#]*|/?)(?:\*[\w./#]*)+")
_PATH = re.compile(r"/[^\W\d]\w*(?:[./#]+\w+)*")  # /joint_states/position, where no division can stand
_OPERAND = re.compile(r"""\s*["(\w]""")
_SPACE = re.compile(r"\s*")
_DIVISION = re.compile(r"/(?=\d+(?:\.\d+)?(?:[eE]\d*)?$)")

#: Kind, text and place of a word.
Token = tuple[str, str, int]


class Names:
    """Columns of a file, as a person may name them.

    Args:
        columns: in the file's order.
    """

    def __init__(self, columns: Collection[str]):
        self.columns = tuple(columns)
        self._known = {
            spelling for name in columns for spelling in (name, name.lower(), units.split(name)[0])
        }

    def __contains__(self, name: str) -> bool:
        return name in self._known or name.lower() in self._known

    def matching(self, pattern: str) -> list[tuple[str, str]]:
        """Return the columns that a pattern with stars matches, in the file's order, each with what the stars stand for."""
        parts = pattern.split("*")
        if len(parts) > MOST_STARS + 1:
            return []
        expression = re.compile("(.+?)".join(map(re.escape, parts)), re.S)
        found: list[tuple[str, str]] = []
        for name in self.columns:
            match = expression.fullmatch(units.split(name)[0]) or expression.fullmatch(name)
            if match and len(name) <= units.LONGEST:
                found.append((name, "_".join(group.strip("/. ") for group in match.groups())))
        return found


def refuse(text: str, what: str, where: int) -> NoReturn:
    """Raise the error of a `--map` that does not follow the grammar."""
    raise MappingError(
        f"--map: {what}, at position {where + 1} of '{text}'.",
        remedy='Write channel=[factor*]column[+...][,column...], for example q=deg*angle1..angle3,tau=0.5*"motor current [A]".',
    )


def tokens(text: str, names: Names) -> list[Token]:
    """Return the words of a `--map`: `number`, `quoted`, `name`, `glob` or `sign`.

    Raises:
        MappingError: a character has no meaning.
    """
    found: list[Token] = []
    at = 0
    while True:
        space = _SPACE.match(text, at)
        at = space.end() if space else at
        if at == len(text):
            return found
        operand = not found or (found[-1][0] == "sign" and found[-1][1] not in (")", "]"))
        token = ((_glob(text, at, names) or _path(text, at, names)) if operand else None) or _word(
            text, at, names
        )
        if token is None:
            refuse(text, f"'{text[at : at + 12]}' is not understood", at)
        found.append(token)
        at += len(token[1])


def _word(text: str, at: int, names: Names) -> Token | None:
    match = _TOKEN.match(text, at)
    if match is None:
        return None
    kind = str(match.lastgroup)
    return (kind, _cut(match[0], names) if kind == "name" else match[0], at)


def _path(text: str, at: int, names: Names) -> Token | None:
    match = _PATH.match(text, at)
    return None if match is None else ("name", _cut(match[0], names), at)


def _cut(name: str, names: Names) -> str:
    """Return as much of a name as is one: it ends before a range's dots or a division that are no part of a column's name."""
    if name in names:
        return name
    first, dots, _ = name.partition("..")
    if dots and first:
        return _cut(first, names)
    head, slash, _ = name.rpartition("/")
    if slash and (_DIVISION.search(name) or head in names):
        return _cut(head, names)
    return name


def _glob(text: str, at: int, names: Names) -> Token | None:
    """Return a pattern with stars, where the first star is no product: nothing, or no factor, stands before it.

    Where it matches no column, it is a pattern all the same unless a factor or a column follows a star.
    """
    match = _GLOB.match(text, at)
    if match is None:
        return None
    pattern = match[0]
    division = _DIVISION.search(pattern)
    if division and "*" in pattern[: division.start()] and not names.matching(pattern):
        pattern = pattern[: division.start()]
    head, *tails = pattern.split("*")
    if not head or (head not in names and head not in CONSTANTS and names.matching(pattern)):
        return "glob", pattern, at
    parts = [_cut(part, names) for part in (head, *tails)]
    product = _OPERAND.match(text, match.end()) or any(_is_factor(part, names) for part in parts)
    return None if product else ("glob", pattern, at)


def _is_factor(part: str, names: Names) -> bool:
    return part in names or part in CONSTANTS or part == INDEX or part[:1] == "." or part[:1].isdigit()
