"""How fast the kernels are: against C written for this, against JAX, on two cores, and called from Python.

Ratios of processor time; both sides take turns within one run, and a ratio is the median over fifteen turns: what a shared machine
does to one it does to the other. Both give fresh arrays. The C (`benchmarks/engine_c`) is written from the equations, for one law
a loop, compiled by gcc -O3 -march=native -ffp-contract=off; single rollouts call the C library's functions, lanes the exponential
function of the package, so that their torques agree in every bit.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import _speed_ticks
import numpy as np
from _common import Judge, parser
from _speed_laws import CURVE, cases

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "engine_c"))
from c_loops import Loops

from backdrive.engine import Axis, DriveModel, Lanes, forward
from backdrive.engine.cores import available
from backdrive.laws import Law, LuGre

DT = 1e-3
LONG, TICKS, TURNS = 1_000_000, 1000, 15
SETS = (100, 1000, 10_000)
BRISTLE = Law(rate=CURVE, element=LuGre(stiffness=1e4, damping=20.0, fading=0.05))
SIDES = {"stribeck": (Law(rate=CURVE), [1, 2, 3, 4]), "lugre": (BRISTLE, [1, 2, 3, 4, 5, 6, 7])}


def moved(n: int) -> np.ndarray:
    """Return positions of strokes with reversals within presliding [rad], (n,)."""
    t = DT * np.arange(n)
    return 0.3 * np.sin(2 * np.pi * 0.31 * t) + 0.01 * np.sin(2 * np.pi * 3.7 * t)


def increments(n: int) -> np.ndarray:
    """Return the increments of these strokes [rad], (1, n)."""
    q = moved(n)
    return np.diff(q, prepend=q[0])[None].copy()


def turns(theirs: Callable, ours: Callable, count: int, clock: Callable[[], float] = time.thread_time):
    """Return the median times of both [s] and the median ratio of ours to theirs."""
    a, b = [], []
    theirs()
    ours()
    for i in range(count):
        for function, times in ((theirs, a), (ours, b))[:: 1 if i % 2 == 0 else -1]:
            start = clock()
            kept = function()
            times.append(clock() - start)
            del kept
    ratio = statistics.median(y / x for x, y in zip(a, b, strict=False))
    return statistics.median(a), statistics.median(b), ratio


def series(loops: Loops, judge: Judge, count: int) -> None:
    """Compare one long rollout of each law."""
    dp, q = increments(LONG), moved(LONG)
    load = np.stack([3.0 * np.sin(9.0 * q), 2.0 * np.cos(7.0 * q)], axis=1)[None].copy()
    motion = np.zeros(1, dtype=np.int64)
    print(f"{'one series':18s}  C [ns]  ours [ns]  ratio")
    for case in cases():
        lanes, row = Lanes([case.law]), case.row[None].copy()
        given = load if case.law.rate.NEEDS else None

        def c(case=case, row=row):
            return loops.torque(case.loop, row, 64, motion, dp, DT, load, 1)

        def ours(lanes=lanes, given=given):
            return lanes.torque(motion, dp, DT, given, workers=1)

        expected = c()
        apart = float(np.abs(expected - ours()).max() / np.abs(expected).max())
        x, y, ratio = turns(c, ours, count)
        print(f"{case.name:18s} {1e9 * x / LONG:7.2f} {1e9 * y / LONG:10.2f} {ratio:6.2f}", flush=True)
        judge.that(f"{case.name}: torques apart by {apart:.1e} of the largest (1e-12)", apart <= 1e-12)
        judge.at_most(f"{case.name}, one series, time over C's", ratio, 1.2)


def drawn(name: str, sets: int) -> tuple[Lanes, np.ndarray]:
    """Return lanes of a law whose every parameter differs, and its rows as C and JAX read them."""
    law, columns = SIDES[name]
    lanes = Lanes([law] * sets)
    lanes.rows[:, 1:] *= np.random.default_rng(7).uniform(0.5, 2.0, lanes.rows[:, 1:].shape)
    return lanes, np.ascontiguousarray(lanes.rows[:, columns])


def sets(loops: Loops, judge: Judge, count: int) -> None:
    """Compare ten thousand sets with C's lanes, and on two cores with one."""
    dp, B = increments(TICKS), SETS[-1]
    motion = np.zeros(B, dtype=np.int64)
    for name in SIDES:
        lanes, rows = drawn(name, B)

        def c(name=name, rows=rows):
            return loops.side_by_side(name, rows, dp[0], DT)

        def ours(lanes=lanes, workers=1):
            return lanes.torque(motion, dp, DT, workers=workers)

        judge.that(f"{name}, {B} sets: every bit of C's lanes", np.array_equal(c(), ours()))
        x, y, ratio = turns(c, ours, count)
        print(f"{name}, {B} sets: C {1e9 * x / B / TICKS:.2f} ns, ours {1e9 * y / B / TICKS:.2f} ns")
        judge.at_most(f"{name}, {B} sets, time over that of C's lanes", ratio, 1.3)
        if available() > 1:
            _, _, faster = turns(lambda ours=ours: ours(workers=2), ours, TURNS, time.perf_counter)
            load = os.getloadavg()[0]
            judge.that(
                f"{name}: two cores {faster:.2f} times as fast (at least 1.75), load {load:.1f}",
                faster >= 1.75,
            )


def against_jax(judge: Judge, scratch: Path, short: bool) -> None:
    """Compare with JAX, which runs in a process of its own; without it, say so."""
    python, dp = os.environ.get("BACKDRIVE_JAX", sys.executable), increments(TICKS)
    program = Path(__file__).with_name("_speed_jax.py")
    if subprocess.run([python, "-c", "import jax"], capture_output=True, check=False).returncode != 0:
        judge.that("JAX is here (extra `bench`, or BACKDRIVE_JAX names a Python that has it)", False)
        return
    for B in SETS[-1:] if short else SETS:
        given, made = {"dp": dp[0], "dt": DT, "some": np.zeros((1, 4))}, {}
        for name in SIDES:
            made[name], given[name] = drawn(name, B)
            few = Lanes([SIDES[name][0]] * 4)
            few.rows[:] = made[name].rows[:4]
            given[f"{name}_torque"] = few.torque(np.zeros(4, dtype=np.int64), dp, DT, workers=1).T
        np.savez(scratch / "sets.npz", **given)
        motion, times = np.zeros(B, dtype=np.int64), {}
        for name, lanes in made.items():

            def ours(lanes=lanes, motion=motion):
                return lanes.torque(motion, dp, DT, workers=1)

            times[name] = turns(lambda: None, ours, TURNS)[1]
        said = subprocess.run(
            [python, str(program), str(scratch / "sets.npz")], capture_output=True, text=True, check=True
        ).stdout
        for line in said.splitlines():
            name, theirs, apart = line.split()
            ahead = float(theirs) / times[name]
            text = f"{name}, {B} sets: {ahead:.2f} times ahead of JAX, torques apart by {float(apart):.1e}"
            if SETS[-1] == B:
                judge.that(f"{text} (at least 1.5)", ahead >= 1.5)
            else:
                print(f"  {text}")


def driven(loops: Loops, judge: Judge, count: int) -> None:
    """Compare a mass under LuGre in a position loop with an implicit step in C."""
    reference = moved(100_000)
    drive = DriveModel(controller="position", proportional=2000.0, derivative=60.0)
    axis = Axis(law=BRISTLE, inertia=0.5, drive=drive)
    row = np.array([4.0, 6.0, 0.05, 1.0, 1e4, 20.0, 0.05])

    def c():
        return loops.forward(row, 0.5, 2000.0, 60.0, reference, DT)

    def ours():
        return forward(axis, reference, dt=DT, workers=1)

    expected, motion = c(), ours()
    apart = float(np.abs(motion.position[0] - expected[:, 0]).max())
    x, y, ratio = turns(c, ours, count)
    n = len(reference)
    print(f"forward LuGre: C {1e9 * x / n:.0f} ns, ours {1e9 * y / n:.0f} ns; positions apart by {apart:.1e}")
    judge.at_most("forward LuGre, time over implicit C's", ratio, 1.3)


def ticks(loops: Loops, judge: Judge, n: int, count: int) -> None:
    """Compare ticks along encoder readings with the compensator's law in C, without guards."""
    q = _speed_ticks.readings(moved(n))
    row = _speed_ticks.numbers(DT)
    expected = loops.alg_fc2(row, q, DT)
    limits = {"algFC2's tick": 1.5, "loop with guards": 2.5, "loop with estimator": 4.0}
    for name, run in _speed_ticks.ours(q, DT).items():
        later = slice(n // 2, None)  # a loop's torque has grown to its limit by then
        apart = float(np.abs(run() - expected)[later].max() / np.abs(expected).max())
        x, y, ratio = turns(lambda: loops.alg_fc2(row, q, DT), run, count)
        print(f"{name}: C {1e9 * x / n:.2f} ns, ours {1e9 * y / n:.2f} ns; torques apart by {apart:.1e}")
        judge.at_most(f"{name}, time over C's law without guards", ratio, limits[name])


def least(call: Callable, count: int, repeats: int = TURNS) -> float:
    """Return the median processor time of a call [us]."""
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        for _ in range(count):
            call()
        times.append((time.thread_time() - start) / count)
    return 1e6 * statistics.median(times)


def scalars(judge: Judge) -> None:
    """Time a torque of one velocity and the making of a law."""
    from backdrive.logs.log import Joint
    from backdrive.model import FrictionModel, JointFriction, Validity

    joint = JointFriction(joint=Joint(name="j"), law=Law(rate=CURVE), validity=Validity(velocity=(-1.0, 1.0)))
    model = FrictionModel(joints=(joint,))
    model.torque("j", 0.2)
    judge.at_most("scalar FrictionModel.torque", least(lambda: model.torque("j", 0.2), 2000), 0.6, "us")
    values, element = CURVE.values(), BRISTLE.element.values()

    def make():
        return Law(rate=type(CURVE)(**values), element=LuGre(**element))

    judge.at_most("a Law", least(make, 2000), 10.0, "us")


def main() -> None:
    """Measure and judge."""
    wanted = parser(str(__doc__).splitlines()[0]).parse_args()
    judge, count = Judge(), 5 if wanted.short else TURNS
    with tempfile.TemporaryDirectory() as scratch:
        loops = Loops(Path(scratch))
        print(f"{loops.compiler}; {available()} cores, load {os.getloadavg()[0]:.1f}")
        series(loops, judge, count)
        sets(loops, judge, count)
        against_jax(judge, Path(scratch), wanted.short)
        driven(loops, judge, count)
        ticks(loops, judge, LONG // 5, count)
    scalars(judge)
    judge.end()


if __name__ == "__main__":
    main()
