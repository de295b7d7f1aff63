"""One file and one line: what is added to a copy of the tree as a person would add it, and then used.

A law, a reader, a health check, a plan, compensators, a method of the estimator of external force, an experiment: they stand in
`_one_file_parts`. Every line outside the added file counts, changed ones too; where there is more than one, it falls short, and the
lines are named. Each use is a process of its own: fitted, saved, shown, simulated, run in the loop, listed, drawn, as each of them
is. `--short` runs the kernels without compiling them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from _common import Judge, parser
from _one_file_parts import PARTS, PRELUDE, Part

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "backdrive"


def add(part: Part, package: Path) -> list[str]:
    """Add a part to a copy of the package and return the lines that it took elsewhere, as `file: line`.

    Raises:
        LookupError: a line to go by does not stand there once.
    """
    texts: dict[str, str] = {}
    taken = []
    for line in part.lines:
        text = texts.get(line.file) or (package / line.file).read_text()
        if text.count(line.anchor) != 1:
            raise LookupError(f"{line.file} holds '{line.anchor.strip()}' {text.count(line.anchor)} times")
        if line.changes:
            text = text.replace(line.anchor, line.new)
        else:
            end = text.find("\n", text.index(line.anchor)) + 1
            text = text[:end] + line.new + "\n" + text[end:]
        texts[line.file] = text
        there = line.anchor.splitlines()
        new = [words.strip() for words in line.new.splitlines() if words not in there]
        taken += [f"{line.file}: {words}" for words in new]
    for name, text in texts.items():
        (package / name).write_text(text)
    (package / part.file).write_text(part.text)
    return taken


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
        for part in PARTS:
            try:
                lines = add(part, root / "backdrive")
            except LookupError as error:
                judge.that(f"{part.kind}: how to add it is not known any more: {error}", False)
                continue
            added.append(part)
            few = len(lines) == 1
            where = "one file, one line" if few else f"one file, {len(lines)} lines"
            judge.that(f"{part.kind}: {where} ({'; '.join(lines)})", few)
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
