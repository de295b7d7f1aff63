"""Unequal directions under gravity, told apart by sweeps about three centers; what that takes, and what it cannot do.

Joint 1 of the thesis (I = 1.6 kg.m^2, gravity 30 N.m cos q, its own encoder), with Coulomb torques of 9.56 and 7.5 N.m, a Stribeck
torque of 2 N.m on top, torque noise of 0.2 N.m and a drive whose delay differs from seed to seed and is not told to the method.
The constant of each direction is the intercept at rest of the true law's own section between the identified V_1 and V_2: with
Stribeck that is not the Coulomb torque, and the sweep, which begins at 0.19 rad/s, does not see the peak at all.

What is repeated is drawn from fresh seeds, whose first is printed: nothing was tuned on them.

    python benchmarks/evidence/asymmetry.py --seed 123400000
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from _common import Judge, first_seed, parser

from backdrive.identification.load_fit import payload_growth
from backdrive.identification.signals import prepare
from backdrive.identification.sweep import fit_sweeps, sweep_knots, to_polyline
from backdrive.identification.sweep_delay import sweep_delay
from backdrive.identification.sweep_fit import SweepFit
from backdrive.identification.sweep_windows import windows
from backdrive.laws import GearLoad, Law, Polyline
from backdrive.logs.log import Log
from backdrive.plans import Sweep
from backdrive.plans.centres import noise_gain
from backdrive.simulation import JointSimulation
from backdrive.simulation.machines import BEND, REACHED, joint_1
from backdrive.simulation.open_loop import simulate

SEEDS, REPEATS = 300, 900  # of three sweeps; of one sweep
CORES = min(4, os.cpu_count() or 1)
STROKE, V, N = np.deg2rad(20.0), 2.0, 10
CENTERS = (-60.0, 0.0, 60.0)  # [deg]
COULOMB = (9.56, 7.5)  # along +q, -q [N.m]
STRIBECK, FADES, GROWTH = 2.0, 0.05, 7.0  # [N.m], [rad/s], [N.m]
DELAY = (0.8e-3, 2.5e-3)  # drawn between these [s]
REACH = 1.96


def curve(coulomb: float, v: np.ndarray) -> tuple[float, ...]:
    """Return friction at speeds [N.m]."""
    growth = GROWTH * (1.0 - np.exp(-v / BEND)) / (1.0 - np.exp(-REACHED / BEND))
    return tuple(coulomb + growth + STRIBECK * np.exp(-((v / FADES) ** 2)))


def joint() -> JointSimulation:
    """Return the joint."""
    v = np.unique(np.concatenate([np.linspace(0.0, 0.3, 16), np.linspace(0.3, 2.4, 22)]))
    law = Law(rate=Polyline(velocity=tuple(v), positive=curve(COULOMB[0], v), negative=curve(COULOMB[1], v)))
    return joint_1().replace(law=law, torque_noise=0.2)


def logs(plant: JointSimulation, centers=CENTERS, seed: int = 0) -> list[Log]:
    """Return one sweep a center."""
    return [
        simulate(plant, Sweep(STROKE, V, N, center=np.deg2rad(c)), seed=10 * seed + i)
        for i, c in enumerate(centers)
    ]


def truth(plant: JointSimulation, velocity) -> np.ndarray:
    """Return the constants of the true law's section through V_1 and V_2, along +q and -q [N.m], (2,)."""
    V_1, V_2 = velocity[0], velocity[1]
    found = []
    for way in (1.0, -1.0):
        F_1, F_2 = way * plant.law.torque(way * np.array([V_1, V_2]))
        found.append(F_1 - V_1 * (F_2 - F_1) / (V_2 - V_1))
    return np.array(found)


def off(found: SweepFit, plant: JointSimulation) -> np.ndarray:
    """Return how far the constants are off [N.m], (2,)."""
    return np.array([value for value, _ in found.constants()]) - truth(plant, found.law.velocity)


def many(work: Callable, seeds: Sequence[int]) -> list:
    """Return what a function gives for seeds, on several cores."""
    sys.stdout.flush()  # a forked process would print what is waiting again
    with ProcessPoolExecutor(CORES) as pool:
        return list(pool.map(work, seeds, chunksize=8))


def ratio_within(judge: Judge, what: str, ratio: float, count: int, asked: int) -> None:
    """Require that scatter by stated error lies within 0.9 and 1.1; with fewer draws than `asked`, but for chance."""
    room = 0.1 if count >= asked else 0.1 + 3.0 / np.sqrt(2.0 * count)
    judge.that(
        f"{what}: scatter by stated error {ratio:.3f} ({1 - room:.2f} to {1 + room:.2f})",
        abs(ratio - 1.0) <= room,
    )


def scatter(values: np.ndarray, stated: np.ndarray) -> np.ndarray:
    """Return the scatter of values over draws by the root mean square of their stated errors, by column."""
    return np.std(values, axis=0, ddof=1) / np.sqrt(np.mean(np.square(stated), axis=0))


def three_sweeps(seed: int) -> tuple[np.ndarray, ...]:
    """Return errors and standard errors of the constants, of the knots and of the delay [ms], and more."""
    plant = joint()
    # whole steps of the simulation
    real = plant.replace(delay=round(np.random.default_rng(seed).uniform(*DELAY), 4))
    found = fit_sweeps(logs(real, seed=seed), "joint_1")
    v = np.array(found.law.velocity)
    knots = np.concatenate(
        [found.law.positive - plant.law.torque(v), found.law.negative + plant.law.torque(-v)]
    )
    said = next(w for w in found.warnings if "delay was estimated" in w).split()
    errors = np.array([e for _, e in found.constants()])
    return (
        off(found, plant),
        errors,
        knots,
        np.concatenate([found.error_pos, found.error_neg]),
        np.array([float(said[3]) - 1e3 * real.delay, float(said[5])]),
        np.array([found.condition, found.noise_gain, v[0]]),
    )


def seeds(judge: Judge, first: int, count: int) -> None:
    """Repeat the identification seed by seed."""
    begun = time.perf_counter()
    done = many(three_sweeps, range(first, first + count))
    E, S, knots, stated, delays, more = (np.array(x) for x in zip(*done, strict=False))
    H = REACH * S
    R = np.sqrt(np.mean(knots.reshape(count, 2, -1) ** 2, axis=2))
    covered, near = np.abs(E) <= H, np.abs(E) <= 0.03
    print(
        f"\n{count} seeds, three sweeps of {N} cycles each: {3 * Sweep(STROKE, V, N).duration:.0f} s of measuring"
    )
    print(
        f"  computed in {time.perf_counter() - begun:.0f} s; "
        f"delay off by {delays[:, 0].mean():+.3f} +- {delays[:, 0].std():.3f} ms, "
        f"stated {delays[:, 1].mean():.3f}"
    )
    alone = noise_gain(np.deg2rad(CENTERS))
    print(f"  condition {more[-1, 0]:.1f}, noise gain {more[-1, 1]:.2f} (half sums alone: {alone:.2f})")
    for i, way in enumerate(("+q", "-q")):
        print(
            f"  along {way}: constant off by {E[:, i].mean():+.4f} +- {E[:, i].std():.4f} N.m, interval +-{H[:, i].mean():.4f}; "
            f"rms over the knots {R[:, i].mean():.4f} (at most {R[:, i].max():.4f}) N.m"
        )
        judge.that(
            f"along {way}: within 0.03 N.m in {100 * near[:, i].mean():.1f} % of {count} (at least 90)",
            near[:, i].mean() >= 0.9,
        )
        inside = 100 * covered[:, i].mean()
        judge.that(
            f"along {way}: inside the 95 % interval in {inside:.1f} % of {count} (91 to 99)",
            91 <= inside <= 99 or (count < SEEDS and inside >= 80),
        )
    print(
        f"  both directions at once: within 0.03 N.m in {100 * near.all(axis=1).mean():.1f} %, "
        f"inside in {100 * covered.all(axis=1).mean():.1f} %"
    )
    ratio = scatter(E, S)
    print(f"  constants: scatter by stated error {ratio[0]:.3f} along +q, {ratio[1]:.3f} along -q")
    ratio_within(judge, "constants, mean of both", float(ratio.mean()), count, SEEDS)
    ratio = scatter(knots, stated)
    print(
        f"  knots of the curve with the delay estimated: {ratio.min():.2f} to {ratio.max():.2f}; inside their 95 % intervals: "
        f"{100 * np.mean(np.abs(knots) <= REACH * stated):.0f} % (their own curvature is not in the interval)"
    )
    ratio_within(judge, "knots of the curve, mean", float(ratio.mean()), count, SEEDS)
    v = more[-1, 2]
    print(
        f"  what the constant is: an intercept with V_1 = {v:.3f} rad/s; the Coulomb torques are {COULOMB}, "
        f"at rest {COULOMB[0] + STRIBECK:.2f} along +q"
    )
    judge.at_most("largest half-width", H.max(), 0.05, "N.m")
    judge.at_most("rms over the knots, mean over seeds, both directions", R.mean(), 0.03, "N.m")


def one_sweep(seed: int) -> tuple[np.ndarray, ...]:
    """Return mean torques and standard errors of a joint with and without a delay, and the delay with its error [ms]."""
    rows = []
    for plant in (joint_1().replace(torque_noise=0.2), joint().replace(delay=1.3e-3)):
        log = simulate(plant, Sweep(STROKE, V, N), seed=seed)
        knots = sweep_knots(log, 0, delay=plant.delay)
        rows.append(np.concatenate([knots.F_pos, knots.F_neg]))
        rows.append(np.concatenate([knots.error_pos, knots.error_neg]))
    parts = prepare(log, 0)
    return *rows, 1e3 * np.array(sweep_delay(parts, windows(log, 0, log.plan, parts)))


def repeated(judge: Judge, first: int, count: int) -> None:
    """Repeat one sweep: do knots and delay scatter as much as their standard errors say?"""
    print(f"\none sweep, repeated {count} times: scatter by the stated standard error")
    plain, error, late, late_error, d = (
        np.array(x) for x in zip(*many(one_sweep, range(first, first + count)), strict=False)
    )
    for name, values, stated in (
        ("knots without a delay", plain, error),
        ("knots with one of 1.3 ms, told", late, late_error),
    ):
        ratio = scatter(values, stated)
        print(f"  {name}: {ratio.min():.2f} to {ratio.max():.2f}, mean {ratio.mean():.3f}")
        ratio_within(judge, f"{name}, mean", float(ratio.mean()), count, REPEATS)
        worst = float(np.abs(ratio - 1.0).max())
        if count >= REPEATS:
            judge.at_most(f"{name}, the one that is farthest from 1, by", worst, 0.15)
    print(f"  delay of 1.3 ms: {d[:, 0].mean():.3f} +- {d[:, 0].std():.3f} ms, stated {d[:, 1].mean():.3f}")
    ratio_within(judge, "delay", float(scatter(d[:, 0], d[:, 1])), count, REPEATS)


def refusals(judge: Judge) -> None:
    """Show what is not attributed."""
    print("\nwhat is not attributed")
    plant = joint()
    for name, centers in (
        ("two centers 30 deg apart", (-15.0, 15.0)),
        ("one center", (0.0,)),
        ("10 deg apart", (0.0, 10.0, 20.0)),
    ):
        found = fit_sweeps(logs(plant, centers), "joint_1", symmetric=False)
        words = next((w for w in found.warnings if "offset unattributed" in w), "")
        print(f"  {name}: condition {found.condition:.3g}")
        judge.that(
            f"{name}: refused, with what would separate it", "half a turn" in words and "vertical" in words
        )
    for centers in ((-90.0, 87.0), (-60.0, 60.0)):
        found = fit_sweeps(logs(plant, centers), "joint_1", symmetric=False)
        v = np.array(found.law.velocity)
        mean = 0.5 * (
            np.array(found.law.positive) + found.law.negative - plant.law.torque(v) + plant.law.torque(-v)
        )
        uneven = np.array(found.law.positive) - found.law.negative
        print(
            f"  centers {centers[0]:g}, {centers[1]:g}: mean curve off by {np.abs(mean).max():.3f} N.m, the difference "
            f"varies by {np.ptp(uneven):.3f} N.m with speed (truth: 0); a constant of {found.terms['offset'][0]:.3f} N.m set apart"
        )
        judge.at_most(
            "two centers bend no curve", float(max(np.abs(mean).max(), 0.5 * np.ptp(uneven))), 0.06, "N.m"
        )
    found = fit_sweeps(logs(plant, (-90.0, 90.0)), "joint_1")
    print(
        f"  two centers half a turn apart: condition {found.condition:.3g}, off by {off(found, plant).round(3)} N.m"
    )
    judge.at_most("half a turn apart: constants off by", float(np.abs(off(found, plant)).max()), 0.05, "N.m")


def harmonic(judge: Judge) -> None:
    """Add what a gravity that is no sine costs, for example of a spring that balances the joint."""
    print("\na harmonic e cos(2 q - phase) that is not in the model: how far the constants go off")
    plant, e = joint(), 0.5
    plain = logs(plant)
    clean = off(fit_sweeps(plain, "joint_1"), plant)
    worst = 0.0
    for phase in (0.0, 45.0, 90.0):
        bent = [
            log.replace(torque=log.torque + e * np.cos(2.0 * log.position - np.deg2rad(phase)))
            for log in plain
        ]
        moved = (off(fit_sweeps(bent, "joint_1"), plant) - clean) / e
        worst = max(worst, float(np.abs(moved).max()))
        print(f"  phase {phase:3.0f} deg: {moved[0]:+.2f} e along +q, {moved[1]:+.2f} e along -q")
    print("  by the weights +1, -1, +1 of the half sums: -2 e at phase 0")
    judge.that(f"worst: {worst:.2f} times the amplitude (about twice: 1 to 2.2)", 1.0 <= worst <= 2.2)


def symmetric(judge: Judge) -> None:
    """Compare the thesis' method, one curve for both directions, on the same data."""
    print("\nthe thesis' symmetric method on the same logs: its intercept less the true constants [N.m]")
    plant = joint()
    for center, log in zip(CENTERS, logs(plant), strict=False):
        for literal in (True, False):
            rate = to_polyline(sweep_knots(log, 0, literal=literal))
            F = np.array(rate.positive)
            rest = F[0] - rate.velocity[0] * (F[1] - F[0]) / (rate.velocity[1] - rate.velocity[0])
            bias = rest - truth(plant, rate.velocity)
            how = "literal" if literal else "aligned"
            print(f"  center {center:+4.0f} deg, {how}: {bias[0]:+.3f} along +q, {bias[1]:+.3f} along -q")
            if not literal:
                judge.at_most(
                    "aligned: bias by half the difference of the directions, differs by",
                    float(np.abs(bias - 0.5 * np.array([-1.0, 1.0]) * (COULOMB[0] - COULOMB[1])).max()),
                    0.03,
                    "N.m",
                )


def load(judge: Judge, first: int, count: int) -> None:
    """Identify friction that grows with the load, by posture and by payload."""
    print("\nfriction that grows with the load, on the assembled joint")
    errors = []
    for seed in range(first, first + count):
        found = fit_sweeps(logs(joint().replace(load_dependence=0.05), seed=seed), "joint_1")
        if found.load is not None:
            errors.append([found.load[0] - 0.05, found.load[1]])
    x = np.array(errors).reshape(-1, 2)
    print(
        f"  by posture, 0.05 put in: {0.05 + x[:, 0].mean():.4f} +- {x[:, 0].std():.4f}, standard error {x[:, 1].mean():.4f}"
    )
    judge.that(f"growth by posture seen in {len(x)} of {count}", len(x) == count)
    judge.at_most("growth by posture, worst error", float(np.abs(x[:, 0]).max()), 0.01)
    far = []
    for seed in range(count // 2):
        plant = joint().replace(load_dependence=0.05, delay=1.3e-3)
        found = fit_sweeps(logs(plant, (-81.67, 0.0, 81.67), seed=first + 300 + seed), "joint_1")
        assert found.load is not None
        v, more = np.array(found.law.velocity), 0.05 * found.load[2]
        up = found.law.positive - plant.law.torque(v) - more
        down = found.law.negative + plant.law.torque(-v) - more
        far.append([found.load[0] - 0.05, np.sqrt(np.mean(np.concatenate([up, down]) ** 2))])
    y = np.abs(far).max(axis=0)
    print(
        f"  about -82, 0, 82 deg, where inertia outweighs gravity, delay of 1.3 ms not told: worst {y[0]:.4f}, curve {y[1]:.3f} N.m"
    )
    judge.at_most("growth there, worst error", float(y[0]), 0.003)
    judge.at_most("curve there, rms over the knots, worst", float(y[1]), 0.1, "N.m")
    bare = 2 * count - 4
    none = sum(
        fit_sweeps(logs(joint(), seed=first + 50 + s), "joint_1").load is not None for s in range(bare)
    )
    judge.that(f"growth seen where there is none: {none} of {bare} (at most 1)", none <= 1)
    rate = GearLoad(coulomb=8.0, load=0.02, driving=0.06, driven=0.01, stribeck_velocity=1e3, viscous=2.0)
    plant = joint().replace(law=Law(rate=rate))
    rows = []
    for seed in range(count // 2):
        knots, payloads = [], []
        for weight in (0.0, 20.0):
            real = plant.replace(gravity_cos=30.0 + weight)
            knots += [
                sweep_knots(log, 0) for log in logs(real, seed=first + 100 + 2 * seed + int(weight > 0))
            ]
            payloads += [(0.0, weight)] * len(CENTERS)
        found = payload_growth(knots, payloads)
        rows.append([found.driving[0], found.driven[0], found.driving[1], found.driven[1], found.gravity[1]])
    x = np.array(rows)
    mean, spread = x.mean(axis=0), x.std(axis=0)
    print(
        f"  by a payload of 20 N.m, 0.08 lifting and 0.03 driven back put in: {mean[0]:.4f} +- {spread[0]:.4f} and "
        f"{mean[1]:.4f} +- {spread[1]:.4f}"
    )
    print(f"    standard errors {mean[2]:.4f} and {mean[3]:.4f}; gravity {mean[4]:.3f} N.m (30 put in)")
    judge.at_most("growth by payload, worst error", float(np.abs(x[:, :2] - (0.08, 0.03)).max()), 0.01)
    posture = fit_sweeps(logs(plant), "joint_1", timing="command")
    print(
        f"  the same joint by posture alone: mean growth {posture.load[0] if posture.load else 0.0:.4f} (0.055 put in), gravity "
        f"{posture.terms['gravity_cos'][0]:.2f}, 30 (1 + 0.025) = 30.75: the difference hides in gravity"
    )


def main() -> None:
    """Print the tables and the verdict."""
    made = parser(__doc__)
    made.add_argument("--seed", type=int, help="first seed of what is repeated; fresh ones by default")
    asked: argparse.Namespace = made.parse_args()
    judge, first = Judge(), first_seed(asked.seed)
    seeds(judge, first, 16 if asked.short else SEEDS)
    repeated(judge, first, 40 if asked.short else REPEATS)
    refusals(judge)
    harmonic(judge)
    symmetric(judge)
    load(judge, first, 4 if asked.short else 12)
    judge.end()


if __name__ == "__main__":
    main()
