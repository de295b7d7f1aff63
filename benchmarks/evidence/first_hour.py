"""A newcomer's first hour: demo, the demo's log identified, arrays and frames in, plot, report, tune, loop, the site built strict.

In full: a new virtual environment, `pip install` of this checkout, a home and a kernel cache that are empty, and a PATH that holds
this environment alone, so no compiler. With `--short`: the environment of the running interpreter, its kernel cache, and the same
PATH rule. Each step is a process of its own; its processor time, children included, has a limit: what a person waits for without
wondering. Install is printed, and has none. Each step must also leave what it promises.

    python benchmarks/evidence/first_hour.py [--short]
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

from _common import Judge, parser

ROOT = Path(__file__).resolve().parents[2]
COMPILERS = ("cc", "gcc", "clang", "c++", "g++", "zig")
READ = "import numpy as np; t, q, tau = np.genfromtxt(LOG, delimiter=',', skip_header=1, usecols=(0, 1, 2), unpack=True)"
IDENTIFY = "from backdrive import Log, identify, load_model, tune; "
TUNED = "tune(load_model('model.json'), top_speed=3.0, stiffness=(8e4, 1.2e5), inertia=(0.6, 0.8), counts=1043038, joints=32)"
STEPS: list[
    tuple[str, float, list[str] | str, str | None]
] = [  # name, limit [CPU s], command or Python, what it leaves
    ("demo", 25.0, ["backdrive", "demo"], "backdrive-demo/report.html"),
    ("identify the demo's log", 10.0, ["backdrive", "identify", "LOG", "-o", "model.json"], "model.json"),
    (
        "arrays in",
        10.0,
        READ + "; r = identify(Log.from_arrays(time=t, position=q, torque=tau)); assert r.summary()",
        None,
    ),
    (
        "pandas frame in",
        10.0,
        "import pandas; r = identify(Log.from_frame(pandas.read_csv(LOG))); assert r.to_dict()",
        None,
    ),
    (
        "polars frame in",
        10.0,
        "import polars; r = identify(Log.from_frame(polars.read_csv(LOG))); assert r.to_dict()",
        None,
    ),
    (
        "plot",
        10.0,
        "from backdrive import read_log; identify(read_log(LOG)).plot().savefig('plot.png')",
        "plot.png",
    ),
    (
        "report",
        15.0,
        "from backdrive import read_log; identify(read_log(LOG)).report('report.html')",
        "report.html",
    ),
    (
        "tune and loop",
        60.0,
        f"m = load_model('model.json'); loop = m.loop({TUNED}, period=1e-3); assert loop",
        None,
    ),
]
DOCS_LIMIT = 60.0


def seconds() -> float:
    """Return the processor time of all children that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def step(
    judge: Judge, name: str, limit: float, command: list[str], folder: Path, environment: dict[str, str]
) -> bool:
    """Run one step, print its processor time beside the limit, and say whether it ended well."""
    before = seconds()
    run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    used = seconds() - before
    if run.returncode:
        tail = " | ".join((run.stdout + run.stderr).strip().splitlines()[-3:])
        judge.that(f"{name} ended with {run.returncode}: {tail}", False)
        return False
    judge.at_most(name, used, limit, "CPU s")
    return True


def environment_of(scratch: Path, short: bool) -> tuple[Path, dict[str, str]]:
    """Return the folder of programs and the variables of a newcomer; installs unless short."""
    programs = Path(sys.executable).parent
    variables = {"HOME": str(scratch / "home"), "LANG": "C.UTF-8", "MPLBACKEND": "Agg"}
    (scratch / "home").mkdir()
    if short:
        print(f"the environment of {sys.executable} and its kernel cache: nothing is installed")
        variables |= {k: os.environ[k] for k in ("PYTHONPATH", "NUMBA_CACHE_DIR") if k in os.environ}
    else:
        venv.create(scratch / "venv", with_pip=True)
        programs = scratch / "venv" / "bin"
        before = seconds()
        subprocess.run(
            [programs / "pip", "install", "-q", f"{ROOT}[demo,docs]", "pandas", "polars"], check=True
        )
        print(f"  install: {seconds() - before:.1f} CPU s (no limit)")
        variables["NUMBA_CACHE_DIR"] = str(scratch / "cache")
    lane = (
        scratch / "bin"
    )  # this environment's programs without a compiler that a wheel or the system may have put beside them
    lane.mkdir()
    for program in ("python", "backdrive", "mkdocs"):
        if (programs / program).exists():
            (lane / program).write_text(f'#!/bin/sh\nexec "{programs / program}" "$@"\n')
            (lane / program).chmod(0o755)
    variables["PATH"] = str(lane)
    return lane, variables


def main() -> None:
    """Run all steps."""
    options = parser(__doc__).parse_args()
    judge = Judge()
    with tempfile.TemporaryDirectory() as place:
        scratch = Path(place)
        programs, variables = environment_of(scratch, options.short)
        compilers = [c for c in COMPILERS if shutil.which(c, path=variables["PATH"])]
        judge.that(f"no compiler in PATH: {', '.join(compilers) or 'none'}", not compilers)
        work = scratch / "work"
        work.mkdir()
        log = work / "backdrive-demo" / "log.csv"
        for name, limit, what, leaves in STEPS:
            if name != "demo" and not log.exists():
                judge.that(f"{name}: the demo wrote no log.csv", False)
                continue
            if isinstance(what, str):
                command = [str(programs / "python"), "-c", f"LOG = {str(log)!r}; {IDENTIFY}{what}"]
            else:
                command = [str(programs / what[0]), *(str(log) if w == "LOG" else w for w in what[1:])]
            if step(judge, name, limit, command, work, variables) and leaves:
                judge.that(
                    f"{name} leaves {leaves}",
                    (work / leaves).is_file() and (work / leaves).stat().st_size > 0,
                )
        if not (ROOT / "mkdocs.yml").exists():
            judge.that("docs built strict: there is no mkdocs.yml", False)
        else:
            builder = [
                str(programs / "python"),
                "-m",
                "mkdocs",
                "build",
                "-q",
                "--strict",
                "-d",
                str(scratch / "site"),
            ]
            step(
                judge,
                "docs built strict",
                DOCS_LIMIT,
                builder,
                ROOT,
                variables,
            )
    judge.end()


if __name__ == "__main__":
    main()
