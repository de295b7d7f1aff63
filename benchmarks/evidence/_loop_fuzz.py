"""A torque loop fed with what no encoder should say: every kind of compensator and estimator, by `update` and by its kernel."""

from __future__ import annotations

import warnings

import numba as nb
import numpy as np
from _common import Judge

from backdrive.control import JointLoop, Loop
from backdrive.control import loop as loop_
from backdrive.control.compensators import Dither, catalog
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators import Adaptation
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe, alg_fe2
from backdrive.laws import GMS, Law, LuGre, MaxwellSlip, Polyline, StribeckGauss

T, COUNT, TOP, F = 1e-3, 1e-5, 3.0, 6.0
CURVE = Polyline(velocity=(0.05, 0.5, 3.0), positive=(F, 5.0, 8.0), negative=(5.0, 4.5, 7.0))
STRIBECK = StribeckGauss(coulomb=4.0, breakaway=F, stribeck_velocity=0.05, viscous=1.0)
ODD = np.array([np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, 1e9, -1e15, 0.0])


def joints() -> list[JointLoop]:
    """Return loops of one joint with everything that can run on it."""
    K, law = 2e4, Law(rate=STRIBECK, element=LuGre(stiffness=2e4, damping=50.0))
    gms = Law(rate=STRIBECK, element=GMS(stiffness=(1e4, 5e3), share=(0.6, 0.4), attraction=50.0))
    slip = Law(rate=CURVE, element=MaxwellSlip(stiffness=(1e4, 5e3), share=(0.6, 0.4)))
    made = {
        "nothing": catalog.nothing(),
        "algFC": catalog.alg_fc(CURVE, K),
        "algFC, alpha 0": catalog.alg_fc(CURVE, K, 0.0, share=1.0),
        "algFC, dither": catalog.alg_fc(CURVE, K, dither=Dither(share=0.3)),
        "algFC, dither of its own phase": catalog.alg_fc(CURVE, K, dither=Dither(share=1.0, mode="reset"), share=1.0),
        "algFC2, dither": catalog.alg_fc2(CURVE, K, 0.015, dither=Dither(share=0.3)),
        "Mahvash-Okamura": catalog.mahvash_okamura(STRIBECK, K),
        "Aung": catalog.aung(CURVE, K, 5.0, COUNT),
        "pulses": catalog.impulsive(CURVE, K, Pulses(height=12.0)),
        "LuGre's observer": catalog.lugre_observer(
            STRIBECK, law.element, BristleObserver(gain=0.1, adaptation=1.0, highest=1.1)  # type: ignore[arg-type]
        ),
        "disturbance observer": catalog.disturbance_observer(
            Law(rate=CURVE, element=slip.element), DisturbanceObserver(inertia=0.5, limit=20.0)
        ),
        "GMS": catalog.by_law(gms, dither=Dither(share=0.3)),
        "Maxwell-slip": catalog.by_law(slip),
        "LuGre": catalog.by_law(law),
    }  # fmt: skip
    methods = ("direct", "momentum", "disturbance", "extended", "kalman")
    learning = {3: Adaptation(slowest=0.1, upper=1.2), 5: Adaptation(slowest=0.1, upper=1.2)}
    found = []
    for i, compensator in enumerate(made.values()):
        friction = alg_fe2(CURVE, K, 0.015) if i % 2 else alg_fe(CURVE, K)
        external = ExternalForce(inertia=0.5, friction=friction, method=methods[i % 5], encoder_count=COUNT)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found.append(
                JointLoop(
                    compensator=compensator,
                    external=external if i else None,
                    adaptation=learning.get(i),
                    limit=(9.0, 20.0, 0.0, 1.0)[i % 4] if i % 7 == 6 else 9.0,
                    top_speed=TOP,
                    encoder_count=COUNT,
                    patience=(0.1, 0.005, 1.0)[i % 3],
                    hold=(0.5, 0.05)[i % 2],
                    ramp=(0.5, 0.15)[i % 2],
                )
            )
    return found


@nb.njit(error_model="numpy")
def storm(A, o, g, codes, q, limit, rate, rng, n, odd, inputs, torque, worst):
    """Run n ticks of the kernel with random readings about q, which goes on.

    `worst`: torque beyond the limit, step by the rate's, ticks that are no numbers, ticks of each status.
    """
    J = codes.size
    v, before = np.zeros(J), np.zeros(J)
    said = np.zeros(J)
    before[:] = g[:, torque]
    wild = rng.random() ** 4  # mostly little is wrong, so that the loop gets to push
    for _ in range(n):
        dt = T
        r = rng.random()
        if r < 0.02 * wild:
            dt = odd[rng.integers(0, odd.size)]
        elif r < 0.04 * wild:
            dt = T * np.exp(4.0 * rng.standard_normal())
        for j in range(J):
            r = rng.random()
            if r < 0.002:
                v[j] = TOP * (2.0 * rng.random() - 1.0) * (1.5 if rng.random() < 0.1 * wild else 0.8)
            elif r < 0.004:
                v[j] = 0.0
            q[j] += v[j] * T
            said[j] = np.floor(q[j] / COUNT) * COUNT
            r = rng.random() / (wild + 1e-3)
            if r < 0.01:
                said[j] = odd[rng.integers(0, odd.size)]
            elif r < 0.015:
                said[j] += rng.standard_normal() * 10.0 ** (6.0 * rng.random() - 4.0)
            elif r < 0.0152:
                q[j] += 2.0 * np.pi * (1.0 if rng.random() < 0.5 else -1.0)
            g[j, inputs[0]] = 10.0 * rng.standard_normal()
            if r < 0.02:
                g[j, inputs[rng.integers(0, inputs.size)]] = odd[rng.integers(0, odd.size)]
            elif r < 0.05:
                for k in range(1, inputs.size):
                    g[j, inputs[k]] = 0.1 * rng.standard_normal()
        loop_.tick(A, o, g, codes, said, dt)
        passed = dt if 0.05 * T <= dt <= 20.0 * T else T
        for j in range(J):
            f = g[j, torque]
            if not np.isfinite(f + g[j, torque + 1] + g[j, torque + 2] + g[j, torque + 3]):
                worst[2] += 1.0
            if abs(f) > limit[j]:
                worst[0] = max(worst[0], abs(f) - limit[j])
            worst[1] = max(worst[1], abs(f - before[j]) / (rate[j] * passed))
            worst[3 + codes[j]] += 1.0
            before[j] = f


def through_kernel(judge: Judge, ticks: float) -> None:
    """Feed the kernel."""
    made = joints()
    loop = Loop(made, interval=T)
    limit, rate = np.array([j.limit for j in made]), np.array([j.normal_rate for j in made])
    rows = np.array(
        [loop_.APPLIED, loop_.KNOWN, loop_.ERROR, loop_.SLOPE, loop_.MOTOR, loop_.LOAD, loop_.TEMPERATURE]
    )
    worst, J, chunk, done = np.zeros(3 + 16), len(made), 2000, 0
    rng, storms, q = np.random.default_rng(0), np.random.default_rng(1), np.zeros(J)
    with np.errstate(all="ignore"):
        while done * J < ticks:
            storm(*loop._arrays, q, limit, rate, storms, chunk, ODD, rows, loop_.TORQUE, worst)
            done += chunk
            loop.temperature[:] = 20.0
            loop.acknowledge()
            if rng.random() < 0.2:
                loop.stop()
            elif rng.random() < 0.1:
                q[:] = 0.0
                loop.reset(q)
    outcome(judge, f"kernel: {done} calls of {J} joints, {done * J:.3g} ticks", worst)


@nb.njit(error_model="numpy")
def look(f, more, codes, before, limit, rate, passed, worst):
    """Look at one call, and keep its torque."""
    for j in range(f.size):
        if not np.isfinite(f[j] + more[0, j] + more[1, j] + more[2, j]):
            worst[2] += 1.0
        worst[0] = max(worst[0], abs(f[j]) - limit[j])
        worst[1] = max(worst[1], abs(f[j] - before[j]) / (rate[j] * passed))
        worst[3 + codes[j]] += 1.0
        before[j] = f[j]


def through_update(judge: Judge, ticks: int) -> None:
    """Feed `Loop.update`, with things that are no arrays too."""
    made = joints()
    J, loop = len(made), Loop(made, interval=T)
    limit, rate = np.array([j.limit for j in made]), np.array([j.normal_rate for j in made])
    rng, raised, worst, before = np.random.default_rng(1), 0, np.zeros(3 + 16), np.zeros(J)
    intervals = [None, T, 2 * T, 5 * T, 0, -T, np.nan, np.inf, 1e9, 10**400, "now", np.float32(T), [T], T / 3]
    shapes = [
        np.zeros(5),
        np.zeros((J, 1)),
        0.0,
        None,
        "six",
        [0.0] * J,
        np.zeros(J, dtype=np.int32),
        ["a"] * J,
    ]
    length, k, place = 2000, 0, np.zeros((1, J))
    warnings.simplefilter("error")
    while k < ticks:
        v = TOP * np.repeat(rng.uniform(-0.9, 0.9, (length // 200, J)), 200, axis=0)
        v[np.repeat(rng.random((length // 50, J)) < 3e-3, 50, axis=0)] *= 2.0
        place = place[-1] + np.cumsum(v * T, axis=0)
        q = np.floor(place / COUNT) * COUNT
        bad = rng.random((length, J)) < rng.choice([0.0, 1e-3, 1e-2, 0.1])
        q[bad] = rng.choice(ODD, int(bad.sum()))
        u = rng.normal(0.0, 5.0, (length, J))
        odd = rng.random(length) < 0.02
        for i in range(length):
            given, torque, dt = q[i], u[i], None
            if odd[i]:
                given = shapes[i % len(shapes)] if rng.random() < 0.3 else given
                torque = shapes[(i + 3) % len(shapes)] if rng.random() < 0.3 else torque
                dt = intervals[rng.integers(len(intervals))]
            try:
                loop.update(given, torque, dt)  # type: ignore[arg-type]
            except Exception as error:
                raised += 1
                print(f"    raised: {error!r}")
            try:
                seconds = T if dt is None else float(dt)  # type: ignore[arg-type]
            except (TypeError, ValueError, OverflowError):
                seconds = T
            passed = seconds if 0.05 * T <= seconds <= 20.0 * T else T
            look(
                loop.torque,
                loop._table[:, loop_.EXTERNAL : loop_.LEVEL + 1],
                loop.codes,
                before,
                limit,
                rate,
                passed,
                worst,
            )
        k += length
        loop.acknowledge()
        if k % (3 * length) == 0:
            loop.stop()
    warnings.simplefilter("default")
    outcome(judge, f"Loop.update: {k} calls of {J} joints, {raised} raised", worst, raised)


def outcome(judge: Judge, what: str, worst: np.ndarray, raised: int = 0) -> None:
    """Judge what came out of one of both."""
    from backdrive.status import Status

    seen = {s.name: worst[3 + s] / max(worst[3:].sum(), 1.0) for s in Status}
    print(f"  {what}: " + ", ".join(f"{name} {100 * share:.2f} %" for name, share in seen.items()))
    judge.that(f"{what}: {worst[2]:.0f} no numbers", worst[2] == 0.0 and raised == 0)
    judge.that(f"  beyond its limit by {max(worst[0], 0.0):.3g} N.m at most", bool(worst[0] <= 0.0))
    judge.that(f"  largest step by the rate's {worst[1]:.9f}", bool(worst[1] <= 1.0 + 1e-9))
    judge.that("  every status was seen", all(share > 0.0 for share in seen.values()))
