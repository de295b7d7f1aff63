"""The kernels along rows of inputs: compiled where the compiler is on, plain otherwise."""

from __future__ import annotations

import inspect
from collections.abc import Callable

import numpy as np

from backdrive._jit import jit
from backdrive.control import JointLoop, Loop
from backdrive.control.loop_kernel import tick
from backdrive.control.table import APPLIED, CAUSE, ERROR, EXTERNAL, FRICTION, KNOWN, LEVEL, LOAD, TORQUE
from backdrive.export.parts import Part


def _runner(part: Part, columns: list[str], kept: list[int]) -> Callable:
    """Return a loop of a part's kernel over rows of inputs, written for its arguments."""
    arrays = [
        a
        for a in dict.fromkeys(part.arguments)
        if isinstance(a, str) and (a in part.constants or a in part.states)
    ]
    words = []
    for a in part.arguments:
        if isinstance(a, int):
            words.append(str(a))
        elif a in arrays:
            words.append(f"a_{a}")
        elif a == "load":
            words.append(
                f"(rows[k, {columns.index('load_motor')}], rows[k, {columns.index('load_external')}])"
            )
        elif a == "idle":
            words.append(f"rows[k, {columns.index(a)}] != 0.0")
        else:
            words.append(f"rows[k, {columns.index(a)}]")
    stores = "; ".join(f"out[k, {at}] = r[{i}]" for at, i in enumerate(kept)) or "out[k, 0] = r"
    text = (
        f"def run({', '.join(f'a_{a}' for a in arrays)}, rows, out):\n    for k in range(rows.shape[0]):\n"
        f"        r = kernel({', '.join(words)})\n        {stores}\n"
    )
    space = {"kernel": part.kernel}
    exec(text, space)  # the text is made above, of names of ours
    return jit_without_cache(space["run"])


def jit_without_cache(function: Callable) -> Callable:
    """Compile as `jit` does, where there is no file that a cache could be named after."""
    from backdrive._jit import COMPILED

    if not COMPILED:
        return function
    import numba

    return numba.njit(error_model="numpy")(function)


def along(part: Part, columns: list[str], rows: np.ndarray, kept: list[int]) -> np.ndarray:
    """Return what a part's kernel gives along rows of inputs: those of a tuple that are `kept`, or its only number."""
    kernel = getattr(part.kernel, "py_func", part.kernel)
    assert len(inspect.signature(kernel).parameters) == len(part.arguments)
    arrays = {n: np.array(v, dtype=float) for n, v in (part.constants | part.states).items()}
    names = [a for a in dict.fromkeys(part.arguments) if isinstance(a, str) and a in arrays]
    values = [np.concatenate([arrays[n], np.zeros(len(arrays[n]))]) if n == "x" else arrays[n] for n in names]
    out = np.empty((len(rows), max(len(kept), 1)))
    with np.errstate(all="ignore"):
        _runner(part, columns, kept)(*values, rows, out)
    return out


@jit
def _loop(A, o, g, codes, q, u, dt, more, out):
    for k in range(q.shape[0]):
        for j in range(q.shape[1]):
            g[j, APPLIED] = u[k, j]
            g[j, ERROR], g[j, KNOWN], g[j, LOAD] = more[k, j, 0], more[k, j, 1], more[k, j, 2]
        tick(A, o, g, codes, q[k], dt[k])
        for j in range(q.shape[1]):
            out[k, j, 0], out[k, j, 1], out[k, j, 2] = g[j, TORQUE], g[j, EXTERNAL], g[j, FRICTION]
            out[k, j, 3], out[k, j, 4], out[k, j, 5] = g[j, LEVEL], g[j, CAUSE], codes[j]


class loop_along:
    """A loop that runs along rows of inputs.

    Args:
        joints: by name.
        interval: period [s].
    """

    def __init__(self, joints: dict[str, JointLoop], interval: float):
        self.loop = Loop(list(joints.values()), interval=interval)

    def __call__(self, q: np.ndarray, u: np.ndarray, dt: np.ndarray, more: np.ndarray) -> np.ndarray:
        out = np.empty((*q.shape, 6))
        with np.errstate(all="ignore"):
            _loop(*self.loop._arrays, q, u, dt, more, out)
        return out
