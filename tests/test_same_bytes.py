"""The same logs and options give the same bytes: whatever the number of threads, by command and in Python."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from backdrive import _blas

ROOT = Path(__file__).parent.parent / "src"
IN_PYTHON = """
from backdrive import identify, read_log
identify(read_log("log.npz"), method="motion").model.save("model.json")
"""
BY_COMMAND = "import sys; from backdrive.cli import main; sys.argv = ['backdrive', *sys.argv[1:]]; main()"
COMMAND = ("identify", "log.npz", "--method", "motion", "-o", "model.json")


@pytest.fixture
def folder(tmp_path):
    generator = np.random.default_rng(0)
    t = np.arange(20_000) / 1000.0
    q = np.stack([0.4 * np.sin((2 + j) * t) + 0.1 * np.sin(7.3 * t) for j in range(2)], axis=1)
    dq = np.gradient(q, t, axis=0)
    tau = 0.5 * np.gradient(dq, t, axis=0) + 4 * np.sign(dq) + 2 * dq + 3 * np.sin(q)
    np.savez(tmp_path / "log.npz", t=t, q=q, tau=tau + 0.1 * generator.standard_normal(tau.shape))
    return tmp_path


def model(folder, program, *words, threads=None) -> str:
    environment = {k: v for k, v in os.environ.items() if k not in _blas.VARIABLES}
    environment |= {"PYTHONPATH": str(ROOT)} | ({"OPENBLAS_NUM_THREADS": threads} if threads else {})
    done = subprocess.run(
        [sys.executable, "-c", program, *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return hashlib.sha256((folder / "model.json").read_bytes()).hexdigest()


def test_neither_threads_nor_the_way_in_change_a_byte(folder):
    found = {
        "command, 1": model(folder, BY_COMMAND, *COMMAND, threads="1"),
        "command, 2": model(folder, BY_COMMAND, *COMMAND, threads="2"),
        "Python": model(folder, IN_PYTHON),
        "Python, 2": model(folder, IN_PYTHON, threads="2"),
    }
    assert len(set(found.values())) == 1, found


def counts() -> list[int]:
    return [library.threads() for library in _blas._find_libraries()]


def test_threads_are_given_back_and_blocks_may_overlap():
    import scipy.linalg  # noqa: F401

    if not _blas._find_libraries():
        pytest.skip("a BLAS that cannot be told")
    before, environment = counts(), {name: os.environ.get(name) for name in _blas.VARIABLES}
    for library in _blas._find_libraries():
        library.limit(3)
    try:
        with _blas.one_thread():
            assert set(counts()) == {1}
            with _blas.one_thread():
                pass
            assert set(counts()) == {1}
            assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
        assert set(counts()) == {3}
        with pytest.raises(KeyError), _blas.one_thread():
            raise KeyError
        assert set(counts()) == {3}
        assert {name: os.environ.get(name) for name in _blas.VARIABLES} == environment
    finally:
        for library, count in zip(_blas._find_libraries(), before, strict=True):
            library.limit(count)
