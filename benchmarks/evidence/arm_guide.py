"""A six-axis arm guided by hand and under sensorless admittance, through the loop of the whole arm; and what faults do to it.

The arm is that of `_arm_scene`: rigid bodies by MuJoCo, motors behind transmissions that yield, friction of another kind than the
model's (a bristle with a Stribeck peak, ripple and growth with the load, by direction), counts, torque a tick late. Masses,
frictions, stiffnesses are drawn per seed; the model is what `identify(method="arm")` makes of 40 s of free motion with the nominal
description. A hand holds the tool softly (800 N/m, 25 N.m/rad) and moves it in strokes of random directions. The bare arm runs
through the same loop with gravity held and nothing else.

- guided: algFC with dither, R 0.8. admittance: beside that, virtual masses of the joints' own inertia, moved by the estimated
  external torque.
- walls: the ranges are so narrow that the hand pushes on against their ends.
- coupled: a wrist whose motors drive two joints each, with the loop that knows it, with one that does not, and bare.
- faults: those of `loop_safety`, readings on one joint of six, models on all.
"""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import _arm_guide_faults as faults
import numpy as np
from _arm_guided import TICK, Machine, Run, play, strokes
from _arm_scene import drawn, free_motion, record
from _arm_truth import COUNT, NAMES, POSTURE, Arm, J
from _common import Judge, first_seed, parser

from backdrive import Joint, Log, identify
from backdrive.control import Admittance, ArmLoop
from backdrive.control.compensators import Dither
from backdrive.errors import BackdriveWarning
from backdrive.model import FrictionModel
from backdrive.plans.limits import JointLimits
from backdrive.robot import Robot, load_robot
from backdrive.status import Status

SECONDS, SETTLED = 6.0, 0.6  # of a run; from when on forces count [s]
DITHER = Dither(share=0.3)
STIFF = 5e-4  # deflection of a contact that is stiffer than this arm's own, 0.5 to 1 mrad [rad]
WIDTH, DEPTH = 0.3, 0.15  # of a narrow range to either side, and of its walls [rad]
FOLLOW, LAG = (
    25.0,
    100.0,
)  # angular frequency of the admittance's position controller [rad/s], and L of its estimate [1/s]
SLOW = 0.3  # speed at which friction is looked at for viscosity and dead band [rad/s]
LATCHED = int(Status.LATCHED)
TOOL = "tool"
COUPLED = np.eye(J)
COUPLED[4, 3], COUPLED[5, 4], COUPLED[4, 5] = 0.25, -0.5, 0.2


@dataclass(frozen=True, eq=False)
class Known:
    """An arm, and what is known of it."""

    arm: Arm
    robot: Robot
    model: FrictionModel


def identified(seed: int, folder: Path) -> Known:
    """Draw an arm and identify it from 40 s of free motion, with the nominal description."""
    rng = np.random.default_rng(seed)
    arm, description = drawn(rng), folder / "arm.urdf"
    description.write_text(Arm().urdf())
    r = record(arm, free_motion(40.0, rng), rng, every=2)
    joints = tuple(
        Joint(name=n, encoder_counts=1.0 / c) for n, c in zip(NAMES, arm.joints[:, COUNT], strict=False)
    )
    log = Log(time=r.time, position=r.position, torque=r.torque, joints=joints)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BackdriveWarning)
        model = identify(log, method="arm", urdf=str(description)).model
    return Known(arm, load_robot(description), model)


def loop_of(known: Known, **options) -> ArmLoop:
    """Return the loop of an identified arm."""
    return ArmLoop.from_model(known.model, known.robot, interval=TICK, **options)


def admittances(known: Known) -> dict[str, dict]:
    """Return a virtual mass of its own inertia for each joint, and a dead band of a fifth of its friction."""
    M = known.robot.inertia(POSTURE[None])[0]
    fields = {}
    for j, name in enumerate(known.robot.joints):
        friction = known.model.joint(name)
        own = float(M[j, j] + friction.dynamics["inertia"].value)
        F = float(np.abs(friction.law.torque(np.array([-SLOW, SLOW]))).mean())
        admittance = Admittance(
            inertia=own, viscosity=0.5 * F, proportional=own * FOLLOW**2, derivative=1.4 * FOLLOW * own, limit=60.0
        )  # fmt: skip
        fields[name] = {"admittance": admittance, "threshold": 0.2 * F}
    return fields


def sizes(r: Run) -> tuple[float, float, float]:
    """Return mean and largest force of the hand [N], and its mean moment [N.m]."""
    begin = round(SETTLED / TICK)
    force = np.linalg.norm(r.force, axis=1)[begin:]
    return float(force.mean()), float(force.max()), float(np.linalg.norm(r.moment, axis=1)[begin:].mean())


def narrow(known: Known) -> dict[str, JointLimits]:
    """Return limits of the joints so close to the posture that a hand meets them."""
    return {
        name: JointLimits(
            name=name, lower=POSTURE[j] - WIDTH, upper=POSTURE[j] + WIDTH, velocity=own.velocity, effort=own.effort
        )
        for j, (name, own) in enumerate(zip(known.robot.joints, known.robot.ranges, strict=False))
    }  # fmt: skip


def outside(r: Run, limits: Mapping[str, JointLimits]) -> float:
    """Return by how much a link left its range at most, negative where none did [rad]."""
    ends = np.array([[x.lower, x.upper] for x in limits.values()])
    return float(max((ends[:, 0] - r.link).max(), (r.link - ends[:, 1]).max()))


def sway(known: Known, loop: ArmLoop, seed: int) -> tuple[float, str]:
    """Return how far the furthest link sways within 1.5 s while the hand stands still [rad], and which it is."""
    still = np.zeros((3000, 3))
    swept = np.ptp(play(Machine(known.arm), loop, still, still).link[1500:], axis=0)
    return float(swept.max()), f"seed {seed}, joint {swept.argmax() + 1}"


def guiding(judge: Judge, first: int, seeds: int) -> Known:
    """Guide arms by hand: bare, compensated, under admittance, against walls."""
    table, latched, beyond, inside = [], 0, -np.inf, 0.0
    tremble = stiffer = (0.0, "")
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + seeds):
            known = identified(seed, Path(folder))
            rng = np.random.default_rng([seed, 1])
            path, velocity = strokes(rng, SECONDS)
            runs = {
                "bare": loop_of(known, share=0.0),
                "guided": loop_of(known, dither=DITHER),
                "admittance": loop_of(known, dither=DITHER, bandwidth=LAG, changes=admittances(known)),
            }
            row = []
            for name, loop in runs.items():
                r = play(Machine(known.arm), loop, path, velocity)
                row += [*sizes(r)]
                latched += bool(np.any(r.codes == LATCHED))
                if name == "admittance":
                    tremble = max(tremble, sway(known, loop, seed))
                    stiff = loop_of(
                        known, dither=DITHER, bend=STIFF, bandwidth=LAG, changes=admittances(known)
                    )
                    stiffer = max(stiffer, sway(known, stiff, seed))
            table.append(row)
            limits = narrow(known)
            walls = {name: {"margin": DEPTH} for name in limits}
            path, velocity = strokes(rng, SECONDS, size=0.22)
            loop = loop_of(known, dither=DITHER, limits=limits, changes=walls)
            r = play(Machine(known.arm), loop, path, velocity)
            latched += bool(np.any(r.codes == LATCHED))
            beyond = max(beyond, outside(r, limits))
            inside += float(np.mean(np.any(np.abs(r.torque[3]) > 0.5, axis=1))) / seeds
    x = np.array(table).reshape(seeds, 3, 3)
    print("| hand's | bare | guided | by the bare | admittance | by the bare |\n|---|---|---|---|---|---|")
    for k, what in enumerate(("mean force [N]", "peak force [N]", "mean moment [N.m]")):
        bare, guided, admitted = x[:, 0, k], x[:, 1, k], x[:, 2, k]
        print(
            f"| {what} | {np.median(bare):.1f} | {np.median(guided):.1f} | {np.median(guided / bare):.2f}, at most "
            f"{(guided / bare).max():.2f} | {np.median(admitted):.1f} | {np.median(admitted / bare):.2f}, at most "
            f"{(admitted / bare).max():.2f} |"
        )
    ratio = x[:, 1:] / x[:, :1]
    judge.that("guided: mean force below the bare arm's in every seed", bool(np.all(ratio[:, 0, 0] < 1.0)))
    judge.that("guided: peak force below the bare arm's in the median", bool(np.median(ratio[:, 0, 1]) < 1.0))
    judge.that(
        "admittance: mean force below the bare arm's in every seed", bool(np.all(ratio[:, 1, 0] < 1.0))
    )
    judge.that(
        "admittance: peak force below the bare arm's in the median", bool(np.median(ratio[:, 1, 1]) < 1.0)
    )
    judge.at_most(
        f"admittance: furthest that any link sways while the hand stands still ({tremble[1]})",
        tremble[0],
        0.02,
        "rad",
    )
    judge.at_most(
        f"the same with contacts of {1e3 * STIFF:g} mrad, stiffer than the joints' own ({stiffer[1]})",
        stiffer[0],
        0.02,
        "rad",
    )
    judge.at_most(
        f"walls ({100 * inside:.0f} % of the time at one): furthest beyond a range", beyond, 0.0, "rad"
    )
    judge.that(f"no latch: {latched} of {4 * seeds} runs", latched == 0)
    return known


def coupled(judge: Judge, first: int, seeds: int) -> None:
    """Guide arms with a coupled wrist."""
    rows = []
    for seed in range(first, first + seeds):
        rng = np.random.default_rng([seed, 2])
        arm = replace(drawn(rng), coupling=COUPLED)
        path, velocity = strokes(rng, SECONDS)
        description = load_text(arm)
        model = {"factor": float(rng.uniform(0.9, 1.1))}
        loops = [
            faults.loop_of(arm, description, model, share=0.0, coupling=COUPLED),
            faults.loop_of(arm, description, model, coupling=COUPLED),
            faults.loop_of(arm, description, model),
        ]
        runs = [play(Machine(arm), loop, path, velocity) for loop in loops]
        rows.append([(*sizes(r), wrist_error(r)) for r in runs])
    x = np.array(rows)
    for k, name in enumerate(("bare", "knows the coupling", "takes motors for joints")):
        force, peak, moment, error = np.median(x[:, k], axis=0)
        print(
            f"  {name:24s} mean {force:.1f} N, peak {peak:.1f} N, moment {moment:.2f} N.m; estimate of joints 4 to 6 off by "
            f"{error:.2f} N.m RMS"
        )
    judge.that(
        "coupled wrist: mean and peak force below the bare arm's in the median, the mean in every seed",
        bool(np.all(x[:, 1, 0] < x[:, 0, 0]) and np.median(x[:, 1, 1] / x[:, 0, 1]) < 1.0),
    )


def wrist_error(r: Run) -> float:
    """Return the RMS error of the external torque on the joints of the wrist [N.m]."""
    error = (r.estimate[0] - r.estimate[1])[round(SETTLED / TICK) :, 3:]
    return float(np.sqrt(np.mean(error**2)))


def load_text(arm: Arm) -> Robot:
    """Return the rigid bodies of an arm."""
    from backdrive.robot import parse_robot

    return parse_robot(arm.urdf())


def through_faults(judge: Judge, first: int, draws: int) -> None:
    """Play the faults of `loop_safety` on an arm."""
    before = len(judge.short)
    print(f"{'fault':48s} {'named':>9s} {'latched':>7s} {'longer':>7s} {'speed':>6s}")
    for name, case in faults.cases().items():
        seen, wrong = faults.Seen(), []
        for k in range(draws):
            rng = np.random.default_rng([first, 3, k])
            arm = drawn(rng)
            wrong += faults.play_fault(rng, arm, load_text(arm), case, seen)
        named = f"{seen.named}/{seen.acted}" if case.done == "named" else case.done
        print(
            f"  {name:46s} {named:>9s} {seen.latched:4d}/{seen.draws} {seen.longer:7.3f} {seen.fastest:6.2f}"
        )
        if wrong:
            judge.that(f"{name}: " + "; ".join(sorted(set(wrong))), False)
    print(
        "  not judged: sign inverted on joints 2 and 3, which carry weight: gravity pulls them down twice, until the brakes hold"
    )
    judge.that(f"{len(faults.cases())} faults on {draws} arms as promised", len(judge.short) == before)


def cost(known: Known, calls: int) -> None:
    """Print what a tick takes beside the calls of pinocchio that it makes, and beside inverse dynamics."""
    from importlib import import_module

    pin: Any = import_module("pinocchio")
    loop = loop_of(known, dither=DITHER, frame=TOOL)
    model, data = known.robot.model, known.robot.model.createData()
    t = TICK * np.arange(calls)[:, None]
    rows = list(POSTURE + 0.1 * np.sin(3.0 * t + np.arange(J)))
    zero, u = np.zeros(J), np.zeros(J)
    loop.reset(rows[0], gravity=1.0)

    fid, axes = known.robot.frame(TOOL), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def ours(q: np.ndarray) -> None:
        pin.computeGeneralizedGravity(model, data, q)
        pin.crba(model, data, q)
        pin.computeCoriolisMatrix(model, data, q, zero)
        pin.computeGeneralizedGravity(model, data, q)
        pin.computeFrameJacobian(model, data, q, fid, axes)

    kinds = {
        "tick": lambda q: loop.update(q, u),
        "its calls of pinocchio": ours,
        "pinocchio rnea": lambda q: pin.rnea(model, data, q, zero, zero),
        "nothing": lambda q: None,
    }
    took = {}
    for name, call in kinds.items():
        each = np.empty(calls)
        for k, row in enumerate(rows):
            begin = time.perf_counter_ns()
            call(row)
            each[k] = time.perf_counter_ns() - begin
        took[name] = np.percentile(each / 1e3, [50, 99])
        print(f"  {name:24s} median {took[name][0]:.2f} us, 99 % {took[name][1]:.2f} us")
    beside = took["tick"][0] - took["its calls of pinocchio"][0]
    print(f"  a tick on top of its calls of pinocchio: {beside:.2f} us")


def main() -> None:
    """Print the tables and the verdict."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int, help="first seed; None: fresh ones")
    options.add_argument("--seeds", type=int, default=20, help="how many")
    asked = options.parse_args()
    seeds = 2 if asked.short else asked.seeds
    first, judge = first_seed(asked.seed), Judge()
    known = guiding(judge, first, seeds)
    print("\na coupled wrist")
    coupled(judge, first, 1 if asked.short else max(seeds // 4, 1))
    print(
        "\nfaults: longer above 1.2 top speed than without compensation [s], largest speed by the top speed"
    )
    through_faults(judge, first, 1 if asked.short else max(seeds // 2, 1))
    print("\na tick of six joints")
    cost(known, 5000 if asked.short else 50_000)
    judge.end()


if __name__ == "__main__":
    main()
