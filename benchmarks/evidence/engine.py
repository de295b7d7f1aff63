"""How fast friction is computed: the part of `speed` against C, against what people write in Python, and how the cost grows."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import speed
from _common import Judge, parser
from growth import power

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "engine_c"))
from c_loops import Loops

from backdrive.engine import Lanes, rollout
from backdrive.engine.cores import available
from backdrive.engine.tick import Tick
from backdrive.laws import Law, LuGre
from backdrive.laws.examples import example

DT = 1e-3
SETS = 10_000
SECONDS = 2.0  # for the turns of one comparison, but at least:
TURNS = 5
LUGRE = example("lugre")
ARM = ("coulomb-viscous", "stribeck-gauss", "lugre", "hayward-armstrong", "maxwell-slip", "gms", "m6")
FIRST = """
import time
wall, cpu = time.perf_counter(), time.process_time()
import numpy as np
from backdrive.engine import rollout
from backdrive.laws.examples import example
ready = time.perf_counter()
q = 0.01 * np.sin(np.arange(1000) * 0.01)
rollout(example("lugre"), q=q, dt=1e-3)
first = time.perf_counter()
print(ready - wall, first - ready, time.process_time() - cpu)
"""


def moved(n: int, slower: float = 1.0) -> np.ndarray:
    """Return positions of strokes with reversals within presliding [rad], (n,)."""
    t = DT * np.arange(n) / slower
    return 0.3 * np.sin(2 * np.pi * 0.31 * t) + 0.01 * np.sin(2 * np.pi * 3.7 * t)


def turns(theirs: Callable, ours: Callable, clock: Callable[[], float], seconds: float = SECONDS) -> dict:
    """Return times of both in turns [s], the median and the best ratio of ours to theirs, and the number of turns."""
    a, b, end = [], [], time.perf_counter() + seconds
    theirs()
    ours()
    while len(a) < TURNS or (time.perf_counter() < end and len(a) < 40):
        for function, times in ((theirs, a), (ours, b))[:: 1 if len(a) % 2 == 0 else -1]:
            start = clock()
            kept = function()
            times.append(clock() - start)
            del kept
    ratio = statistics.median(y / x for x, y in zip(a, b, strict=False))
    return {"theirs": min(a), "ours": min(b), "ratio": ratio, "of_best": min(b) / min(a), "turns": len(a)}


def by_hand(law: Law, dq: np.ndarray) -> np.ndarray:
    """Return LuGre's torque as people write it for an optimiser: numbers out of arrays, NumPy's functions, one tick at a time."""
    r, e = law.rate.values(), law.element.values()
    names = (r["coulomb"], r["breakaway"], r["stribeck_velocity"], r["viscous"], e["stiffness"], e["damping"])
    F_c, F_s, v_s, sigma_2, sigma_0, sigma_1 = np.array(names)
    z, tau = np.zeros(len(dq) + 1), np.zeros(len(dq))
    for k in range(len(dq)):
        v = dq[k]
        s = F_c + (F_s - F_c) * np.exp(-((v / v_s) ** 2))
        z[k + 1] = (z[k] + v * DT) / (1.0 + sigma_0 * np.abs(v) * DT / s)
        tau[k] = sigma_0 * z[k + 1] + sigma_1 * (z[k + 1] - z[k]) / DT + sigma_2 * v
    return tau


def by_integrator(law: Law, dq: np.ndarray, method: str) -> np.ndarray:
    """Return LuGre's torque by a stiff integrator along the same velocities."""
    from scipy.integrate import solve_ivp

    r, e = law.rate.values(), law.element.values()
    F_c, F_s, v_s, sigma_2 = r["coulomb"], r["breakaway"], r["stribeck_velocity"], r["viscous"]
    sigma_0, sigma_1 = e["stiffness"], e["damping"]
    t = DT * np.arange(len(dq))

    def rate(at, z):
        v = np.interp(at, t, dq)
        s = F_c + (F_s - F_c) * np.exp(-((v / v_s) ** 2))
        return v - sigma_0 * abs(v) / s * z

    # without a largest step LSODA jumps over reversals
    z = solve_ivp(rate, (0.0, t[-1]), [0.0], method=method, t_eval=t, rtol=1e-6, atol=1e-9, max_step=0.1).y[0]
    s = F_c + (F_s - F_c) * np.exp(-((dq / v_s) ** 2))
    slope = dq - sigma_0 * np.abs(dq) / s * z
    return sigma_0 * z + sigma_1 * slope + sigma_2 * dq


def against_python(judge: Judge) -> dict:
    """Compare a whole `rollout` call with a loop in Python and with SciPy's integrators."""
    law, results = Law(rate=LUGRE.rate, element=LuGre(stiffness=1e4, damping=20.0)), {}
    for name, n, other in (
        ("a NumPy loop", 50_000, lambda dq: by_hand(law, dq)),
        ("solve_ivp LSODA", 10_000, lambda dq: by_integrator(law, dq, "LSODA")),
        ("solve_ivp Radau", 3000, lambda dq: by_integrator(law, dq, "Radau")),
    ):
        dq = np.gradient(moved(n), DT)

        def ours(dq=dq):
            return rollout(law, dq=dq, dt=DT, workers=1)

        tau = ours()
        apart = float(np.sqrt(np.mean((other(dq) - tau) ** 2)) / np.sqrt(np.mean(tau**2)))
        got = turns(lambda dq=dq, other=other: other(dq), ours, time.thread_time, seconds=1.5)
        results[name] = {
            "times": 1.0 / got["ratio"],
            "apart": apart,
            "theirs": got["theirs"],
            "ours": got["ours"],
        }
        judge.that(
            f"LuGre, {n} ticks: {results[name]['times']:.0f} times as fast as {name} (at least 100); torques apart by "
            f"{100 * apart:.3g} % rms",
            results[name]["times"] >= 100.0,
        )
    return results


def growth(judge: Judge) -> dict:
    """Measure how the time grows with joints, sets and length, and what a set takes in memory."""
    law, results = LUGRE, {}
    q = moved(1_000_000)
    dp = np.diff(q, prepend=q[0])[None].copy()
    wide = {J: np.repeat(q[:20_000, None], J, axis=1) for J in (4, 8, 16, 32, 64)}
    lanes = {B: Lanes([law] * B) for B in (300, 1000, 3000, 10_000)}
    work: dict[str, tuple[tuple[int, ...], Callable[[int], Callable]]] = {
        "joints": (tuple(wide), lambda J: lambda: rollout(law, q=wide[J], dt=DT, workers=1)),
        "sets": (
            tuple(lanes),
            lambda B: lambda: lanes[B].torque(np.zeros(B, dtype=np.int64), dp[:, :300].copy(), DT, workers=1),
        ),
        "length": (
            (30_000, 100_000, 300_000, 1_000_000),
            lambda n: lambda: rollout(law, q=q[:n], dt=DT, workers=1),
        ),
    }
    for name, (sizes, made) in work.items():
        times = [np.inf] * len(sizes)
        for _ in range(7):
            for i, size in enumerate(sizes):
                run, start = made(size), time.thread_time()
                run()
                times[i] = min(times[i], time.thread_time() - start)
        slope = power(sizes, times)
        results[name] = {"sizes": list(sizes), "seconds": times, "slope": slope}
        judge.that(f"time grows with {name} by the power {slope:.3f} (0.9 to 1.1)", 0.9 <= slope <= 1.1)
    B = SETS
    tracemalloc.start()
    many = Lanes([law] * B)
    many.torque(np.zeros(B, dtype=np.int64), dp[:, :10].copy(), DT, workers=1)
    peak = tracemalloc.get_traced_memory()[1] - B * 10 * 8
    tracemalloc.stop()
    row, state = 8 * many.rows.shape[1], 8 * many.states
    results["bytes"] = {"row": row, "state": state, "peak": peak / B}
    print(
        f"  a set of LuGre: {row} bytes of row, {state} of state; {peak / B:.0f} at the peak, output excluded"
    )
    return results


def starts() -> dict:
    """Time the first `rollout` of a process, with an empty cache and with a full one."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")} | {
            "NUMBA_CACHE_DIR": cache
        }
        runs = []
        for _ in range(6):
            start = time.perf_counter()
            done = subprocess.run(
                [sys.executable, "-c", FIRST], env=environment, capture_output=True, text=True, check=True
            )
            runs.append([time.perf_counter() - start, *(float(w) for w in done.stdout.split())])
    names = ("process", "imports", "first_rollout", "cpu")
    result = {
        "cold": dict(zip(names, runs[0], strict=False)),
        "warm": dict(zip(names, (statistics.median(r[i] for r in runs[1:]) for i in range(4)), strict=False)),
    }
    for name, r in result.items():
        print(
            f"  {name} start: first rollout {r['first_rollout']:.2f} s, imports {r['imports']:.2f} s, whole process "
            f"{r['process']:.2f} s (CPU {r['cpu']:.2f} s)"
        )
    return result


def ticking(judge: Judge, calls: int = 100_000) -> dict:
    """Time single ticks of seven joints with seven laws, called from Python."""
    tick = Tick([example(name) for name in ARM], dt=DT)
    tick.load[:] = [3.0, -2.0]
    rows = list(np.diff(np.outer(moved(calls + 1), np.linspace(0.5, 1.5, len(ARM))), axis=0))
    call, clock = tick.tick, time.perf_counter_ns
    took, idle = np.empty(calls, dtype=np.int64), np.empty(calls, dtype=np.int64)
    for k, row in enumerate(rows):
        start = clock()
        call(row)
        took[k] = clock() - start
        start = clock()
        idle[k] = clock() - start
    result = {
        name: {p: float(np.percentile(values, float(p))) for p in ("50", "99", "99.9", "100")}
        for name, values in (("tick", took), ("nothing", idle))
    }
    print(
        f"  tick, percentiles [ns]: {result['tick']}\n  clock alone, the machine's noise [ns]: {result['nothing']}"
    )
    judge.at_most("tick of seven joints, median", result["tick"]["50"] / 1e3, 2.0, "us")
    judge.at_most("tick of seven joints, 99 %", result["tick"]["99"] / 1e3, 10.0, "us")
    whole, broken = (Tick([example(name) for name in ARM], dt=DT) for _ in range(2))
    right = True
    for k, row in enumerate(rows[:2000]):
        bad = row.copy()
        bad[k % 7] = np.nan
        others = np.arange(7) != k % 7
        before = whole._states.copy()
        broken._states[:], broken.torque[:] = before, whole.torque
        expected, got = whole.tick(row), broken.tick(bad)
        right &= np.array_equal(expected[others], got[others]) and bool(np.isfinite(got).all())
    judge.that("a NaN in one joint leaves the torques of the others as they are, bit for bit", right)
    return result


def main() -> None:
    """Measure, write down and judge."""
    made = parser(str(__doc__).splitlines()[0])
    made.add_argument("--json", type=Path, help="write the figures there")
    wanted = made.parse_args()
    judge = Judge()
    with tempfile.TemporaryDirectory() as scratch:
        loops = Loops(Path(scratch))
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
        print(f"{loops.compiler}; {available()} cores, load {load:.1f}")
        found = {"compiler": loops.compiler, "cores": available(), "load": load}
        count = 5 if wanted.short else speed.TURNS
        speed.series(loops, judge, count)
        speed.sets(loops, judge, count)
        speed.driven(loops, judge, count)
    found["against_python"] = against_python(judge)
    found["growth"] = growth(judge)
    found["starts"] = starts()
    found["tick"] = ticking(judge)
    if wanted.json:
        wanted.json.write_text(json.dumps(found, indent=1))
    judge.end()


if __name__ == "__main__":
    main()
