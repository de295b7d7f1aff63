"""What reading costs: CSV of 200 MB beside pandas' C parser, whole processes, our parsing child included.

Every figure is processor time of a process and its children, imports included, interleaved, median of several runs; the ratio to
pandas' parse alone stands beside it. Numbers are compared with Python's `float` on sampled lines. pandas is of the extra `bench`;
Arrow, of `table`, is hidden from the runs without extras.
"""

from __future__ import annotations

import importlib.util
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from _common import Judge, parser
from big_log import tree_memory

JOINTS, RUNS, FEWER = 7, 15, 3
SIZE, SMALL = 200e6, 80e6  # of a file; with --short [B]
WITH_EXTRA, WITHOUT, MEMORY = 2.0, 3.0, 350.0  # gates [1], [1], [MB]
#: Name -> format of a number, delimiter, decimal sign.
KINDS = {
    "nine decimals": ("%.9f", ",", "."),
    "every digit": ("%.17g", ",", "."),
    "decimal comma": ("%.9f", ";", ","),
}

OURS = """
import sys
from backdrive import read_log
log = read_log(sys.argv[1])
rows = [0, len(log) // 3, len(log) - 1]
print([[repr(float(x)) for x in (log.time[r], *log.position[r], *log.velocity[r], *log.torque[r])] for r in rows], len(log))
"""
PANDAS = """
import sys, time
import pandas
begun = time.process_time()
table = pandas.read_csv(sys.argv[1], engine="c", sep=sys.argv[2], decimal=sys.argv[3])
print(time.process_time() - begun)
"""


def write(path: Path, kind: str, size: float) -> None:
    """Write a log of seven joints: time, position, velocity, torque."""
    number, cut, point = KINDS[kind]
    generator = np.random.default_rng(1)
    names = [f"{c}_{j}" for c in ("q", "dq", "tau") for j in range(JOINTS)]
    line = cut.join(["%.3f"] + [number] * len(names)) + "\n"
    rows, written = 5000, 0
    with open(path, "w") as stream:
        stream.write(cut.join(["t", *names]) + "\n")
        k = 0
        while written < size:
            t = (np.arange(rows) + k * rows) / 1000.0
            w = 0.7 * (1 + 0.1 * np.arange(JOINTS))
            q, dq = 0.5 * np.sin(t[:, None] * w), 0.5 * w * np.cos(t[:, None] * w)
            tau = 3 * np.sign(dq) + dq + 0.1 * generator.standard_normal(dq.shape)
            text = "".join(line % tuple(row) for row in np.column_stack([t, q, dq, tau]).tolist())
            written += stream.write(text if point == "." else text.replace(".", point))
            k += 1


def run(code: str, *arguments: str, watch: bool = False, before: str = "") -> tuple[str, float, float]:
    """Return what a process printed, its processor time with its children's [s], and the peak of all their memory [MB].

    Modules are looked for in the folder `before` first.
    """
    paths = os.pathsep.join(filter(None, [before, os.environ.get("PYTHONPATH", "")]))
    began = os.times()
    peak = 0.0
    with subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": paths},
    ) as process:
        if watch:

            def look() -> None:
                nonlocal peak
                while process.poll() is None:
                    peak = max(peak, tree_memory(process.pid))
                    time.sleep(0.01)

            watcher = threading.Thread(target=look)
            watcher.start()
            watcher.join()
        output = process.communicate()[0]
    if process.returncode:
        raise SystemExit(f"a process ended with {process.returncode}")
    after = os.times()
    used = after.children_user + after.children_system - began.children_user - began.children_system
    return output, used, peak


def same_numbers(path: Path, kind: str, output: str) -> bool:
    """Return whether the rows that a process printed are those of the file, to the last bit."""
    _, cut, point = KINDS[kind]
    lines = path.read_text().splitlines()[1:]
    wanted = [
        [repr(float(x.replace(point, "."))) for x in lines[r].split(cut)]
        for r in (0, len(lines) // 3, len(lines) - 1)
    ]
    return output.strip() == f"{wanted} {len(lines)}"


def main() -> None:
    """Write, read, compare."""
    short = parser(__doc__).parse_args().short
    size, runs = (SMALL, FEWER) if short else (SIZE, RUNS)
    if importlib.util.find_spec("pandas") is None:
        print("pandas is absent: install the extra `bench`")
        sys.exit(2)
    judge = Judge()
    fast = importlib.util.find_spec("pyarrow") is not None
    empty = statistics.median(run("pass")[1] for _ in range(5))
    for kind, (_, cut, point) in KINDS.items():
        with tempfile.TemporaryDirectory() as scratch:
            path = Path(scratch, "log.csv")
            write(path, kind, size)
            output, _, peak = run(OURS, str(path), watch=True)
            (Path(scratch) / "pyarrow.py").write_text("raise ImportError")
            ours, theirs, parse = [], [], []
            plain = [run(OURS, str(path), before=scratch)[1] for _ in range(FEWER)]
            for _ in range(runs):
                ours.append(run(OURS, str(path))[1])
                text, used, _ = run(PANDAS, str(path), cut, point)
                theirs.append(used)
                parse.append(float(text))
            exact = same_numbers(path, kind, output)
            mega = path.stat().st_size / 1e6
        own, whole, alone, slow = (statistics.median(values) for values in (ours, theirs, parse, plain))
        print(
            f"{kind}, {mega:.0f} MB: {own:.2f} s; pandas {whole:.2f} s, its parse alone {alone:.2f} s "
            f"(ratio to that {(own - empty) / alone:.2f}, not judged)"
        )
        judge.that(f"{kind}: three rows are those of the file, bit for bit", exact)
        judge.that(f"{kind}: Arrow is here (extra `table`)", fast)
        judge.at_most(f"{kind}: of pandas, with the extra `table`", own / whole, WITH_EXTRA)
        judge.at_most(f"{kind}: of pandas, without extras", slow / whole, WITHOUT)
        if not short:
            judge.at_most(f"{kind}: parent and child together", peak, MEMORY, "MB")
    judge.end()


if __name__ == "__main__":
    main()
