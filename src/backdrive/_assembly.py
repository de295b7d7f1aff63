"""Kernels for laws and parts that are known: made from the source of the general ones, with every choice made beforehand.

A general kernel checks at every tick which law, estimator or dither a row asks for. All of them are compiled before its first
tick. `assemble` compiles the same code with some names replaced. A `choice` becomes the one kernel that it would choose, a set
of kinds becomes all or none of them, and a kernel becomes an assembled one. What the kernel calls is made anew where it leads
to one of these names, and shared as it is where it does not. The numbers are the same bit for bit, for the code is the same.

Assembled kernels are cached on disk as all others, under a name that says what was put in. Without a compiler the general kernel
is returned.
"""

from __future__ import annotations

import dis
import hashlib
from collections.abc import Mapping
from functools import cache
from types import FunctionType, ModuleType
from typing import Any

from backdrive._jit import CHOICES, COMPILED, F, Kernel, choice, jit, ladder, leaf

#: What takes the place of a name: key of a `choice`, a kernel or ("module", "NAME") -> what stands there instead.
Parts = Mapping[Any, Any]

_made: dict[tuple, Any] = {}


def assemble(kernel: F, parts: Parts) -> F:
    """Return a kernel with parts put in.

    Args:
        kernel: general, made by `jit`, `leaf` or `ladder`.
        parts: what to put in: for a `choice` the number of its kernel or a tuple of several, for a kernel another, for
            (module, name) a number.
    """
    if not COMPILED:
        return kernel
    key = (kernel, frozenset(parts.items()))
    if key not in _made:
        _made[key] = _Assembly(parts).anew(kernel)
    return _made[key]


def put_in(function: FunctionType, parts: Parts) -> FunctionType:
    """Return a plain function with parts put in, to be compiled by `specialise`, which names its cache file by what they are.

    Ladders stay ladders, written out in the function: it works on many ticks at once, and the compiler sees more of it.

    Args:
        function: that calls kernels.
        parts: as of `assemble`.
    """
    if not COMPILED:
        return function
    return _bound(function, _Assembly(parts, written_out=True).changes(function))


class _Assembly:
    """Kernels with some parts put in.

    Args:
        parts: as of `assemble`.
        written_out: ladders stay ladders.
    """

    def __init__(self, parts: Parts, written_out: bool = False):
        self.parts = parts
        self.written_out = written_out
        self.seen: dict[Any, Any] = {}

    def anew(self, kernel: Any) -> Any:
        """Return a kernel with the parts put in, itself where it leads to none of them."""
        if kernel in self.parts:
            if kernel not in self.seen:
                self.seen[kernel] = self._part(kernel)
            return self.seen[kernel]
        source = getattr(kernel, "py_func", None)
        if not isinstance(source, FunctionType):
            return kernel
        if kernel not in self.seen:
            changed = self.changes(source)
            self.seen[kernel] = self._make(kernel, source, changed) if changed else kernel
        return self.seen[kernel]

    def changes(self, source: FunctionType) -> dict[str, Any]:
        """Return the names of a kernel that stand for something else now, and for what; of a module, which of its names."""
        changed: dict[str, Any] = {}
        for name, attributes in _names(source).items():
            old = source.__globals__.get(name)
            if isinstance(old, ModuleType):
                inside = {a: self._instead(old.__name__, a, vars(old).get(a)) for a in attributes}
                inside = {a: new for a, new in inside.items() if new is not vars(old).get(a)}
                if inside:
                    changed[name] = inside
            else:
                new = self._instead(source.__module__, name, old)
                if new is not old:
                    changed[name] = new
        return changed

    def _instead(self, module: str, name: str, value: Any) -> Any:
        """Return what stands for the value of a name in a module."""
        if (module, name) in self.parts:
            return self.parts[module, name]
        return self.anew(value) if callable(value) else value

    def _part(self, kernel: Any) -> Any:
        """Return what stands for a kernel, or for a choice among several, with the parts put into these too."""
        value = self.parts[kernel]
        if kernel not in CHOICES:
            return value
        kernels, otherwise = CHOICES[kernel]
        numbers = sorted({value} if isinstance(value, int) else value)
        chosen = {number: self.anew(kernels.get(number, otherwise)) for number in numbers}
        if len(set(chosen.values())) > 1:
            key = ("choice", *chosen.items(), otherwise)
            if key not in _made:
                _made[key] = choice(chosen, otherwise)
            return _made[key]
        return _only(chosen[numbers[0]])

    def _make(self, kernel: Any, source: FunctionType, changed: dict[str, Any]) -> Any:
        """Return a kernel of some source in which names stand for something else."""
        words = (f"{name}={_label(value)}" for name, value in sorted(changed.items()))
        name = f"{source.__name__}_{_digest(_label(kernel), str(self.written_out), *words)}"
        if (source, name) not in _made:
            made = _bound(source, changed)
            made.__qualname__ = name
            options = kernel.targetoptions
            was_ladder = options.get("inline") == "always"
            compiler = jit
            if was_ladder or options.get("forceinline"):
                compiler = ladder if was_ladder and self.written_out else leaf
            _made[source, name] = compiler(made)
        return _made[source, name]


@cache
def _only(chosen: Kernel) -> Kernel:
    """Return a choice that has only one kernel."""

    def only(number, arguments):
        return chosen(*arguments)

    only.__qualname__ = f"only_{_digest(_label(chosen))}"
    return leaf(only)


@cache
def _names(source: FunctionType) -> dict[str, set[str]]:
    """Return the global names that a function uses, and what it asks of each."""
    found: dict[str, set[str]] = {}
    last = ""
    for instruction in dis.get_instructions(source):
        if instruction.opname == "LOAD_GLOBAL":
            last = instruction.argval
            found.setdefault(last, set())
        elif last and instruction.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            found[last].add(instruction.argval)
            last = ""
        elif instruction.opname != "CACHE":
            last = ""
    return found


def _bound(source: FunctionType, changed: Mapping[str, Any]) -> FunctionType:
    """Return a function of the same code in which names stand for something else."""
    names = {n: _module(source.__globals__[n], v) if isinstance(v, dict) else v for n, v in changed.items()}
    made = FunctionType(
        source.__code__,
        {**source.__globals__, **names},
        source.__name__,
        source.__defaults__,
        source.__closure__,
    )
    made.__qualname__, made.__module__ = source.__qualname__, source.__module__
    vars(made).update(vars(source))
    return made


def _module(module: ModuleType, changed: Mapping[str, Any]) -> ModuleType:
    """Return a stand-in for a module in which some names stand for something else."""
    made = ModuleType(module.__name__)
    vars(made).update({**vars(module), **changed})
    return made


def _label(value: Any) -> str:
    """Return what tells a value from all others, the same in every process."""
    if isinstance(value, dict):
        return str({n: _label(v) for n, v in sorted(value.items())})
    if value in CHOICES:
        kernels, otherwise = CHOICES[value]
        return str([(n, _label(k)) for n, k in (*kernels.items(), (-1, otherwise))])
    source = getattr(value, "py_func", None)
    return repr(value) if source is None else f"{source.__module__}.{source.__qualname__}"


def _digest(*words: str) -> str:
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]
