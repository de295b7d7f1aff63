"""Types of the arguments of public functions, and the error that names an argument of a wrong type."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Collection, Iterable, Mapping
from numbers import Integral, Real
from os import PathLike
from typing import Any, NamedTuple, ParamSpec, TypeVar

from backdrive._catalog import did_you_mean
from backdrive.errors import InvalidInput, UnknownName

P = ParamSpec("P")
R = TypeVar("R")


class Kind(NamedTuple):
    """Values that an argument accepts: what they are called, and whether a value is one."""

    words: str
    holds: Callable[[Any], bool]


def _flag(value: Any) -> bool:
    return isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")  # the latter are numpy's


def _number(value: Any) -> bool:
    return isinstance(value, Real) and not _flag(value)


def _names(value: Any) -> bool:
    return isinstance(value, str) or (_several(value) and all(isinstance(name, str) for name in value))


def _several(value: Any) -> bool:
    return isinstance(value, Collection) and not isinstance(value, (str, bytes, Mapping))


def _pair(value: Any) -> bool:
    return _several(value) and len(value) == 2 and all(map(_number, value))


FLAG = Kind("True or False", _flag)
NUMBER = Kind("a number", _number)
SEED = Kind("a whole number, 0 or above", lambda v: isinstance(v, Integral) and not _flag(v) and int(v) >= 0)
WORD = Kind("a name, as a string", lambda v: isinstance(v, str))
NAMES = Kind("names: a string, or a list of them", _names)
PAIRS = Kind("a list of pairs of numbers", lambda v: isinstance(v, (list, tuple)) and all(map(_pair, v)))
TABLE = Kind("a dict", lambda v: isinstance(v, Mapping))
PATH = Kind("the name of a file, as a string or a Path", lambda v: isinstance(v, (str, PathLike)))
PATHS = Kind(
    "names of files, as strings or Paths",
    lambda v: PATH.holds(v) or (_several(v) and all(map(PATH.holds, v))),
)
FUNCTION = Kind("a function", callable)


def optional(kind: Kind) -> Kind:
    """Return a kind that accepts None too."""
    return Kind(f"{kind.words}, or None", lambda value: value is None or kind.holds(value))


def either(words: str, *kinds: Kind) -> Kind:
    """Return a kind that accepts what one of several does."""
    return Kind(words, lambda value: any(kind.holds(value) for kind in kinds))


def instance(words: str, *classes: type) -> Kind:
    """Return the kind of a class's instances."""
    return Kind(words, lambda value: isinstance(value, classes))


def check_arguments(kinds: Mapping[str, Kind], values: Mapping[str, Any]) -> None:
    """Refuse an argument of a wrong type.

    Args:
        kinds: by name of the argument.
        values: of the arguments, by name; others than those of `kinds` are not looked at.

    Raises:
        InvalidInput: there is one; the message names the argument and what it accepts.
    """
    for name, kind in kinds.items():
        value = values[name]
        if not kind.holds(value):
            text = repr(value)
            shown = f"= {text}" if len(text) <= 40 else f"is of type {type(value).__name__}"
            raise InvalidInput(f"{name} {shown}.", remedy=f"Give {kind.words}.")


def as_table(name: str, value: Any) -> dict[str, Any]:
    """Return a dict that was passed as an argument, or an empty one for None; see `check_arguments`."""
    check_arguments({name: optional(TABLE)}, {name: value})
    return {} if value is None else dict(value)


def check_keywords(function: str, given: Iterable[str], known: Collection[str]) -> None:
    """Refuse keyword arguments that a function does not have.

    Args:
        function: its name, for the message.
        given: names that were passed.
        known: names that there are.

    Raises:
        UnknownName: there is another one; the message names the nearest of the known ones, and lists them.
    """
    for name in given:
        if name not in known:
            raise UnknownName(
                f"{function} has no argument '{name}'.",
                remedy=f"{did_you_mean(name, known)}It has {', '.join(known)}.",
                name=name,
            )


def guard_keywords(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a public function, so that it answers an unknown keyword argument as `check_keywords` does."""
    known = list(inspect.signature(function).parameters)

    @functools.wraps(function)
    def call(*args: P.args, **given: P.kwargs) -> R:
        check_keywords(function.__name__, given, known)
        return function(*args, **given)

    return call
