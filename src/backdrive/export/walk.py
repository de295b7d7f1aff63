"""A walk through a kernel with symbols: branches become selections, loops are written out, searches for a root are not."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import FunctionType
from typing import Any

from backdrive.export.graph import BINARY, Graph, Node
from backdrive.export.search import Search
from backdrive.export.values import Untranslatable
from backdrive.export.walk_values import Values

LONGEST = 200  # rounds of a loop that is written out
SEARCH = 24  # rounds of a root search with its own stop; by then the secant method has reached full precision


@dataclass
class State:
    """What a path through a function holds: variables, and numbers of the arrays that change."""

    names: dict[str, Any]
    memory: dict[str, list[Any]]
    path: Any

    def copy(self, path: Any) -> State:
        """Return the same for a branch."""
        return State(dict(self.names), {k: list(v) for k, v in self.memory.items()}, path)


class Walk:
    """One walk through a kernel.

    Args:
        graph: to add operations to.
        known: arrays of parameters whose numbers decide about structure: name -> numbers.
    """

    def __init__(self, graph: Graph, known: dict[str, Sequence[float]]):
        self.graph, self.known = graph, known

    def call(
        self, kernel: Callable, arguments: Sequence[Any], memory: dict[str, list[Any]], path: Any
    ) -> Any:
        """Return what a kernel gives; `memory` is changed in place."""
        source = getattr(kernel, "py_func", kernel)
        if not isinstance(source, FunctionType):
            raise Untranslatable(f"{kernel!r} is no kernel.")
        tree = ast.parse(textwrap.dedent(inspect.getsource(source))).body[0]
        if not isinstance(tree, ast.FunctionDef):
            raise Untranslatable(source.__name__)
        frame = _Frame(self, {**source.__globals__, **inspect.getclosurevars(source).nonlocals})
        state = State(dict(zip((a.arg for a in tree.args.args), arguments, strict=False)), memory, path)
        end = frame.block(tree.body, state.copy(path))
        ends = [*frame.returns, *([(end, None)] if end is not None else [])]
        final, result = ends[-1]
        merged = final.memory
        for other, value in reversed(ends[:-1]):
            result = self.graph.select(other.path, value, result)
            merged = {
                k: [self.graph.select(other.path, a, b) for a, b in zip(other.memory[k], v, strict=False)]
                for k, v in merged.items()
            }
        memory.update(merged)
        return result


class _Frame(Values):
    """A function that is being walked through."""

    def __init__(self, walk: Walk, names: dict[str, Any]):
        self.walk, self.graph, self.globals = walk, walk.graph, names
        self.returns: list[tuple[State, Any]] = []
        self.breaks: list[list[State]] = []
        self.continues: list[list[State]] = []

    def block(self, statements: list[ast.stmt], state: State | None) -> State | None:
        """Walk through statements; None where no path goes on."""
        for statement in statements:
            if state is None:
                return None
            state = getattr(self, "_" + type(statement).__name__.lower())(statement, state)
        return state

    def _expr(self, node: ast.Expr, state: State) -> State:
        if not isinstance(node.value, ast.Constant):
            self.value(node.value, state)
        return state

    def _return(self, node: ast.Return, state: State) -> None:
        value = None if node.value is None else self.value(node.value, state)
        self.returns.append((state, value))

    def _break(self, node: ast.Break, state: State) -> None:
        self.breaks[-1].append(state)

    def _continue(self, node: ast.Continue, state: State) -> None:
        self.continues[-1].append(state)

    def _assign(self, node: ast.Assign, state: State) -> State:
        value = self.value(node.value, state)
        for target in node.targets:
            self.bind(target, value, state)
        return state

    def _augassign(self, node: ast.AugAssign, state: State) -> State:
        before = self.value(node.target, state)
        value = self.graph.binary(BINARY[type(node.op)], before, self.value(node.value, state), state.path)
        self.bind(node.target, value, state)
        return state

    def bind(self, target: ast.expr, value: Any, state: State) -> None:
        """Give a target its value."""
        if isinstance(target, ast.Name):
            state.names[target.id] = value
        elif isinstance(target, ast.Tuple):
            for each, item in zip(target.elts, value, strict=False):
                self.bind(each, item, state)
        elif isinstance(target, ast.Subscript):
            row, index = self.value(target.value, state), self.value(target.slice, state)
            state.memory[row.name][row.begin + int(index)] = value
        else:
            raise Untranslatable(ast.unparse(target))

    def _if(self, node: ast.If, state: State) -> State | None:
        condition = self.value(node.test, state)
        if not isinstance(condition, Node):
            return self.block(node.body if condition else node.orelse, state)
        inside = self.graph.both(state.path, condition)
        outside = self.graph.both(state.path, self.graph.no(condition))
        then = self.block(node.body, state.copy(inside))
        other = self.block(node.orelse, state.copy(outside))
        if then is None or other is None:
            return other if then is None else then
        return self.join_two(condition, then, other, state.path)

    def join_two(self, condition: Any, a: State, b: State, path: Any) -> State:
        """Return one state for two paths, the first where a condition holds."""
        select = self.graph.select
        names = {n: select(condition, v, b.names[n]) for n, v in a.names.items() if n in b.names}
        memory = {
            k: [select(condition, x, y) for x, y in zip(v, b.memory[k], strict=False)]
            for k, v in a.memory.items()
        }
        return State(names, memory, path)

    def join(self, states: list[State]) -> State:
        """Return one state for paths that exclude each other."""
        result = states[-1]
        for state in reversed(states[:-1]):
            result = self.join_two(state.path, state, result, self.graph.either(state.path, result.path))
        return result

    def _for(self, node: ast.For, state: State) -> State:
        call = node.iter
        if (
            not isinstance(call, ast.Call)
            or ast.unparse(call.func) != "range"
            or not isinstance(node.target, ast.Name)
        ):
            raise Untranslatable(ast.unparse(node).split("\n")[0])
        numbers = range(*(int(self.value(a, state)) for a in call.args))
        if len(numbers) > SEARCH and any(isinstance(n, ast.Break) for n in ast.walk(node)):
            return self.search(node, node.target.id, state, [numbers[0], numbers[SEARCH - 1]])
        return self.rounds(node, state, [{node.target.id: k} for k in numbers])

    def _while(self, node: ast.While, state: State) -> State:
        return self.rounds(node, state, [{} for _ in range(LONGEST)])

    def search(self, node: ast.For, counter: str, state: State, rounds: list[int]) -> State:
        """Walk through one round of a search, and return what a search of at most SEARCH rounds ends with."""
        assigned = {
            n.id
            for each in node.body
            for n in ast.walk(each)
            if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
        }
        names = sorted(assigned & set(state.names))
        self.graph.searches += 1
        carried = [
            self.graph.node("carried", self.graph.searches, name) for name in (*names, "whether it goes on")
        ]
        results = [self.round(node, counter, state, k, names, carried) for k in rounds]
        if repr(results[0]) != repr(results[1]):
            raise Untranslatable("a search whose rounds differ")
        search = Search.of(self.graph, SEARCH, carried, results[0])
        begin = [state.names[name] for name in names]
        begin = [float(b) if isinstance(b, int) else b for b in begin]
        ran = self.graph.node("search", search, len(carried), *begin, state.path, *search.inputs())
        after = state.copy(state.path)
        after.names |= {name: self.graph.node("end", ran, i) for i, name in enumerate(names)}
        return after

    def round(
        self, node: ast.For, counter: str, state: State, k: int, names: list[str], carried: list[Node]
    ) -> list[Any]:
        """Return what a round gives for some names, and whether the search then goes on."""
        now = State(state.names | dict(zip(names, carried, strict=False)), state.memory, carried[-1])
        now = now.copy(carried[-1])
        now.names[counter] = k
        self.breaks.append([])
        self.continues.append([])
        end = self.block(node.body, now)
        ends = [*self.continues.pop(), *([end] if end is not None else [])]
        left = self.breaks.pop()
        joined = self.join([*left, *ends])
        if joined.memory != state.memory:
            raise Untranslatable("a search that changes arrays")
        return [*(joined.names[name] for name in names), self.join(ends).path if ends else False]

    def rounds(self, node: ast.For | ast.While, state: State, each: list[dict[str, Any]]) -> State:
        """Walk through a loop round by round; paths that leave it early are joined after its end."""
        entry, live = state.path, state
        left: list[State] = []
        self.breaks.append([])
        stops = any(isinstance(n, ast.Break) for n in ast.walk(node))
        for names in each:
            before = dict(live.names)
            live.names.update(names)
            if isinstance(node, ast.While):
                condition = self.value(node.test, live)
                if isinstance(condition, Node):
                    left.append(live.copy(self.graph.both(live.path, self.graph.no(condition))))
                    live.path = self.graph.both(live.path, condition)
                elif not condition:
                    break
            self.continues.append([])
            end = self.block(node.body, live.copy(live.path))
            ends = [*self.continues.pop(), *([end] if end is not None else [])]
            if not ends:
                live = None  # type: ignore[assignment]
                break
            live = self.join(ends)
            if stops:  # what is not on the path stands still, lest it grow beyond all numbers round by round
                live.names |= {n: self.graph.select(live.path, live.names[n], v) for n, v in before.items()}
        left += self.breaks.pop()
        if live is not None:
            left.append(live)
        result = self.join(left)
        result.path = entry
        return result
