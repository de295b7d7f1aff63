"""Time of the kernels' elementary functions beside the C library's, as numba calls it, in a loop over an array [ns a value]."""

from __future__ import annotations

import time

import numpy as np
from numba import njit

from backdrive import elementary

REPEATS = 15


def compiled(function):
    """Return a function of numpy's as numba calls it."""

    @njit
    def call(x):
        return function(x)

    return call


#: Name -> ours, the library's, and the arguments.
FUNCTIONS = {
    "exp": (elementary.exp, compiled(np.exp), (-20.0, 5.0)),
    "tanh": (elementary.tanh, compiled(np.tanh), (-20.0, 5.0)),
    "sin": (elementary.sin, compiled(np.sin), (-20.0, 5.0)),
    "cos": (elementary.cos, compiled(np.cos), (-20.0, 5.0)),
    "pow": (njit(lambda x: elementary.pow(x, 1.7)), njit(lambda x: x**1.7), (0.0, 20.0)),
    "log": (elementary.log, compiled(np.log), (0.0, 20.0)),
}


def cost(function, x: np.ndarray) -> float:
    """Return the least processor time of a value [ns]."""

    @njit(error_model="numpy")
    def along(x, out):
        for i in range(x.size):
            out[i] = function(x[i])

    out, least = np.empty_like(x), np.inf
    along(x, out)
    for _ in range(REPEATS):
        begun = time.process_time()
        along(x, out)
        least = min(least, time.process_time() - begun)
    return 1e9 * least / x.size


def main() -> None:
    """Time each and print a line."""
    random = np.random.default_rng(0)
    for name, (ours, library, ends) in FUNCTIONS.items():
        x = random.uniform(*ends, 100_000)
        print(f"{name:5s} {cost(ours, x):6.2f} ns, the library's {cost(library, x):6.2f} ns")


if __name__ == "__main__":
    main()
