"""Friction that changes: two models compared, many tracked, temperature in the law, and a level adapted in the loop.

Everything is simulated; no log of a real warm-up was at hand. The joints are the thesis' Joint 1 (sweeps) and Joint 0 (warm-up,
loop); how they warm is assumed: a time constant of 10 minutes, a rise of 3 degC
for every watt of friction, friction that falls with it.
"""

from __future__ import annotations

import math
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from dataclasses import replace

import numpy as np
from _common import Judge, parser

from backdrive.control import BareLoop, Loop
from backdrive.control.compensators import alg_fc
from backdrive.control.estimators import Adaptation
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.engine import axis, rollout, servo
from backdrive.identification.drift import (
    change_of,
    identify_thermal,
    passive_level,
    track,
    virtual_temperature,
)
from backdrive.identification.drift.change import chance
from backdrive.identification.drift.curve_errors import REPEAT
from backdrive.identification.sweep import fit_sweeps, identify_sweep
from backdrive.laws import CoulombViscous, Law, LoadTemperature, Polyline
from backdrive.logs.log import Joint, Log
from backdrive.model import JointFriction
from backdrive.plans import Sweep
from backdrive.simulation.kernel import encoder
from backdrive.simulation.machines import joint_0, joint_1
from backdrive.simulation.open_loop import simulate

PLAN = Sweep(np.deg2rad(20.0), 2.0, 10)
SETTLES, RISE, AMBIENT = 600.0, 3.0, 20.0  # C/h [s], eta/h [degC/W], [degC]
RATE = 100.0  # of the warm-up logs [Hz]
DT = 1e-3


def scaled(factor: float) -> Law:
    """Return Joint 1's friction times a factor."""
    rate = joint_1().law.rate
    assert isinstance(rate, Polyline)
    up = tuple(factor * f for f in rate.positive)
    return Law(rate=Polyline(velocity=rate.velocity, positive=up, negative=up))


def identified(factor: float, seed: int, noise: float = 0.2) -> JointFriction:
    """Return what one sweep of Joint 1 gives."""
    plant = joint_1().replace(law=scaled(factor), torque_noise=noise)
    return identify_sweep([simulate(plant, PLAN, seed=seed)], "joint_1", timing="command")[0]


def compared(judge: Judge, pairs: int, centers: int) -> list[JointFriction]:
    """Ask of many pairs whether friction changed, where it did not and where it did."""
    same = [identified(1.0, seed) for seed in range(2 * pairs)]
    print(f"\ntwo identifications of one joint, unchanged: called changed in ... of {pairs} pairs")
    for alarm in (0.01, 0.05):
        found = [change_of(a, b, alarm=alarm) for a, b in zip(same[::2], same[1::2], strict=False)]
        count = sum(c.is_significant for c in found)
        plain = sum(chance(REPEAT**2 * c.chi_square, c.degrees) < alarm for c in found)
        judge.that(
            f"alarm {100 * alarm:g} %: {count} of {pairs} (at most {math.ceil(pairs * alarm)}); with errors as they are {plain}",
            count <= math.ceil(pairs * alarm),
        )
    print("  changed by                found                  called changed in")
    for factor in (0.99, 0.997, 0.95, 0.88):
        later = [identified(factor, 500 + s) for s in range(20)]
        found = [change_of(a, b) for a, b in zip(same, later, strict=False)]
        mean, error = (
            100 * np.mean([c.mean for c in found]),
            100 * np.mean([1.96 * c.mean_error for c in found]),
        )
        inside = np.mean([abs(c.mean - (factor - 1.0)) <= 1.96 * c.mean_error for c in found])
        print(
            f"  {100 * (factor - 1):+6.1f} %    {mean:+8.2f} +- {error:.2f} % (inside {100 * inside:.0f} %)   "
            f"{sum(c.is_significant for c in found)} of 20"
        )
        if factor <= 0.99:
            judge.that(
                f"a change of {100 * (factor - 1):+.0f} % is seen in all",
                all(c.is_significant for c in found),
            )
    print(f"  in words: {found[0].verdict}")
    several = [about_three_centers(seed) for seed in range(2 * centers)]
    p = [[], []]
    for (a, A), (b, B) in zip(several[::2], several[1::2], strict=False):
        p[0].append(change_of(a, b, alarm=0.05).is_significant)
        p[1].append(change_of(a, b, alarm=0.05, covariances=(A, B)).is_significant)
    print("  three centers, by direction, alarm 5 %: called changed in")
    judge.that(
        f"  {sum(p[1])} of {centers} with the knots' covariance (at most {math.ceil(0.1 * centers)})",
        sum(p[1]) <= math.ceil(0.1 * centers),
    )
    print(f"        {sum(p[0])} of {centers} with standard errors alone")
    return same


def about_three_centers(seed: int) -> tuple[JointFriction, np.ndarray]:
    """Return what sweeps about three centers give, and the covariance of the knots."""
    rate = joint_1().law.rate
    assert isinstance(rate, Polyline)
    law = Law(rate=replace(rate, negative=tuple(f - 2.0 for f in rate.negative)))
    plant = joint_1().replace(law=law, torque_noise=0.2)
    logs = [
        simulate(plant, replace(PLAN, center=np.deg2rad(c)), seed=5000 + 3 * seed + i)
        for i, c in enumerate((-60.0, 0.0, 60.0))
    ]
    friction, _ = identify_sweep(logs, "joint_1", timing="command")
    return friction, fit_sweeps(logs, "joint_1", timing="command").covariance


def tracked(judge: Judge, same: list[JointFriction]) -> None:
    """Follow a level over twelve identifications, worn or not."""
    print("\ntwelve identifications in a row: the friction at 1 rad/s")

    def levels(frictions):
        y = [float(f.law.torque(1.0)) for f in frictions]
        s = [
            REPEAT * float(np.hypot(*np.sort(np.asarray(f.standard_errors["positive"]))[4:6]) / np.sqrt(2))
            for f in frictions
        ]
        return y, s

    days = np.arange(12.0)
    alarms = 0
    rows = min(13, len(same) // 12)
    for i in range(0, 12 * rows, 12):
        alarms += track(days, *levels(same[i : i + 12])).is_significant
    judge.that(f"unchanged joint: called changed in {alarms} of {rows} rows (at most 1)", alarms <= 1)
    factors = 1.0 - 0.02 * np.maximum(days - 3.0, 0.0) / 8.0
    worn = track(days, *levels([identified(f, 900 + i) for i, f in enumerate(factors)]))
    true = np.array([float(scaled(f).torque(1.0)) for f in factors])
    print(f"  2 % lost from day 3 on: {worn.verdict}; true change {true[-1] - true[0]:+.3f} N.m")
    judge.that("2 % of wear is seen", worn.is_significant)
    rng, hits, alarms = np.random.default_rng(5), [], 0
    for _ in range(400):
        walk = np.cumsum(0.5 * rng.standard_normal(20))
        found = track(np.arange(20.0), walk + rng.standard_normal(20), np.ones(20))
        hits.append(np.abs(found.level - walk) <= 1.96 * found.error)
        alarms += track(np.arange(20.0), rng.standard_normal(20), np.ones(20), alarm=0.05).is_significant
    print(
        f"  400 random walks: level inside its 95 % interval in {100 * np.mean(hits):.0f} %; 400 constant levels: "
        f"called changed in {100 * alarms / 400:.1f} % at an alarm of 5 %"
    )
    judge.that("intervals of the level hold 88 to 98 %", 0.88 <= np.mean(hits) <= 0.98)
    judge.that("constant levels are called changed in at most 6.5 %", alarms <= 26)


def linear(v: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Return friction whose curve falls by straight lines with temperature [N.m]."""
    return np.sign(v) * (6.85 * (1.0 - 0.006 * rise) + 3.0 * (1.0 - 0.012 * rise) * np.abs(v))


def thinning(v: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Return friction of a lubricant that thins exponentially [N.m]."""
    rate = LoadTemperature(coulomb=6.0, viscous=1.0, viscous_temperature=6.0, thinning=20.0)
    return rollout(Law(rate=rate), dq=v, dt=1 / RATE, load=np.zeros((v.size, 2)), temperature=AMBIENT + rise)


def warm_up(friction, minutes: float, seed: int, pauses: bool = False) -> tuple[Log, np.ndarray]:
    """Return the log of a warm-up and the rise of the temperature in it [degC], (n,)."""
    t = np.arange(int(60 * minutes * RATE)) / RATE
    top = 1.1 - 0.9 * np.cos(2.0 * np.pi * t / 20.0)  # a speed of its own for every few strokes
    if pauses:
        on = np.clip(np.minimum(np.mod(t, 600.0), 300.0 - np.mod(t, 600.0)), 0.0, 1.0)
        top = 0.6 * on * top
    v = top * np.sin(np.cumsum(2.0 * top / 0.5) / RATE)
    rise = np.zeros(t.size)
    for _ in range(4):  # heat follows friction and friction follows heat
        tau = friction(v, rise)
        rise = RISE * virtual_temperature(tau * v, 1 / RATE, SETTLES)
    rng = np.random.default_rng(seed)
    torque = tau + 0.71 * np.gradient(v, t) + 0.2 * rng.standard_normal(t.size)
    position = (np.cumsum(v) - 0.5 * v) / RATE
    sensor = AMBIENT + rise + 0.1 * rng.standard_normal(t.size)
    log = Log(
        time=t,
        joints=(Joint(name="joint_0"),),
        position=position,
        torque=torque,
        temperature=sensor,
    )
    return log, rise


def warmed(judge: Judge) -> None:
    """Identify friction as a function of temperature, with a sensor and without."""
    print("\nwarm-up logs of 40 min (simulated; no real one was at hand)")
    for name, friction in (("straight lines", linear), ("thinning lubricant", thinning)):
        log, rise = warm_up(friction, 40.0, 1)
        other, other_rise = warm_up(friction, 40.0, 2, pauses=True)
        v = np.gradient(other.position[:, 0], 1 / RATE)
        fast = np.abs(v) > 0.1
        truth = friction(v, other_rise)
        for virtual in (False, True):
            begun = time.perf_counter()
            found = identify_thermal(log, virtual=virtual)
            seconds = time.perf_counter() - begun
            F = np.array(found.law(found.reached[1]).rate.positive)  # type: ignore[attr-defined]
            true = np.abs(friction(found.velocity, np.full(5, rise[-1])))
            if virtual:
                power, theta = truth * v, np.zeros(v.size)
                for _ in range(2):
                    theta = virtual_temperature(power, 1 / RATE, found.time_constant[0])
                    power = predicted(found, v, theta) * v
                theta = virtual_temperature(power, 1 / RATE, found.time_constant[0])
            else:
                theta = AMBIENT + other_rise - found.reference
            left = (predicted(found, v, theta) - truth)[fast]
            cold = (predicted(found, v, 0.0 * v) - truth)[fast]
            share = 100 * np.sqrt(np.mean(left**2) / np.mean(cold**2))
            T, error = found.time_constant
            clock = f"T_th {T:.0f} +- {1.96 * error:.0f} s (600)" if virtual else "sensor"
            off = float(np.abs(F - true).max())
            print(f"  {name}, {clock}: rise {rise[-1]:.1f} degC, fitted in {seconds:.1f} s")
            print(
                f"    explains {100 * found.explained:.0f} % of what changes, warm curve off by {off:.3f} N.m, "
                f"another motion with pauses off by {share:.0f} % of the cold curve's error"
            )
            judge.at_most(
                f"{name}, {'virtual' if virtual else 'measured'}: another motion's error by the cold curve's",
                share,
                25.0,
                "%",
            )
            if virtual and friction is linear:
                judge.that(
                    "T_th within 5 %, and its 95 % interval within 15 %",
                    abs(T / SETTLES - 1) < 0.05 and 1.96 * error < 0.15 * T,
                )
            if friction is linear:
                judge.at_most(f"{name}: warm curve off by", float(np.abs(F - true).max()), 0.1, "N.m")


def predicted(found, v: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return friction by the identified curve at speeds and temperatures [N.m]."""
    cold = Law(
        rate=Polyline(velocity=tuple(found.velocity), positive=tuple(found.cold), negative=tuple(found.cold))
    )
    slope = np.sign(v) * (np.interp(np.abs(v), found.velocity, found.slope))
    return cold.torque(v) + theta * slope


def in_the_loop(judge: Judge) -> None:
    """Adapt the level of a compensation in the loop: friction falls by 30 %, the joint stops, a hand leans on it."""
    print(
        "\na level adapted in the loop (Joint 0, R = 0.9): friction falls to 70 % in 20 s, the joint rests from 20 to 25 s, "
        "a hand leans on it from 30 to 35 s"
    )
    base = CoulombViscous(
        coulomb_positive=6.85, coulomb_negative=6.85, viscous_positive=3.0, viscous_negative=3.0
    )
    R, law = 0.9, Law(rate=base)
    least = Law(rate=CoulombViscous(**{k: 0.7 * x for k, x in base.values().items()}))
    bound = passive_level(law, least, gain=R, top_speed=1.0)
    for name, upper, push in (
        ("bounded", bound, -6.0),
        ("bounded, pushed along", bound, 6.0),
        ("unbounded", 3.0, -6.0),
    ):
        level, ratio, energy, held, first, last = loop(law, R, upper, push)
        print(
            f"  {name} (upper {upper:.3f}): level {first:.3f} at the start, {last:.3f} at 29 s (true 0.700), "
            f"{level[30000:35000].max():.3f} at most under the hand"
        )
        print(f"    R theta f / F at most {ratio:.3f}, energy given {energy:.3g} J")
        judge.that(f"{name}: frozen at rest, the level moves by {held:.1e}", held == 0.0)
        if upper == bound:
            judge.at_most(f"{name}: R theta f / F by the curves, above 2e-3 rad/s", ratio, 1.0 + 1e-9)
            judge.at_most(f"{name}: energy given there beyond what friction takes", energy, 0.0, "J")
            judge.at_most(f"{name}: level at 29 s off by", abs(last - 0.7), 0.05)
        else:
            judge.that(
                "unbounded: it would give energy, which is why there is a bound", ratio > 1.0 and energy > 0.0
            )


class Bare(Loop):
    """A loop without guards: what learning does by itself, also where a `JointLoop` would refuse it."""

    def _admit(self) -> None:
        pass


def loop(law: Law, R: float, upper: float, push: float):
    """Play 40 s; return level (n,), largest share of friction, energy given [J], movement at rest, level at start and at 29 s."""
    plant = joint_0().replace(law=law)
    plant = plant.replace(
        servo=replace(plant.servo, integral=0.0)
    )  # no hunting at rest; there is no gravity to hold
    adaptation = Adaptation(
        slowest=0.01, time=0.5, floor=3.0, dead_zone=0.3, lower=0.3, upper=upper, start=min(1.0, upper)
    )
    joint = BareLoop(
        compensator=alg_fc(law.rate, 5e4, share=R),
        external=ExternalForce(inertia=plant.inertia, friction=alg_fe(law.rate, 5e4)),
        adaptation=adaptation,
    )
    running = Bare(joint, interval=DT)
    j, s, p, x = plant.row(), plant.at_rest(0.0), law.row(), law.state()
    own = p.copy()
    row, state = plant.servo.row(), np.zeros(servo.STATES)  # type: ignore[union-attr]
    n = 40000
    t = DT * np.arange(n)
    run = np.where((t >= 20.0) & (t < 25.0), 0.0, 1.0)
    phase = np.cumsum(run) * DT * 2.0 * np.pi * 0.3
    target = 0.3 * np.sin(phase)
    wanted = np.gradient(target, DT)
    level, ratio, energy = np.zeros(n), 0.0, 0.0
    u, q = np.zeros(1), np.zeros(1)
    for k in range(n):
        q[0] = encoder(s[0], plant.encoder_count)
        running.update(q, u)
        level[k] = running.level[0]
        f = running.torque[0]
        u[0] = f + servo.tick(row, 0, state, DT, target[k], wanted[k], q[0], plant.torque_limit)
        factor = 1.0 - 0.3 * min(t[k] / 20.0, 1.0)
        p[1:] = factor * own[1:]
        j[9] = -push * np.sign(wanted[k]) if 30.0 <= t[k] < 35.0 else 0.0
        for _ in range(2):
            axis.advance(j, s, law.rate.KIND, law.element.KIND, p, x, u[0], 0.5 * DT, AMBIENT)
        if abs(s[1]) > 2e-3 and f * s[1] > 0.0:
            F, at_speed = factor * abs(float(law.torque(s[1]))), R * level[k] * abs(float(law.torque(s[1])))
            ratio = max(ratio, at_speed / F)
            energy += max(at_speed - F, 0.0) * abs(s[1]) * DT
    return level, ratio, energy, float(np.ptp(level[21000:25000])), level[0], level[29000]


def main() -> None:
    """Print the tables and the verdict."""
    short = parser(__doc__).parse_args().short
    judge = Judge()
    same = compared(judge, 20 if short else 200, 4 if short else 30)
    tracked(judge, same)
    warmed(judge)
    in_the_loop(judge)
    judge.end()


if __name__ == "__main__":
    main()
