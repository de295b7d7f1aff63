"""Which laws have their loops compiled in a test: one of a kind. The others run in the plain interpreter, as `.ci/run` does."""

from __future__ import annotations

from collections.abc import Iterable

import numba
import pytest

FEW = ("stribeck-gauss", "polyline", "m6", "lugre", "gms", "decaying")
PLAIN = pytest.mark.skipif(
    not numba.config.DISABLE_JIT, reason="runs with NUMBA_DISABLE_JIT=1, as .ci/run does"
)


def one_of_a_kind(names: Iterable[str]) -> list[str]:
    """Return the names whose loops are compiled in a test; without the compiler, all."""
    return [name for name in names if name in FEW or numba.config.DISABLE_JIT]


def of_a_kind(names: Iterable[str], *more: object) -> list:
    """Return a case of a test for each name, with more arguments behind it."""
    return [pytest.param(name, *more, marks=() if name in FEW else PLAIN) for name in names]
