"""The tree before the work on one house, from git: what it was is compared with what is."""

from __future__ import annotations

import io
import subprocess
import sys
import sysconfig
import tarfile
import venv
from pathlib import Path

BEFORE = "1f006ae"  # the last commit with `identify` and `fit` side by side, and twenty-four rooms
ROOT = Path(__file__).resolve().parents[2]


def tree(folder: Path, commit: str = BEFORE) -> Path | None:
    """Write the files of a commit into a folder, or return None where this is no checkout that knows the commit.

    Args:
        folder: an existing one.
        commit: of this repository.
    """
    try:
        done = subprocess.run(["git", "-C", str(ROOT), "archive", commit], capture_output=True, check=False)
    except OSError:
        return None
    if done.returncode:
        return None
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(folder, **({"filter": "data"} if sys.version_info >= (3, 11, 4) else {}))
    return folder


def interpreter(root: Path, folder: Path) -> Path:
    """Return a Python that knows a tree's package by itself, for its children are told nothing by the environment.

    Args:
        root: of the tree that holds `src`.
        folder: for the environment; it is made.
    """
    venv.create(folder, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    paths = [root / "src", *(sysconfig.get_path(name) for name in ("purelib", "platlib"))]
    (packages / "tree.pth").write_text("".join(f"{path}\n" for path in paths))
    return folder / "bin" / "python"
