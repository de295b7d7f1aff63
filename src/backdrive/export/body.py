"""The translation of one kernel for given knowledge of its arguments."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive import elementary
from backdrive.control.table import is_set
from backdrive.export.code import Assign, declare, lines, merge, prune, reads, walk
from backdrive.export.expressions import DEAD, number_of
from backdrive.export.function import Function
from backdrive.export.results import Results
from backdrive.export.statements import c_name
from backdrive.export.values import (
    LONG,
    PLACE,
    PRIMARY,
    REAL,
    WIDE,
    Array,
    Const,
    Scalar,
    Several,
    Table,
    Untranslatable,
    Value,
)
from backdrive.laws.rates import polyline

if TYPE_CHECKING:
    from backdrive.export.program import Program

INTERVALS, TIMED = ("dt", "T"), ("loop_kernel", "readings", "guard")
RARE = ("restart", "jump_status", "relax", "adapt", "acknowledge", "unusual_power", "solve")
APART = ("shift",)  # rare, and called from several places
MOVES = ("by",)  # shifts of positions, with the same precision as positions
ONE_AT_A_TIME = {polyline.section: polyline.section_of_one}  # in place of what is written for vectors
CASTS = {elementary.integer_of: LONG, elementary.double_of: WIDE}  # of the last argument, likewise
OF_FLOATS = {getattr(elementary, name): f"{name}f" for name in ("exp", "log", "pow", "tanh", "sin", "cos")}
OF_FLOATS[elementary.decay] = "expf"


class Body(Results):
    """The translation of one kernel for some arguments."""

    def __init__(self, program: Program, source: FunctionType, arguments: Sequence[Value], inner: bool):
        super().__init__(program.spelling, source.__globals__, {})
        self.program, self.source, self.arguments, self.inner = program, source, arguments, inner
        tree = ast.parse(textwrap.dedent(inspect.getsource(source))).body[0]
        if not isinstance(tree, ast.FunctionDef):
            raise Untranslatable(source.__name__)
        self.tree = tree
        closure = inspect.getclosurevars(source).nonlocals
        self.globals = {**source.__globals__, **closure}

    def function(self) -> Function:
        """Translate twice: the first pass determines the kind of every variable."""
        for _ in range(2):
            self._begin()
            self.run(self.tree.body)
            self.kinds = self.kinds_seen
        return self._finish()

    def _begin(self) -> None:
        self.made = Function("")
        self.block, self.returns, self.env, self.kinds_seen = [], [], {}, {}
        self.temporaries, self.written = 0, set()
        self.parameters = []
        names = [a.arg for a in self.tree.args.args]
        if len(names) != len(self.arguments):
            raise Untranslatable(f"{self.source.__name__}: {len(self.arguments)} arguments for {len(names)}")
        for name, value in zip(names, self.arguments, strict=False):
            self.env[name] = self._parameter(name, value)

    def _parameter(self, name: str, value: Value) -> Value:
        if isinstance(value, Const):
            return value
        if isinstance(value, Several):
            return Several(tuple(self._parameter(f"{name}_{i}", v) for i, v in enumerate(value.items)))
        if isinstance(value, Table):
            self.parameters += [("table", "g"), ("settings", "k")]
            return value
        kind = self._kind(name, value)
        name = c_name(name)
        if isinstance(value, Array):
            self.parameters.append((f"{self.spelling.type_name(value.kind)} *", name))
            if value.places and self.spelling.single:
                self.parameters.append(("double *", f"{name}_at"))
            if value.own >= value.begin:
                self.parameters.append((f"{self.spelling.type_name(value.kind)} *", f"{name}_own"))
            content = None if value.content is None else value.content[value.begin :]
            places = frozenset(i - value.begin for i in value.places if i >= value.begin)
            own = max(value.own - value.begin, -1)
            dead = frozenset(i - value.begin for i in value.dead if i >= value.begin)
            made = replace(value, name=name, begin=0, content=content, own=own, dead=dead, places=places)
            return replace(made, names=frozenset())
        self.parameters.append((self.spelling.type_name(kind), name))
        self.kinds_seen[name] = kind
        return Scalar(name, kind, names=frozenset({name}), known=value.known)

    def _kind(self, name: str, value: Value) -> str:
        """Return the kind of a parameter: times that measure a fault are summed in doubles, other times are reals."""
        kind = getattr(value, "kind", REAL)
        apart = self.source.__module__.rsplit(".", 1)[-1] in TIMED
        return REAL if kind == PLACE and name in INTERVALS and not apart else kind

    def _finish(self) -> Function:
        made = self.made
        made.title = _title(self.source)
        made.macro = self._macro()
        self.results()
        prune(self.block)
        merge(self.block)
        while self.block and self.block[-1] and getattr(self.block[-1], "word", "") == "return":
            last = self.block[-1]
            if getattr(last, "value", None) is not None:
                break
            self.block.pop()
        used = frozenset().union(*(reads(s) for s in walk(self.block))) | {
            s.name for s in walk(self.block) if isinstance(s, Assign)
        }
        made.parameters = [(self._type(t, n), n) for t, n in self.parameters if n in used]
        declare(self.block, {n for _, n in self.parameters})
        made.body = list(lines(self.block))
        made.written = frozenset(self.written)
        made.effect = bool(self.written)
        return made

    def _macro(self) -> str:
        """Return how the function is defined: inline, as one function, or as the compiler decides."""
        name = self.source.__name__
        if not self.program.inlines or name in RARE:
            return "static inline"
        return f"{self.program.prefix.upper()}_{'APART' if name in APART else 'INLINE'}"

    def _type(self, type_: str, name: str) -> str:
        if type_ == "table":
            return (
                f"{self.program.prefix}_joint *"
                if name in self.written
                else f"const {self.program.prefix}_joint *"
            )
        if type_ == "settings":
            return f"const {self.program.prefix}_settings *"
        return f"const {type_}" if type_.endswith("*") and name not in self.written else type_

    def call(self, function: Callable, arguments: list[Value], hint: str = "") -> Value:
        """Return the value of a call of a kernel, which is translated for these arguments."""
        if function in OF_FLOATS and all(isinstance(a, Const) for a in arguments):
            return Const(getattr(function, "py_func", function)(*(number_of(a) for a in arguments)))
        if function in OF_FLOATS and self.spelling.single:
            (first, *_), name = arguments, OF_FLOATS[function]
            if (
                name in ("sinf", "cosf") and getattr(first, "kind", REAL) == PLACE
            ):  # in turns first, as a double
                return self.helper(f"{name}_wide", REAL, [self.spelling.scalar(first)])
            parts = [self.spelling.scalar(a, REAL) for a in arguments]
            text = f"{name}({', '.join(p.text for p in parts)})"
            return self.spelling.join(text, REAL, PRIMARY, parts)
        if function is is_set:
            return self.compare(ast.Gt, arguments[0], Const(0.0))
        function = ONE_AT_A_TIME.get(function, function)
        if function in CASTS:
            kind, number = CASTS[function], number_of(arguments[-1])
            known = None if number is None else int(number) if kind == LONG else float(number)
            return replace(self.spelling.scalar(self.spelling.scalar(arguments[-1]), kind), known=known)
        source = getattr(function, "py_func", function)
        names = inspect.signature(source).parameters
        arguments = [
            a.exact if n in MOVES and isinstance(a, Scalar) and a.exact is not None else a
            for n, a in zip(names, arguments, strict=False)
        ]
        made = self.program.translate(function, arguments, inner=True)
        if made.result != "void" or made.effect:
            self.made.calls.append(made)
        return self._call_of(made, arguments, source)

    def _call_of(self, made: Function, arguments: list[Value], source: FunctionType) -> Value:
        names = list(inspect.signature(source).parameters)
        given: dict[str, Scalar] = {}
        for name, value in zip(names, arguments, strict=False):
            self._give(c_name(name), name, value, given, made.parameters)
        parts = [given[n] for _, n in made.parameters]
        text = f"{made.name}({', '.join(p.text for p in parts)})"
        for n in made.written:
            if n in given:
                self.written |= {next(iter(given[n].names))} if len(given[n].names) == 1 else given[n].names
        memory = frozenset(f"{n}[]" for p in parts for n in p.names if p.kind == "pointer")
        names_read = frozenset().union(*(p.names for p in parts))
        kind = made.kind if made.result != "void" else REAL
        call = Scalar(text, kind, PRIMARY, names_read, memory)
        return self.result_of_call(made, call, given)

    def _give(
        self, name: str, plain: str, value: Value, given: dict[str, Scalar], parameters: list[tuple[str, str]]
    ) -> None:
        if isinstance(value, Several):
            for i, each in enumerate(value.items):
                self._give(c_name(f"{plain}_{i}"), f"{plain}_{i}", each, given, parameters)
        elif isinstance(value, Table):
            given["g"] = Scalar("g", "pointer", names=frozenset({"g"}))
            given["k"] = Scalar("k", REAL, names=frozenset({"k"}))
        elif isinstance(value, Array):
            text = f"{value.name} + {value.begin}" if value.begin else value.name
            root = value.names | ({value.name} if value.name.isidentifier() else set())
            kind = "pointer" if value.content is None else REAL
            given[name] = Scalar(text, kind, names=frozenset(root))
            if value.places and self.spelling.single:
                rank = sum(i < value.begin for i in value.places)
                text = f"{value.name}_at + {rank}" if rank else f"{value.name}_at"
                given[f"{name}_at"] = Scalar(text, kind, names=frozenset({f"{value.name}_at"}))
            if value.own >= value.begin:
                own = f"{value.name}_own"
                given[f"{name}_own"] = Scalar(own, "pointer", names=frozenset({own}))
        elif isinstance(value, Scalar):
            made = next((t for t, n in parameters if n == name), "")
            given[name] = (
                self.spelling.scalar(value, REAL) if made == self.spelling.type_name(REAL) else value
            )

    def bind(self, target: ast.expr, value: Value) -> None:
        """Give a target its value, and note which array it is in."""
        super().bind(target, value)
        if isinstance(target, ast.Subscript):
            self._note(target)

    def _augassign(self, node: ast.AugAssign) -> None:
        super()._augassign(node)
        if isinstance(node.target, ast.Subscript):
            self._note(node.target)

    def _note(self, target: ast.Subscript) -> None:
        base = self.env.get(target.value.id) if isinstance(target.value, ast.Name) else None
        if isinstance(base, Array):
            at = len(self.block)
            place = self.value(target)
            del self.block[at:]
            if isinstance(place, Scalar) and place.text != DEAD:
                self.written.add(place.text.split("[")[0])
        else:
            self.written.add("g")

    def _name(self, node: ast.Name) -> Value:
        value = super()._name(node)
        if isinstance(value, Const) and node.id not in self.env:
            return replace(value, name=self.program.symbols.get(node.id, node.id))
        return value

    def array(self, name: str, value: Any) -> Array:
        """Return a table of numbers and add it to the program."""
        numbers = np.asarray(value)
        whole = numbers.dtype.kind == "i"
        full = f"{self.program.prefix}_{name}"
        self.program.tables[full] = numbers
        self.made.tables.add(full)
        content = tuple(map(tuple, numbers.tolist())) if numbers.ndim == 2 else tuple(numbers.tolist())
        rows = numbers.shape[1] if numbers.ndim == 2 else 0
        return Array(
            full, numbers.shape[0], content=content, rows=rows, writeable=False, kind=LONG if whole else WIDE
        )

    def helper(self, name: str, kind: str, parts: list[Scalar]) -> Scalar:
        """Return a call of one of the few functions that a header brings along."""
        name = name if self.spelling.single else name.removesuffix("_wide")
        full = f"{self.program.prefix}_{name}"
        self.made.helpers.add(name)
        return self.spelling.join(f"{full}({', '.join(p.text for p in parts)})", kind, PRIMARY, parts)


def _title(source: FunctionType) -> str:
    doc = inspect.getdoc(source) or ""
    return doc.split("\n\n")[0].replace("\n", " ").replace("`", "").replace("*/", "* /")
