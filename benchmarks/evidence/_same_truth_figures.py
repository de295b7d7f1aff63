"""The figures of every evidence program of before beside those of the same program now, each run in its own tree."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path
from typing import NamedTuple

from _before import interpreter
from _common import Judge

SEED = "20260101"  # for programs that else draw one
MOST = 600.0  # s of one program
OUTCOMES = {0: "met", 1: "short", 2: "no data"}
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
VERDICT = re.compile(r"  (?:ok   |SHORT) ")
#: Times of this machine, at this hour: `same_truth` takes its own, in turns.
OF_TIME = re.compile(r"\b(?:ms|us|s|seconds|MB|CPU|memory|processor|wall|compil\w+|faster|slower|MSteps?)\b")


class Figures(NamedTuple):
    """What a program printed.

    Attributes:
        outcome: met, short, no data, or why there is none.
        rows: what was judged, numbers taken out -> its numbers, first that of which it speaks.
        short: sentences that fell short.
    """

    outcome: str
    rows: dict[str, list[float]]
    short: list[str]


def programs(root: Path) -> list[str]:
    """Return the names of a tree's evidence programs."""
    return sorted(f.stem for f in (root / "benchmarks" / "evidence").glob("[a-z]*.py"))


def figures(root: Path, name: str, python: Path, cache: Path) -> Figures:
    """Run a program of a tree, short, and return what it printed.

    Args:
        root: of the tree.
        name: of the program.
        python: that knows the tree's package.
        cache: folder for compiled kernels.
    """
    program = root / "benchmarks" / "evidence" / f"{name}.py"
    words = [str(python), str(program), "--short"]
    if "first_seed" in program.read_text():
        words += ["--seed", SEED]
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    environment |= {"NUMBA_CACHE_DIR": str(cache), "OPENBLAS_NUM_THREADS": "1"}
    environment |= {"PATH": f"{python.parent}:{os.environ.get('PATH', '')}"}
    try:
        done = subprocess.run(
            words, env=environment, capture_output=True, text=True, timeout=MOST, check=False
        )
    except subprocess.TimeoutExpired:
        return Figures(f"not ended in {MOST:g} s", {}, [])
    rows: dict[str, list[float]] = {}
    for line in done.stdout.splitlines():
        if VERDICT.match(line):
            text = VERDICT.sub("", line)
            key = NUMBER.sub("#", text)
            while key in rows:
                key += " again"
            rows[key] = [float(n) for n in NUMBER.findall(text)]
    short = [VERDICT.sub("", line) for line in done.stdout.splitlines() if line.startswith("  SHORT ")]
    outcome = OUTCOMES.get(done.returncode, f"ended with {done.returncode}")
    if "Traceback" in done.stderr:
        outcome = f"stopped: {done.stderr.strip().splitlines()[-1][:100]}"
    return Figures(outcome, rows, short)


def largest_change(before: Figures, now: Figures) -> tuple[int, int, float, str]:
    """Return how many rows both sides have, how many are equal to their last digit, the largest relative change and its row."""
    both = [row for row in before.rows if row in now.rows and not OF_TIME.search(row)]
    equal, most, where = 0, 0.0, ""
    for row in both:
        pairs = list(zip(before.rows[row], now.rows[row], strict=False))
        equal += all(a == b for a, b in pairs)
        for a, b in pairs:
            change = abs(b - a) / max(abs(a), abs(b), 1e-300)
            if a != b and change > most:
                most, where = change, f"{row[:90]}: {a:g} before, {b:g} now"
    return len(both), equal, most, where


def table(judge: Judge, old: Path, new: Path, scratch: Path) -> None:
    """Print the table, and judge that every former program is there and met where it was.

    Args:
        judge: of this program.
        old: root of the tree of before.
        new: root of this tree.
        scratch: folder for two caches of compiled kernels.
    """
    names = [name for name in programs(old) if name != "same_truth"]
    sides = [
        (root, (interpreter(root, scratch / f"python-{side}"), scratch / f"cache-{side}"))
        for root, side in ((old, "before"), (new, "now"))
    ]
    print("\nprogram, short | before | now | figures on both sides, but times | equal | largest change")
    for name in names:
        if name not in programs(new):
            judge.that(f"{name} is there", False)
            continue
        before, now = (figures(root, name, *where) for root, where in sides)
        both, equal, most, where = largest_change(before, now)
        change = f"{100.0 * most:.2g} % of {where}" if where else "none"
        print(f"{name} | {before.outcome} | {now.outcome} | {both} | {equal} | {change}", flush=True)
        for sentence in now.short:
            print(f"    short now: {sentence}")
        judge.that(
            f"{name}: {now.outcome} now, {before.outcome} before",
            now.outcome == "met" or now.outcome == before.outcome == "no data",
        )
