"""What the first run of a command costs, with an empty cache of compiled kernels, and that the second run compiles nothing.

Each command is a process of its own; processor time counts its children too. What is compiled is written down by numba itself, in
every process, as its compiler begins: functions and the types of their arguments. Required beside the times: the second run of each
command compiles nothing, and no function is compiled twice for arrays that differ only by being read-only or by how they lie in
memory. `demo` and the first `Loop` are goals: printed, not judged. The package's bytecode is there, as after `pip install`.

    python benchmarks/evidence/cold_start.py [--short] [--only identify]
"""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from _common import Judge, parser

import backdrive

#: Loaded by every Python process of a command: notes what numba compiles, as soon as numba itself is imported.
WATCH = """
import importlib.util, os, sys

def install(event):
    class Note(event.Listener):
        def on_start(self, e):
            f, types = e.data["dispatcher"].py_func, e.data["args"]
            with open(os.environ["COMPILED_LIST"], "a") as stream:
                stream.write(f"{f.__module__}.{f.__qualname__}({', '.join(map(str, types))})\\n")
        def on_end(self, e):
            pass
    event.register("numba:compile", Note())

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name != "numba.core.event":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        run = spec.loader.exec_module
        def exec_module(module):
            run(module)
            install(module)
        spec.loader.exec_module = exec_module
        return spec

sys.meta_path.insert(0, Finder())
"""
LOOP = """
import numpy as np
from backdrive.control import JointLoop, Loop
from backdrive.control.compensators import alg_fc
from backdrive.laws import CoulombViscous
rate = CoulombViscous(coulomb_positive=1.0, coulomb_negative=1.0, viscous_positive=0.1, viscous_negative=0.1)
joint = JointLoop(compensator=alg_fc(rate, 8e3, 20.0), top_speed=2.0, limit=1.0, encoder_count=1e-5)
loop = Loop([joint], interval=1e-3)
loop.update(np.zeros(1), np.zeros(1), 1e-3)
"""
SECONDS, RATE = 20.0, 1000.0


class Command(NamedTuple):
    """What is run.

    Attributes:
        words: behind `python`.
        limit: of processor time [s].
        judged: whether the limit is, or is a goal.
    """

    words: tuple[str, ...]
    limit: float
    judged: bool


TUNE = (
    *("tune", "preset:thesis/hp3j", "--joint", "joint_0", "--stiffness", "8e4:1.2e5", "--inertia", "0.6:0.8"),
    *("--top-speed", "3", "-o", "tuning.json"),
)
#: Python may keep bytecode, as it does for users.
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
COMMANDS = {
    "demo": Command(("-m", "backdrive", "demo"), 6.0, False),
    "reproduce fig-3.8": Command(("-m", "backdrive", "reproduce", "fig-3.8", "--folder", "book"), 9.0, True),
    "identify --law auto": Command(
        ("-m", "backdrive", "identify", "log.csv", "--law", "auto", "-o", "m.json"), 7.0, True
    ),
    "tune": Command(("-m", "backdrive", *TUNE), 14.0, True),
    "first Loop": Command(("-c", LOOP), 3.0, False),
}


class Outcome(NamedTuple):
    """Of a process: processor time [s], and what was compiled."""

    seconds: float
    compiled: list[str]


def write_log(path: Path) -> None:
    """Write a CSV of one joint, 20 s at 1 kHz."""
    rng, t = np.random.default_rng(0), np.arange(SECONDS * RATE) / RATE
    q, v, a = np.zeros((3, t.size))
    for hertz, size in ((0.11, 0.9), (0.31, 0.4), (0.83, 0.1)):
        w, phase = 2.0 * np.pi * hertz, rng.uniform(0.0, 2.0 * np.pi)
        q += size * np.sin(w * t + phase)
        v += size * w * np.cos(w * t + phase)
        a -= size * w * w * np.sin(w * t + phase)
    friction = np.tanh(v / 0.003) * (1.5 + 0.6 * np.exp(-np.abs(v) / 0.1)) + 0.8 * v
    tau = 0.15 * a + friction + 2.0 * np.sin(q) + 0.05 * rng.standard_normal(t.size)
    columns = np.column_stack([t, np.round(q / 1e-5) * 1e-5, tau])
    np.savetxt(path, columns, delimiter=",", header="t,q,tau", comments="", fmt="%.9g")


def run(command: Command, place: Path, cache: Path) -> Outcome:
    """Run a command in a folder and return what it cost."""
    notes = place / "compiled.txt"
    notes.write_text("")
    given = ENVIRONMENT | {
        "NUMBA_CACHE_DIR": str(cache),
        "COMPILED_LIST": str(notes),
        "PYTHONPATH": os.pathsep.join([str(place / "watch"), ENVIRONMENT.get("PYTHONPATH", "")]).rstrip(
            os.pathsep
        ),
        "MPLCONFIGDIR": str(place / "matplotlib"),
    }
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, *command.words], cwd=place, env=given, capture_output=True, text=True, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(f"{' '.join(command.words[:4])} ended with {done.returncode}: {done.stderr[-600:]}")
    return Outcome(
        after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, notes.read_text().splitlines()
    )


def install_bytecode() -> None:
    """Compile the package's modules to bytecode, as pip does where it installs them."""
    folder = str(Path(backdrive.__file__).parent)
    subprocess.run([sys.executable, "-m", "compileall", "-q", folder], env=ENVIRONMENT, check=True)


def twice(compiled: list[str]) -> list[str]:
    """Return the functions that were compiled more than once for arrays that differ only in how they are held."""
    plain = Counter(
        re.sub(r"[Rr]eadonly ?|, [ACF](?=[,)])", "", one) for one in compiled if not one.startswith("numba.")
    )
    return sorted({one.split("(")[0] for one, n in plain.items() if n > 1})


def main() -> None:
    """Run every command twice."""
    options = parser(__doc__)
    options.add_argument("--only", nargs="*", default=[], help="commands whose name begins so")
    given = options.parse_args()
    names = ["identify --law auto"] if given.short else list(COMMANDS)
    names = [n for n in names if not given.only or any(n.startswith(o) for o in given.only)]
    judge = Judge()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "watch").mkdir()
        (place / "watch" / "sitecustomize.py").write_text(WATCH)
        write_log(place / "log.csv")
        install_bytecode()
        print(
            f"{'command':22s}{'first [s]':>10s}{'goal':>6s}{'second [s]':>12s}{'compiled':>10s}{'second':>8s}"
        )
        for name in names:
            command, cache = COMMANDS[name], place / ("cache of " + name.replace(" ", "_"))
            first, second = run(command, place, cache), run(command, place, cache)
            print(
                f"{name:22s}{first.seconds:10.1f}{command.limit:6.0f}{second.seconds:12.1f}{len(first.compiled):10d}"
                f"{len(second.compiled):8d}",
                flush=True,
            )
            if command.judged:
                judge.at_most(
                    f"{name}: processor time with an empty cache", first.seconds, command.limit, "s"
                )
            else:
                print(f"  ({name}: {first.seconds:.1f} s; goal {command.limit:g} s)")
            judge.that(
                f"{name}: the second run compiles {len(second.compiled)} functions", not second.compiled
            )
            again = twice(first.compiled)
            judge.that(
                f"{name}: compiled twice for arrays that are held otherwise: {', '.join(again) or 'none'}",
                not again,
            )
    judge.end()


if __name__ == "__main__":
    main()
