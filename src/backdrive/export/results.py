"""The result of a kernel in C: nothing, a number, or a structure of the values that its caller does not know.

In a tuple, a caller knows the constants, the entries of its own tables (`-p[3]`), and the repetitions.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

from backdrive.export.code import Assign, Declare, Store
from backdrive.export.expressions import number_of
from backdrive.export.function import RESULT, Function
from backdrive.export.loops import Loops
from backdrive.export.values import PRIMARY, REAL, UNARY, Const, Scalar, Several, Untranslatable, Value, wider

ORIGIN = re.compile(r"(-?)(\w+)\[(\d+)\]")  # number of a table that a parameter points to


class Results(Loops):
    """Translates what a kernel returns, and what its callers make of it.

    Attributes:
        source: the kernel.
        made: its function in C.
        parameters: declaration and name of each.
        inner: only kernels call it, so its result may have the form that suits them.
    """

    source: Any
    made: Function
    inner: bool
    parameters: list[tuple[str, str]]

    def results(self) -> None:
        """Write down what every `return` gives, now that all are known."""
        made, values = self.made, [v for _, v, _ in self.returns]
        if not values or all(v is None for v in values):
            made.result = "void"
            return
        if any(isinstance(v, Several) for v in values):
            self._several()
            return
        if all(isinstance(v, Const) for v in values) and len({repr(number_of(v)) for v in values if v}) == 1:
            made.result, made.fields = "void", [values[0]]
            return
        made.kind = wider(*(v.kind for v in values if isinstance(v, (Const, Scalar))))
        made.result = self.spelling.type_name(made.kind)
        for leave, value, _ in self.returns:
            assert value is not None
            leave.value = self.spelling.scalar(value, made.kind)

    def _several(self) -> None:
        made = self.made
        rows = [v.items for _, v, _ in self.returns if isinstance(v, Several)]
        if len(rows) != len(self.returns) or len({len(r) for r in rows}) != 1:
            raise Untranslatable(f"{self.source.__name__}: returns of different lengths")
        columns = [[row[i] for row in rows] for i in range(len(rows[0]))]
        taken: set[str] = set()
        for i, column in enumerate(columns):
            known = self._common_value(columns, i)
            if known is not None:
                made.fields.append((None, known))
                continue
            kind = wider(*(v.kind for v in column))
            name = next((n for v in column for n in [_name_of(v)] if n and n not in taken), f"r{i}")
            taken.add(name)
            made.fields.append((self.spelling.type_name(kind), name, kind))
        kept = [i for i, f in enumerate(made.fields) if len(f) == 3]
        if not kept:
            made.result = "void"
        elif len(kept) == 1 and self.inner:
            (at,) = kept
            made.result, _, made.kind = made.fields[at]
            made.fields[at] = (None, None)
            for (leave, _, _), row in zip(self.returns, rows, strict=True):
                leave.value = self.spelling.scalar(row[at], made.kind)
        else:
            self._structure(rows, kept)

    def _common_value(self, columns: list[list[Value]], i: int) -> Value | int | None:
        """Return what a caller knows of a result: a constant, its place in a table, or an equal earlier result."""
        column = columns[i]
        first = column[0]
        if all(isinstance(v, Const) for v in column) and len({repr(number_of(v)) for v in column}) == 1:
            return first
        if not self.inner or not all(isinstance(v, Scalar) and v == first for v in column):
            return None
        assert isinstance(first, Scalar)
        if first.origin and first.kind == REAL:
            sign, name, _ = ORIGIN.fullmatch(first.origin).groups()  # type: ignore[union-attr]
            if any(name == n for _, n in self.parameters):
                return replace(first, text=first.origin, level=UNARY if sign else PRIMARY)
        return next((k for k in range(i) if columns[k] == column), None)

    def _structure(self, rows: list[tuple[Value, ...]], kept: list[int]) -> None:
        made = self.made
        made.result = "_result"
        whole = Scalar("result", REAL, names=frozenset({"result"}))
        for (leave, _, block), row in zip(self.returns, rows, strict=True):
            at = next(i for i, statement in enumerate(block) if statement is leave)
            block[at:at] = [
                Store(
                    replace(whole, text=f"result.{made.fields[i][1]}"),
                    self.spelling.scalar(row[i], made.fields[i][2]),
                )
                for i in kept
            ]
            leave.value = whole
        self.block.insert(0, Declare(RESULT, ["result"]))

    def result_of_call(self, made: Function, call: Scalar, given: dict[str, Scalar]) -> Value:
        """Return the value of a call of a function in C."""
        if made.effect:
            self._effectful()
        fields: list[Value] = []
        if made.result == "void":
            if made.effect:
                self.do(call)
            if len(made.fields) == 1 and isinstance(made.fields[0], Const):
                return made.fields[0]
        elif not made.fields:
            return self._temporary(made, call) if made.effect else call
        else:
            call = self._temporary(made, call)
        for field in made.fields:
            if len(field) == 3:
                _, name, kind = field
                fields.append(Scalar(f"{call.text}.{name}", kind, names=call.names))
            elif isinstance(field[1], int):
                fields.append(fields[field[1]])
            elif isinstance(field[1], Scalar):
                fields.append(_elsewhere(field[1], given))
            else:
                fields.append(call if field[1] is None else field[1])
        return Several(tuple(fields))

    def _temporary(self, made: Function, call: Scalar) -> Scalar:
        self.temporaries += 1
        name = f"t{self.temporaries}"
        self.block.append(Assign(name, made.result, call, made.effect))
        return Scalar(name, made.kind, names=frozenset({name}))

    def _effectful(self) -> None:
        if self.conditional:
            raise Untranslatable(f"{self.source.__name__}: a call that changes something within a condition")


def _elsewhere(value: Scalar, given: dict[str, Scalar]) -> Scalar:
    """Return a number of a table of a called function as its caller sees it."""
    sign, name, at = ORIGIN.fullmatch(value.text).groups()  # type: ignore[union-attr]
    table = given[name]
    name, _, begin = table.text.partition(" + ")
    text = f"{sign}{name}[{int(at) + int(begin or 0)}]"
    return replace(value, text=text, names=table.names, origin=text)


def _name_of(value: Value) -> str:
    if not isinstance(value, Scalar):
        return ""
    words = re.findall(r"[A-Za-z_]\w*", value.text)
    return words[0] if len(words) == 1 else ""
