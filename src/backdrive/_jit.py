"""The package's only numba decorator, with a disk cache that is invalidated when any kernel changes.

Numba's own cache checks the file of the compiled function only, not the files of the functions that it calls. After an edit in
such a file it returns the old numbers. Here the stamp of the cache is a digest of every file that holds a kernel, or that such
a file imports. An edit anywhere in them recompiles. The stamp hooks into numba's internals (`_jit_cache`). If a release of
numba has moved them, every process compiles its functions anew: slower, but never out of date.
"""

from __future__ import annotations

import hashlib
import os
import re
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba as nb

Kernel = Callable[..., Any]
F = TypeVar("F", bound=Kernel)

KERNEL = b"from backdrive._jit import"
IMPORT = re.compile(rb"^ *(?:from|import) (backdrive[\w.]*)(?: import \(?([\w, ]+))?", re.MULTILINE)


@cache
def kernel_digest() -> str:
    """Return the sha256 over all sources that hold a kernel, and all that these import, names included."""
    total = hashlib.sha256(nb.__version__.encode())
    for name, source in kernel_sources(Path(__file__).parent).items():
        total.update(name.encode())
        total.update(source)
    return total.hexdigest()


def kernel_sources(root: str | Path) -> dict[str, bytes]:
    """Return path -> content of the files of a package that hold a kernel and of those that these import, in order.

    A kernel keeps the numbers of the modules that it was compiled with, not only the functions: so imports count.

    Args:
        root: folder of the package.
    """
    sources = {}
    for folder, _, files in os.walk(root):
        within = os.path.relpath(folder, root).replace(os.sep, "/").removeprefix(".").lstrip("/")
        for file in files:
            if file.endswith(".py"):
                with open(os.path.join(folder, file), "rb") as stream:
                    sources[f"{within}/{file}".lstrip("/")] = stream.read()
    waiting = [name for name, source in sources.items() if KERNEL in source]
    reached = {"_jit.py"}
    while waiting:
        name = waiting.pop()
        if name in reached:
            continue
        reached.add(name)
        for module, members in IMPORT.findall(sources[name]):
            stem = module.decode().removeprefix("backdrive").removeprefix(".").replace(".", "/")
            stems = [stem, *(f"{stem}/{m.strip()}".strip("/") for m in members.decode().split(","))]
            waiting += [f for s in stems for f in (f"{s}.py", f"{s}/__init__.py") if f in sources]
    return {name: sources[name] for name in sorted(reached)}


#: Whether kernels are compiled in this process.
COMPILED = not nb.config.DISABLE_JIT  # type: ignore[attr-defined]


def _bits() -> tuple[Callable[[float], int], Callable[[int], float]]:
    """Return the two functions that read a double's 64 bits as an integer, and an integer as a double's bits."""
    if not COMPILED:
        return (
            lambda x: struct.unpack("<q", struct.pack("<d", x))[0],
            lambda i: struct.unpack("<d", struct.pack("<Q", i % (1 << 64)))[0],
        )
    from numba.extending import intrinsic

    def cast(target: Any) -> Kernel:
        def typing(context, value):
            def generate(context, builder, signature, arguments):
                return builder.bitcast(arguments[0], context.get_value_type(target))

            return target(nb.int64 if target == nb.float64 else nb.float64), generate

        return intrinsic(typing)

    return cast(nb.int64), cast(nb.float64)


to_bits, from_bits = _bits()


def _part() -> Callable[..., Any]:
    """Return the function that views a part of a row of a table, `table[row, begin:end]`, and looks at no bounds."""
    if not COMPILED:
        return lambda table, row, begin, end: table[row, begin:end]
    from numba.core import cgutils
    from numba.extending import intrinsic

    def typing(context, table, row, begin, end):
        view = nb.types.Array(table.dtype, 1, "C", readonly=not table.mutable)

        def generate(context, builder, signature, arguments):
            whole = context.make_array(table)(context, builder, arguments[0])
            part = context.make_array(view)(context, builder)
            begins = builder.add(
                builder.mul(arguments[1], cgutils.unpack_tuple(builder, whole.shape, 2)[1]), arguments[2]
            )
            context.populate_array(
                part,
                data=builder.gep(whole.data, [begins], inbounds=True),
                shape=[builder.sub(arguments[3], arguments[2])],
                strides=[whole.itemsize],
                itemsize=whole.itemsize,
                meminfo=whole.meminfo,
                parent=whole.parent,
            )
            return part._getvalue()

        whole_numbers = [nb.int64] * 3
        return view(table, *whole_numbers), generate

    return intrinsic(typing)


part = _part()


def _widest() -> Callable[..., Any]:
    """Return the function that lets the compiler use the machine's widest registers in the function that calls it.

    On processors with registers of 512 bits, LLVM uses 256 bits unless told otherwise. No result depends on it.
    """
    if not COMPILED:
        return lambda: None
    from numba.extending import intrinsic

    def typing(context):
        def generate(context, builder, signature, arguments):
            attributes: Any = builder.function.attributes  # a set whose own `add` knows none with a value
            with suppress(TypeError):  # another llvmlite: slower, no less right
                set.add(attributes, '"prefer-vector-width"="512"')
            return context.get_dummy_value()

        return nb.types.none(), generate

    return intrinsic(typing)


widest = _widest()


def jit(function: F) -> F:
    """Compile `function` without fastmath (a NaN stays a NaN) and cache it on disk.

    Kernels allocate nothing, so numba's reference counting is off: its atomic operations cost several times what a
    law does. With NUMBA_DISABLE_JIT=1 the plain function is returned, so that the same tests run on both.
    """
    return _compile(function)


def leaf(function: F) -> F:
    """Compile as `jit` does, and inline the function wherever it is called: for what is called every tick.

    Do not use it for functions that call the selection of laws more than once, since the code would become too large to
    compile.
    """
    return _compile(function, forceinline=True)


def ladder(function: F) -> F:
    """Compile as `jit` does, and write the body out wherever it is called, before its types are known.

    If the integers of its branches are constants of the caller, the other branches are removed, and the functions called
    there are never compiled.
    """
    return _compile(function, inline="always")


def by_python(function: F) -> F:
    """Mark a function that Python calls too: a kernel that calls it first has its wrapper for Python made as well."""
    vars(function)["by_python"] = True
    return function


def entry(kernel: F, *arguments: Any) -> F:
    """Return what a kernel runs for arguments of some types, without a look at the types at every call.

    Args:
        kernel: made by `jit`, `leaf` or `specialise`.
        arguments: such as it will be called with; it is called once.
    """
    kernel(*arguments)
    compiled = list(getattr(kernel, "overloads", {}).values())
    return getattr(compiled[0], "entry_point", kernel) if len(compiled) == 1 else kernel


#: What `choice` has made, with the kernels that it chooses among and the one of all other numbers.
CHOICES: dict[Kernel, tuple[Mapping[int, Kernel], Kernel]] = {}


def choice(kernels: Mapping[int, Kernel], otherwise: Kernel) -> Kernel:
    """Return `f(number, arguments)`, which hands a tuple of arguments to the kernel of a number, written out as a `ladder` is.

    Args:
        kernels: by number.
        otherwise: kernel of all other numbers.
    """
    chosen: Any = ladder(lambda number, arguments: kernels.get(number, otherwise)(*arguments))
    if COMPILED:
        numbers = list(kernels)
        chosen = ladder(lambda number, arguments: otherwise(*arguments))
        for i in range(0, len(numbers), 4):
            chosen = _four([(n, kernels[n]) for n in numbers[i : i + 4]], otherwise, chosen)
    CHOICES[chosen] = (kernels, otherwise)
    return chosen


def _four(kernels: list[tuple[int, Kernel]], otherwise: Kernel, below: Kernel) -> Kernel:
    """Four at once, for the compiler's work grows with the square of how deep one stands in another."""
    (a, of_a), (b, of_b), (c, of_c), (d, of_d) = (*kernels, *[(-1, otherwise)] * (4 - len(kernels)))

    def four(number, arguments):
        if number == a:
            return of_a(*arguments)
        if number == b:
            return of_b(*arguments)
        if number == c:
            return of_c(*arguments)
        if number == d:
            return of_d(*arguments)
        return below(number, arguments)

    return ladder(four)


def specialise(function: F, *kinds: int) -> F:
    """Compile a closure over the integers `kinds`, a loop of its own for each of their values.

    The compiler may assume that output arrays do not overlap other arguments. So parameters stay in registers; otherwise they
    would be read again in every tick, after each store to the output. `kinds` are part of the cache file's name, so that two
    processes can fill the cache at once.
    """
    function.__qualname__ = "_".join([function.__name__, *(str(kind) for kind in kinds)])
    compiled: Any = _compile(function)
    try:
        compiler, usual = compiled._compiler, compiled._compiler._customize_flags

        def apart(flags):
            flags = usual(flags)
            if hasattr(flags, "noalias"):
                flags.noalias = True
            return flags

        compiler._customize_flags = apart
    except AttributeError:  # slower, no less right
        pass
    return compiled


def _compile(function: F, **wanted: Any) -> F:
    if not COMPILED:
        return function
    from numba.core.options import DefaultOptions

    options: Any = {"_nrt": False} | wanted
    options = {name: value for name, value in options.items() if hasattr(DefaultOptions, name)}
    compiled: Any = nb.njit(error_model="numpy", nogil=True, **options)(function)
    with suppress(ImportError, AttributeError, TypeError):  # slower to compile, no less right
        from backdrive._jit_inner import without_wrappers

        without_wrappers(compiled)
    stamped = _stamp_cache(function)
    if stamped is not None:
        compiled._cache = stamped
    return compiled


def _stamp_cache(function: Kernel):
    try:
        from backdrive._jit_cache import cache_of

        return cache_of(function, kernel_digest())
    except (ImportError, AttributeError, TypeError):
        return None
