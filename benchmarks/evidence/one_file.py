"""One file and one line: what is added to a copy of the tree as a person would add it, and then used.

A law, a reader, a health check, a plan, compensators, a method of the estimator of external force, an experiment: they stand in
`_one_file_parts` and `_one_file_parts_control`. A part has room for one new line outside its file, and none that is changed. Each
use is a process of its own: fitted, saved, shown, simulated, run in the loop, listed, drawn, as each of them is. `--short` runs the
kernels without compiling them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import _one_file_parts_control as control
from _common import Judge, parser
from _one_file_parts import PARTS, PRELUDE, Part

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "backdrive"


def add(part: Part, package: Path) -> None:
    """Add a part to a copy of the package: its file, and its line in another.

    Raises:
        LookupError: the line to go by does not stand there once.
    """
    line, path = part.line, package / part.line.file
    lines = path.read_text().splitlines()
    here = [k for k, words in enumerate(lines) if line.anchor in words]
    if len(here) != 1:
        raise LookupError(f"{line.file} holds '{line.anchor.strip()}' {len(here)} times")
    lines.insert(here[0] + 1, line.new)
    path.write_text("\n".join(lines) + "\n")
    (package / part.file).write_text(part.text)


def use(part: Part, root: Path, folder: Path, plain: bool) -> str:
    """Run the program that uses a part, and return why it failed, empty where it did not.

    Args:
        part: that was added.
        root: folder that holds the package.
        folder: an empty one to work in.
        plain: run the kernels as Python.
    """
    environment = os.environ | {"PYTHONPATH": str(root), "NUMBA_CACHE_DIR": str(root / "cache")}
    environment["NUMBA_DISABLE_JIT"] = str(int(plain))
    done = subprocess.run(
        [sys.executable, "-c", PRELUDE + part.use],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return "" if done.returncode == 0 else (done.stderr.strip() or "it failed").rpartition("\n")[2]


def main() -> None:
    """Add, count, use, judge."""
    short = parser(__doc__).parse_args().short
    judge = Judge()
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch, "root")
        shutil.copytree(PACKAGE, root / "backdrive", ignore=shutil.ignore_patterns("__pycache__"))
        added = []
        for part in (*PARTS, *control.PARTS):
            try:
                add(part, root / "backdrive")
            except LookupError as error:
                judge.that(f"{part.kind}: how to add it is not known any more: {error}", False)
                continue
            added.append(part)
            one = "\n" not in part.line.new
            judge.that(f"{part.kind}: one file, one line ({part.line.file}: {part.line.new.strip()})", one)
        for part in added:
            folder = Path(scratch, part.file.replace("/", "_"))
            folder.mkdir()
            begun = time.perf_counter()
            failure = use(part, root, folder, short)
            took = time.perf_counter() - begun
            judge.that(
                f"{part.kind}: used in {took:.0f} s" + (f"; {failure}" if failure else ""), not failure
            )
    judge.end()


if __name__ == "__main__":
    main()
