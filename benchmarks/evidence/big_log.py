"""One hour, 1 kHz, seven joints: identified within 2 GB, the reading of the file included."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from _common import Judge, parser

HOURS, RATE, JOINTS = 1.0, 1000, 7
COULOMB = 3.0 + np.arange(JOINTS)
VISCOUS = 1.0 + 0.2 * np.arange(JOINTS)


def write_log(path: Path, hours: float) -> None:
    """Write the log joint by joint, so that making it needs little memory itself."""
    n = round(hours * 3600 * RATE)
    folder = path.parent
    t = np.arange(n) / RATE
    q = np.lib.format.open_memmap(folder / "q.npy", mode="w+", dtype=np.float64, shape=(n, JOINTS))
    tau = np.lib.format.open_memmap(folder / "tau.npy", mode="w+", dtype=np.float64, shape=(n, JOINTS))
    generator = np.random.default_rng(0)
    for j in range(JOINTS):
        position, dq, ddq = np.zeros(n), np.zeros(n), np.zeros(n)
        for f in 0.07 * np.array([1.0, 2.7, 5.3]) * (1 + 0.11 * j):
            w, phase = 2 * np.pi * f, generator.uniform(0, 2 * np.pi)
            position += 0.03 / f * np.sin(w * t + phase)
            dq += 0.03 / f * w * np.cos(w * t + phase)
            ddq -= 0.03 / f * w * w * np.sin(w * t + phase)
        q[:, j] = position
        tau[:, j] = (
            0.5 * ddq + COULOMB[j] * np.sign(dq) + VISCOUS[j] * dq + 0.2 * generator.standard_normal(n)
        )
    del q, tau
    np.save(folder / "t.npy", t)
    import zipfile

    with zipfile.ZipFile(path, "w", allowZip64=True) as archive:
        for name in ("t", "q", "tau"):
            archive.write(folder / f"{name}.npy", f"{name}.npy")
            (folder / f"{name}.npy").unlink()


def tree_memory(pid: int) -> float:
    """Return the resident memory of a process and its descendants, shared pages counted once [MB]."""
    total, todo = 0, [pid]
    while todo:
        one = todo.pop()
        try:
            text = Path(f"/proc/{one}/smaps_rollup").read_text()
            total += sum(int(line.split()[1]) for line in text.splitlines() if line.startswith("Pss:"))
            for task in Path(f"/proc/{one}/task").iterdir():
                todo += [int(c) for c in (task / "children").read_text().split()]
        except (OSError, ValueError):
            continue
    return total / 1024.0


def main() -> None:
    """Make the log, identify it in a process of its own, and watch its memory."""
    hours = 0.1 if parser(__doc__).parse_args().short else HOURS
    judge = Judge()
    with tempfile.TemporaryDirectory() as scratch:
        log, model = Path(scratch, "hour.npz"), Path(scratch, "m.json")
        write_log(log, hours)
        print(f"log of {60 * hours:.0f} min: {log.stat().st_size / 1e6:.0f} MB")
        start = time.perf_counter()
        with subprocess.Popen(
            [sys.executable, "-m", "backdrive", "identify", str(log), "-o", str(model)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as process:
            peak = [0.0]

            def watch() -> None:
                while process.poll() is None:
                    peak[0] = max(peak[0], tree_memory(process.pid))
                    time.sleep(0.05)

            watcher = threading.Thread(target=watch)
            watcher.start()
            output = process.communicate()[0]
            watcher.join()
        wall = time.perf_counter() - start
        if process.returncode:
            judge.that(f"identify ended with {process.returncode}: {output}", False)
            judge.end()
        largest = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0
        print(
            f"identified in {wall:.1f} s on {os.cpu_count()} cores; largest single process {largest:.0f} MB"
        )
        joints = json.loads(model.read_text())["joints"]
        judge.that(f"{len(joints)} joints in the model", len(joints) == JOINTS)
        for j, joint in enumerate(joints):
            parameters = joint["parameters"]
            off = []
            for way in ("positive", "negative"):
                found = parameters.get(f"coulomb_{way}", parameters.get(way))["value"]
                off.append(abs((found[0] if isinstance(found, list) else found) - COULOMB[j]))
            judge.at_most(f"Coulomb torque of joint {j} off by, worse direction", max(off), 0.05, "N.m")
        judge.at_most(
            "peak memory of the process and its reader together", max(peak[0], largest), 2048.0, "MB"
        )
    judge.end()


if __name__ == "__main__":
    main()
