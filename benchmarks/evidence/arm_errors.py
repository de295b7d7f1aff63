"""Standard errors that `identify --method arm` states, by the scatter of what comes out.

A planar arm of two links, written out as in textbooks with numpy alone, Coulomb and viscous friction and friction with a Stribeck
peak, follows the same motion again and again; from log to log only what disturbs it differs: white noise, noise that lasts 0.3 s,
friction whose level wanders by 5 % within 3 s or within 10 s. Judged, without the last: of all parameters that the motion shows,
how many lie within 1.96 stated errors of their mean. Then the same of the six-axis arm of `_arm_scene`, each log
another motion: there the misfit of a friction that follows no curve changes with the motion.

    python benchmarks/evidence/arm_errors.py [--short] [--seed N]
"""

from __future__ import annotations

import numpy as np
from _arm_scene import NAMES, drawn, free_motion, record
from _common import Judge, first_seed, parser
from scipy.signal import lfilter

from backdrive.identification.arm import identify_arm
from backdrive.logs.log import Joint, Log
from backdrive.robot import Robot, parse_robot

RATE, SECONDS = 100.0, 60.0
G, LENGTH = 9.81, 0.5
MASS, CENTER, INERTIA = (4.0, 2.5), (0.22, 0.18), (0.08, 0.04)
MOTOR, OFFSET = np.array([0.3, 0.15]), np.array([0.6, -0.4])
TONES = (
    ((0.11, 0.7, 0.3), (0.29, 0.35, 1.0), (0.83, 0.08, 2.0)),
    ((0.17, 0.8, 0.9), (0.41, 0.3, 0.1), (1.1, 0.06, 0.7)),
)
#: What disturbs a log: white noise, lasting noise [N.m], its memory [s]; wandering of the friction [-], its memory [s].
KINDS = {
    "white noise": (0.1, 0.0, 1.0, 0.0, 1.0),
    "noise that lasts 0.3 s": (0.02, 0.2, 0.3, 0.0, 1.0),
    "friction wanders within 3 s": (0.02, 0.0, 1.0, 0.05, 3.0),
    "friction wanders within 10 s": (0.02, 0.0, 1.0, 0.05, 10.0),
}
INFORMING = ("friction wanders within 10 s",)
SLIDES = 0.05  # share of the top speed above which knots make Coulomb and viscous friction
HOLDS, RATIO = 0.90, 1.5  # share within 1.96 stated errors; scatter by stated error of any parameter


def description() -> str:
    """Return the arm as URDF."""
    parts = ['<robot name="planar"><link name="base"/>']
    for i, (m, c, inertia) in enumerate(zip(MASS, CENTER, INERTIA, strict=False)):
        parts.append(
            f'<link name="l{i}"><inertial><mass value="{m}"/><origin xyz="{c} 0 0"/><inertia ixx="0.01" iyy="{inertia}" '
            f'izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j{i}" type="revolute"><parent '
            f'link="{"base" if i == 0 else "l0"}"/><child link="l{i}"/><origin xyz="{0.0 if i == 0 else LENGTH} 0 0"/>'
            '<axis xyz="0 -1 0"/><limit effort="1" velocity="1" lower="-9" upper="9"/></joint>'
        )
    return "".join(parts) + "</robot>"


def motion() -> tuple[np.ndarray, ...]:
    """Return time, positions, velocities and accelerations."""
    t = np.arange(round(SECONDS * RATE)) / RATE
    q, dq, ddq = np.zeros((3, t.size, 2))
    for j, tones in enumerate(TONES):
        for hertz, size, phase in tones:
            w = 2.0 * np.pi * hertz
            q[:, j] += size * np.sin(w * t + phase)
            dq[:, j] += size * w * np.cos(w * t + phase)
            ddq[:, j] -= size * w * w * np.sin(w * t + phase)
    return t, q, dq, ddq


def torque(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """Return the torque of bodies and motors [N.m], (n, 2)."""
    (q1, q2), (d1, d2), (a1, a2) = q.T, dq.T, ddq.T
    h = MASS[1] * LENGTH * CENTER[1]
    m22 = INERTIA[1] + MASS[1] * CENTER[1] ** 2
    m11 = INERTIA[0] + MASS[0] * CENTER[0] ** 2 + m22 + MASS[1] * LENGTH**2 + 2.0 * h * np.cos(q2)
    m12 = m22 + h * np.cos(q2)
    g2 = MASS[1] * CENTER[1] * G * np.cos(q1 + q2)
    g1 = (MASS[0] * CENTER[0] + MASS[1] * LENGTH) * G * np.cos(q1) + g2
    one = m11 * a1 + m12 * a2 - h * np.sin(q2) * (2.0 * d1 * d2 + d2**2) + g1
    two = m12 * a1 + m22 * a2 + h * np.sin(q2) * d1**2 + g2
    return np.column_stack([one, two]) + MOTOR * ddq + OFFSET


def friction(v: np.ndarray) -> np.ndarray:
    """Return Coulomb friction with a Stribeck peak, and viscous friction [N.m], (n, 2)."""
    speed = np.abs(v)
    return np.sign(v) * ([4.0, 2.0] + np.array([1.5, 0.8]) * np.exp(-speed / 0.15) + [2.0, 1.0] * speed)


def lasting(rng: np.random.Generator, n: int, memory: float) -> np.ndarray:
    """Return noise of unit variance that forgets within a memory [s], (n, 2)."""
    keep = np.exp(-1.0 / (memory * RATE))
    first = rng.standard_normal((1, 2)) * keep
    return lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal((n, 2)), axis=0, zi=first)[0]


def logs_of(kind: str, seed: int, count: int) -> list[Log]:
    """Return logs of the two-link arm."""
    white, slow, memory, wander, forgets = KINDS[kind]
    t, q, dq, ddq = motion()
    clean, F, made = torque(q, dq, ddq), friction(dq), []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        tau = clean + F * (1.0 + wander * lasting(rng, t.size, forgets))
        tau += white * rng.standard_normal(q.shape) + slow * lasting(rng, t.size, memory)
        made.append(Log(time=t, joints=(Joint(name="j0"), Joint(name="j1")), position=q, torque=tau))
    return made


def scatter(logs: list[Log], robot: Robot) -> tuple[list[str], np.ndarray, np.ndarray, np.ndarray]:
    """Return names of the parameters, values and stated errors by log, and which of them the motion shows."""
    values, errors, names, shown = [], [], [], np.zeros(0, dtype=bool)
    for log in logs:
        frictions, support, _ = identify_arm(log, robot, load_friction=False)
        row: dict[str, float] = {}
        for f in frictions:
            speeds, top = np.array(f.law.rate.velocity[:-1]), f.law.rate.velocity[-1]
            knots = 0.5 * (np.array(f.law.rate.positive[:-1]) + np.array(f.law.rate.negative[:-1]))
            speeds, knots = speeds[speeds >= SLIDES * top], knots[speeds >= SLIDES * top]
            line = np.linalg.lstsq(np.column_stack([np.ones(speeds.size), speeds]), knots, rcond=None)[0]
            row |= {f"coulomb {f.joint.name}": line[0], f"viscous {f.joint.name}": line[1]}
            row |= {f"{term} {f.joint.name}": f.dynamics[term].value for term in ("offset", "inertia")}
        stated = {f"{p.name} {p.joint}": p for s in support for p in s.precision}
        names = list(row)
        shown = np.array([stated[n].shows for n in names])
        values.append(list(row.values()))
        errors.append([stated[n].achieved for n in names])
    return names, np.array(values), np.array(errors), shown


def conclude(judge: Judge | None, what: str, logs: list[Log], robot: Robot) -> None:
    """Print scatter by stated error, and judge."""
    names, values, errors, shown = scatter(logs, robot)
    size = np.sqrt(np.mean(errors**2, axis=0))
    ratio = values.std(axis=0, ddof=1) / size
    few = np.sqrt(len(logs) / (len(logs) - 1.0))  # the mean is of the same logs
    inside = np.abs(values - values.mean(axis=0)) * few < 1.96 * errors
    share, worst = float(np.mean(inside[:, shown])), float(ratio[shown].max())
    told = ", ".join(f"{n} {r:.2f}" for n, r in zip(np.array(names)[shown], ratio[shown], strict=False))
    print(f"\n{what}, {len(logs)} logs; scatter by stated error: {told}", flush=True)
    if judge is None:
        print(f"  (within 1.96 stated errors: {100 * share:.1f} %)")
        return
    judge.that(f"{what}: {100 * share:.1f} % within 1.96 stated errors (at least 90)", share >= HOLDS)
    judge.at_most(f"{what}: largest scatter by stated error", worst, RATIO)


def main() -> None:
    """Draw, identify, judge."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int)
    given = options.parse_args()
    judge, seed = Judge(), first_seed(given.seed)
    planar, count = parse_robot(description()), 15 if given.short else 60
    for kind in KINDS:
        conclude(None if kind in INFORMING else judge, kind, logs_of(kind, seed, count), planar)
    if not given.short:
        arm = drawn(np.random.default_rng(seed))
        made = []
        for k in range(10):
            rng = np.random.default_rng([seed, k])
            r = record(arm, free_motion(150.0, rng), rng, every=4)
            joints = tuple(Joint(name=n) for n in NAMES)
            made.append(Log(time=r.time, position=r.position, torque=r.torque, joints=joints))
        conclude(judge, "six axes, each log another motion", made, parse_robot(arm.urdf()))
    judge.end()


if __name__ == "__main__":
    main()
