"""Motions for whole arms: limits kept between the knots, information against random multisines, errors expected and achieved.

Two arms of `example-robot-data`, a UR5 and a Panda, planned by `backdrive plan arm` as a person would. Judged by code of its own:
rigid bodies by Newton and Euler in NumPy (`_arm_bodies`), self-collision by pinocchio's geometry with the meshes themselves in
the place of hulls, between the knots of the 100 Hz trajectory that a robot would be given, by cubic pieces through positions and
velocities.

Random multisines have the same period, number of sines, duration and limits: amplitudes at random, every joint scaled until it
fills its range, speed or acceleration about a random posture, then all shrunk together until torque and self-collision allow it.
They run at full pace all the time. Information is that of what is asked for, base parameters and Coulomb and viscous friction by
joint, with offsets estimated beside them: its determinant to the power of 1 / number of parameters.

The simulated arm has bodies 20 % off the description's, Coulomb and viscous friction with a Stribeck bump, drives with inertia,
offsets, an encoder, and white noise of the torque; it is identified by the method `arm`. Achieved: the standard error that a fit
states, median of all runs, and, beside it, the scatter of the runs.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from _arm_plan_bodies import Chain
from _common import Judge, first_seed, parser
from scipy.interpolate import CubicHermiteSpline
from ur3 import description

from backdrive.cli._plan_arm import plan_arm
from backdrive.cli._plan_request import Request
from backdrive.identification.arm import identify_arm
from backdrive.logs.log import Joint, Log
from backdrive.plans.limits import read_limits
from backdrive.robot import load_robot

ARMS = {  # description, joints, acceleration limits [rad/s^2]
    "ur5": ("ur_description/urdf/ur5_robot.urdf", 6, (8.0,) * 6),
    "panda": ("panda_description/urdf/panda.urdf", 7, (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0)),
}
DURATION = 60.0  # s
RANDOM, HALVINGS, RUNS = 50, 8, 20
INSTANTS, KNOTS = 10_000, 100.0  # between the knots; knots a second
RATE, COUNT = 200.0, 2e-5  # of the simulated log [Hz], its encoder's count [rad]
NOISE, FRICTION, MARGIN = (
    0.01,
    0.05,
    0.05,
)  # below 5 Hz and friction, of the torque limit [-]; the command's margin


class Arm:
    """One arm, as this program knows it."""

    def __init__(self, name: str):
        robots = description().parents[2]
        file, count, acceleration = ARMS[name]
        self.name, self.urdf, self.packages = name, robots / file, robots.parents[1]
        self.joints = load_robot(self.urdf).joints[:count]
        limits = read_limits(self.urdf)
        self.lower, self.upper, self.velocity, self.effort = (
            np.array([getattr(limits[j], k) for j in self.joints])
            for k in ("lower", "upper", "velocity", "effort")
        )
        self.acceleration = np.array(acceleration)
        self.chain = Chain(self.urdf, self.joints)
        self._collisions()

    def _collisions(self) -> None:
        """Prepare pinocchio's own geometry with the meshes, all pairs but those whose links share a joint."""
        import pinocchio as pin

        whole = pin.buildModelFromUrdf(str(self.urdf))
        shapes = pin.buildGeomFromUrdf(
            whole, str(self.urdf), pin.GeometryType.COLLISION, package_dirs=[str(self.packages)]
        )
        held = [i for i, n in enumerate(whole.names) if i and n not in self.joints]
        self.model, self.shapes = pin.buildReducedModel(whole, shapes, held, pin.neutral(whole))
        self.shapes.removeAllCollisionPairs()
        objects, parents = list(self.shapes.geometryObjects), list(self.model.parents)
        for i, a in enumerate(objects):
            for j in range(i):
                x, y = a.parentJoint, objects[j].parentJoint
                if x != y and parents[x] != y and parents[y] != x:
                    self.shapes.addCollisionPair(pin.CollisionPair(j, i))
        self.data, self.shape_data = self.model.createData(), pin.GeometryData(self.shapes)
        self.collide = pin.computeCollisions

    def collides(self, q: np.ndarray) -> bool:
        """Return whether links overlap at any of some positions (n, J)."""
        return any(self.collide(self.model, self.data, self.shapes, self.shape_data, x, True) for x in q)

    def torque(self, q, dq, ddq) -> np.ndarray:
        """Return the torque of the description's bodies [N.m], (n, J)."""
        return self.chain.regressor(q, dq, ddq) @ self.chain.parameters

    def shares(self, q, dq, ddq) -> dict[str, float]:
        """Return the largest share of each limit, friction as expected on top of the torque."""
        middle, half = 0.5 * (self.upper + self.lower), 0.5 * (self.upper - self.lower)
        push = np.abs(self.torque(q, dq, ddq)) + FRICTION * self.effort
        return {
            "position": float((np.abs(q - middle) / half).max()),
            "speed": float((np.abs(dq) / self.velocity).max()),
            "acceleration": float((np.abs(ddq) / self.acceleration).max()),
            "torque with friction": float((push / self.effort).max()),
        }

    def information(self, q, dq, ddq, base: np.ndarray) -> float:
        """Return log det of the information per parameter asked for, offsets estimated beside them."""
        n, J = q.shape
        gram = 0.0
        for at in range(0, n, 1000):
            s = slice(at, at + 1000)
            bodies = self.chain.regressor(q[s], dq[s], ddq[s]) @ base
            own = np.zeros((bodies.shape[0], J, 3 * J))
            each = np.arange(J)
            own[:, each, each], own[:, each, J + each], own[:, each, 2 * J + each] = (
                np.sign(dq[s]),
                dq[s],
                1.0,
            )
            rows = np.concatenate([bodies, own], axis=2) / (NOISE * self.effort)[None, :, None]
            flat = rows.reshape(-1, rows.shape[2])
            gram = gram + flat.T @ flat * (10.0 * DURATION / n)
        rest = gram[-J:, -J:]
        asked = gram.shape[0] - J
        return float((np.linalg.slogdet(gram)[1] - np.linalg.slogdet(rest)[1]) / asked)


def random_motion(arm: Arm, period: float, sines: int, random: np.random.Generator):
    """Return a random multisine within the limits: position, velocity, acceleration over its period."""
    room = 0.5 * MARGIN * (arm.upper - arm.lower)
    low, high = arm.lower + room, arm.upper - room
    while True:
        center = random.uniform(low, high)
        still = np.zeros((1, center.size))
        light = np.abs(arm.torque(center[None], still, still)[0]) < (1 - MARGIN - FRICTION) * arm.effort
        if light.all() and not arm.collides(center[None]):
            break
    w = 2 * np.pi / period * np.arange(1, sines + 1)
    a, b = random.normal(size=(2, sines, center.size)) / w[None, :, None]
    t = np.linspace(0, period, 20 * sines, endpoint=False)
    turn = np.outer(t, w)
    swing = np.sin(turn) @ a + np.cos(turn) @ b
    speed = (np.cos(turn) * w) @ a - (np.sin(turn) * w) @ b
    rise = -(np.sin(turn) * w**2) @ a - (np.cos(turn) * w**2) @ b
    rest = 1.0 - MARGIN
    factor = np.minimum(
        rest * arm.velocity / np.abs(speed).max(0), rest * arm.acceleration / np.abs(rise).max(0)
    )
    factor = np.minimum(factor, (high - center) / swing.max(0))
    factor = np.minimum(factor, (center - low) / -swing.min(0))

    def scaled(share: float):
        return center + share * factor * swing, share * factor * speed, share * factor * rise

    def allowed(share: float) -> bool:
        q, dq, ddq = scaled(share)
        push = np.abs(arm.torque(q, dq, ddq)) / arm.effort
        return bool(push.max() <= rest - FRICTION) and not arm.collides(q)

    low_share, high_share = (1.0, 1.0) if allowed(1.0) else (0.0, 1.0)
    while high_share - low_share > 2.0**-HALVINGS:
        middle = 0.5 * (low_share + high_share)
        low_share, high_share = (middle, high_share) if allowed(middle) else (low_share, middle)
    return scaled(low_share)


def simulated(arm: Arm, plan, truth: dict[str, np.ndarray], random: np.random.Generator) -> Log:
    """Return a log of the plan by an arm of other bodies, with friction, drives, offsets, counts and noise."""
    t = np.arange(int(plan.duration * RATE) + 1) / RATE
    q, dq, ddq = plan.position(t), plan.velocity(t), plan.acceleration(t)
    bump = 1.0 + 0.15 * np.exp(-((dq / (0.05 * arm.velocity)) ** 2))
    tau = arm.chain.regressor(q, dq, ddq) @ truth["bodies"] + truth["drive"] * ddq + truth["offset"]
    tau = tau + np.sign(dq) * truth["coulomb"] * bump + truth["viscous"] * dq
    white = NOISE * arm.effort * np.sqrt(RATE / 10.0)  # so much of it lies below 5 Hz
    return Log(
        time=t,
        joints=tuple(Joint(name=n) for n in arm.joints),
        position=COUNT * np.round(q / COUNT),
        torque=tau + white * random.standard_normal(tau.shape),
        plan=plan,
    )


def values_of(robot, frictions, model) -> dict[tuple[str, str], float]:
    """Return the estimates that standard errors are stated of, by joint and name."""
    base = robot.base.relation @ np.array(model.parameters)
    names = [robot.parameter_names[c].split(" of ", 1) for c in robot.base.columns]
    out = {(joint, name): float(v) for (name, joint), v in zip(names, base, strict=False)}
    for friction in frictions:
        name, rate = friction.joint.name, friction.law.rate
        knots = np.array(rate.velocity[:-1])
        mean = 0.5 * (np.array(rate.positive[:-1]) + np.array(rate.negative[:-1]))
        slides = knots >= 0.05 * rate.velocity[-1]
        line = np.linalg.lstsq(
            np.column_stack([np.ones(knots.size), knots])[slides], mean[slides], rcond=None
        )[0]
        out[name, "coulomb"], out[name, "viscous"] = float(line[0]), float(line[1])
        for key in ("offset", "inertia"):
            out[name, key] = friction.dynamics[key].value
    return out


def errors(arm: Arm, outcome, runs: int, seed: int, judge: Judge) -> None:
    """Simulate, identify, and compare standard errors."""
    random = np.random.default_rng(seed)
    J = len(arm.joints)
    truth = {
        "bodies": arm.chain.parameters * np.repeat(1.0 + 0.2 * random.uniform(-1, 1, J), 10),
        "drive": 0.1 * np.abs(arm.chain.parameters.reshape(J, 10)[:, 4:]).max() * random.uniform(0.5, 1.5, J),
        "offset": 0.01 * arm.effort * random.uniform(-1, 1, J),
        "coulomb": FRICTION * arm.effort * random.uniform(0.4, 0.8, J),
        "viscous": 0.3 * FRICTION * arm.effort / arm.velocity * random.uniform(0.5, 1.0, J),
    }
    robot = load_robot(arm.urdf).without_tools(arm.joints)
    expected = {(e.joint, e.name): e for e in outcome.errors}
    unseen = simulated(arm, outcome.plan, truth, random).rows(slice(0, round(5 * RATE)))
    stated, found = [], []
    for _ in range(runs):
        log = simulated(arm, outcome.plan, truth, random)
        frictions, evidence, model = identify_arm(log, robot, held_out=[unseen.replace(plan=None)])
        stated.append({(p.joint, p.name): p.achieved for e in evidence for p in e.precision})
        found.append(values_of(robot, frictions, model))
    keys = list(expected)
    plan_errors = np.array([expected[k].expected for k in keys])
    fit = np.median([[s[k] for k in keys] for s in stated], axis=0)
    scatter = np.std([[f[k] for k in keys] for f in found], axis=0, ddof=1)
    shows = np.array([expected[k].shows for k in keys])
    print(
        f"\n{arm.name}: standard errors of {len(keys)} parameters, {runs} runs; expected over stated and over scatter"
    )
    for kind, pick in (
        ("Coulomb", [k[1] == "coulomb" for k in keys]),
        ("viscous", [k[1] == "viscous" for k in keys]),
        ("offset", [k[1] == "offset" for k in keys]),
        ("drives", [k[1] == "inertia" for k in keys]),
        ("bodies", [k[1] not in ("coulomb", "viscous", "offset", "inertia") for k in keys]),
    ):
        a, b = plan_errors[pick] / fit[pick], plan_errors[pick] / scatter[pick]
        print(
            f"  {kind:8s} {sum(pick):3d}   stated {np.median(a):5.2f} ({a.min():.2f} to {a.max():.2f})   "
            f"scatter {np.median(b):5.2f} ({b.min():.2f} to {b.max():.2f})"
        )
    for what, achieved in (("stated by the fit", fit), ("the scatter of the runs", scatter)):
        ratio = plan_errors / achieved
        within = np.mean((ratio > 1 / 1.5) & (ratio < 1.5))
        shown = np.mean(((ratio > 1 / 1.5) & (ratio < 1.5))[shows])
        print(f"  within 1.5 of {what}: {100 * within:.1f} % of all, {100 * shown:.1f} % of those that show")
        if what.startswith("stated") or runs >= 20:
            share = within if what.startswith("stated") else shown
            of = "" if what.startswith("stated") else " of those said to show"
            judge.that(
                f"{arm.name}: {100 * share:.1f} %{of} within 1.5 of {what} (at least 90)", share >= 0.9
            )
    print(f"  said to hardly show: {int(np.sum(~shows))}")


def judged(name: str, short: bool, seed: int, judge: Judge) -> None:
    """Plan for one arm and judge it."""
    arm = Arm(name)
    said: list[tuple[float, float]] = []
    limits = [f"{j}.acceleration={a}" for j, a in zip(arm.joints, arm.acceleration, strict=False)]
    request = Request(
        kind="arm",
        urdf=arm.urdf,
        joint=list(arm.joints),
        packages=Path(arm.packages),
        limit=limits,
        duration=DURATION,
    )
    wall, cpu = time.perf_counter(), time.process_time()
    outcome = plan_arm(request, lambda sentence: said.append((time.perf_counter(), time.process_time())))
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    plan, silence = outcome.plan, np.diff(said, axis=0).max(axis=0)
    print(
        f"\n{name}: planned in {wall:.0f} s ({cpu:.0f} s of one core), {len(said)} signs of progress, "
        f"longest silence {silence[0]:.1f} s ({silence[1]:.1f} s of one core)"
    )
    for note in outcome.notes:
        print(f"  {note}")
    judge.at_most(f"{name}: planned in", min(wall, cpu), 180.0, "s of a core")
    judge.at_most(
        f"{name}: longest silence between signs of progress", float(min(silence)), 2.0, "s of a core"
    )

    random = np.random.default_rng(seed)
    knots = np.arange(int(plan.duration * KNOTS) + 1) / KNOTS
    spline = CubicHermiteSpline(knots, plan.position(knots), plan.velocity(knots))
    t = random.uniform(0, knots[-1], INSTANTS)
    q, dq, ddq = spline(t), spline(t, 1), spline(t, 2)
    for what, share in arm.shares(q, dq, ddq).items():
        judge.at_most(f"{name}: {what} at {INSTANTS} instants between the knots", share, 1.0, "of its limit")
    judge.that(f"{name}: no self-collision at {INSTANTS} instants, by the meshes", not arm.collides(q))

    base = arm.chain.base()
    t = np.linspace(0, plan.duration, 4000)
    ours = arm.information(plan.position(t), plan.velocity(t), plan.acceleration(t), base)
    others = []
    for _ in range(RANDOM if not short else 10):
        motion = random_motion(arm, plan.period, len(plan.sine[0]), random)
        others.append(arm.information(*motion, base))
    gain = float(np.exp(ours - max(others)))
    print(
        f"{name}: information per parameter {np.exp(ours):.4g}; of {len(others)} random multisines best "
        f"{np.exp(max(others)):.4g}, median {np.exp(np.median(others)):.4g}"
    )
    judge.that(f"{name}: {gain:.2f} times the information of the best random one (at least 2)", gain >= 2.0)
    errors(arm, outcome, 2 if short else RUNS, seed + 1, judge)


def main() -> None:
    """Judge both arms."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int)
    options.add_argument("--arm", choices=tuple(ARMS), action="append", help="only this one")
    given = options.parse_args()
    seed, judge = first_seed(given.seed), Judge()
    for name in given.arm or (["ur5"] if given.short else ARMS):
        judged(name, given.short, seed, judge)
    judge.end()


if __name__ == "__main__":
    main()
