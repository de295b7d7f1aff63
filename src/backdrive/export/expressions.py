"""Expressions of kernels in C; everything known at translation time is evaluated."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np

from backdrive import _jit, elementary
from backdrive.export.operators import BINARY, DEAD, MATH, Operators, number_of
from backdrive.export.values import (
    BOOL,
    LONG,
    PLACE,
    PRIMARY,
    UNARY,
    WIDE,
    Array,
    Const,
    Mixture,
    Scalar,
    Several,
    Table,
    Untranslatable,
    Value,
)


class Expressions(Operators):
    """Translates expressions within a function; `call` of a subclass translates calls of kernels."""

    def call(self, function: Callable, arguments: list[Value], hint: str = "") -> Value:
        """Return the value of a call of a kernel."""
        raise NotImplementedError

    def array(self, name: str, value: Any) -> Array:
        """Return a table of numbers that kernels read."""
        raise NotImplementedError

    def scalar(self, node: ast.expr, kind: str | None = None) -> Scalar:
        """Return an expression as a scalar."""
        return self.spelling.scalar(self.value(node), kind)

    def value(self, node: ast.expr) -> Value:
        """Return the value of an expression."""
        method = getattr(self, "_" + type(node).__name__.lower(), None)
        if method is None:
            raise Untranslatable(f"{ast.unparse(node)}: {type(node).__name__}")
        return method(node)

    def in_order(self, nodes: list[ast.expr]) -> list[Value]:
        """Return values that are computed in this order, even if a later one changes the inputs of an earlier one."""
        values: list[Value] = []
        for node in nodes:
            at = len(self.block)
            values.append(self.value(node))
            if len(self.block) > at:
                for i, before in enumerate(values[:-1]):
                    if isinstance(before, Scalar) and before.memory:
                        late, self.block = self.block[at:], self.block[:at]
                        values[i] = self.temporary(before)
                        self.block += late
                        at += 1
        return values

    def _constant(self, node: ast.Constant) -> Value:
        return Const(node.value)

    def _name(self, node: ast.Name) -> Value:
        if node.id in self.env:
            return self.env[node.id]
        return self.fixed(node.id, self.resolve(node))

    def resolve(self, node: ast.expr) -> Any:
        """Return the Python object that a name outside the function stands for."""
        if isinstance(node, ast.Name):
            if node.id in self.globals:
                return self.globals[node.id]
            import builtins

            return getattr(builtins, node.id)
        if isinstance(node, ast.Attribute):
            return getattr(self.resolve(node.value), node.attr)
        raise Untranslatable(ast.unparse(node))

    def fixed(self, name: str, value: Any) -> Value:
        """Return a Python object as a value."""
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, (bool, int, float)):
            return Const(value)
        if isinstance(value, tuple):
            return Several(tuple(self.fixed(name, v) for v in value))
        if isinstance(value, (np.ndarray, list)):
            return self.array(name, value)
        raise Untranslatable(f"{name} is {value!r}")

    def _attribute(self, node: ast.Attribute) -> Value:
        if isinstance(node.value, ast.Name) and isinstance(self.env.get(node.value.id), Array):
            array = self.env[node.value.id]
            if node.attr == "size" and isinstance(array, Array):
                return Const(array.size)
        return self.fixed(node.attr, self.resolve(node))

    def _tuple(self, node: ast.Tuple) -> Value:
        return Several(tuple(self.in_order(node.elts)))

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        value = self.value(node.operand)
        number = number_of(value)
        if isinstance(node.op, ast.Not):
            if number is not None:
                return Const(not number)
            operand = self.spelling.scalar(value)
            return self.spelling.join(f"!{operand.within(PRIMARY)}", BOOL, UNARY, [operand])
        if not isinstance(node.op, ast.USub):
            raise Untranslatable(ast.unparse(node))
        if isinstance(value, Const):
            return Const(-value.value)
        operand = self.spelling.scalar(value)
        origin = f"-{operand.origin}" if operand.origin and operand.origin[0] != "-" else ""
        negative = self.spelling.join(
            f"-{operand.within(PRIMARY)}", operand.kind, UNARY, [operand], None if number is None else -number
        )
        return replace(negative, origin=origin)

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.in_order([node.left, node.right])
        return self.binary(type(node.op), left, right)

    def _compare(self, node: ast.Compare) -> Value:
        if isinstance(node.ops[0], ast.In):
            return self._among(node)
        values = self.in_order([node.left, *node.comparators])
        parts = [self.compare(type(op), a, b) for op, a, b in zip(node.ops, values, values[1:], strict=False)]
        return self.all_of(parts)

    def _among(self, node: ast.Compare) -> Value:
        value, choices = self.value(node.left), self.value(node.comparators[0])
        if not isinstance(choices, Several):
            raise Untranslatable(ast.unparse(node))
        return self.any_of([self.compare(ast.Eq, value, c) for c in choices.items])

    def _boolop(self, node: ast.BoolOp) -> Value:
        decides = isinstance(node.op, ast.Or)
        parts: list[Value] = []
        for i, each in enumerate(node.values):
            self.conditional += i > 0
            part = self.value(each)
            self.conditional -= i > 0
            parts.append(part)
            number = number_of(part)
            if number is not None and bool(number) == decides:
                break
        return self.any_of(parts) if decides else self.all_of(parts)

    def _ifexp(self, node: ast.IfExp) -> Value:
        condition = self.value(node.test)
        number = number_of(condition)
        if number is not None:
            return self.value(node.body if number else node.orelse)
        self.conditional += 1
        a, b = self.value(node.body), self.value(node.orelse)
        self.conditional -= 1
        test = self.spelling.scalar(condition)
        if isinstance(a, Several) and isinstance(b, Several):
            return Several(tuple(self.either(test, x, y) for x, y in zip(a.items, b.items, strict=False)))
        return self.either(test, a, b)

    def _subscript(self, node: ast.Subscript) -> Value:
        base, *indices = self.in_order(
            [node.value, *(node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice])]
        )
        if isinstance(base, Table):
            return self.field(base, indices[0])
        if isinstance(base, Several):
            at = number_of(indices[0])
            if at is None:
                raise Untranslatable(ast.unparse(node))
            return base.items[at]
        if not isinstance(base, Array):
            raise Untranslatable(ast.unparse(node))
        return self.element(base, indices[0])

    def _slice(self, node: ast.Slice) -> Value:
        if node.upper is not None or node.step is not None or node.lower is None:
            raise Untranslatable(ast.unparse(node))
        return Several((self.value(node.lower),))

    def field(self, table: Table, row: Value) -> Scalar:
        """Return a field of the table."""
        name, kind, stays = table.fields[number_of(row)]
        if name in table.dead:
            return Scalar(DEAD, kind)
        table.used.add(name)
        base = "g" if stays is None else "k"
        text = f"{base}->{name}"
        return Scalar(
            text,
            kind,
            names=frozenset({base}),
            memory=frozenset({text} if stays is None else ()),
            known=stays,
        )

    def element(self, array: Array, index: Value) -> Value:
        """Return an element of an array, or for a slice the rest of the array from an index on."""
        if isinstance(index, Several):
            by = number_of(index.items[0])
            if by is None:
                raise Untranslatable("a slice whose begin is not known")
            return Array(**{**vars(array), "begin": array.begin + by, "size": array.size - by})
        at = number_of(index)
        names = array.names | {array.name}
        if array.rows:
            place = self.spelling.scalar(index if at is None else Const(at))
            text = f"{array.name}[{place.text}]"
            row = None if at is None or array.content is None else array.content[at]
            return Array(
                text, array.rows, content=row, names=names | place.names, writeable=False, kind=array.kind
            )
        if at is None:
            if array.dead or (array.places and self.spelling.single):
                raise Mixture(array.name)
            begin = array.begin
            place = self.spelling.scalar(index)
            shifted = self.spelling.scalar(self.binary(ast.Add, Const(begin), index)) if begin else place
            changes = array.writeable
            kind = array.kind
            return Scalar(
                f"{array.name}[{shifted.text}]",
                kind,
                names=names | place.names,
                memory=place.memory | ({f"{array.name}[]"} if changes else set()),
            )
        at = int(at) + array.begin
        if not at >= 0:
            raise Untranslatable(f"{array.name}[{at}]")
        if at in array.dead:
            return Scalar(DEAD, array.kind)
        if at == array.own:
            text = f"{array.name}_own[0]"
            return Scalar(text, array.kind, names=frozenset({f"{array.name}_own"}), memory=frozenset({text}))
        number = None if array.content is None or at >= len(array.content) else array.content[at]
        kind = PLACE if at in array.places else array.kind
        text = f"{array.name}[{at}]"
        if self.spelling.single and at in array.places:  # doubles stand apart
            text = f"{array.name}_at[{sorted(array.places).index(at)}]"
            names = frozenset({f"{array.name}_at"})
        changes = frozenset() if number is not None or not array.writeable else frozenset({text})
        origin = text if number is not None and not array.writeable else ""
        return Scalar(text, kind, names=frozenset(names), memory=changes, known=number, origin=origin)

    def _call(self, node: ast.Call) -> Value:
        if node.keywords:
            raise Untranslatable(ast.unparse(node))
        function = self.resolve(node.func)
        nodes: list[ast.expr] = []
        for each in node.args:
            if not isinstance(each, ast.Starred):
                nodes.append(each)
        turns = function in (elementary.sin, elementary.cos)
        self.angle += turns
        values = self.in_order(nodes)
        self.angle -= turns
        arguments: list[Value] = []
        for each in node.args:
            if isinstance(each, ast.Starred):
                many = self.value(each.value)
                if not isinstance(many, Several):
                    raise Untranslatable(ast.unparse(node))
                arguments += many.items
            else:
                arguments.append(values.pop(0))
        return self.call_of(function, arguments, ast.unparse(node.func))

    def call_of(self, function: Any, arguments: list[Value], text: str) -> Value:
        """Return the value of a call."""
        if isinstance(function, ModuleType):
            raise Untranslatable(text)
        if function in (min, max):
            return self._least(function is min, arguments)
        if function is int:
            number = number_of(arguments[0])
            if number is not None:
                return Const(int(number))
            return self.spelling.scalar(self.spelling.scalar(arguments[0]), LONG)
        if function in (np.isfinite, np.isnan):
            return self._class_of(function, arguments[0])
        if function is _jit.to_bits or function is _jit.from_bits:
            x = self.spelling.scalar(arguments[0])
            name, kind = ("to_bits", LONG) if function is _jit.to_bits else ("from_bits", WIDE)
            return self.helper(name, kind, [x])
        if function is elementary.power_of_two:  # of unsigned integers, which may overflow
            return self.helper("power_of_two", WIDE, [self.spelling.scalar(arguments[0])])
        if function in MATH:
            return self._math(function, arguments)
        if function in _jit.CHOICES:
            kernels, otherwise = _jit.CHOICES[function]
            choice, rest = arguments
            at = number_of(choice)
            if at is None or not isinstance(rest, Several):
                raise Untranslatable(f"{text}: chosen by what is not known")
            return self.call(kernels.get(at, otherwise), list(rest.items))
        return self.call(function, arguments)


__all__ = ["BINARY", "DEAD", "Expressions", "number_of"]
