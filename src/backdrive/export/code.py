"""Statements in C as a tree: unused statements are removed, variables are declared at their first use, and the rest is
printed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from backdrive.export.values import Scalar

INDENT = "  "
TEMPORARY = re.compile(r"t\d+")


@dataclass(eq=False)
class Assign:
    """A variable gets a value; `effect`: computing it changes something."""

    name: str
    type: str
    value: Scalar
    effect: bool = False
    declares: bool = False


@dataclass(eq=False)
class Store:
    """A place in memory gets a value."""

    place: Scalar
    value: Scalar
    operator: str = ""


@dataclass(eq=False)
class Do:
    """A call whose result is not used; without a text, an empty statement."""

    value: Scalar


@dataclass(eq=False)
class Leave:
    """`return`, `break` or `continue`."""

    word: str
    value: Scalar | None = None


@dataclass(eq=False)
class Branch:
    """An `if`."""

    condition: Scalar
    then: list[Statement] = field(default_factory=list)
    other: list[Statement] = field(default_factory=list)


@dataclass(eq=False)
class Loop:
    """A `for` or a `while`; its head is a text with what that reads."""

    head: Scalar
    body: list[Statement] = field(default_factory=list)


@dataclass(eq=False)
class Declare:
    """Variables that begin in several places."""

    type: str
    names: list[str]


Statement = Assign | Store | Do | Leave | Branch | Loop | Declare


def blocks(statement: Statement) -> list[list[Statement]]:
    """Return the blocks in a statement."""
    if isinstance(statement, Branch):
        return [statement.then, statement.other]
    return [statement.body] if isinstance(statement, Loop) else []


def walk(block: list[Statement]) -> Iterator[Statement]:
    """Yield every statement of a block and of the blocks in it."""
    for statement in block:
        yield statement
        for inner in blocks(statement):
            yield from walk(inner)


def reads(statement: Statement) -> frozenset[str]:
    """Return the names that a statement itself reads."""
    if isinstance(statement, (Assign, Do)):
        return statement.value.names
    if isinstance(statement, Store):
        return statement.place.names | statement.value.names
    if isinstance(statement, Branch):
        return statement.condition.names
    if isinstance(statement, Loop):
        return statement.head.names
    if isinstance(statement, Leave) and statement.value is not None:
        return statement.value.names
    return frozenset()


def prune(block: list[Statement]) -> None:
    """Remove assignments to variables that are never read, and empty branches."""
    while True:
        used = frozenset().union(*(reads(s) for s in walk(block)))
        if not _prune(block, used) and not _prune_overwritten(block):
            return


def _prune(block: list[Statement], used: frozenset[str]) -> bool:
    changed = False
    for statement in list(block):
        for inner in blocks(statement):
            changed |= _prune(inner, used)
        if isinstance(statement, Assign) and statement.name not in used:
            at = block.index(statement)
            block[at : at + 1] = [Do(statement.value)] if statement.effect else []
            changed = True
        elif (isinstance(statement, Branch) and not statement.then and not statement.other) or (
            isinstance(statement, Loop) and not statement.body
        ):
            block.remove(statement)
            changed = True
    return changed


def _prune_overwritten(block: list[Statement]) -> bool:
    """Take out assignments to variables that get another value before anything reads them."""
    changed = False
    for i, statement in reversed(list(enumerate(block))):
        for inner in blocks(statement):
            changed |= _prune_overwritten(inner)
        if (
            isinstance(statement, Assign)
            and not statement.effect
            and _overwritten(statement.name, block[i + 1 :])
        ):
            del block[i]
            changed = True
    return changed


def _overwritten(name: str, after: list[Statement]) -> bool:
    for statement in after:
        if isinstance(statement, Assign) and statement.name == name:
            return name not in reads(statement)
        if _speaks(statement, name) or any(
            isinstance(s, Leave) and s.word != "return" for s in walk([statement])
        ):
            return False
    return False


def merge(block: list[Statement]) -> None:
    """Inline a call whose result only the next statement reads."""
    counts: dict[str, int] = {}
    for statement in walk(block):
        for name in reads(statement):
            counts[name] = counts.get(name, 0) + 1
    _merge(block, counts)


def _merge(block: list[Statement], counts: dict[str, int]) -> None:
    for statement in block:
        for inner in blocks(statement):
            _merge(inner, counts)
    i = 0
    while i + 1 < len(block):
        first, second = block[i], block[i + 1]
        if isinstance(first, Assign) and TEMPORARY.fullmatch(first.name) and counts.get(first.name, 0) == 1:
            if isinstance(second, Branch) and second.condition.text == first.name:
                second.condition = first.value
                del block[i]
                continue
            value = getattr(second, "value", None)
            if isinstance(second, (Assign, Store, Leave)) and value is not None and value.text == first.name:
                second.value = first.value
                if isinstance(second, Assign):
                    second.effect = first.effect
                del block[i]
                continue
        i += 1


def declare(block: list[Statement], parameters: set[str]) -> None:
    """Declare each variable at its first use, in the innermost block that contains all its uses.

    Args:
        block: a function's body.
        parameters: of the function, which need no declaration.
    """
    places: dict[str, list[list[list[Statement]]]] = {}
    types: dict[str, str] = {}
    _places(block, [block], places, types)
    for name, paths in places.items():
        if name not in types or name in parameters:
            continue
        depth = min(len(path) for path in paths)
        while depth > 1 and any(path[depth - 1] is not paths[0][depth - 1] for path in paths):
            depth -= 1
        home = paths[0][depth - 1]
        for i, statement in enumerate(home):
            if isinstance(statement, Assign) and statement.name == name and name not in reads(statement):
                statement.declares = True
                break
            if _speaks(statement, name):
                before = home[i - 1] if i else None
                if isinstance(before, Declare) and before.type == types[name]:
                    before.names.append(name)
                else:
                    home.insert(i, Declare(types[name], [name]))
                break


def _places(block, path, places, types) -> None:
    for statement in block:
        names = set(reads(statement))
        if isinstance(statement, Assign):
            names.add(statement.name)
            types[statement.name] = statement.type
        for name in names:
            places.setdefault(name, []).append(path)
        for inner in blocks(statement):
            _places(inner, [*path, inner], places, types)


def _speaks(statement: Statement, name: str) -> bool:
    return any(name in reads(s) or (isinstance(s, Assign) and s.name == name) for s in walk([statement]))


def lines(block: list[Statement], indent: str = INDENT) -> Iterator[str]:
    """Yield the lines of a block."""
    for s in block:
        if isinstance(s, Assign):
            yield f"{indent}{_pointer(s.type) if s.declares else ''}{s.name} = {s.value.text};"
        elif isinstance(s, Declare):
            yield f"{indent}{_pointer(s.type)}{', '.join(s.names)};"
        elif isinstance(s, Store):
            yield f"{indent}{s.place.text} {s.operator}= {s.value.text};"
        elif isinstance(s, Do):
            yield f"{indent}{s.value.text};"
        elif isinstance(s, Leave):
            yield f"{indent}{s.word}{f' {s.value.text}' if s.value else ''};"
        elif isinstance(s, Loop):
            yield f"{indent}{s.head.text} {{"
            yield from lines(s.body, indent + INDENT)
            yield f"{indent}}}"
        else:
            yield from _branch(s, indent)


def _branch(s: Branch, indent: str, begin: str = "") -> Iterator[str]:
    condition, then, other = s.condition, s.then, s.other
    if not then:
        text = condition.text if condition.level == 15 else f"({condition.text})"
        condition, then, other = Scalar(f"!{text}", "bool", 14, condition.names), other, []
    yield f"{indent}{begin}if ({condition.text}) {{"
    yield from lines(then, indent + INDENT)
    if len(other) == 1 and isinstance(other[0], Branch) and other[0].then:
        yield from _branch(other[0], indent, "} else ")
        return
    if other:
        yield f"{indent}}} else {{"
        yield from lines(other, indent + INDENT)
    yield f"{indent}}}"


def _pointer(type: str) -> str:
    return type if type.endswith("*") else f"{type} "
