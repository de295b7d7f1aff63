"""How long a tick of the torque loop takes from Python, and how many seconds of a joint a second simulates.

Six joints, each with algFC2 and dither, and with the direct estimator of the external force (cascade filter, algFE2), in one fused
call. Ticks are timed one by one; beside them stands an empty pair of clock readings, for what the machine itself does to the
99th percentile. Simulated joints are the thesis' two set-ups under a hand, with everything on, at 1 kHz and 20 us.
"""

from __future__ import annotations

import gc
import json
import os
import time
from pathlib import Path

import numpy as np
from _common import Judge, parser

from backdrive.control import JointLoop, Loop, torque_limit
from backdrive.control.compensators import Dither, alg_fc2
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe2, between_counts
from backdrive.engine.cores import available
from backdrive.simulation import machine
from backdrive.simulation.closed_loop import Scene, play
from backdrive.simulation.hand import Hand, strokes
from backdrive.simulation.machines import joint_0

T = 1e-3
SETTINGS = {  # joint -> K, V_W, hand, stroke
    "setup_a": (1.2e6, 0.01, Hand(stiffness=800.0, damping=40.0), 0.06),
    "joint_0": (5e4, 0.005, Hand(stiffness=120.0, damping=6.0), 0.15),
}


def made(name: str) -> tuple:
    """Return a joint and what runs on it."""
    plant = joint_0(compliant=True) if name == "joint_0" else machine(name)
    K, threshold, _, _ = SETTINGS[name]
    V_W = between_counts(threshold, plant.encoder_count, T)
    rate = plant.law.rate
    compensator = alg_fc2(rate, K, V_W, dither=Dither(share=0.3), share=0.9)
    loop = JointLoop(
        compensator=compensator,
        external=ExternalForce(inertia=plant.inertia, friction=alg_fe2(rate, K, V_W)),
        top_speed=5.0,
        limit=torque_limit(compensator, 5.0),
        encoder_count=plant.encoder_count,
    )
    return plant, loop


def ticking(judge: Judge, calls: int) -> dict:
    """Time ticks of six joints."""
    _, joint = made("joint_0")
    loop = Loop([joint] * 6, interval=T)
    t = T * np.arange(calls)[:, None]
    rows, u = list(0.2 * np.sin(3.0 * t + np.arange(6)) + 1e-3 * np.sin(70.0 * t)), np.zeros(6)
    took, idle = np.empty(calls, dtype=np.int64), np.empty(calls, dtype=np.int64)
    update, clock = loop.update, time.perf_counter_ns
    for row in rows[:1000]:
        update(row, u)
    gc.disable()
    for k, row in enumerate(rows):
        start = clock()
        update(row, u)
        took[k] = clock() - start
        start = clock()
        idle[k] = clock() - start
    gc.enable()
    result = {
        name: {p: float(np.percentile(values, float(p))) / 1e3 for p in ("50", "99", "99.9", "100")}
        for name, values in (("tick", took), ("nothing", idle))
    }
    for name, values in result.items():
        print(f"  {name:8s} {calls} times [us]: " + ", ".join(f"{p} %: {v:.2f}" for p, v in values.items()))
    judge.that("the loop is at work", bool(np.all(loop.codes == 0) and np.abs(loop.torque).max() > 3.0))
    judge.at_most("six joints, compensator + estimator + filter, median", result["tick"]["50"], 2.0, "us")
    judge.at_most("six joints, compensator + estimator + filter, 99 %", result["tick"]["99"], 4.0, "us")
    return result


def simulating(judge: Judge) -> dict:
    """Time simulated joints on one core and on all."""
    results = {}
    for name, (_, _, hand, stroke) in SETTINGS.items():
        plant, loop = made(name)
        motion = strokes(T, stroke=stroke, duration=0.7, count=20)
        scene = Scene(plant=plant, motion=motion, hand=hand, loop=loop, delay=T)
        many = [scene.replace(seed=s) for s in range(4 * available())]
        seconds = len(motion.position) * T
        play(scene)
        one, every = [], []
        for _ in range(3):
            start = time.thread_time()
            play(many[:4], workers=1)
            one.append(4 * seconds / (time.thread_time() - start))
            start = time.perf_counter()
            play(many)
            every.append(len(many) * seconds / (time.perf_counter() - start))
        results[name] = {"one_core": max(one), "all_cores": max(every)}
        print(
            f"  {name}: {max(one):.0f} simulated seconds a second on one core, {max(every):.0f} on {available()}"
        )
        judge.that(f"{name}: at least 50 times real time on one core", max(one) >= 50.0)
    return results


def arm() -> dict:
    """Time the six-axis arm: a hand at its grip, three joints compensated, three held."""
    from backdrive.simulation.arm import Arm, local_servos
    from backdrive.simulation.arm_loop import guide, polygon

    square = [(0.0, 0.0, 0.0), (0.0, 0.15, 0.0), (-0.12, 0.15, 0.0), (-0.12, 0.0, 0.0)]
    path, velocity = polygon(square, dt=T, duration=0.7, interval=0.75, rounds=1)
    _, joint = made("joint_0")
    best = 0.0
    for _ in range(3):
        robot = Arm()
        held = local_servos(robot.joints)
        start = time.perf_counter()
        guide(
            robot,
            path,
            velocity,
            hand=Hand(stiffness=800.0, damping=40.0),
            loops=dict.fromkeys(range(3), joint),
            servos={j: held[j] for j in (3, 4, 5)},
        )
        best = max(best, len(path) * T / (time.perf_counter() - start))
    print(f"  arm: {best:.1f} simulated seconds a second (three joints compensated, three held; one core)")
    return {"one_core": best}


def main() -> None:
    """Measure, write down and judge."""
    options = parser(__doc__)
    options.add_argument("--json", type=Path, help="write the figures there")
    options.add_argument("--calls", type=int, default=100_000, help="ticks to time")
    wanted = options.parse_args()
    if wanted.short:
        wanted.calls = min(wanted.calls, 20_000)
    judge = Judge()
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    print(f"{available()} cores, load {load:.1f}")
    found = {"cores": available(), "load": load, "tick": ticking(judge, wanted.calls)}
    found["simulated"] = simulating(judge)
    found["arm"] = arm()
    if wanted.json:
        wanted.json.write_text(json.dumps(found, indent=1))
    judge.end()


if __name__ == "__main__":
    main()
