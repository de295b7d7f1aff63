"""What a kernel is compiled to where other kernels call it: the code alone, without what Python needs to call it.

Numba makes two wrappers for every function, one for calls from Python and one with a plain C signature. They take a quarter of
the compiler's time, and a function that only kernels call needs neither. The C wrapper is never made, since no kernel is passed
to another as an argument. The Python wrapper is made when Python first calls the function, which is compiled again for that.

While numba infers types, it compares the options of the compilation thousands of times, each time through a property for every
one of thirty options. That is up to a fifth of its time, so the options of kernels compare what is set (`QuickFlags`).
"""

from __future__ import annotations

from threading import local
from typing import Any

from numba.core import sigutils
from numba.core.compiler import Flags
from numba.core.registry import CPUDispatcher

_state = local()


def is_inner(function: Any) -> bool:
    """Return whether this thread compiles a function for a kernel alone: not for Python, and not marked as `by_python`."""
    return getattr(_state, "depth", 0) > 0 and not hasattr(function, "by_python")


class QuickFlags(Flags):
    """Options of a compilation whose values are found at once; they are equal, and hash, as numba's own."""

    __slots__ = ()
    _defaults = {name: option.default for name, option in Flags.options.items()}
    _hash = hash(Flags())

    def values(self):
        """Return a dict of all values."""
        return {**self._defaults, **self._values}

    def __eq__(self, other):
        if type(other) is QuickFlags and self._values == other._values:
            return True
        return super().__eq__(other)

    def __hash__(self):
        return self._hash


class Inner(CPUDispatcher):
    """A compiled function that gets a wrapper for Python only once Python calls it."""

    inner: set[tuple]  # signatures that only kernels can call

    def get_call_template(self, args, kws):
        """Compile for a kernel that calls this one."""
        _state.depth = getattr(_state, "depth", 0) + 1
        try:
            return super().get_call_template(args, kws)
        finally:
            _state.depth -= 1

    def compile(self, sig):
        """Compile for a signature, anew where only kernels could call what there is."""
        args = tuple(sigutils.normalize_signature(sig)[0])
        if not is_inner(self.py_func) and args in self.inner:
            self.inner.discard(args)
            self.overloads.pop(args, None)
        return super().compile(sig)

    def add_overload(self, cres):
        """Add what was compiled; Python finds it only if it has a wrapper."""
        if not is_inner(self.py_func):
            super().add_overload(cres)
            return
        args = tuple(cres.signature.args)
        self.inner.add(args)
        self.overloads[args] = cres


def without_wrappers(compiled: Any) -> None:
    """Have a compiled function made without wrappers that nobody calls.

    Raises:
        AttributeError, TypeError: numba's internals have moved.
    """
    compiler, usual = compiled._compiler, compiled._compiler._customize_flags

    def thin(flags):
        quick: Any = QuickFlags(usual(flags))
        quick.no_cfunc_wrapper = True
        quick.no_cpython_wrapper = is_inner(compiled.py_func)
        return quick

    compiled.inner = set()
    compiled.__class__ = Inner
    compiler._customize_flags = thin
