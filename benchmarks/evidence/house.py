"""The house: less code than before, small files, few layers, nothing twice, and no kernel that the cache forgets.

The first two rows compare with the last commit before the rooms were put in order (`_before.BEFORE`); without git history they
are left out, and the program ends with 2 where all else is met. What reproduces the thesis is not counted on either side (`thesis`;
before: `experiments`, `plots/thesis`, `reproduce`); the figures with it stand beside.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path

import _house_kernels as kernels
import _house_layers as layers_
import _house_sources as sources_
from _before import BEFORE, ROOT, tree
from _common import Judge, parser

FEWER = 25.0  # % of the statements
LONGEST = 350  # lines of a file
MEDIAN = (90, 180)
LAYERS, ROOMS = 11, 3


def size(judge: Judge, now: dict[str, str], before: dict[str, str]) -> None:
    """Compare statements and docstrings with those of before."""
    kept, was = sources_.without_thesis(now), sources_.without_thesis(before)
    counts = [sources_.statements(files) for files in (was, kept, before, now)]
    fewer = [100.0 * (1.0 - after / ago) for ago, after in (counts[:2], counts[2:])]
    print(f"with the thesis: {counts[2]} statements at {BEFORE}, {counts[3]} now, {fewer[1]:.1f} % fewer")
    print(f"files: {len(before)} at {BEFORE}, {len(now)} now; without the thesis {len(was)} and {len(kept)}")
    judge.that(
        f"statements without the thesis: {counts[0]} at {BEFORE}, {counts[1]} now, {fewer[0]:.1f} % fewer (at least {FEWER:g} %)",
        fewer[0] >= FEWER,
    )
    for what, ago, after in zip(
        ("public definitions with a docstring", "docstrings in all lines"),
        sources_.docstrings(was),
        sources_.docstrings(kept),
        strict=False,
    ):
        judge.that(f"{what}: {100 * ago:.2f} % before, {100 * after:.2f} % now (not lower)", after >= ago)


def files(judge: Judge, now: dict[str, str]) -> None:
    """Judge the lengths of files, blocks that rooms share, and second homes."""
    lines = {name: len(text.splitlines()) for name, text in now.items()}
    long = [f"{name} {n}" for name, n in lines.items() if n > LONGEST]
    judge.that(f"files above {LONGEST} lines: {', '.join(long) or 'none'}", not long)
    median = statistics.median(lines.values())
    judge.that(
        f"median of {len(lines)} files: {median:g} lines ({MEDIAN[0]} to {MEDIAN[1]})",
        MEDIAN[0] <= median <= MEDIAN[1],
    )
    pairs = [f"{a}:{i} and {b}:{j} ({n} lines)" for a, i, b, j, n in sources_.repeated(now)]
    judge.that(
        f"blocks of {sources_.BLOCK} lines that two rooms share: {', '.join(pairs) or 'none'}", not pairs
    )
    for what, places in sources_.homes(sources_.without_thesis(now)).items():
        names = [f"{name} ({', '.join(functions)})" for name, functions in places.items()]
        judge.that(f"one home of {what}: {', '.join(names) or 'none'}", len(places) == 1)


def rooms(judge: Judge) -> None:
    """Judge the import contract and what is imported."""
    house = layers_.layers(ROOT)
    judge.that(f"layers: {len(house)} (at most {LAYERS})", len(house) <= LAYERS)
    most = max(house[:-1], key=len)
    judge.that(f"rooms side by side: {', '.join(most)} (at most {ROOMS})", len(most) <= ROOMS)
    try:
        graph = layers_.imports()
    except ModuleNotFoundError:
        judge.that("imports: not judged, `pip install grimp` (it comes with import-linter)", False)
        return
    wrong = layers_.upward(graph, house)
    judge.that(f"imports upwards or sideways: {', '.join(wrong) or 'none'}", not wrong)
    for ring in layers_.cycles(graph):
        own = all(m.startswith("backdrive.laws") for m in ring)
        names = ", ".join(m.removeprefix("backdrive.") for m in ring[:6])
        judge.that(f"modules that import one another: {names}{' ...' if len(ring) > 6 else ''}", own)


def edits(judge: Judge, scratch: Path) -> None:
    """Edit one kernel in each room and look whether the next process sees it."""
    package = ROOT / "src" / "backdrive"
    held = kernels.rooms(package)
    judge.that(
        f"rooms with kernels: {', '.join(sorted(held))}, an edit in each of them", held == set(kernels.EDITS)
    )
    for room, file, before, after in kernels.seen(package, scratch):
        try:
            holds = float(before) != float(after)
        except ValueError:
            holds = False
        judge.that(f"{room}: an edit of {file} is seen, {before} becomes {after}", holds)


def main() -> None:
    """Count and judge."""
    parser(__doc__).parse_args()
    judge = Judge()
    now = sources_.sources(ROOT)
    with tempfile.TemporaryDirectory() as scratch:
        before = tree(Path(scratch))
        if before is None:
            print(f"statements and docstrings are not compared: no git history that holds {BEFORE} in {ROOT}")
        else:
            size(judge, now, sources_.sources(before))
    files(judge, now)
    rooms(judge)
    with tempfile.TemporaryDirectory() as scratch:
        edits(judge, Path(scratch))
    if before is None and not judge.short:
        sys.exit(2)
    judge.end()


if __name__ == "__main__":
    main()
