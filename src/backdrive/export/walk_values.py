"""Values of expressions met on a walk through a kernel: of names, operators, comparisons, places and calls."""

from __future__ import annotations

import ast
import operator
from typing import TYPE_CHECKING, Any

from backdrive import _jit
from backdrive.export.graph import BINARY, COMPARE, ELEMENTARY, NUMPY, Node, Row
from backdrive.export.values import Untranslatable

if TYPE_CHECKING:
    from backdrive.export.walk import State


class Values:
    """What a frame of a walk evaluates; `walk` and its names are those of the frame."""

    walk: Any
    globals: dict[str, Any]
    graph: Any

    def value(self, node: ast.expr, state: State) -> Any:
        """Return the value of an expression: a number, a `Node`, a tuple of them or a `Row`."""
        method = getattr(self, "_v_" + type(node).__name__.lower(), None)
        if method is None:
            raise Untranslatable(ast.unparse(node))
        return method(node, state)

    def _v_constant(self, node: ast.Constant, state: State) -> Any:
        return node.value

    def _v_name(self, node: ast.Name, state: State) -> Any:
        return state.names[node.id] if node.id in state.names else self.resolve(node)

    def resolve(self, node: ast.expr) -> Any:
        """Return the Python object that a name outside the function stands for."""
        if isinstance(node, ast.Name):
            import builtins

            return self.globals[node.id] if node.id in self.globals else getattr(builtins, node.id)
        if isinstance(node, ast.Attribute):
            return getattr(self.resolve(node.value), node.attr)
        raise Untranslatable(ast.unparse(node))

    def _v_attribute(self, node: ast.Attribute, state: State) -> Any:
        if isinstance(node.value, ast.Name) and isinstance(state.names.get(node.value.id), Row):
            row = state.names[node.value.id]
            return len(state.memory[row.name]) - row.begin
        return self.resolve(node)

    def _v_tuple(self, node: ast.Tuple, state: State) -> Any:
        return tuple(self.value(e, state) for e in node.elts)

    def _v_unaryop(self, node: ast.UnaryOp, state: State) -> Any:
        value = self.value(node.operand, state)
        if isinstance(node.op, ast.Not):
            return self.graph.no(value)
        return self.graph.node("neg", value) if isinstance(value, Node) else -value

    def _v_binop(self, node: ast.BinOp, state: State) -> Any:
        a, b = self.value(node.left, state), self.value(node.right, state)
        return self.graph.binary(BINARY[type(node.op)], a, b, state.path)

    def _v_compare(self, node: ast.Compare, state: State) -> Any:
        left, result = self.value(node.left, state), True
        for op, right_node in zip(node.ops, node.comparators, strict=False):
            right = self.value(right_node, state)
            if isinstance(op, ast.In):
                found: Any = False
                for each in right:
                    found = self.graph.either(found, self.graph.binary(operator.eq, left, each))
                return found
            result = self.graph.both(result, self.graph.binary(COMPARE[type(op)], left, right))
            left = right
        return result

    def _v_boolop(self, node: ast.BoolOp, state: State) -> Any:
        join = self.graph.both if isinstance(node.op, ast.And) else self.graph.either
        result: Any = isinstance(node.op, ast.And)
        for each in node.values:
            value = self.value(each, state)
            result = join(result, value if isinstance(value, Node) else bool(value))
            if not isinstance(result, Node) and result != isinstance(node.op, ast.And):
                return result
        return result

    def _v_ifexp(self, node: ast.IfExp, state: State) -> Any:
        condition = self.value(node.test, state)
        if not isinstance(condition, Node):
            return self.value(node.body if condition else node.orelse, state)
        path = state.path
        state.path = self.graph.both(path, condition)
        a = self.value(node.body, state)
        state.path = self.graph.both(path, self.graph.no(condition))
        b = self.value(node.orelse, state)
        state.path = path
        return self.graph.select(condition, a, b)

    def _v_subscript(self, node: ast.Subscript, state: State) -> Any:
        base = self.value(node.value, state)
        if isinstance(node.slice, ast.Slice):
            if node.slice.lower is None or not isinstance(base, Row):
                raise Untranslatable(ast.unparse(node))
            return Row(base.name, base.begin + int(self.value(node.slice.lower, state)))
        index = self.value(node.slice, state)
        if isinstance(base, tuple):
            return base[index]
        if not isinstance(base, Row):
            raise Untranslatable(ast.unparse(node))
        if isinstance(index, Node):  # one of a few places
            places = sorted(self._possible(index))
            numbers = [state.memory[base.name][base.begin + at] for at in places]
            return self.graph.node("pick", index, tuple(places), *numbers)
        return state.memory[base.name][base.begin + int(index)]

    def _possible(self, index: Any) -> set[int]:
        """Return the numbers that an index can be."""
        if not isinstance(index, Node):
            return {int(index)}
        name, arguments = self.graph.operations[index.index]
        if name == "where":
            return self._possible(arguments[1]) | self._possible(arguments[2])
        if name in ("add", "sub", "mul"):
            a, b = (self._possible(x) for x in arguments)
            return {int(getattr(operator, name)(x, y)) for x in a for y in b}
        raise Untranslatable("an index that is not known")

    def _v_call(self, node: ast.Call, state: State) -> Any:
        function = self.resolve(node.func)
        arguments: list[Any] = []
        for each in node.args:
            if isinstance(each, ast.Starred):
                arguments += self.value(each.value, state)
            else:
                arguments.append(self.value(each, state))
        graph, path = self.graph, state.path
        if function in (min, max):
            result = arguments[0]
            for other in arguments[1:]:
                less = (other, result) if function is min else (result, other)
                result = graph.select(graph.binary(operator.lt, *less), other, result)
            return result
        if function is int:
            return self._whole(arguments[0])
        if function in NUMPY:
            return graph.function(NUMPY[function], arguments, path)
        if function in ELEMENTARY:
            return graph.function(ELEMENTARY[function], arguments, path)
        if function in _jit.CHOICES:
            kernels, otherwise = _jit.CHOICES[function]
            function, arguments = kernels.get(arguments[0], otherwise), list(arguments[1])
        return self.walk.call(function, arguments, state.memory, path)

    def _whole(self, value: Any) -> int:
        """Return a number that decides about structure: of a parameter, what it is in the model."""
        if not isinstance(value, Node):
            return int(value)
        name, arguments = self.graph.operations[value.index]
        if name != "parameter":
            raise Untranslatable("int() of what is not known")
        return int(self.walk.known[arguments[0]][arguments[1]])
