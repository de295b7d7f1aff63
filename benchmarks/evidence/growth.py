"""How cost grows with samples, joints, laws and parameter sets, one at a time; an hour of seven joints; 500 logs in a row; reports.

Each measurement is the processor time in a process of its own, its compiling done before; of reading, which is done by a child,
the wall time. A power is the slope of log cost over log
size by least squares, once over the larger half of the sizes, where what does not grow no longer hides it. The logs are made here:
motion of three sines, friction of Coulomb and viscous part, white noise.

    python benchmarks/evidence/growth.py --short
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _common import Judge, parser

RATE = 1000
POWER = 1.1
REPORT = 0.1  # of a joint more [s]
HERE = Path(__file__).resolve()

#: What one process measures: sizes in, processor seconds by size out.
WORKER = """
import json, sys, time
sys.path.insert(0, {folder!r})
import growth
what, sizes = json.loads(sys.argv[1])
print(json.dumps([growth.cost(what, size) for size in sizes]))
"""


def signals(n: int, joints: int = 1, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, positions and torques of a log, (n,), (n, J), (n, J)."""
    t, rng = np.arange(n) / RATE, np.random.default_rng(seed)
    q, tau = np.zeros((n, joints)), np.zeros((n, joints))
    for j in range(joints):
        dq, ddq = np.zeros(n), np.zeros(n)
        for f in 0.2 * np.array([1.0, 2.7, 5.3]) * (1.0 + 0.01 * j):
            w, phase = 2.0 * np.pi * f, rng.uniform(0.0, 2.0 * np.pi)
            q[:, j] += 0.1 / f * np.sin(w * t + phase)
            dq += 0.1 / f * w * np.cos(w * t + phase)
            ddq -= 0.1 / f * w * w * np.sin(w * t + phase)
        tau[:, j] = 0.5 * ddq + 3.0 * np.sign(dq) + 1.5 * dq + 0.2 * rng.standard_normal(n)
    return t, q, tau


def cost(what: str, size: int) -> float:
    """Return the processor seconds of one kind of work of one size, the median of some runs."""
    from backdrive import Log, identify, read_log
    from backdrive.engine import Lanes
    from backdrive.laws import Coulomb, Law, LuGre
    from backdrive.logs.health import screen

    kind, _, variable = what.partition(" by ")
    n = size if variable == "samples" else 20_000
    t, q, tau = signals(n, size if variable == "joints" else 1)
    log = Log.from_arrays(time=t, position=q, torque=tau)
    if kind == "health":
        work = lambda: screen(log)  # noqa: E731
    elif kind == "identify":
        work = lambda: identify(log, method="motion")  # noqa: E731
    elif kind == "report":
        result = identify(log, method="motion")
        with tempfile.TemporaryDirectory() as folder:
            return usual(lambda: result.report(Path(folder, "report.html")))
    elif kind == "law fit":
        laws = (
            "stribeck-gauss" if variable == "samples" else LAWS[:size] if variable == "laws" else LAWS[size]
        )
        work = lambda: identify(log, method="dynamic", law=laws)  # noqa: E731
    elif kind == "rollout":
        sets = size if variable == "sets" else 1
        law = [
            Law(rate=Coulomb(coulomb=3.0 + 1e-4 * i), element=LuGre(stiffness=1e4, damping=30.0))
            for i in range(sets)
        ]
        lanes, dp = Lanes(law), np.diff(q[:2001, 0] if variable == "sets" else q[:, 0])[None]
        motion = np.zeros(sets, dtype=np.int64)
        work = lambda: lanes.torque(motion, dp, 1.0 / RATE, workers=1)  # noqa: E731
    else:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "log.csv")
            table = np.column_stack([t, q, tau])
            names = ["t", *(f"q{j}" for j in range(q.shape[1])), *(f"tau{j}" for j in range(q.shape[1]))]
            np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
            return usual(lambda: read_log(path), time.perf_counter)  # a process of its own reads
    return usual(work)


LAWS = (
    "coulomb-viscous",
    "stribeck-gauss",
    "stribeck-tustin",
    "stribeck-lorentz",
    "sigmoid",
    "degressive",
    "makkar",
    "coulomb",
)


def usual(work: Callable[[], Any], clock: Callable[[], float] = time.process_time) -> float:
    """Return the median time of a call by a clock [s], of three, or of as many as take half a second.

    The least would favour short calls: of many runs the least is lower than of three.
    """
    work()  # compiles
    times: list[float] = []
    while sum(times) < (5.0 if len(times) < 3 else 0.5):
        begun = clock()
        work()
        times.append(clock() - begun)
    return float(np.median(times))


def measured(what: str, sizes: Sequence[int]) -> list[float]:
    """Return the processor seconds by size, taken in a process of its own."""
    script = WORKER.format(folder=str(HERE.parent))
    done = subprocess.run(
        [sys.executable, "-c", script, json.dumps([what, list(sizes)])],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(done.stderr[-2000:])
    return json.loads(done.stdout.splitlines()[-1])


def power(sizes: Sequence[int], times: Sequence[float]) -> float:
    """Return the slope of log cost over log size, of the larger half of the sizes, two at least."""
    half = (len(sizes) - 1) // 2
    return float(np.polyfit(np.log(sizes[half:]), np.log(times[half:]), 1)[0])


def series(judge: Judge, short: bool) -> None:
    """Measure each kind of work over sizes."""
    most = 10**5 if short else 10**7
    samples = [n for n in (10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000) if n <= most]
    joints = [1, 2, 4] if short else [1, 2, 4, 8, 16, 32, 64]
    cases = {
        "health by samples": samples,
        "identify by samples": samples,
        "law fit by samples": samples[:2] if short else samples[:5],
        "rollout by samples": samples,
        "reading by samples": samples if short else samples[:5],
        "health by joints": joints,
        "identify by joints": joints,
        "reading by joints": joints,
        "report by joints": joints[: 3 if short else 5],
        "law fit by laws": [1, 2] if short else [1, 2, 4, 8],
        "rollout by sets": [16, 64, 256] if short else [16, 64, 256, 1024, 4096],
    }
    for what, sizes in cases.items():
        times = measured(what, sizes)
        grown: Sequence[float] = sizes
        if what.endswith("laws"):  # each costs another time: by what they cost one at a time
            grown = np.cumsum(measured("law fit by law", range(sizes[-1])))[[k - 1 for k in sizes]].tolist()
        print(
            f"  {what}: " + ", ".join(f"{n:g}: {1e3 * s:.3g} ms" for n, s in zip(sizes, times, strict=True))
        )
        judge.at_most(f"{what}, power", power(grown, times), POWER)
        if what == "report by joints":
            judge.at_most("report, seconds a joint", (times[-1] - times[0]) / (sizes[-1] - sizes[0]), REPORT)


HOUR = """
import json, sys, time
sys.path.insert(0, {folder!r})
import growth
from backdrive import Log, identify
t, q, tau = growth.signals({n}, 7)
log = Log.from_arrays(time=t, position=q, torque=tau)
size = sum(a.nbytes for a in (log.time, log.position, log.torque))
small = growth.signals(20000)
identify(Log.from_arrays(time=small[0], position=small[1], torque=small[2]))
del t, q, tau
made = growth.most_memory()
open("/proc/self/clear_refs", "w").write("5")  # making the log took memory too, which is not asked about
before = growth.most_memory()
begun = time.process_time()
identify(log)
spent = time.process_time() - begun
print(json.dumps([size, made, before, growth.most_memory(), spent]))
"""


def most_memory() -> int:
    """Return the largest memory of this process since `clear_refs` was last written [byte]."""
    (line,) = (x for x in Path("/proc/self/status").read_text().splitlines() if x.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


def hour(judge: Judge, short: bool) -> None:
    """Identify an hour of seven joints from memory."""
    n = RATE * (120 if short else 3600)
    script = HOUR.format(folder=str(HERE.parent), n=n)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr[-2000:])
    size, made, before, peak, spent = json.loads(done.stdout.splitlines()[-1])
    print(
        f"  {n / RATE / 60:.0f} min of seven joints: {size / 1e6:.0f} MB; making it {made / 1e6:.0f} MB, before "
        f"{before / 1e6:.0f} MB, peak {peak / 1e6:.0f} MB"
    )
    judge.at_most("peak memory by the log's bytes, beyond an empty process", (peak - 250e6) / size, 2.5)
    judge.at_most("processor time", spent * 3600 * RATE / n if short else spent, 30.0, "s")


MANY = """
import json, resource, sys, time
sys.path.insert(0, {folder!r})
import growth
from backdrive import Log, identify
each = [growth.signals(20000, seed=s) for s in range(5)]
logs = [Log.from_arrays(time=t, position=q, torque=tau) for t, q, tau in each]
for log in logs:
    identify(log)
begun, rest = time.process_time(), []
for k in range({n}):
    identify(logs[k % 5])
    if k == {n} // 5 or k == {n} - 1:
        rest.append(int(open("/proc/self/statm").read().split()[1]) * 4096)
print(json.dumps([(time.process_time() - begun) / {n}, *rest]))
"""


def many(judge: Judge, short: bool) -> None:
    """Identify many logs one after the other in one process."""
    n = 20 if short else 500
    done = subprocess.run(
        [sys.executable, "-c", MANY.format(folder=str(HERE.parent), n=n)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(done.stderr[-2000:])
    each, early, late = json.loads(done.stdout.splitlines()[-1])
    judge.at_most(f"processor time of each of {n} logs of 20 s", 1e3 * each, 30.0, "ms")
    judge.at_most(f"memory after {n} logs, more than after a fifth of them", (late - early) / 1e6, 5.0, "MB")


def main() -> None:
    """Measure and judge."""
    short, judge = parser(__doc__).parse_args().short, Judge()
    series(judge, short)
    hour(judge, short)
    many(judge, short)
    judge.end()


if __name__ == "__main__":
    main()
