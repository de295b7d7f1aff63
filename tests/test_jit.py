"""Tests for _jit.py: an edited kernel is never answered from an old cache."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.caching import NullCache

import backdrive
from backdrive import _jit
from backdrive.laws import kernels
from backdrive.laws.rates import coulomb_viscous

SCRIPT = """
import numpy as np
from backdrive.laws import CoulombViscous, Law
law = Law(rate=CoulombViscous(coulomb_positive=1.0, coulomb_negative=1.0, viscous_positive=2.0))
print(float(law.torque(3.0)))
"""


def run(root: Path, cache: Path) -> str:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(root), "NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_an_edited_law_is_recompiled_through_its_callers(tmp_path):
    package = tmp_path / "root" / "backdrive"
    source = Path(backdrive.__file__).parent
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    cache = tmp_path / "cache"
    assert run(package.parent, cache) == "7.0"
    assert list(cache.rglob("*.nbi")), "the first run should have filled the cache"
    law = package / "laws" / "rates" / "coulomb_viscous.py"
    text = law.read_text()
    assert "sigma_p * v" in text
    law.write_text(text.replace("sigma_p * v", "10.0 * sigma_p * v"))
    assert run(package.parent, cache) == "61.0"


@pytest.mark.skipif(
    os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="needs both the compiled and the plain kernel"
)
def test_compiled_and_plain_kernels_agree_to_the_last_bit():
    p = np.array([4.0, 1.5, 2.0, 0.3, 0.4])
    for v in (-2.0, -0.0, 0.0, 1e-9, 3.0, np.nan):
        got = coulomb_viscous.limits(p, v, np.zeros(2), np.nan)
        expected = coulomb_viscous.limits.py_func(p, v, np.zeros(2), np.nan)
        assert np.array_equal(got, expected, equal_nan=True)


def test_an_unknown_kind_gives_nan_and_not_an_old_number():
    row = np.array([0.0])
    assert np.isnan(kernels.step(99, 0, row, np.zeros(1), 1.0, 1.0, np.zeros(2), 0.0))


@pytest.mark.skipif(not _jit.COMPILED, reason="needs the compiler")
def test_a_loop_that_asks_for_the_widest_registers_is_compiled_with_them():
    def both(a, b):
        _jit.widest()
        for i in range(a.size):
            b[i] = 2.0 * a[i]

    def usual(a, b):
        for i in range(a.size):
            b[i] = 2.0 * a[i]

    texts = []
    for function in (both, usual):
        compiled = _jit.specialise(function, 0)
        compiled._cache = NullCache()  # what comes from a cache shows nothing
        x, y = np.arange(5.0), np.empty(5)
        compiled(x, y)
        assert np.array_equal(y, 2.0 * x)
        texts.append("".join(compiled.inspect_llvm().values()))
    assert ['"prefer-vector-width"="512"' in text for text in texts] == [True, False]
