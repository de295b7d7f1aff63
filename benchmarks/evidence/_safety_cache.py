"""Compile caches that are damaged, each in a copy of the package, so that this tree's own cache takes no harm."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from _safety_commands import Bench

NOBODY = 65534


def _compiled(package: Path) -> list[Path]:
    return [p for p in package.rglob("*.nb?") if p.is_file()]


def truncated(file: Path, rng: np.random.Generator) -> None:
    """Cut a file in half."""
    os.truncate(file, file.stat().st_size // 2)


def emptied(file: Path, rng: np.random.Generator) -> None:
    """Empty a file."""
    os.truncate(file, 0)


def garbage(file: Path, rng: np.random.Generator) -> None:
    """Replace the bytes of a file by random ones."""
    file.write_bytes(rng.bytes(file.stat().st_size))


def in_the_way(file: Path, rng: np.random.Generator) -> None:
    """Put a folder in the place of a file."""
    file.unlink()
    file.mkdir()


def lost(file: Path, rng: np.random.Generator) -> None:
    """Remove what the index names."""
    if file.suffix == ".nbc":
        file.unlink()


DAMAGES: dict[str, Callable[[Path, np.random.Generator], None]] = {
    "truncated": truncated,
    "emptied": emptied,
    "garbage": garbage,
    "a folder in place of each file": in_the_way,
    "index without data": lost,
}


def damaged_caches(
    bench: Bench, rng: np.random.Generator, short: bool
) -> Iterator[tuple[str, Path, dict[str, Any], bool]]:
    """Yield kind of damage, a copy of the package with it, how to start a command, and whether a note is due."""
    for kind, damage in list(DAMAGES.items())[: 2 if short else None]:
        package = bench.root / "caches" / kind.replace(" ", "-")
        shutil.copytree(bench.package, package)
        files = _compiled(package)
        assert files, "the package was never compiled"
        for file in files:
            damage(file, rng)
        yield f"{kind} ({len(files)} files)", package, {}, kind != "index without data"
        shutil.rmtree(package)
    if short:
        return
    if os.geteuid():
        package = bench.root / "caches" / "unwritable"
        shutil.copytree(bench.package, package)
        for file in _compiled(package):
            emptied(file, rng)
            file.chmod(0o444)
        for folder in package.rglob("__pycache__"):
            folder.chmod(0o555)
        yield "emptied and unwritable", package, {}, True
        for folder in package.rglob("__pycache__"):
            folder.chmod(0o755)
        return
    package = bench.root / "caches" / "read-only"
    package.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=400m", "tmpfs", str(package)], capture_output=True, check=False
    )
    if done.returncode == 0:
        shutil.copytree(bench.package, package, dirs_exist_ok=True)
        for file in _compiled(package):
            emptied(file, rng)
        subprocess.run(["mount", "-o", "remount,ro", str(package)], check=False)
        try:
            yield "emptied, on a read-only disk", package, {}, True
        finally:
            subprocess.run(["umount", str(package)], check=False)
    package = bench.root / "caches" / "foreign"
    shutil.copytree(bench.package, package)
    for folder in package.rglob("__pycache__"):
        os.chown(folder, NOBODY, NOBODY)
    yield "of another owner", package, {}, False
