"""The tree before the work on one house, from git: what it was is compared with what is."""

from __future__ import annotations

import io
import subprocess
import sys
import tarfile
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
        done = subprocess.run(
            ["git", "-C", str(ROOT), "archive", commit, "src", "benchmarks"], capture_output=True, check=False
        )
    except OSError:
        return None
    if done.returncode:
        return None
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(folder, **({"filter": "data"} if sys.version_info >= (3, 11, 4) else {}))
    return folder
