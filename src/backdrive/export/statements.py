"""Statements of kernels in C: variables, branches, loops, stores and returns."""

from __future__ import annotations

import ast
from dataclasses import replace
from typing import Any

from backdrive.export.code import Assign, Branch, Do, Leave, Statement, Store
from backdrive.export.expressions import BINARY, DEAD, Expressions, number_of
from backdrive.export.operators import beside
from backdrive.export.values import (
    REAL,
    Array,
    Const,
    Scalar,
    Several,
    Spelling,
    Table,
    Untranslatable,
    Value,
    wider,
)

RESERVED = {
    *[
        "auto",
        "break",
        "case",
        "char",
        "const",
        "continue",
        "default",
        "do",
        "double",
        "else",
        "enum",
        "extern",
        "float",
        "for",
        "goto",
        "if",
        "inline",
        "int",
        "long",
    ],
    *[
        "register",
        "restrict",
        "return",
        "short",
        "signed",
        "sizeof",
        "static",
        "struct",
        "switch",
        "typedef",
        "union",
        "unsigned",
        "void",
        "volatile",
    ],
    *[
        "while",
        "bool",
        "true",
        "false",
        "class",
        "new",
        "delete",
        "this",
        "template",
        "namespace",
        "operator",
        "private",
        "public",
        "protected",
    ],
    *[
        "virtual",
        "friend",
        "try",
        "catch",
        "throw",
        "using",
        "y0",
        "y1",
        "yn",
        "j0",
        "j1",
        "jn",
        "exp",
        "log",
        "sin",
        "cos",
        "tanh",
        "sqrt",
        "fabs",
        "N_",
    ],
}


def c_name(name: str) -> str:
    """Return a name that C takes."""
    return f"{name}_" if name in RESERVED else name


class Statements(Expressions):
    """Translates the body of one kernel, by its arguments.

    Attributes:
        returns: every `return`, whose texts are written when all are known.
    """

    def __init__(self, spelling: Spelling, names: dict[str, Any], kinds: dict[str, str]):
        super().__init__(spelling, names)
        self.kinds = kinds  # of variables, where a pass before this one has seen them
        self.kinds_seen: dict[str, str] = {}
        self.returns: list[tuple[Leave, Value | None, list[Statement]]] = []
        self.writes = False
        self.changing: set[str] = set()  # variables that a loop around changes
        self.carried: set[str] = set()  # of these, such as were there before it

    def run(self, statements: list[ast.stmt]) -> bool:
        """Translate statements into the present block and return whether they leave it."""
        for statement in statements:
            method = getattr(self, "_" + type(statement).__name__.lower(), None)
            if method is None:
                raise Untranslatable(ast.unparse(statement))
            if method(statement):
                return True
        return False

    def assign(self, name: str, value: Value, always: bool = False) -> Value:
        """Bind a variable; `always`: also where the value is a number, which needs no variable otherwise."""
        if isinstance(value, Several):
            return Several(tuple(self.assign(f"{name}_{i}", v, always) for i, v in enumerate(value.items)))
        if isinstance(value, (Array, Table)):
            return self._pointer(name, value) if isinstance(value, Array) else value
        root = name.rsplit("_", 1)[0] if name not in self.changing else name
        always = always or root in self.changing
        if isinstance(value, Const) and not always:
            return value
        name, carried = c_name(name), root in self.carried
        kind = wider(value.kind, self.kinds.get(name, value.kind))
        self.kinds_seen[name] = wider(kind, self.kinds_seen.get(name, kind))
        scalar = self.spelling.scalar(value, kind)
        self.block.append(Assign(name, self.spelling.type_name(kind), scalar, self._effect(scalar)))
        known, origin = number_of(value), getattr(value, "origin", "")
        if carried:
            known, origin = None, ""
        return Scalar(name, kind, names=frozenset({name}), known=known, origin=origin)

    def _effect(self, value: Scalar) -> bool:
        return False

    def _pointer(self, name: str, array: Array) -> Array:
        if array.name.isidentifier():
            return array
        type_ = f"const {self.spelling.type_name(array.kind)} *"
        value = Scalar(array.name, array.kind, names=array.names)
        self.block.append(Assign(name, type_, value))
        return replace(array, name=name, names=frozenset())

    def do(self, value: Scalar) -> None:
        """Compute a value for what that changes."""
        self.block.append(Do(value))

    def _expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return
        value = self.value(node.value)
        if isinstance(value, Scalar) and self._effect(value):
            self.do(value)

    def _assign(self, node: ast.Assign) -> None:
        if len(node.targets) == 1:
            target = node.targets[0]
            if isinstance(target, ast.Tuple):
                self._unpack(target.elts, node.value)
            else:
                self.bind(target, self.value(node.value))
            return
        value = self.value(node.value)
        if isinstance(value, Scalar) and value.known is None:
            value = self.temporary(value)
        for target in reversed(node.targets):
            self.bind(target, value)

    def _unpack(self, targets: list[ast.expr], node: ast.expr) -> None:
        value = self.value(node)
        if not isinstance(value, Several) or len(value.items) != len(targets):
            raise Untranslatable(ast.unparse(node))
        items = list(value.items)
        plain = [c_name(t.id) for t in targets if isinstance(t, ast.Name)]
        for i, item in enumerate(items):  # everything that an earlier target changes is read first
            if not isinstance(item, Scalar):
                continue
            before = {c_name(t.id) for t in targets[:i] if isinstance(t, ast.Name)}
            stores = [t for t in targets[:i] if not isinstance(t, ast.Name)]
            places = {self._place(t).text for t in stores}
            hit = item.names & before or (
                places and (item.memory & places or any("[]" in m for m in item.memory))
            )
            if hit and item.text not in plain[i : i + 1]:
                items[i] = self.temporary(item)
        for target, item in zip(targets, items, strict=False):
            self.bind(target, item)

    def _place(self, target: ast.expr) -> Scalar:
        at = len(self.block)
        place = self.value(target)
        del self.block[at:]
        return place if isinstance(place, Scalar) else Scalar("", REAL)

    def bind(self, target: ast.expr, value: Value) -> None:
        """Give a target its value."""
        if isinstance(target, ast.Name):
            if target.id == "_":
                return
            self.env[target.id] = self.assign(target.id, value)
        elif isinstance(target, ast.Tuple):
            if not isinstance(value, Several):
                raise Untranslatable(ast.unparse(target))
            for each, item in zip(target.elts, value.items, strict=False):
                self.bind(each, item)
        else:
            place = self.value(target)
            if not isinstance(place, Scalar) or place.known is not None:
                raise Untranslatable(f"{ast.unparse(target)} is written to, but is a parameter")
            self.writes = True
            if place.text != DEAD:
                self.block.append(Store(place, self.spelling.scalar(value, place.kind)))

    def _augassign(self, node: ast.AugAssign) -> None:
        target = node.target
        sign = BINARY[type(node.op)][0]
        if isinstance(target, ast.Name):
            self.env[target.id] = self.assign(
                target.id, self.binary(type(node.op), *self.in_order([target, node.value]))
            )
            return
        place, value = self.in_order([target, node.value])
        value = beside(value, place)
        if not isinstance(place, Scalar) or place.known is not None:
            raise Untranslatable(f"{ast.unparse(target)} is written to, but is a parameter")
        self.writes = True
        if place.text == DEAD:
            return
        result = self.binary(type(node.op), place, value)
        kind = place.kind
        if self.spelling.scalar(result).kind == kind:
            self.block.append(Store(place, self.spelling.scalar(value, kind), sign))
        else:
            self.block.append(Store(place, self.spelling.scalar(result, kind)))

    def _return(self, node: ast.Return) -> bool:
        value = None if node.value is None else self.value(node.value)
        leave = Leave("return")
        self.returns.append((leave, value, self.block))
        self.block.append(leave)
        return True

    def _pass(self, node: ast.Pass) -> None:
        return

    def _break(self, node: ast.Break) -> bool:
        self.block.append(Leave("break"))
        return True

    def _continue(self, node: ast.Continue) -> bool:
        self.block.append(Leave("continue"))
        return True

    def _if(self, node: ast.If) -> bool:
        condition = self.value(node.test)
        number = number_of(condition)
        if number is not None:
            return self.run(node.body if number else node.orelse)
        branch = Branch(self.spelling.scalar(condition))
        outer, before = self.block, self.env
        ends, envs = [], []
        for statements, block in ((node.body, branch.then), (node.orelse, branch.other)):
            self.block, self.env = block, dict(before)
            ends.append(self.run(statements))
            envs.append(self.env)
        self.block = outer
        if all(ends):
            self.block.append(branch)
            return True
        if any(ends):
            self.env = envs[ends.index(False)]
            self.block.append(branch)
            return False
        early: list[Statement] = []
        self.env = {}
        for name in [*envs[0], *(n for n in envs[1] if n not in envs[0])]:
            a, b = envs[0].get(name), envs[1].get(name)
            if a is None or b is None:
                continue
            self.env[name] = self._join(name, a, b, before.get(name), branch, early)
        outer += early
        outer.append(branch)
        return False

    def _join(
        self, name: str, a: Value, b: Value, before: Value | None, branch: Branch, early: list[Statement]
    ) -> Value:
        """Return a variable after a branch; it has the same name in C on both sides."""
        if a == b:
            return a
        if isinstance(a, Several) and isinstance(b, Several):
            earlier = before.items if isinstance(before, Several) else [None] * len(a.items)
            return Several(
                tuple(
                    self._join(f"{name}_{i}", x, y, z, branch, early)
                    for i, (x, y, z) in enumerate(zip(a.items, b.items, earlier, strict=False))
                )
            )
        if not isinstance(a, (Const, Scalar)) or not isinstance(b, (Const, Scalar)):
            raise Untranslatable(f"{name} is one thing or another")
        name = c_name(name)
        kind = wider(a.kind, b.kind, self.kinds.get(name, a.kind))
        self.kinds_seen[name] = wider(kind, self.kinds_seen.get(name, kind))
        for value, block in ((a, branch.then), (b, branch.other)):
            if isinstance(value, Scalar) and value.text == name:
                continue
            scalar = self.spelling.scalar(value, kind)
            statement = Assign(name, self.spelling.type_name(kind), scalar)
            if value == before and name not in branch.condition.names:
                early.append(statement)
            else:
                block.append(statement)
        return Scalar(name, kind, names=frozenset({name}))
