"""How long a person waits: import, help, and a whole identification, each as a process of its own.

Every figure is the median of several warm runs. The machine's own `import numpy` stands beside them: on a quiet machine it
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

import numpy as np
from _common import Judge

RUNS = 5
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


def run(command: list[str], environment: dict[str, str] | None = None) -> tuple[float, float]:
    """Return wall time [s] and peak memory of the process and its children [MB]."""
    probe = (
        "import resource, subprocess, sys; done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL); "
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); sys.exit(done.returncode)"
    )
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-S", "-c", probe, *command],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    wall = time.perf_counter() - start
    if done.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}: {done.stderr}")
    return wall, int(done.stdout) / (1024.0 if sys.platform != "darwin" else 1024.0**2)


def median(command: list[str]) -> tuple[float, float]:
    """Return the median wall time [s] and memory [MB] of warm runs."""
    run(command)
    results = [run(command) for _ in range(RUNS)]
    return statistics.median(r[0] for r in results), statistics.median(r[1] for r in results)


def numerics() -> float:
    """Return the median time of the sweep identification of one 16 s, 1 kHz log [s]."""
    from backdrive.excite import Sweep
    from backdrive.identification.sweep import sweep_knots
    from backdrive.plants.thesis import joint_1
    from backdrive.simulate import simulate

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
    judge = Judge()
    python = sys.executable
    bare, _ = median([python, "-c", "pass"])
    numpy_wall, _ = median([python, "-c", "import numpy"])
    print(f"this machine: python alone {bare:.3f} s, import numpy {numpy_wall:.3f} s, {os.cpu_count()} cores")
    wall, _ = median([python, "-c", "import backdrive"])
    judge.at_most(f"import backdrive ({wall:.3f} s as a process) beyond bare python", wall - bare, 0.1, "s")
    wall, _ = median([python, "-m", "backdrive", "--help"])
    judge.at_most("backdrive --help", wall, 0.3, "s")
    with tempfile.TemporaryDirectory() as scratch:
        log = Path(scratch, "six.npz")
        write_log(log)
        wall, memory = median(
            [python, "-m", "backdrive", "identify", str(log), "-o", str(Path(scratch, "m.json"))]
        )
        judge.at_most(f"identify of {JOINTS} joints, {SECONDS} s, {RATE} Hz, warm", wall, 2.5, "s")
        judge.at_most("its peak memory", memory, 500.0, "MB")
    judge.at_most("sweep numerics alone", 1e3 * numerics(), 20.0, "ms")
    judge.end()


if __name__ == "__main__":
    main()
