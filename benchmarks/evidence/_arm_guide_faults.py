"""The faults of `loop_safety` through the loop of six joints: who is given what, what is promised of it, and whether it holds.

Readings are wrong on one joint of six, models on all. The loop believes friction, stiffness and inertia as the fault has it; limits
are 1.5 R F(top speed) of the true joint, as there. A hand guides the tool and lets go after 3 s; two joints are nudged with 2 to
5 F. Readings that are bad for long latch; a brake holds a motor 0.4 s after its latch.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from _arm_guided import TICK, Machine, Run, play, strokes
from _arm_truth import (
    BACK,
    BEND,
    COUNT,
    FORTH,
    MOTOR,
    NAMES,
    PEAK,
    PEAK_SPEED,
    SPEED,
    STIFF,
    VISCOUS,
    Arm,
    J,
)  # fmt: skip
from _loop_cases import Case, cases, longest
from _loop_scenes import Fault

from backdrive.control import ArmJoint, ArmLoop, JointLoop
from backdrive.control.compensators import Dither, alg_fc, nothing
from backdrive.control.compensators.extras import DisturbanceObserver
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.errors import LimitWarning
from backdrive.laws import Polyline
from backdrive.plans.limits import JointLimits
from backdrive.robot import Robot
from backdrive.status import Status

SHARE, LASTS, FAST = 0.8, 5.5, 1.5
KNOTS = (0.002, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0, 1.3)  # by the top speed
LATCHED, GONE, HELD = int(Status.LATCHED), 0.2, 1.05  # torque beside gravity, and gravity, after a latch [s]
MISSING = (
    1.6  # time that passes, by what the loop is told, where every third call is missed and nobody says so
)
NOTABLE = 0.2  # share of the limit from which a torque is one that a frozen encoder leaves standing
LONGER = 0.05  # above 1.2 top speed than without compensation [s]
TOP = 1.5 * SPEED


def true_friction(arm: Arm, j: int, v: np.ndarray) -> np.ndarray:
    """Return a motor's friction at speeds, without load, the least of both directions [N.m]."""
    row = arm.joints[j]
    peak = row[PEAK] * np.exp(-((v / row[PEAK_SPEED]) ** 2))
    return min(row[FORTH], row[BACK]) + peak + row[VISCOUS] * v / (1.0 + v / FAST)


def loop_of(
    arm: Arm,
    robot: Robot,
    model: dict,
    *,
    share: float = SHARE,
    dither: float = 0.3,
    coupling: np.ndarray | None = None,
) -> ArmLoop:
    """Return the loop of an arm whose friction is believed to be `factor` times what it is, and so on; share 0: gravity alone."""
    factor, stiffer = model.get("factor", 1.0), model.get("stiffer", 1.0)
    joints = {}
    for j, name in enumerate(NAMES):
        row, top = arm.joints[j], float(TOP[j])
        v = top * np.array(KNOTS)
        torque = tuple((factor * true_friction(arm, j, v)).tolist())
        rate = Polyline(velocity=tuple(v.tolist()), positive=torque, negative=torque)
        F = float(true_friction(arm, j, np.zeros(1))[0])
        K = stiffer * 0.5 / (float(row[BEND]) / F + 1.0 / float(row[STIFF]))
        mass = float(row[MOTOR] + 0.5 * robot.inertia(np.zeros((1, J)))[0, j, j])
        mass *= model.get("inertia", 1.0)
        compensator = nothing()
        if share > 0.0:
            compensator = alg_fc(rate, K, dither=Dither(share=dither), share=share)
            if model.get("observer"):
                extra = DisturbanceObserver(inertia=mass, limit=F)
                compensator = compensator.replace(extra=extra, dither=None)
        limit = 1.5 * share * float(true_friction(arm, j, np.array([top]))[0])
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", LimitWarning
            )  # of a limit above that of a model that is wrong on purpose
            loop = JointLoop(
                compensator=compensator,
                external=ExternalForce(inertia=mass, friction=alg_fe(rate, K), method="momentum"),
                limit=limit,
                top_speed=top,
                encoder_count=float(row[COUNT]),
            )
        joints[name] = ArmJoint(
            loop=loop,
            limits=JointLimits(name=name, lower=-3.0, upper=3.0, effort=300.0),
            inertia=float(row[MOTOR]),
        )
    return ArmLoop(robot, joints, interval=TICK, coupling=None if coupling is None else coupling.tolist())


@dataclass(frozen=True, eq=False)
class Play:
    """A scene of a hand that lets go, and of two nudges."""

    path: np.ndarray
    velocity: np.ndarray
    grip: np.ndarray
    nudge: np.ndarray


def scene(rng: np.random.Generator, arm: Arm) -> Play:
    """Return a scene: guided for 3 s, let go, nudged."""
    path, velocity = strokes(rng, LASTS)
    n = len(path)
    nudge = np.zeros((n, J))
    for at in (3.4, 4.2):
        j = int(rng.integers(J))
        size = rng.uniform(2.0, 5.0) * float(true_friction(arm, j, np.zeros(1))[0]) * rng.choice([-1.0, 1.0])
        nudge[round(at / TICK) : round((at + 0.1) / TICK), j] = size
    return Play(path, velocity, (np.arange(n) * TICK < 3.0).astype(float), nudge)


class Faulty:
    """Gives a loop the readings of a fault on one joint."""

    def __init__(self, fault: Fault, joint: int):
        self.fault, self.joint = fault, joint
        self.kept, self.missed, self.late = 0.0, 0, np.zeros(0, dtype=bool)

    def __call__(self, k: int, reading: np.ndarray) -> tuple[np.ndarray, float | None] | None:
        f, j, q = self.fault, self.joint, reading.copy()
        if f.frozen is not None:
            if k == f.frozen[0, j]:
                self.kept = q[j]
            if f.frozen[0, j] <= k <= f.frozen[1, j]:
                q[j] = self.kept
        if f.offset is not None:
            q[j] += f.offset[k, j]
        if f.missed is not None and f.missed[k]:
            self.missed += 1
            return None
        since, self.missed = self.missed + 1, 0
        return q, (since * TICK if f.told and since > 1 else None)


def above(run: Run) -> np.ndarray:
    """Return the time above 1.2 top speed [s], (J,)."""
    return TICK * np.sum(np.abs(run.speed) > 1.2 * TOP, axis=0)


@dataclass
class Seen:
    """What a fault came to over draws."""

    draws: int = 0
    acted: int = 0
    named: int = 0
    latched: int = 0
    longer: float = 0.0
    fastest: float = 0.0


def play_fault(rng: np.random.Generator, arm: Arm, robot: Robot, case: Case, seen: Seen) -> list[str]:
    """Play a fault on an arm and return what does not hold."""
    model = dict(case.model)
    if model.get("inertia") == "wrong":
        model["inertia"] = float(rng.choice([3.0, 1.0 / 3.0]))
    s, joint = scene(rng, arm), int(rng.integers(J))
    fault = case.make(rng, len(s.path), range(J))  # type: ignore[arg-type]
    way = np.ones(J)
    way[joint] = -1.0 if fault.turned else 1.0
    loop, bare = loop_of(arm, robot, model), loop_of(arm, robot, {}, share=0.0)
    scenes = {"grip": s.grip, "nudge": s.nudge}
    r = play(Machine(arm), loop, s.path, s.velocity, fault=Faulty(fault, joint), way=way, **scenes)  # type: ignore[arg-type]
    reference = play(Machine(arm), bare, s.path, s.velocity, **scenes)  # type: ignore[arg-type]
    weighty = fault.turned and joint in (1, 2)  # gravity itself is turned, and nothing but the brakes holds
    return _short(case, fault, joint, loop, r, above(reference), weighty, seen)


def _short(
    case: Case, fault: Fault, joint: int, loop: ArmLoop, r: Run, before: np.ndarray, weighty: bool, seen: Seen
) -> list[str]:
    """Return what does not hold of a run."""
    wrong = []
    loops = [one.loop for one in loop.joints.values()]
    limit, rate = np.array([x.limit for x in loops]), np.array([x.normal_rate for x in loops])
    total, gravity, compensation, drive = r.torque
    stand = 3 if fault.missed is not None else 1  # ticks that a call may stand for, one missed after another
    step = np.abs(np.diff(compensation, axis=0)).max(axis=0)
    if not np.all(np.isfinite(r.torque)):
        wrong.append("a torque is not finite")
    if np.any(np.abs(total) > 300.0) or np.any(np.abs(compensation) > limit * (1.0 + 1e-9)):
        wrong.append("a torque exceeds its limit")
    if np.any(step > rate * TICK * (1.0 + 1e-9) * (stand if fault.missed is None else 20)):
        wrong.append("the compensation changes faster than its rate")
    latched = (r.codes == LATCHED).any(axis=0)
    for j in np.flatnonzero(latched):
        first = int((r.codes[:, j] == LATCHED).argmax())
        rest = np.abs(compensation[:, j]) + np.abs(drive[:, j])
        late = round(1.0 if fault.missed is None else 2.0) * round(GONE / TICK)
        if rest[first + late :].max(initial=0.0) > 0.0:
            wrong.append(f"torque of latched joint {j + 1} beside gravity is not gone after 0.2 s")
        held = round(HELD / TICK * (1.0 if fault.missed is None or fault.told else MISSING)) + late
        if np.abs(gravity[first + held :, j]).max(initial=0.0) > 0.0:
            wrong.append(f"gravity of latched joint {j + 1} is not gone after {HELD:g} s")
    longer = above(r) - before
    if np.any(longer > LONGER) and not weighty:
        wrong.append(f"{longer.max():.3f} s longer above 1.2 top speed than without compensation")
    own = [
        c for i, c in enumerate(r.causes) if i != joint and c is not Status.OK and c is not Status.OVERSPEED
    ]
    if own and fault.missed is None:  # calls are missed for all joints
        wrong.append(f"another joint latched for {own[0].name}")
    if fault.offset is not None and np.isnan(fault.offset[:, joint]).any():
        long = longest(np.isnan(fault.offset[:, joint])) * TICK > loops[joint].patience + 3.0 * TICK
        if long and r.causes[joint] is not Status.NOT_FINITE:
            wrong.append("readings that are none for longer than the patience did not latch")
    if case.done == "named" and case.status is not None:
        codes = r.codes if fault.missed is not None else r.codes[:, [joint]]
        acted = fault.frozen is None or bool(
            np.abs(compensation[fault.frozen[0, joint] - 1, joint]) > NOTABLE * limit[joint]
        )
        named = bool(np.any(codes == int(case.status)))
        seen.acted += acted
        seen.named += acted and named
        if acted and not named:
            wrong.append(f"not named {case.status.name}")
    seen.draws += 1
    seen.latched += bool(latched.any())
    seen.longer = max(seen.longer, float(longer.max()) if not weighty else 0.0)
    seen.fastest = max(seen.fastest, float((np.abs(r.speed).max(axis=0) / TOP).max()))
    return wrong


__all__ = ["Seen", "cases", "loop_of", "play_fault", "scene"]
