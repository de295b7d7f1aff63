"""The league of estimators: friction from the encoder by every model, external force by every observer.

All use the same logs. In one, a hand moves the bare joint and lets go; its force is to be estimated. In the other, a servo
moves the joint without a hand, so that every force above a threshold is a false contact. Observers are tuned with the same
number of tries.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import (
    NOTHING,
    FrictionEstimator,
    alg_fe,
    alg_fe2,
    between_counts,
    ct,
    ha,
)
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.laws import GMS, Law, LuGre
from backdrive.simulation.closed_loop import Record, Scene, play
from backdrive.simulation.hand import Hand, pushes, strokes
from backdrive.thesis._league_joints import DT, NOMINAL, SUBSTEP, Contender, contenders, low_gains

TRIES = 9  # settings of every observer
CONTACT = 0.35  # of the Coulomb torque, above which an estimate counts as a contact [-]
METHODS: tuple[Literal["direct", "momentum", "extended", "kalman"], ...] = (
    "direct",
    "momentum",
    "extended",
    "kalman",
)
LATEST = 80  # ticks of delay that are looked at


def models(who: Contender) -> dict[str, FrictionEstimator]:
    """Return the friction estimators by name, with what is believed of the joint."""
    K, threshold = 0.5 * who.stiffness, between_counts(2.0 * who.count / DT, who.count, DT)
    element = GMS(
        stiffness=(0.5 * K, 0.25 * K, 0.15 * K, 0.1 * K),
        share=(0.2, 0.25, 0.25, 0.3),
        attraction=20.0 * who.coulomb,
    )
    return {
        "none": NOTHING,
        "CT": ct(who.rate, threshold),
        "HA": ha(who.rate, K),
        "algFE": alg_fe(who.rate, K),
        "algFE2": alg_fe2(who.rate, K, threshold),
        "LuGre": FrictionEstimator(law=Law(rate=who.rate, element=LuGre(stiffness=K))),
        "GMS": FrictionEstimator(law=Law(rate=who.rate, element=element)),
    }


def record_logs(who: Contender, seed: int) -> tuple[Record, Record]:
    """Return the log of a hand that moves the bare joint and lets go, and that of a servo without a hand."""
    plant = who.plant(NOMINAL)
    common = {
        "plant": plant,
        "ripple": who.ripple,
        "ripple_cycles": who.cycles,
        "substep": SUBSTEP,
        "seed": seed,
    }
    motion = strokes(DT, stroke=who.stroke, duration=0.7, count=7, variation=0.1, seed=seed)
    n = len(motion.position)
    hand = Hand(stiffness=who.hand.stiffness, damping=who.hand.damping)
    t = DT * np.arange(6000)
    goal = who.stroke * np.sin(2 * np.pi * 0.4 * t) * np.minimum(t, 1.0)
    target = np.stack([goal, np.gradient(goal, DT)], axis=1)
    servo = low_gains(plant)
    stiff = type(servo).from_bandwidth(plant.inertia, 60.0, filter_time=3e-3)
    scenes = [
        Scene(motion=motion.release(DT * (n - 700), DT), hand=hand, **common),  # type: ignore[arg-type]
        Scene(motion=pushes(np.zeros(len(t))), controller=stiff, target=target, **common),  # type: ignore[arg-type]
    ]
    first, second = play(scenes)
    return first, second


def tries(method: str, who: Contender) -> list[dict[str, Any]]:
    """Return settings of an observer."""
    levels = np.linspace(0.0, 1.0, TRIES)
    if method == "direct":
        # a filter's gain goes with the accelerations of the stroke
        a = 10.0 * who.stroke
        return [
            {"filter": MotionFilter(gain=a * 10.0 ** (3.0 * x), second_gain=5.0 * a * 10.0 ** (3.0 * x))}
            for x in levels
        ]
    if method == "kalman":
        return [
            {"force_rate": who.coulomb * 10.0 ** (-0.5 + 3.0 * x), "encoder_count": who.count} for x in levels
        ]
    return [{"bandwidth": 10.0 ** (1.0 + 1.7 * x)} for x in levels]


def score_estimator(
    who: Contender, estimator: ExternalForce, moved: Record, free: Record
) -> dict[str, float]:
    """Return RMS error and error at rest by the RMS force, delay [s], and the share of time with a false contact."""
    n = len(moved.time)
    weight = who.truth.weight(moved.reading)
    got, _ = estimator.run(moved.reading, moved.command, DT, weight)
    force = moved.force
    size = float(np.sqrt(np.mean(force[: n - 700] ** 2)))
    held = slice(300, n - 700)
    error = got[held] - force[held]
    lags = [float(np.mean((got[300 + k : n - 700 + k] - force[held]) ** 2)) for k in range(min(LATEST, 699))]
    rest = got[n - 250 :]
    alone, _ = estimator.run(free.reading, free.command, DT, who.truth.weight(free.reading))
    return {
        "rms": float(np.sqrt(np.mean(error**2))) / size,
        "delay": DT * int(np.argmin(lags)),
        "standstill": float(np.sqrt(np.mean(rest**2))) / size,
        "false": float(np.mean(np.abs(alone[500:]) > CONTACT * who.coulomb)),
    }


def estimator_table(seed: int = 0, count: int = 4) -> dict[str, Any]:
    """Return for every friction model and observer the means over the joints of what the best of its settings achieved.

    Args:
        seed: of hand and noises.
        count: of joints, Setup A first.
    """
    joints = contenders()[:count]
    logs = [(record_logs(who, seed), record_logs(who, seed + 1)) for who in joints]
    rows = []
    for name in models(joints[0]):
        for method in METHODS:
            found = []
            for who, (shown, unseen) in zip(joints, logs, strict=False):
                friction = models(who)[name]
                made = [
                    ExternalForce(inertia=who.truth.inertia, friction=friction, method=method, **given)
                    for given in tries(method, who)
                ]
                costs = [score_estimator(who, e, *shown)["rms"] for e in made]
                found.append(score_estimator(who, made[int(np.argmin(costs))], *unseen))
            rows.append(
                {"friction": name, "method": method}
                | {score: float(np.mean([f[score] for f in found])) for score in found[0]}
            )
    return {"rows": rows}
