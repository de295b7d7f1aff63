"""Mutations of source files: where one can be made, and what the file then reads.

A mutation is a span of a file and what stands there instead, found in the syntax tree; nothing else of the file moves. What
a person reads is left alone: docstrings, annotations, strings, what is raised, `__repr__`, imports, and where a parameter's
typical value was published.

    number      a number is twice itself or of the other sign; an integer one more or one less
    few percent a number is 5 % larger
    sign        + for -, - for +, a leading minus dropped
    product     * for /, / for *, // for /
    power       ** for *
    edge        < for <=, > for >=, and back, beside a number or a size: no test can put a computed float on an edge
    turned      < for >=, == for !=, `in` for `not in`, `is` for `is not`, and back
    logic       `and` for `or` and back, `not` dropped
    extreme     min for max, argmin for argmax, any for all, floor for ceil, sin for cos, and back
    bare        abs, sqrt, square, round dropped
    swapped     the first two arguments of a call in the other order
    removed     a statement left out: a call, an assignment to an element or an attribute, +=, return, continue, break

What nobody could see is left alone: numbers below 1e-8 or beyond 1e8, which guard against rounding and overflow; how often
an iteration repeats at most; a / b for a * b where only its sign is asked for, or b is a sign; the order of the number and
the lower end of a clip; and the size -1 of a reshape, for which any negative one will do. Where numbers are rules of thumb
and not those of equations, nobody could say that 99 is wrong where 100 was meant: there a number is not changed by 5 %, an
integer above 2 only by the factor two or in a subscript, and an edge only beside a size.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

#: What is skipped wherever it is a keyword: words and provenance.
WORDS = {"typical", "source", "symbol", "unit", "remedy", "sentence", "log", "many", "help", "metavar"}
#: Functions whose first two arguments may change places, or that only say something.
EVEN = {
    "min", "max", "minimum", "maximum", "fmin", "fmax", "print", "isinstance", "array_equal", "allclose", "logical_and",
    "logical_or", "zip", "add", "multiply", "hypot", "union1d", "Parameter", "Check", "getattr", "hasattr", "open",
}  # fmt: skip
EXTREMES = {
    "min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "argmin": "argmax", "argmax": "argmin",
    "any": "all", "all": "any", "floor": "ceil", "ceil": "floor", "sin": "cos", "cos": "sin",
}  # fmt: skip
BARE = {"abs", "sqrt", "round", "square"}
ARITHMETIC = {
    ast.Add: ("+", "-", "sign"), ast.Sub: ("-", "+", "sign"), ast.Mult: ("*", "/", "product"),
    ast.Div: ("/", "*", "product"), ast.FloorDiv: ("//", "/", "product"), ast.Pow: ("**", "*", "power"),
}  # fmt: skip
EDGE = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">"}
TURNED = {
    ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "==", ast.In: "not in",
    ast.NotIn: "in", ast.Is: "is not", ast.IsNot: "is",
}  # fmt: skip
SIGNS = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.In: "in",
    ast.NotIn: "not in", ast.Is: "is", ast.IsNot: "is not",
}  # fmt: skip


@dataclass(frozen=True)
class Mutation:
    """One change of one file.

    Attributes:
        path: of the file, below the tree's root.
        start: first byte of the span that goes.
        stop: first byte behind it.
        text: what stands there instead.
        operator: one of those above, or `named`.
    """

    path: str
    start: int
    stop: int
    text: str
    operator: str

    def applied(self, source: bytes) -> bytes:
        """Return the file's content with the change."""
        return source[: self.start] + self.text.encode() + source[self.stop :]

    def line(self, source: bytes) -> int:
        """Return the line at which it begins, from 1."""
        return source.count(b"\n", 0, self.start) + 1

    def lines(self, source: bytes) -> tuple[str, str]:
        """Return the lines that it touches, before and after, stripped."""
        begin = source.rfind(b"\n", 0, self.start) + 1
        end = source.find(b"\n", self.stop)
        end = len(source) if end < 0 else end
        old = source[begin:end]
        new = source[begin : self.start] + self.text.encode() + source[self.stop : end]
        return old.decode().strip(), new.decode().strip()


def named(path: str, source: bytes, old: str, new: str) -> Mutation:
    """Return the mutation that replaces the one place where `old` stands; ValueError where there is none or several."""
    count = source.count(old.encode())
    if count != 1:
        raise ValueError(
            f"{path}: {old!r} stands there {count} times, once was expected: bring the table up to date"
        )
    at = source.index(old.encode())
    return Mutation(path, at, at + len(old.encode()), new, "named")


def mutations(path: str, source: bytes, exact: bool = True) -> list[Mutation]:
    """Return every mutation of a file that the operators allow, each once.

    Args:
        path: of the file, below the tree's root.
        source: its content.
        exact: its numbers are those of equations, not rules of thumb.
    """
    return list(dict.fromkeys(_Places(path, source, exact).found()))


class _Places:
    def __init__(self, path: str, source: bytes, exact: bool):
        self.path, self.source, self.exact = path, source, exact
        self.tree = ast.parse(source)
        self.signs_only: set[ast.AST] = set()
        #: numbers raised to a power, which for an even one have no sign
        self.bases = {
            n.left for n in ast.walk(self.tree) if isinstance(n, ast.BinOp) and isinstance(n.op, ast.Pow)
        }
        self.begins = [0]
        for row in source.splitlines(keepends=True):
            self.begins.append(self.begins[-1] + len(row))

    def found(self) -> Iterator[Mutation]:
        for statement in self.tree.body:
            yield from self.walk(statement, False)

    def span(self, node: ast.AST) -> tuple[int, int]:
        return (
            self.begins[node.lineno - 1] + node.col_offset,  # type: ignore[attr-defined]
            self.begins[node.end_lineno - 1] + node.end_col_offset,  # type: ignore[attr-defined]
        )

    def text(self, node: ast.AST) -> str:
        start, stop = self.span(node)
        return self.source[start:stop].decode()

    def replaced(self, node: ast.AST, text: str, operator: str) -> Mutation:
        return Mutation(self.path, *self.span(node), text, operator)

    def between(
        self, left: ast.AST, right: ast.AST, sign: str, text: str, operator: str
    ) -> Iterator[Mutation]:
        """Replace the sign that stands between two operands."""
        start, stop = self.span(left)[1], self.span(right)[0]
        at = self.source.find(sign.encode(), start, stop)
        if at >= 0:
            yield Mutation(self.path, at, at + len(sign), text, operator)

    def repeats(self, node: ast.AST) -> str:
        """Return `range` for the range of a loop that does not ask which round it is."""
        if isinstance(node, ast.Call) and self.text(node.func) == "range" and len(node.args) == 1:
            return "range" if isinstance(node.args[0], ast.Constant) and node.args[0].value >= 4 else ""
        return ""

    def walk(self, node: ast.AST, index: bool | str) -> Iterator[Mutation]:
        """Yield the mutations of a node and of what is in it; `index`: it stands in a subscript."""
        if isinstance(node, ast.Import | ast.ImportFrom | ast.JoinedStr | ast.Raise | ast.Assert):
            return
        if isinstance(node, ast.FunctionDef) and node.name in ("__repr__", "__str__"):
            return
        if isinstance(node, ast.If) and "TYPE_CHECKING" in self.text(node.test):
            return
        for make in (self.numbers, self.signs, self.comparisons, self.logic, self.calls, self.statements):
            yield from make(node, index)
        skipped: list[ast.AST] = []
        if isinstance(node, ast.Call) and self.text(node.func).endswith("reshape"):
            skipped = [a for a in node.args if isinstance(a, ast.UnaryOp) and self.text(a) == "-1"]
        if isinstance(node, ast.Compare) and any(
            self.text(side) in ("0", "0.0") for side in node.comparators
        ):
            self.signs_only.add(node.left)
        if isinstance(node, ast.FunctionDef):
            skipped += [*node.decorator_list, *([node.returns] if node.returns else [])]
        if isinstance(node, ast.arg | ast.AnnAssign) and node.annotation is not None:
            skipped += [node.annotation]
        if isinstance(node, ast.ClassDef):
            skipped += [*node.bases, *node.decorator_list, *node.keywords]
        if isinstance(node, ast.keyword) and node.arg in WORDS:
            return
        for name, value in ast.iter_fields(node):
            inside = index or (isinstance(node, ast.Subscript) and name == "slice") or self.repeats(node)
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST) and child not in skipped:
                    yield from self.walk(child, inside)

    def numbers(self, node: ast.AST, index: bool | str) -> Iterator[Mutation]:
        if not isinstance(node, ast.Constant):
            return
        value = node.value
        if isinstance(value, bool):
            yield self.replaced(node, str(not value), "logic")
        elif isinstance(value, int):
            if index != "range" and (self.exact or index or value <= 2):
                yield self.replaced(node, str(value + 1), "number")
                if value > 0:
                    yield self.replaced(node, str(value - 1), "number")
            if value > 0 and not index and value < 10**8:
                yield self.replaced(node, str(2 * value), "number")
        elif isinstance(value, float):
            if value == 0.0:
                yield self.replaced(node, "1.0", "number")
            elif 1e-8 <= abs(value) <= 1e8:
                if self.exact:
                    yield self.replaced(node, f"({1.05 * value!r})", "few percent")
                yield self.replaced(node, f"({2.0 * value!r})", "number")
                if node not in self.bases:
                    yield self.replaced(node, f"(-{value!r})", "number")

    def signs(self, node: ast.AST, index: bool | str) -> Iterator[Mutation]:
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            yield self.replaced(node, f"({self.text(node.operand)})", "sign")
        operator = ARITHMETIC.get(type(getattr(node, "op", None)))
        if operator is None:
            return
        sign, other, name = operator
        if name == "product" and (
            node in self.signs_only
            or (isinstance(node, ast.BinOp) and self.text(node.right).startswith("np.sign("))
        ):
            return
        if isinstance(node, ast.BinOp) and not self.is_text(node.left) and not self.is_text(node.right):
            yield from self.between(node.left, node.right, sign, other, name)
        if isinstance(node, ast.AugAssign) and not self.is_text(node.value):
            yield from self.between(node.target, node.value, sign, other, name)

    def comparisons(self, node: ast.AST, index: bool | str) -> Iterator[Mutation]:
        if not isinstance(node, ast.Compare):
            return
        operands = [node.left, *node.comparators]
        for left, right, operator in zip(operands, operands[1:], node.ops, strict=False):
            for table, name in ((EDGE, "edge"), (TURNED, "turned")):
                if type(operator) in table and (name != "edge" or self.has_edge(left, right)):
                    yield from self.between(left, right, SIGNS[type(operator)], table[type(operator)], name)

    def logic(self, node: ast.AST, index: bool | str) -> Iterator[Mutation]:
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yield self.replaced(node, f"({self.text(node.operand)})", "logic")
        if isinstance(node, ast.BoolOp):
            other = "or" if isinstance(node.op, ast.And) else "and"
            # all of them at once, for one alone would bind otherwise
            joined = f" {other} ".join(f"({self.text(value)})" for value in node.values)
            yield self.replaced(node, f"({joined})", "logic")

    def calls(self, node: ast.AST, index: bool | str) -> Iterator[Mutation]:
        if not isinstance(node, ast.Call):
            return
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in EXTREMES:
            start, stop = self.span(node.func)
            yield Mutation(self.path, stop - len(name), stop, EXTREMES[name], "extreme")
        if name in BARE and len(node.args) == 1 and not node.keywords:
            yield self.replaced(node, f"({self.text(node.args[0])})", "bare")
        if (
            len(node.args) >= 2
            and name not in EVEN
            and not (name == "clip" and len(node.args) == 3)
            and not any(isinstance(a, ast.Starred) for a in node.args)
        ):
            first, second = node.args[:2]
            a, b = self.text(first), self.text(second)
            if a != b and not (self.is_text(first) or self.is_text(second)):
                between = self.source[self.span(first)[1] : self.span(second)[0]].decode()
                start, stop = self.span(first)[0], self.span(second)[1]
                yield Mutation(self.path, start, stop, f"{b}{between}{a}", "swapped")

    def statements(self, node: ast.AST, index: bool | str) -> Iterator[Mutation]:
        to_place = isinstance(node, ast.Assign) and all(
            isinstance(target, ast.Subscript | ast.Attribute) for target in node.targets
        )
        speaks = isinstance(node, ast.Expr) and not isinstance(node.value, ast.Call)  # a docstring
        leaves = isinstance(node, ast.Return | ast.Continue | ast.Break | ast.AugAssign)
        if to_place or leaves or (isinstance(node, ast.Expr) and not speaks):
            yield self.replaced(node, "pass", "removed")

    def has_edge(self, *sides: ast.expr) -> bool:
        """Say whether one side is a number or a size, so that a test can meet the edge between them."""
        texts = [self.text(side) for side in sides]
        sizes = any(text.endswith((".size", ".ndim")) or text.startswith("len(") for text in texts)
        return sizes or (
            self.exact and any(isinstance(ast.parse(text, mode="eval").body, ast.Constant) for text in texts)
        )

    def is_text(self, node: ast.AST) -> bool:
        if isinstance(node, ast.BinOp):
            return self.is_text(node.left) or self.is_text(node.right)
        return isinstance(node, ast.JoinedStr) or (
            isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
        )
