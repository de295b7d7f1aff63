"""How long a person waits: import, help, and a whole identification, each as a process of its own.

Every figure is the median of several warm runs and counts the process with the children that it starts: the time until all of them
have ended, the processor time of all, and their memory added up, though they need not hold it at the same time. `identify` parses
in a child of its own. The machine's own `import numpy` stands beside them: on a quiet machine it
takes about 0.2 s, and where it takes longer everything does.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from _common import Judge, parser

RUNS, FEWER = 5, 2  # warm runs of each command; with --short
SECONDS, RATE, JOINTS = 60, 1000, 6


def write_log(path: Path) -> None:
    """Write an NPZ of six joints in motion, friction and noise included."""
    generator = np.random.default_rng(0)
    t = np.arange(SECONDS * RATE) / RATE
    q, tau = np.zeros((t.size, JOINTS)), np.zeros((t.size, JOINTS))
    for j in range(JOINTS):
        dq, ddq = np.zeros_like(t), np.zeros_like(t)
        for f in 0.1 * np.array([1.0, 2.3, 4.1]) * (1 + 0.13 * j):
            w, phase = 2 * np.pi * f, generator.uniform(0, 2 * np.pi)
            q[:, j] += 0.3 / f * 0.1 * np.sin(w * t + phase)
            dq += 0.3 / f * 0.1 * w * np.cos(w * t + phase)
            ddq -= 0.3 / f * 0.1 * w * w * np.sin(w * t + phase)
        tau[:, j] = (0.5 + j) * ddq + (4 + j) * np.sign(dq) + 2 * dq + 3 * np.sin(q[:, j])
    tau += 0.1 * generator.standard_normal(tau.shape)
    np.savez(path, t=t, q=q, tau=tau)


class Cost(NamedTuple):
    """Of a process and all its children.

    Attributes:
        wall: from the start until none of them is left [s].
        processor: user and system time of all [s].
        memory: peaks of all, added up [MB].
    """

    wall: float
    processor: float
    memory: float


#: Waits for the command as its child and, made the reaper of orphans, for whatever that leaves behind; each is weighed as it ends.
PROBE = """
import ctypes, os, resource, subprocess, sys, threading, time

peaks, over = {}, threading.Event()

def children(pid):
    try:
        with open(f"/proc/{pid}/task/{pid}/children") as stream:
            found = [int(word) for word in stream.read().split()]
    except OSError:
        return []
    return found + [x for child in found for x in children(child)]

def weigh():
    while not over.wait(0.01):
        for pid in children(os.getpid()):
            try:
                with open(f"/proc/{pid}/status") as stream:
                    lines = [line.split() for line in stream if line.startswith("VmHWM")]
            except OSError:
                continue
            peaks[pid] = int(lines[0][1]) if lines else peaks.get(pid, 0)

try:
    ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)
except (OSError, AttributeError):
    pass
watch = threading.Thread(target=weigh, daemon=True)
watch.start()
begun = time.perf_counter()
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
try:
    while True:
        os.wait()
except ChildProcessError:
    pass
wall = time.perf_counter() - begun
over.set()
watch.join()
used = resource.getrusage(resource.RUSAGE_CHILDREN)
largest = used.ru_maxrss / (1 if sys.platform != "darwin" else 1024)
print(wall, used.ru_utime + used.ru_stime, max(largest, sum(peaks.values())))
sys.exit(code)
"""


def run(command: list[str]) -> Cost:
    """Return what a command costs, its children included."""
    done = subprocess.run(
        [sys.executable, "-S", "-c", PROBE, *command], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}: {done.stderr}")
    wall, processor, memory = (float(word) for word in done.stdout.split())
    return Cost(wall, processor, memory / 1024.0)


def median(command: list[str], runs: int) -> Cost:
    """Return the medians of warm runs."""
    run(command)
    results = [run(command) for _ in range(runs)]
    return Cost(*(statistics.median(values) for values in zip(*results, strict=False)))


def numerics() -> float:
    """Return the median time of the sweep identification of one 16 s, 1 kHz log [s]."""
    from backdrive.identification.sweep import sweep_knots
    from backdrive.plans import Sweep
    from backdrive.simulation.machines import joint_1
    from backdrive.simulation.open_loop import simulate

    sweep = Sweep(stroke=np.deg2rad(20.0), top_speed=2.0, cycles=10)
    log = simulate(joint_1(), sweep, seed=0)
    times = []
    for _ in range(RUNS + 1):
        start = time.perf_counter()
        sweep_knots(log, 0)
        times.append(time.perf_counter() - start)
    return statistics.median(times[1:])


def main() -> None:
    """Measure and judge."""
    runs = FEWER if parser(__doc__).parse_args().short else RUNS
    judge = Judge()
    python = sys.executable
    bare = median([python, "-c", "pass"], runs).wall
    numpy_wall = median([python, "-c", "import numpy"], runs).wall
    print(f"this machine: python alone {bare:.3f} s, import numpy {numpy_wall:.3f} s, {os.cpu_count()} cores")
    wall = median([python, "-c", "import backdrive"], runs).wall
    judge.at_most(f"import backdrive ({wall:.3f} s as a process) beyond bare python", wall - bare, 0.1, "s")
    judge.at_most("backdrive --help", median([python, "-m", "backdrive", "--help"], runs).wall, 0.3, "s")
    with tempfile.TemporaryDirectory() as scratch:
        log = Path(scratch, "six.npz")
        write_log(log)
        identify = [python, "-m", "backdrive", "identify", str(log), "-o", str(Path(scratch, "m.json"))]
        cost = median(identify, runs)
        what = f"identify of {JOINTS} joints, {SECONDS} s, {RATE} Hz, warm"
        judge.at_most(f"{what}, until parent and child have ended", cost.wall, 2.5, "s")
        judge.at_most("processor time of parent and child", cost.processor, 2.7, "s")
        judge.at_most("peak memory of parent and child, added", cost.memory, 500.0, "MB")
    judge.at_most(
        "sweep numerics alone", 1e3 * numerics(), 23.5, "ms"
    )  # 21.4 was measured, errors of noise included
    judge.end()


if __name__ == "__main__":
    main()
