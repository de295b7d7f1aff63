"""Presliding of the thesis' joint 0, simulated: LuGre and GMS from one 60 s log, judged on another motion.

The joint (`backdrive.simulation`, Iwatani 2017, Setup B) gets a friction of presliding stiffness 5e4 N.m/rad, and is moved by its
own servo: slow triangles, triangles of shrinking amplitude that end inside presliding, and a sweep. The log holds what a real one
would: encoder counts and commanded torque with the actuator's noise. The fit is timed; what it found then predicts the
torque of a motion of another kind (multisine), where it is compared with the best curve without presliding.
"""

from __future__ import annotations

import time

import numpy as np
from _common import Judge, parser

from backdrive.identification.dynamic.law_fit import fit_law
from backdrive.identification.dynamic.stretch import stretch
from backdrive.identification.signals import prepare
from backdrive.laws import GMS, Law, LuGre, StribeckGauss
from backdrive.logs.log import Log
from backdrive.simulation import machine
from backdrive.simulation.open_loop import drive

RATE = 1000.0
CURVE = StribeckGauss(coulomb=6.85, breakaway=8.2, stribeck_velocity=0.05, viscous=2.5)
TRUTHS = {
    "stribeck-gauss+lugre": Law(rate=CURVE, element=LuGre(stiffness=5e4, damping=60.0, fading=0.1)),
    "stribeck-gauss+gms": Law(
        rate=CURVE, element=GMS(stiffness=(6e4, 2.5e4, 8e3), share=(0.5, 0.3, 0.2), attraction=150.0)
    ),
}


def triangle(travel: float, speed: float, cycles: int) -> np.ndarray:
    """Return velocities of a triangle wave with rounded corners [rad/s]."""
    period = 2.0 * travel / speed
    t = np.arange(round(period * cycles * RATE)) / RATE
    return speed * np.tanh(8.0 * np.sin(2 * np.pi * t / period))


def slow_motion() -> np.ndarray:
    """Return position and velocity of the 60 s motion that is fitted, (n, 2)."""
    pieces = [triangle(0.02, 0.01, 2), triangle(0.06, 0.03, 2), triangle(0.2, 0.1, 2)]
    pieces += [triangle(a, 0.004, 2) for a in (8e-3, 4e-3, 2.4e-3, 1.8e-3, 1.4e-3, 1.1e-3, 0.8e-3)]
    t = np.arange(int(8 * RATE)) / RATE
    pieces += [0.12 * (1 + 0.8 * np.sin(2 * np.pi * 4 * t)) * np.minimum(1, 4 * t)]
    t = np.arange(int(12 * RATE)) / RATE
    pieces += [0.8 * np.sin(2 * np.pi * 0.5 * t) * np.minimum(1, t)]
    v = np.concatenate(pieces)
    v = np.concatenate([v, np.tile(triangle(0.01, 0.01, 1), 30)])[: int(60 * RATE)]
    return np.column_stack([np.cumsum(v) / RATE, v])


def other_motion() -> np.ndarray:
    """Return position and velocity of the 20 s motion that is predicted, (n, 2)."""
    t = np.arange(int(20 * RATE)) / RATE
    q = (
        0.15 * np.sin(2 * np.pi * 0.21 * t)
        + 0.04 * np.sin(2 * np.pi * 0.83 * t + 1)
        + 0.004 * np.sin(2 * np.pi * 3.7 * t)
    )
    q *= np.minimum(1, t)
    return np.column_stack([q, np.gradient(q, 1 / RATE)])


def record(law: Law, target: np.ndarray, seed: int) -> Log:
    """Return the log of the joint along a motion."""
    joint = machine("joint_0").replace(law=law, torque_noise=0.05)
    out, _ = drive(joint, target, closed=True, seed=seed, period=1 / RATE)
    n = len(out)
    return Log(time=np.arange(n) / RATE, joints=(joint.as_joint(),), position=out[:, 0], torque=out[:, 1])


def stretches(log: Log) -> list:
    """Return the log ready for a fit."""
    return [stretch(s) for s in prepare(log, 0)]


def main() -> None:
    """Print the table and the verdict."""
    parser(__doc__).parse_args()  # it takes seconds, shortened or not
    judge = Judge()
    fit_law(
        "lugre",
        stretches(record(TRUTHS["stribeck-gauss+lugre"], slow_motion()[:3000], 9)),
        iterations=1,
        begin=2,
    )
    for name, law in TRUTHS.items():
        log = record(law, slow_motion(), 1)
        counts = log.joints[0].encoder_counts
        begun = time.perf_counter()
        found = fit_law(name, stretches(log), counts=counts, terms=("inertia",))
        seconds = time.perf_counter() - begun
        other = stretches(record(law, other_motion(), 2))
        plain = fit_law("stribeck-gauss", stretches(log), counts=counts, terms=("inertia",))
        size = float(np.sqrt(np.mean(other[0].torque ** 2)))
        errors = {
            fit.name: 100 * float(np.sqrt(np.mean((fit.predict(other)[0] - other[0].torque)[5:] ** 2))) / size
            for fit in (found, plain)
        }
        print(f"\n{name}: {len(log) / RATE:.0f} s log, fitted in {seconds:.1f} s, rms {found.rms:.3f} N.m")
        for number, value in found.values.items():
            print(f"  {number:<20} {value:12.5g} +- {found.standard_errors[number]:.2g}")
        print(
            f"  another motion: {errors[found.name]:.2f} % of torque, without presliding {errors[plain.name]:.2f} %"
        )
        judge.at_most(f"{name}: fit of a 60 s log", seconds, 5.0, "s")
        judge.at_most(f"{name}: error on a different motion", errors[found.name], 3.0, "%")
        judge.at_most(
            f"{name}: that error by the error without presliding",
            errors[found.name] / errors[plain.name],
            0.7,
        )
    judge.end()


if __name__ == "__main__":
    main()
