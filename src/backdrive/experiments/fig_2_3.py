"""Fig. 2.3: data of a sweep, and the windows around its velocity peaks; Iwatani 2017, (2.7)."""

from __future__ import annotations

import numpy as np

from backdrive.experiments import Claim, Outcome
from backdrive.experiments._sweeps import CYCLES, SETTING, TOP_SPEED, plan, sweep
from backdrive.identification.function_a import SHARE
from backdrive.plants.thesis import joint_1

STROKE = 20.0  # A [deg]
SHOWN = 7  # cycle of the lower panel, as the thesis' n-th


def run(seed: int = 0) -> Outcome:
    """Sweep Joint 1 and return velocity and torque with the samples that (2.7) uses."""
    joint = joint_1()
    done = sweep(joint, STROKE, seed=seed)
    log, knots = done.log, done.knots["literal"]
    t, f = log.time, done.torque
    v = np.diff(done.position, prepend=done.position[0]) / log.period
    windows = plan(STROKE).windows()
    speeds = TOP_SPEED * np.arange(1, CYCLES + 1) / CYCLES
    used = np.zeros(t.size, dtype=int)
    for (begin, end), speed in zip(windows, speeds):
        inside = (t >= begin) & (t < end)
        used[inside & (v >= SHARE * speed)] = 1
        used[inside & (v <= -SHARE * speed)] = -1
    share = np.sqrt(1.0 - SHARE**2) / np.arccos(SHARE)  # mean of a sine's top above c
    ratio = knots.V / speeds
    reached = np.array([np.abs(v[(t >= a) & (t < b)]).max() for a, b in windows]) / speeds
    level = float(joint.gravity(0.0))
    error = knots.F - joint.law.torque(knots.V)
    claims = (
        Claim(
            what="The controller only has to reach the top speed of each cycle",
            thesis="enough to realize V",
            ours=f"{100 * reached.min():.1f} to {100 * reached.max():.1f} % of nV/N",
            gate="at least 98 %",
            holds=bool(reached.min() > 0.98),
        ),
        Claim(
            what="V_n is not nV/N but the mean of a sine's top above c",
            thesis="V_n = average, c = 0.8",
            ours=f"{ratio.min():.4f} to {ratio.max():.4f} of nV/N; a sine gives {share:.4f}",
            gate="within 2 %",
            holds=bool(np.all(np.abs(ratio / share - 1) < 0.02)),
            why="The top 7 % of the range of speeds is therefore extrapolated.",
        ),
        Claim(
            what="Half the sum of the directions is gravity and leaves F_n",
            thesis="(2.13), (2.14)",
            ours=f"{knots.bias:.2f} N.m; put in: {level:.2f} N.m",
            gate="within 0.3 N.m",
            holds=bool(abs(knots.bias - level) < 0.3),
        ),
        Claim(
            what="F_n is the friction at V_n",
            thesis="(2.14)",
            ours=f"errors {error.min():+.2f} to {error.max():+.2f} N.m of {joint.law.torque(2.0):.1f} N.m",
            gate="within 0.5 N.m",
            holds=bool(np.abs(error).max() < 0.5),
            why="What is left grows with speed: a velocity taken as a backward difference belongs one tick before the torque "
            "beside it, and so inertia does not cancel.",
        ),
    )
    return Outcome(
        name="fig-2.3",
        title="Data of a sweep and the windows around its velocity peaks",
        setting=f"{SETTING} Joint 1, A = {STROKE:g} deg, c = {SHARE:g}.",
        claims=claims,
        data={
            "time": t,
            "velocity": v,
            "torque": f,
            "used": used,
            "windows": windows,
            "speeds": speeds,
            "V": knots.V,
            "F_pos": knots.F_pos,
            "F_neg": knots.F_neg,
            "share": SHARE,
            "shown": SHOWN,
        },
        numbers={f"F_{n + 1}": float(x) for n, x in enumerate(knots.F)},
    )
