"""Tests for _jit_cache.py: a cache that is damaged, emptied or out of reach costs time and one note, and nothing else."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="nothing is compiled, nothing is cached"
)
ROOT = Path(__file__).parent.parent / "src"

#: How each kernel's cache is spoilt: kernel number -> what is done to its (index, data).
DAMAGE = (
    ("index emptied", lambda index, data: index.write_bytes(b"")),
    ("index cut", lambda index, data: index.write_bytes(index.read_bytes()[:-7])),
    ("index of noise", lambda index, data: index.write_bytes(bytes(range(256)) * 3)),
    ("index a folder", lambda index, data: (index.unlink(), index.mkdir())),
    ("index a full folder", lambda index, data: (index.unlink(), index.mkdir(), (index / "x").touch())),
    ("data emptied", lambda index, data: data.write_bytes(b"")),
    ("data cut", lambda index, data: data.write_bytes(data.read_bytes()[: data.stat().st_size // 2])),
    ("data altered", lambda index, data: data.write_bytes(altered(data.read_bytes()))),
    ("data a folder", lambda index, data: (data.unlink(), data.mkdir())),
    ("data gone", lambda index, data: data.unlink()),
    ("index gone", lambda index, data: index.unlink()),
)


def altered(content: bytes) -> bytes:
    """Flip a bit in the middle of the object code, which stays a valid pickle."""
    at = content.index(b"\x7fELF") + 700 if b"\x7fELF" in content else len(content) // 2
    return content[:at] + bytes([content[at] ^ 4]) + content[at + 1 :]


def kernels(folder: Path, count: int) -> Path:
    """Write a program of small kernels that prints their values and whether each came from the cache."""
    lines = ["import json, sys", "from backdrive._jit import jit", "found = []"]
    for i in range(count):
        lines += [
            "@jit",
            f"def k{i}(x):",
            f"    return x * {i + 2}.0",
            f"found.append((k{i}(10.0), sum(k{i}.stats.cache_hits.values())))",
        ]
    path = folder / "program.py"
    path.write_text("\n".join([*lines, "print(json.dumps(found))", ""]))
    return path


def run(program: Path, cache: Path | None, home: Path | None = None) -> tuple[list, list[str]]:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"}
    environment |= {"NUMBA_CACHE_DIR": str(cache)} if cache is not None else {}
    environment |= {"HOME": str(home), "XDG_CACHE_HOME": str(home)} if home is not None else {}
    done = subprocess.run(
        [sys.executable, str(program)], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr.splitlines()


def test_whatever_is_wrong_with_a_file_the_kernel_is_compiled_again_with_one_note(tmp_path):
    program, cache = kernels(tmp_path, len(DAMAGE)), tmp_path / "cache"
    expected = [10.0 * (i + 2) for i in range(len(DAMAGE))]
    found, said = run(program, cache)
    assert ([v for v, _ in found], said) == (expected, [])
    for i, (_, damage) in enumerate(DAMAGE):
        (index,), (data,) = cache.rglob(f"program.k{i}-*.nbi"), cache.rglob(f"program.k{i}-*.nbc")
        damage(index, data)
    found, said = run(program, cache)
    assert [v for v, _ in found] == expected
    assert all(hits == 0 for _, hits in found), [name for name, _ in DAMAGE]
    assert len(said) == 1
    assert said[0].startswith("backdrive: the compile cache in ")
    found, said = run(program, cache)
    assert [v for v, _ in found] == expected
    unmended = [name for (name, _), (_, hits) in zip(DAMAGE, found, strict=True) if not hits]
    assert unmended == ["index a full folder"], (
        "only what cannot be removed is compiled in memory, every time"
    )
    assert not list(cache.rglob("*.tmp.*"))


def test_a_cache_folder_that_is_a_file_is_passed_by(tmp_path):
    (tmp_path / "cache").write_text("not a folder")
    found, said = run(kernels(tmp_path, 2), tmp_path / "cache")
    assert [v for v, _ in found] == [20.0, 30.0]
    assert len(said) == 1
    assert "cannot be used" in said[0]


def test_a_system_folder_as_cache_is_passed_by(tmp_path):
    if not Path("/proc/self").exists():
        pytest.skip("no folder here that even root cannot write")
    found, said = run(kernels(tmp_path, 1), Path("/proc/self"))
    assert [v for v, _ in found] == [20.0]
    assert len(said) == 1


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give a folder away"
)
def test_a_folder_of_another_user_is_not_believed(tmp_path):
    program, cache = kernels(tmp_path, 1), tmp_path / "cache"
    run(program, cache)
    for folder in [p for p in cache.rglob("*") if p.is_dir()]:
        os.chown(folder, 12345, 12345)
    found, said = run(program, cache)
    assert found[0] == [20.0, 0]
    assert "belongs to another user" in said[0]


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give a folder away"
)
def test_a_cache_beside_the_sources_that_is_lost_is_spoken_of_until_another_is_filled(tmp_path):
    program = kernels(tmp_path, 1)
    assert run(program, None, tmp_path / "home") == ([[20.0, 0]], [])
    assert run(program, None, tmp_path / "home") == ([[20.0, 1]], [])
    os.chown(tmp_path / "__pycache__", 12345, 12345)
    found, said = run(program, None, tmp_path / "home")
    assert found == [[20.0, 0]]
    assert len(said) == 1
    assert "belongs to another user" in said[0]
    assert str(tmp_path / "home") in said[0]
    assert run(program, None, tmp_path / "home") == ([[20.0, 1]], [])


def test_a_full_disk_leaves_no_piece_behind(tmp_path):
    program = kernels(tmp_path, 1)
    text = program.read_text()
    full = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (600, 600))\nimport signal\n"
    program.write_text(full + "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n" + text)
    found, said = run(program, tmp_path / "cache")
    assert found == [[20.0, 0]]
    assert len(said) == 1
    assert "compiling in memory" in said[0]
    assert not list((tmp_path / "cache").rglob("*.tmp.*"))
