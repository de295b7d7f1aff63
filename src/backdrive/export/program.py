"""A C program of the kernels that are called, each specialized for its known arguments.

Every function is translated from the syntax tree of a kernel. A kernel called with other known arguments is translated again;
if the text is the same, the function is shared.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import FunctionType
from typing import Any

import numpy as np

from backdrive.export.body import Body
from backdrive.export.function import Function
from backdrive.export.values import (
    Array,
    Const,
    Scalar,
    Several,
    Spelling,
    Untranslatable,
    Value,
)


class Program:
    """Functions in C, tables and helpers that they need.

    Attributes:
        prefix: of every name outside a function.
        spelling: how numbers are written.
        inlines: functions called every tick are inlined, if the compiler supports it.
        functions: translated so far, each after those that it calls.
        tables: name -> numbers that kernels read.
        symbols: constants of kernels that have a name in C.
    """

    def __init__(
        self, prefix: str, spelling: Spelling, symbols: dict[str, str] | None = None, inlines: bool = False
    ):
        self.prefix, self.spelling, self.inlines = prefix, spelling, inlines
        self.symbols = symbols or {}
        self.functions: list[Function] = []
        self.tables: dict[str, np.ndarray] = {}
        self._memo: dict[Any, Function] = {}

    def translate(self, kernel: Callable, arguments: Sequence[Value], inner: bool = False) -> Function:
        """Return a kernel in C for some arguments.

        Args:
            kernel: compiled or plain.
            arguments: what is known of each.
            inner: only kernels call it, so its result may have the form that suits them.

        Raises:
            Untranslatable: it uses what the translator does not know.
        """
        source = getattr(kernel, "py_func", kernel)
        if not isinstance(source, FunctionType):
            raise Untranslatable(f"{kernel!r} is no kernel.")
        key = (source, inner, tuple(_describe(a) for a in arguments))
        if key not in self._memo:
            self._memo[key] = self._unique(source, Body(self, source, arguments, inner).function())
        return self._memo[key]

    def reachable(self, roots: Sequence[Function]) -> list[Function]:
        """Return the functions that some functions need, each after those that it calls."""
        needed: set[int] = set()
        waiting = list(roots)
        while waiting:
            function = waiting.pop()
            if id(function) not in needed:
                needed.add(id(function))
                waiting += function.calls
        return [f for f in self.functions if id(f) in needed]

    def _unique(self, source: FunctionType, made: Function) -> Function:
        module = source.__module__.rsplit(".", 1)[-1]
        name = f"{self.prefix}_core_{module}_{source.__name__.strip('_')}"
        same = [f for f in self.functions if f.name == name or re.fullmatch(rf"{name}_\d+", f.name)]
        for other in same:
            same_text = (
                replace(made, name=other.name, result=_rename(made, other.name)).text() == other.text()
            )
            if same_text and repr(made.fields) == repr(other.fields):
                return other
        made.name = name if not same else f"{name}_{len(same) + 1}"
        made.result = _rename(made, made.name)
        self.functions.append(made)
        return made


def _rename(function: Function, name: str) -> str:
    return f"{name}_result" if function.result.endswith("_result") else function.result


def _describe(value: Value) -> Any:
    """Return the properties of an argument that a translation depends on."""
    if isinstance(value, Const):
        return ("const", type(value.value), repr(value.value))
    if isinstance(value, Scalar):
        return ("scalar", value.kind, value.known)
    if isinstance(value, Several):
        return tuple(_describe(v) for v in value.items)
    if isinstance(value, Array):
        places = frozenset(i - value.begin for i in value.places)
        content = None if value.content is None else value.content[value.begin :]
        dead = frozenset(i - value.begin for i in value.dead)
        return ("array", value.size, content, value.own - value.begin, dead, places, value.rows, value.kind)
    return ("table", value.fields, value.dead)
