"""Loops of kernels in C: everything that a loop changes is stored in a variable before the loop."""

from __future__ import annotations

import ast
from dataclasses import replace

from backdrive.export.code import Assign, Loop
from backdrive.export.expressions import number_of
from backdrive.export.statements import Statements, c_name
from backdrive.export.values import (
    BOOL,
    INT,
    PRIMARY,
    Array,
    Const,
    Mixture,
    Scalar,
    Several,
    Table,
    Untranslatable,
    Value,
    wider,
)


class Loops(Statements):
    """Translates loops."""

    def _for(self, node: ast.For) -> bool:
        call = node.iter
        if not (
            isinstance(call, ast.Call)
            and ast.unparse(call.func) == "range"
            and isinstance(node.target, ast.Name)
        ):
            raise Untranslatable(ast.unparse(node).split("\n")[0])
        bounds = [self.value(a) for a in call.args]
        first, last = (Const(0), bounds[0]) if len(bounds) == 1 else bounds[:2]
        begin, end = number_of(first), number_of(last)
        if begin is None or end is None or len(bounds) > 2:
            raise Untranslatable(f"{ast.unparse(call)}: how often is not known")
        begin, end = int(begin), int(end)
        if end <= begin:
            return False
        name = c_name(node.target.id) if node.target.id != "_" else "round_"
        if end == begin + 1 and not any(isinstance(x, (ast.Break, ast.Continue)) for x in ast.walk(node)):
            self.env[node.target.id] = Const(begin)
            return self.run(node.body)
        counter = Scalar(name, INT, names=frozenset({name}))
        head = Scalar(f"for (int {name} = {begin}; {name} < {end}; {name}++)", INT)
        at, env = len(self.block), dict(self.env)
        try:
            self._loop(node, head, {node.target.id: counter})
        except Mixture:
            del self.block[at:]
            self.env = env
            for k in range(begin, end):
                self.env[node.target.id] = Const(k)
                if self.run(node.body):
                    raise
        return False

    def _while(self, node: ast.While) -> bool:
        self._loop(node, None, {})
        return False

    def _loop(self, node: ast.For | ast.While, head: Scalar | None, own: dict[str, Value]) -> None:
        changing = sorted(
            {
                n.id
                for s in node.body
                for n in ast.walk(s)
                if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store) and n.id != "_"
            }
        )
        for name in changing:
            if name in self.env:
                self.env[name] = self._loosen(name, self.env[name])
        if isinstance(node, ast.While):
            at = len(self.block)
            condition = self.spelling.scalar(self.value(node.test))
            if len(self.block) != at:
                raise Untranslatable(ast.unparse(node.test))
            text = condition.text
            head = self.spelling.join(f"while ({text})", BOOL, PRIMARY, [condition])
        assert head is not None
        loop = Loop(head)
        outer, before = self.block, dict(self.env)
        around = self.changing, self.carried
        self.changing, self.carried = (
            self.changing | set(changing),
            self.carried | (set(changing) & set(before)),
        )
        self.block = loop.body
        self.env = dict(before) | own
        try:
            ended = self.run(node.body)
        except Mixture:
            self.block = outer
            raise
        finally:
            self.changing, self.carried = around
        for name, value in self.env.items():
            was = before.get(name)
            if name in own or was == value or ended:
                continue
            if was is None:  # a variable that begins in the loop
                before[name] = value
            elif isinstance(was, Scalar) and isinstance(value, (Const, Scalar)):
                self._write_back(was, value)
            elif isinstance(was, Several) and isinstance(value, Several):
                for x, y in zip(was.items, value.items, strict=False):
                    if x != y and isinstance(x, Scalar):
                        self._write_back(x, y)
            else:
                raise Untranslatable(f"{name} changes in a loop")
        self.block = outer
        self.block.append(loop)
        self.env = before

    def _write_back(self, was: Scalar, value: Value) -> None:
        if isinstance(value, Scalar) and value.text == was.text:
            return
        scalar = self.spelling.scalar(value, was.kind)
        self.block.append(Assign(was.text, self.spelling.type_name(was.kind), scalar))

    def _loosen(self, name: str, value: Value) -> Value:
        """Return a variable that a loop may change: it has a name in C and an unknown value."""
        if isinstance(value, Several):
            return Several(tuple(self._loosen(f"{name}_{i}", v) for i, v in enumerate(value.items)))
        if isinstance(value, (Array, Table)):
            return value
        if not (isinstance(value, Scalar) and value.text == c_name(name)):
            value = self.assign(name, value, always=True)
        assert isinstance(value, Scalar)
        kind = wider(value.kind, self.kinds.get(value.text, value.kind))
        return replace(value, known=None, origin="", kind=kind)
