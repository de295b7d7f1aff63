"""Many logs on one machine: what a log costs, whether memory stays flat, and whether the results are the same for any workers.

Logs of one joint, 20 s at 1 kHz, NPZ, drawn here in closed form. Processor time is that of every process together, read from /proc.
"""

from __future__ import annotations

import hashlib
import io
import math
import os
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np
from _common import Judge, parser
from _fleet_processes import Use, fleet

from backdrive.fleet.batches import cut
from backdrive.fleet.sources import list_logs
from backdrive.fleet.store import Store
from backdrive.fleet.work import do_batch, do_log

SECONDS, RATE, ROBOTS = 20.0, 1000.0, 100


def write_logs(folder: Path, count: int, samples: int, *, first: int = 0) -> None:
    """Write logs of robots over days; a sum of sines, Coulomb and viscous friction, inertia, gravity, noise."""
    t = np.arange(samples) / RATE
    for number in range(first, first + count):
        robot, day = number % ROBOTS, number // ROBOTS
        draws = np.random.default_rng([77, number])
        q, dq, ddq = np.zeros((3, t.size))
        for hertz, amplitude in ((0.15, 0.8), (0.35, 0.45), (0.85, 0.15), (1.9, 0.03)):
            w, shift = 2 * math.pi * hertz, draws.uniform(0, 2 * math.pi)
            q += amplitude * np.sin(w * t + shift)
            dq += amplitude * w * np.cos(w * t + shift)
            ddq -= amplitude * w * w * np.sin(w * t + shift)
        tau = 0.5 * ddq + 3.0 * np.sign(dq) + 2.0 * dq + 4.0 * np.sin(q) + 0.1 * draws.standard_normal(t.size)
        place = folder / f"r{robot:03d}"
        place.mkdir(parents=True, exist_ok=True)
        content = io.BytesIO()
        np.savez(content, t=t, q=q, tau=tau, temp=np.full(t.size, 25.0, dtype=np.float32))
        name = np.datetime64("2026-01-01") + day
        (place / f"{name}.npz").write_bytes(content.getvalue())


def digest(folder: Path) -> str:
    """Return a digest of every file of results and its name."""
    whole = hashlib.sha256()
    for path in sorted((folder / "logs").rglob("*.parquet")):
        whole.update(str(path.relative_to(folder)).encode() + path.read_bytes())
    return whole.hexdigest()


def batch_times(place: Path) -> None:
    """Print how long the first batch of short and of long logs takes in one process, reading included."""
    for samples in (800, 20_000):
        write_logs(place / f"b{samples}", ROBOTS, samples)
        batch = next(cut(list_logs(place / f"b{samples}"), "tag"))
        store = Store.open(place / f"s{samples}", make=True)
        do_log(batch.entries[0], {})  # compiled kernels, started reader
        begun, wall = time.process_time(), time.perf_counter()
        do_batch(batch, {}, str(store.folder))
        print(
            f"  a batch of logs of {samples} samples is {len(batch.entries)} logs: {time.perf_counter() - wall:.1f} s, "
            f"{time.process_time() - begun:.1f} s of processor without its reader, load {os.getloadavg()[0]:.1f}"
        )


def tell(name: str, use: Use, logs: int, idle: float) -> float:
    """Print what a run used; return the processor's milliseconds a log, starting included."""
    each = 1e3 * use.processor / logs
    marginal = 1e3 * (use.processor - idle) / logs
    print(
        f"  {name}: {use.wall:.1f} s, {use.processor:.1f} s of processor, {each:.1f} ms a log ({marginal:.1f} without the start), "
        f"worker {use.worker / 1e6:.0f} MB, parent {use.parent / 1e6:.0f} MB",
        flush=True,
    )
    if use.code:
        print(use.output)
    return each


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--logs", type=int, default=10_000)
    given = options.parse_args()
    sizes = [10, 40, 120] if given.short else [100, given.logs // 10, given.logs]
    samples = int(SECONDS * RATE) if not given.short else int(5 * RATE)
    judge = Judge()
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors; logs of {samples} samples")
    with tempfile.TemporaryDirectory(prefix="fleet-") as scratch:
        place = Path(scratch)
        for first in (0, 31 * ROBOTS):  # a log in each of two months is a batch for each of two workers
            write_logs(place / "one", 1, samples, first=first)
        fleet(place / "one", "-o", place / "first", "--workers", 1)  # fills the cache of compiled kernels
        idle = min(
            fleet(place / "one", "-o", place / name, "--workers", 2).processor for name in ("second", "third")
        )
        print(f"starting and ending costs {idle:.1f} s of processor")
        batch_times(place)
        costs = []
        for size in sizes:
            logs = place / f"logs{size}"
            write_logs(logs, size, samples)
            use = fleet(logs, "-o", place / f"r{size}", "--workers", 2)
            each = tell(f"{size} logs, 2 workers", use, size, idle)
            costs.append(max(use.processor - idle, 1e-3))
            if size == sizes[1]:
                single = fleet(logs, "-o", place / "w1", "--workers", 1)
                tell(f"{size} logs, 1 worker ", single, size, idle)
                eight = fleet(logs, "-o", place / "w8", "--workers", 8)
                tell(f"{size} logs, 8 workers", eight, size, idle)
                several = [digest(place / name) for name in (f"r{size}", "w1", "w8")]
                judge.that("results of 1, 2 and 8 workers are the same bytes", len(set(several)) == 1)
                speedup = (single.wall, use.wall)
            if size != sizes[-1]:
                shutil.rmtree(logs)
        again = fleet(place / f"logs{sizes[-1]}", "-o", place / f"r{sizes[-1]}", "--workers", 2)
        judge.that(f"all {sizes[-1]} logs are done", use.code == 0 and f"{sizes[-1]} done" in use.output)
        judge.at_most("a second run [s]", again.wall, 10.0)
        judge.that("it does nothing", " 0 done" in again.output)
        middle = [m for t, m in use.course if 0.3 * use.wall < t < 0.6 * use.wall]
        late = [m for t, m in use.course if t > 0.6 * use.wall]
        growth = max(late, default=0) / max(max(middle, default=1), 1)
        judge.at_most("largest worker [MB]", use.worker / 1e6, 1000.0)
        judge.at_most("growth of the largest worker in the last 40 % of the run [1]", growth, 1.1)
        judge.at_most("parent [MB]", use.parent / 1e6, 300.0)
        power = math.log(costs[-1] / costs[0]) / math.log(sizes[-1] / sizes[0])
        if given.short:  # starting costs more than so few logs
            print(f"cost grows from {sizes[0]} to {sizes[-1]} logs with the power {power:.2f}")
        else:
            judge.at_most(f"cost grows from {sizes[0]} to {sizes[-1]} logs with the power", power, 1.05)
            judge.at_most("processor time a log, all told [ms]", each, 35.0)
            judge.that(
                f"two workers are {speedup[0] / speedup[1]:.2f} times one (at least 1.75), load {os.getloadavg()[0]:.1f}",
                speedup[0] / speedup[1] >= 1.75,
            )
    judge.end()


if __name__ == "__main__":
    main()
