"""Tests for _jit_inner.py: a kernel that kernels call has no wrapper for Python until Python calls it, cached or not."""

import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="needs the compiler")

KERNELS = """
from backdrive._jit import by_python, jit, leaf
@leaf
def half(x):
    return 0.5 * x
@jit
def third(x):
    return x / 3.0
@jit
@by_python
def fifth(x):
    return x / 5.0
@jit
def both(x):
    return half(x) + third(x) + 0.0 * fifth(x)
"""
SCRIPT = """
import json, sys
from numba.core import event
compiled = []
class Note(event.Listener):
    def on_start(self, e):
        compiled.append(e.data["dispatcher"].py_func.__name__)
    def on_end(self, e):
        pass
event.register("numba:compile", Note())
from made import both, fifth, half, third
from numba import float64
def inner():
    return sorted(kernel.__name__ for kernel in (fifth, half, third, both) if (float64,) in kernel.inner)
said = [both(6.0), inner()]
said += [half(6.0), third(6.0), both(6.0), fifth(5.0), inner()]
print(json.dumps([said, compiled]))
"""


def run(folder):
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment |= {
        "PYTHONPATH": os.pathsep.join([str(folder), *sys.path]),
        "NUMBA_CACHE_DIR": str(folder / "cache"),
    }
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_python_may_call_what_was_compiled_for_kernels_and_both_are_cached(tmp_path):
    (tmp_path / "made.py").write_text(KERNELS)
    said, compiled = run(tmp_path)
    assert said == [5.0, ["half", "third"], 3.0, 2.0, 5.0, 1.0, []]
    assert sorted(compiled) == [
        "both",
        "fifth",
        "half",
        "half",
        "third",
        "third",
    ]  # two once more, for Python
    said, compiled = run(tmp_path)  # the cache holds both kinds
    assert said[0] == 5.0
    assert said[2:6] == [3.0, 2.0, 5.0, 1.0]
    assert compiled == []


def test_the_options_of_kernels_are_those_of_numba():
    from numba.core.compiler import Flags

    from backdrive._jit_inner import QuickFlags

    usual = Flags()
    quick = QuickFlags(usual)
    assert (
        quick == usual and usual == quick and hash(quick) == hash(usual) and quick.values() == usual.values()
    )
    quick.nrt = not usual.nrt
    assert quick != usual and usual != quick and quick != QuickFlags(usual)
    usual.nrt = quick.nrt
    assert quick == usual and quick.values() == usual.values() and quick == quick.copy() and quick != 1
    default = QuickFlags()
    default.nrt = Flags().nrt  # set to what it is anyway
    assert default == QuickFlags() and default.get_mangle_string() == QuickFlags(default).get_mangle_string()
