"""Compensators against the algorithms of the thesis, written out as printed, and what theory says of them."""

from fractions import Fraction
from functools import cache

import numba as nb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from _loops import bench
from backdrive.control import BareLoop
from backdrive.control.compensators import (
    Compensator,
    Dither,
    alg_fc,
    alg_fc2,
    aung,
    by_law,
    disturbance_observer,
    impulsive,
    lugre_observer,
    mahvash_okamura,
    nothing,
)
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, alg_fe2, between_counts, ct, ha
from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput
from backdrive.laws import (
    GMS,
    Coulomb,
    CoulombViscous,
    Decaying,
    HaywardArmstrong,
    Law,
    LuGre,
    Polyline,
    StribeckGauss,
)
from backdrive.simulation.closed_loop import Scene, play
from backdrive.simulation.hand import still
from backdrive.simulation.joint import JointSimulation

JIT = not nb.config.DISABLE_JIT
T = 1e-3
K = 5e4
LENGTH = 400 if JIT else 60
CURVE = Polyline(velocity=(0.2, 0.5, 1.0), positive=(12.5, 13.5, 14.0), negative=(8.6, 9.5, 9.9))


def curve(v):
    """Return F_p, F_n and Phi of `CURVE`, by hand: lines through its knots, straight on beyond them."""
    V, F = np.array([0.0, 0.2, 0.5, 1.0]), {}
    for sign, knots in ((1, CURVE.positive), (-1, CURVE.negative)):
        slope = (knots[1] - knots[0]) / 0.3
        F[sign] = np.array([knots[0] - 0.2 * slope, *knots])
    values = F[1] if v >= 0 else F[-1]
    i = min(max(np.searchsorted(V, abs(v), side="right") - 1, 0), 2)
    at = values[i] + (values[i + 1] - values[i]) / (V[i + 1] - V[i]) * (abs(v) - V[i])
    return F[1][0], F[-1][0], np.sign(v) * (at - values[0])


def walk(seed, n=LENGTH, size=1e-3):
    """Return positions that rest, creep, run and turn back [rad]."""
    rng = np.random.default_rng(seed)
    scale = size * 10.0 ** rng.uniform(-3.0, 0.0, n // 20 + 1).repeat(20)[:n]
    scale[rng.random(n) < 0.1] = 0.0
    way = np.where(rng.random(n // 20 + 1) < 0.5, -1.0, 1.0).repeat(20)[:n]
    return np.cumsum(scale * (way + 0.7 * rng.standard_normal(n)))


def along(compensator, q, *, error=None, slope=None, applied=None, dt=T):
    """Return the torque of a compensator along positions, the first of which is where it rests."""
    loop = bench(dt, compensator=compensator)
    loop.reset(q[:1])
    f = np.empty(len(q))
    for k in range(len(q)):
        loop.error[0] = 0.0 if error is None else error[k]
        loop.slope[0] = 0.0 if slope is None else slope[k]
        loop.update(q[k : k + 1], np.zeros(1) if applied is None else applied[k : k + 1])
        f[k] = loop.torque[0]
    return f


# ------------------------------------------------------------------------------------------- as the thesis prints it


ABOVE = 1.0 + 1e-12


def gsat(a, x, b):
    """Iwatani 2017, (3.22)."""
    return b if x > b else a if x < a else x


def alg_fc_printed(p, alpha, *, R_d=0.0, omega=30.0 * np.pi, R=1.0):
    """Iwatani 2017, (3.27), line by line, with q as its state; R of (2.21) on all but the dither. alpha: one, or one a tick.

    (3.27e) with equality, which the rounding of K (p - q) is kept from deciding: the inclusion's sgn is [-1, 1] at rest.
    """
    alpha = np.broadcast_to(alpha, p.shape)
    q, out = p[0], np.empty(p.size)
    for k in range(p.size):
        F_p, F_n, _ = curve(0.0)
        f_star = K * (p[k] - q) / (1.0 + T * alpha[k])
        q_k = p[k] - gsat(-F_n, f_star, F_p) / K
        f_m = K * (p[k] - q_k)
        if -F_n * ABOVE <= f_star <= F_p * ABOVE:
            f_d = R_d * ((F_p + F_n) / 2.0 * np.sin(omega * T * (k + 1)) + (F_p - F_n) / 2.0)
        else:
            f_d = 0.0
        out[k] = R * (f_m + curve((q_k - q) / T)[2]) + f_d
        q = q_k
    return out


CASES = {"C": (0.0, 0.0), "CD": (0.0, 1.0), "P": (20.0, 0.0), "PD": (20.0, 0.3), "P500": (500.0, 0.0)}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("share", [1.0, 0.9])
def test_the_leaky_clip_is_alg_fc(case, share):
    alpha, R_d = CASES[case]
    dither = Dither(share=R_d) if R_d else None
    for seed in range(5 if JIT else 1):
        p = walk(seed)
        f = along(alg_fc(CURVE, K, alpha, dither, share=share), p)
        assert np.abs(f - alg_fc_printed(p, alpha, R_d=R_d, R=share)).max() < 1e-9
    assert np.abs(f).max() > 5.0


def test_the_compact_form_is_the_printed_one_to_the_last_digits():
    """Without Phi, whose velocity divides what is rounded by T: f = clip((f + K dp)/(1 + T alpha), -F_n, F_p)."""
    F_p, F_n, alpha = 12.0, 8.3, 20.0
    rng = np.random.default_rng(3)
    dp = rng.standard_normal(2000 if JIT else 100) * 2e-4
    estimator = alg_fe(CoulombViscous(coulomb_positive=F_p, coulomb_negative=F_n), K, alpha)
    p, x, row = estimator.law.row(), estimator.law.state(), estimator.row()
    e, worst = 0.0, 0.0  # e = p - q: with p itself, K p would lose digits
    for step in dp:
        e = gsat(-F_n, K * (e + step) / (1.0 + T * alpha), F_p) / K
        f = friction_.tick(row, 0, p, x, np.zeros(1), 0, step, T, (0.0, 0.0), 20.0)
        worst = max(worst, abs(f - K * e))
    assert worst < 1e-12


def test_alg_fc2_is_as_printed_but_for_max_and_min():
    """(3.28) with the weight kept within 0 and 1; as printed it leaves them."""
    count = 2.0 * np.pi / 65536 / 100
    V_W = between_counts(0.005, count, T)
    p = count * np.round(walk(11, size=5e-5) / count)
    w, weights, printed, printed_weights = 0.0, [], 0.0, []
    for k in range(p.size):
        fast = abs(p[k] - p[k - 1]) / T > V_W if k else False
        w = min(w + 0.01, 1.0) if fast else max(w - 0.01, 0.0)
        printed = max(printed + 0.01, 1.0) if fast else min(printed - 0.01, 0.0)
        weights.append(w)
        printed_weights.append(printed)
    alpha = (1.0 - np.array(weights)) * 20.0 + np.array(weights) * 500.0
    f = along(alg_fc2(CURVE, K, V_W, share=1.0), p)
    assert np.abs(f - alg_fc_printed(p, alpha)).max() < 1e-9
    assert max(weights) > 0.0
    if JIT:
        assert not (np.min(printed_weights) >= 0.0 and np.max(printed_weights) <= 1.0)


@pytest.mark.parametrize("dt", [4e-3, 1e-3, 1.25e-4])
def test_the_weight_takes_a_tenth_of_a_second(dt):
    """R_W = 0.01 a millisecond is r_W = 10 1/s, at any sampling time."""
    estimator = alg_fe2(Coulomb(coulomb=5.0), K, 0.01)
    p, x, s = estimator.law.row(), estimator.law.state(), np.zeros(1)
    seconds = {}
    for dp, end in ((0.02 * dt, 1.0), (0.0, 0.0)):
        ticks = 0
        while abs(s[0] - end) > 1e-9 and ticks < 10000:
            ticks += 1
            friction_.tick(estimator.row(), 0, p, x, s, 0, dp, dt, (0.0, 0.0), 20.0)
            assert 0.0 <= s[0] <= 1.0
            assert p[-1] == pytest.approx((1.0 - s[0]) * 20.0 + s[0] * 500.0)
        seconds[end] = ticks * dt
    assert seconds == pytest.approx({1.0: 0.1, 0.0: 0.1}, abs=1.01 * dt)


@pytest.mark.parametrize(
    ("threshold", "count", "counts"),
    [(0.01, 5e-6, 2), (0.005, 9.587e-7, 5), (0.001, 9.587e-7, 1), (1e-9, 5e-6, 0)],
)
def test_the_threshold_lies_between_counts(threshold, count, counts):
    """Setup A: 0.01 m/s is two counts a tick to the last digit; that is still, and three are moving."""
    V = between_counts(threshold, count, T)
    estimator = ct(CURVE, V)
    reading = count * np.arange(2000.0)
    for steps, moves in ((counts, False), (counts + 1, True)):
        moved = [
            friction_.tick(
                estimator.row(),
                0,
                estimator.law.row(),
                np.zeros(2),
                np.zeros(1),
                0,
                b - a,
                T,
                (0.0, 0.0),
                20.0,
            )
            != 0.0
            for a, b in zip(reading[::37], reading[steps::37], strict=False)
        ]
        assert all(m == moves for m in moved) or counts == 0
    raw = np.diff(count * np.arange(0.0, 4000.0, 2.0)) / T > 0.01
    if count == 5e-6:
        assert 0.2 < raw.mean() < 0.8  # why: rounding decides
    assert between_counts(threshold, 0.0, T) == threshold


def test_mahvash_and_okamura_as_printed():
    """(2.22): e = F_0/K sat(K/F_0 (dt v + e)), f = R (K e + phi_0(v)); (2.24) without phi_0, (2.25) with B_c v."""
    F_0, B_c, R, stiffness = 9.0, 4.0, 0.9, 1e4
    line = CoulombViscous(
        coulomb_positive=F_0, coulomb_negative=F_0, viscous_positive=B_c, viscous_negative=B_c
    )
    bent = Polyline(velocity=(0.5, 1.0, 2.0), positive=(9.5, 9.8, 10.0), negative=(9.5, 9.8, 10.0))

    def phi_0(v):
        return np.sign(v) * (np.interp(abs(v), [0.0, 0.5, 1.0, 9.0], [9.2, 9.5, 9.8, 11.4]) - 9.2)

    p = walk(4)
    cases = (
        (Coulomb(coulomb=F_0), F_0, lambda v: 0.0),
        (line, F_0, lambda v: B_c * v),
        (bent, 9.2, phi_0),
    )
    for rate, F, viscous in cases:
        f, e = along(mahvash_okamura(rate, stiffness, R), p), 0.0
        for k in range(1, p.size):
            v = (p[k] - p[k - 1]) / T
            a = stiffness / F * (T * v + e)
            e = F / stiffness * (a / abs(a) if abs(a) > 1.0 else a)
            assert f[k] == pytest.approx(R * (stiffness * e + viscous(v)), abs=1e-9)


FALLING = Polyline(velocity=(0.1, 0.4, 1.5), positive=(9.0, 8.0, 9.5), negative=(9.0, 8.0, 9.5))


def along_mop_printed(p, stiffness, R):
    """Iwatani 2017, (2.22), on `FALLING`, line by line."""
    F_0 = 9.0 + 0.1 / 0.3
    e, out = 0.0, np.zeros(p.size)
    for k in range(1, p.size):
        v = (p[k] - p[k - 1]) / T
        a = stiffness / F_0 * (T * v + e)
        e = F_0 / stiffness * (a / abs(a) if abs(a) > 1.0 else a)
        phi = np.interp(abs(v), [0.0, 0.1, 0.4, 1.5, 4.8], [F_0, 9.0, 8.0, 9.5, 14.0])
        out[k] = R * (stiffness * e + np.sign(v) * (phi - F_0))
    return out


def test_mahvash_and_okamura_on_a_falling_curve_as_printed_and_narrowed():
    """The printed form opposes a motion that begins; by default the fall narrows the contact. In sliding they are the same."""
    stiffness, R, F_0 = 1e4, 0.9, 9.0 + 0.1 / 0.3
    t = T * np.arange(2 * LENGTH)
    p = 0.25 * np.sin(2.0 * np.pi * 0.5 * t)
    printed = along(mahvash_okamura(FALLING, stiffness, R, literal=True), p)
    assert printed == pytest.approx(along_mop_printed(p, stiffness, R), abs=1e-9)
    ours = along(mahvash_okamura(FALLING, stiffness, R), p)
    if JIT:
        sliding = np.abs(np.abs(printed) - R * falling_torque(np.gradient(p, T))) < 0.02
        assert sliding.mean() > 0.8
        assert np.abs(printed - ours)[sliding].max() < 0.05
        assert 0.2 < np.abs(printed - ours).max() < R * (F_0 - 8.0)
    # from rest, forwards at 0.4 rad/s: nothing is stretched yet, and the printed form pulls back
    begin = np.r_[0.0, 0.4 * T * np.ones(3)].cumsum()
    assert along(mahvash_okamura(FALLING, 100.0, R, literal=True), begin)[1] < -0.5
    assert np.all(along(mahvash_okamura(FALLING, 100.0, R), begin) >= 0.0)


def falling_torque(v):
    """Return the magnitude of `FALLING` at velocities."""
    return np.interp(np.abs(v), [0.0, 0.1, 0.4, 1.5], [9.0 + 0.1 / 0.3, 9.0, 8.0, 9.5])


def test_the_printed_form_is_of_its_contact_alone():
    with pytest.raises(InvalidInput, match="is not the contact that"):
        FrictionEstimator(law=Law(rate=FALLING, element=Decaying(stiffness=K)), literal=True)


def test_nothing_gives_nothing_and_any_law_is_a_compensator():
    q = walk(2)
    assert np.all(along(nothing(), q) == 0.0)
    law = Law(
        rate=StribeckGauss(coulomb=6.0, breakaway=8.0, stribeck_velocity=0.05, viscous=2.0),
        element=GMS(stiffness=(4e4, 1e4), share=(0.6, 0.4), attraction=100.0),
    )
    p, x = law.row(), law.state()
    row = FrictionEstimator(law=law).row()
    f = along(by_law(law, share=0.8), q)
    for k in range(1, q.size):
        expected = friction_.tick(row, 0, p, x, np.zeros(1), 0, q[k] - q[k - 1], T, (0.0, 0.0), 20.0)
        assert f[k] == pytest.approx(0.8 * expected, rel=1e-12, abs=1e-12)


# ------------------------------------------------------------------------------------------------------------ dither


def exact_alg_fc(counts, *, stiffness, count, F_p, F_n):
    """Return dither at 1 of (3.27) for alpha = 0 in rational arithmetic, where equality in (3.27e) is exact: with it, without it.

    counts: encoder, whole numbers. A stuck tick is 1, a sliding one 0.
    """
    K_, delta = Fraction(stiffness), Fraction(count)
    high, low = Fraction(F_p), -Fraction(F_n)
    q, closed, opened = counts[0] * delta, [], []
    for c in counts:
        p = int(c) * delta
        f_star = K_ * (p - q)
        q = p - min(max(f_star, low), high) / K_
        closed.append(low <= f_star <= high)
        opened.append(low < f_star < high)
    return np.array(closed), np.array(opened)


MACHINES = {
    "Setup A": dict(stiffness=1.2e6, count=5e-6, F_p=12.0, F_n=8.0),
    "Joint 0": dict(stiffness=5e4, count=2.0 * np.pi / 65536 / 100, F_p=6.85, F_n=6.85),
}


@pytest.mark.parametrize("machine", MACHINES)
def test_a_joint_that_stops_after_sliding_is_stuck_also_without_decay(machine):
    """(3.27e) with its equality, as the inclusion (3.3a) has it: sgn is [-1, 1] at rest, ends included."""
    numbers = MACHINES[machine]
    rng = np.random.default_rng(5)
    runs = [np.r_[np.full(40, way * size), np.zeros(30), -way * np.ones(3), np.zeros(20)] for way, size in
            zip(rng.choice([-1, 1], 12), rng.integers(1, 400, 12), strict=True)]  # fmt: skip
    counts = np.r_[np.zeros(20), np.cumsum(np.concatenate(runs))].astype(int)
    closed, opened = exact_alg_fc(counts, **numbers)
    rate = CoulombViscous(coulomb_positive=numbers["F_p"], coulomb_negative=numbers["F_n"])
    q = numbers["count"] * counts
    f, plain = (
        along(alg_fc(rate, numbers["stiffness"], 0.0, dither, share=1.0), q)
        for dither in (Dither(share=0.5, frequency=7.0), None)
    )
    stands = np.diff(counts, prepend=0) == 0
    sure = stands | (closed == opened)  # not the tick that ends on the bound to the last digit: it is both
    assert np.array_equal((f != plain)[sure], closed[sure])
    assert np.all(closed[stands])
    assert opened[stands].mean() < 0.7  # without equality many stops are no standstill


def test_the_share_is_not_of_the_dither():
    """(2.21) is of the friction; the dither has R_d, (3.26)."""
    q = walk(6)
    dithers = [along(alg_fc(CURVE, K, 20.0, Dither(share=0.4), share=R), q) for R in (1.0, 0.5)]
    plain = [along(alg_fc(CURVE, K, 20.0, share=R), q) for R in (1.0, 0.5)]
    assert dithers[0] - plain[0] == pytest.approx(dithers[1] - plain[1], abs=1e-9)
    assert plain[1] == pytest.approx(0.5 * plain[0], abs=1e-9)


def test_at_rest_the_dither_is_a_sine_about_half_the_difference():
    F_p, F_n, _ = curve(0.0)
    f = along(alg_fc(CURVE, K, 20.0, Dither(share=0.5, frequency=10.0), share=1.0), np.zeros(200))
    t = T * np.arange(1, 201)
    assert f == pytest.approx(0.5 * ((F_p + F_n) / 2 * np.sin(20 * np.pi * t) + (F_p - F_n) / 2), abs=1e-9)
    assert -F_n < f.min() < f.max() < F_p


def stop_and_go():
    """Return rest for 33 ms, a run, and rest."""
    dp = np.zeros(150)
    dp[33:60] = 2e-3
    return np.cumsum(dp)


def test_reset_begins_at_phase_zero_where_fixed_goes_by_the_clock():
    q, F = stop_and_go(), 6.0
    rate = Coulomb(coulomb=F)
    fixed, reset = (
        along(alg_fc(rate, K, 20.0, Dither(share=0.3, mode=mode), share=1.0), q)
        - along(alg_fc(rate, K, 20.0, share=1.0), q)
        for mode in ("fixed", "reset")
    )
    assert np.all(fixed[33:60] == 0.0)
    assert np.all(reset[33:60] == 0.0)
    omega = 30.0 * np.pi
    assert fixed[60:] == pytest.approx(0.3 * F * np.sin(omega * T * np.arange(61, 151)), abs=1e-9)
    assert reset[60:] == pytest.approx(0.3 * F * np.sin(omega * T * np.arange(90)), abs=1e-9)
    assert abs(reset[60]) < 1e-12


def test_adaptive_dither_grows_until_it_shows_and_shrinks_when_it_shows_too_much():
    count = 1e-5
    dither = Dither(share=0.9, mode="adaptive", count=count, counts=2.0, window=0.07, growth=0.1)
    rate, n = Coulomb(coulomb=6.0), 1500

    def amplitudes(q):
        f = along(alg_fc(rate, 1e3, 20.0, dither, share=1.0), q)
        return [np.abs(f[a : a + 70]).max() for a in range(0, n - 70, 70)]

    still_ = amplitudes(np.zeros(n))
    assert still_[0] < 0.2
    assert np.all(np.diff(still_[:10]) > 0.0)
    assert still_[-1] == pytest.approx(0.9 * 6.0, rel=0.02)
    shaken = np.where(np.arange(n) < 700, 0.0, 6 * count * np.sign(np.sin(100.0 * T * np.arange(n))))
    assert amplitudes(shaken)[-1] < 0.1 * 6.0
    quiet = np.where(np.arange(n) < 700, 0.0, count * (np.arange(n) % 60 < 30))
    kept = amplitudes(quiet)
    assert kept[-1] == pytest.approx(kept[11], rel=0.05)


def test_a_bristle_that_comes_near_its_bound_slides():
    """LuGre approaches its bound without end; there is no dither in motion all the same."""
    law = Law(rate=Coulomb(coulomb=6.0), element=LuGre(stiffness=K))
    q = np.cumsum(np.full(200, 1e-4))
    f, plain = along(by_law(law, dither=Dither()), q), along(by_law(law), q)
    assert np.all(f[50:] == plain[50:])


def test_the_three_parts_of_aung():
    """Nothing at rest but a dither of a few counts, the rate law in motion, a damped contact between."""
    compensator = aung(CURVE, K, 50.0, 1e-6, share=1.0)
    assert compensator.dither is not None
    f = along(compensator, np.concatenate([np.zeros(300), np.cumsum(np.full(300, 1e-3))]))
    assert np.abs(f[:60]).max() == 0.0
    assert 0.0 < np.abs(f[:300]).max() < CURVE.positive[0]
    assert f[-1] == pytest.approx(curve(1.0)[0] + curve(1.0)[2], rel=1e-6)


# ------------------------------------------------------------------------------------- pulses, bristle, disturbances


@pytest.mark.parametrize("width", [0.003, 0.0042, 0.001])
def test_pulses_come_where_the_joint_is_stuck_off_its_reference(width):
    pulses = Pulses(height=9.0, width=width, wait=0.02, tolerance=1e-4)
    compensator, n = impulsive(Coulomb(coulomb=6.0), K, pulses), 200
    ticks = round(width / T)
    for error, height in ((2e-4, 9.0), (-2e-4, -9.0), (0.5e-4, 0.0)):
        f = along(compensator, np.zeros(n), error=np.full(n, error))
        assert set(np.unique(f)) <= {0.0, height}
        begins = np.flatnonzero(np.diff(f, prepend=0.0) * np.sign(height) > 0.0)
        if height:
            assert np.count_nonzero(f[: begins[1]]) == ticks
            assert begins[0] * T == pytest.approx(0.02, abs=1.1 * T)
            assert np.diff(begins) * T == pytest.approx(ticks * T + 0.02, abs=2.1 * T)
    moving = along(compensator, 1e-6 * np.arange(n), error=np.full(n, 2e-4))
    assert np.all(np.diff(moving[2:]) >= -1e-9)  # no pulse


def test_a_pulse_moves_a_joint_by_what_mechanics_says():
    """(f - F) f w^2/(2 M F), a rigid mass under Coulomb friction; and so it creeps to its reference."""
    M, F, height, width = 2.0, 6.0, 10.0, 0.004
    joint = JointSimulation(name="j", law=Law(rate=Coulomb(coulomb=F)), motor_inertia=M)
    target = np.zeros((400 if JIT else 60, 2))
    target[1:, 0] = 1e-4
    n = len(target)
    compensator = impulsive(
        Coulomb(coulomb=0.0), K, Pulses(height=height, width=width, wait=0.02, tolerance=3e-5)
    )
    record = play(
        Scene(
            plant=joint,
            motion=still(n),
            target=target,
            controller=Servo(proportional=0.0, derivative=0.0),  # which only says where to
            loop=BareLoop(compensator=compensator),
            substep=1e-5 if JIT else 1e-4,
        )
    )
    leaps = np.diff(record.motor[np.r_[0, np.flatnonzero(np.diff(record.command) > 0.0), n - 1]])
    expected = (height - F) * height * width**2 / (2.0 * M * F)
    assert leaps[leaps > 1e-9][:2] == pytest.approx(expected, rel=0.05)
    assert abs(record.motor[-1] - 1e-4) < 3e-5 + expected if JIT else True


OBSERVED = LuGre(stiffness=K, damping=20.0)
STRIBECK = StribeckGauss(coulomb=6.0, breakaway=7.5, stribeck_velocity=0.05, viscous=2.0)


def test_an_observer_that_corrects_nothing_is_the_law():
    q = walk(8)
    observed = along(lugre_observer(STRIBECK, OBSERVED, BristleObserver(), share=1.0), q)
    assert observed == pytest.approx(
        along(by_law(Law(rate=STRIBECK, element=OBSERVED), share=1.0), q), abs=1e-9
    )


def test_bristle_and_scale_stay_within_their_bounds():
    """Whatever error the tracking shows: |z| <= s/sigma_0, lowest <= theta <= highest."""
    observer = BristleObserver(gain=5.0, corner=50.0, adaptation=1e4, lowest=0.7, highest=1.3)
    compensator = lugre_observer(STRIBECK, LuGre(stiffness=K), observer, share=1.0)
    rng = np.random.default_rng(0)
    loop, q, theta = bench(T, compensator=compensator), walk(9), []
    place = np.size(compensator.row(T)) + 6  # of the observer's state in the rows of the loop
    for k in range(q.size):
        loop.error[0], loop.slope[0] = 10.0 ** rng.uniform(-6, 3) * rng.choice([-1.0, 1.0]), rng.normal()
        loop.update(q[k : k + 1], np.zeros(1))
        s = loop._arrays[0][0, place : place + 2]
        assert abs(s[0]) <= 7.5 * (1.0 + 1e-12)
        theta.append(s[1])
    assert min(theta) >= 0.7
    assert max(theta) <= 1.3
    assert not JIT or (min(theta) == 0.7 and max(theta) == 1.3)


def tracked(compensator, law, inertia=0.7, seconds=3.0):
    """Return the tracking error (rms, last two thirds) and the record of a joint under PD that follows a sine."""
    joint = JointSimulation(
        name="j",
        law=law,
        motor_inertia=inertia,
        encoder_count=1e-6,
        servo=Servo(proportional=600.0, derivative=40.0),
    )
    t = T * np.arange(round((seconds if JIT else 0.1) / T))
    target = np.stack([0.2 * (1.0 - np.cos(4.0 * t)), 0.8 * np.sin(4.0 * t)], axis=1)
    record = play(
        Scene(
            plant=joint,
            motion=still(t.size),
            target=target,
            controller=joint.servo,
            loop=BareLoop(compensator=compensator),
            substep=1e-4,
        )
    )
    wrong = record.motor - target[:, 0]
    return float(np.sqrt(np.mean(wrong[t.size // 3 :] ** 2))), record


def test_adaptation_finds_the_friction_that_a_wrong_model_misses():
    """A model of 70 % of the friction: with adaptation of theta the tracking error falls, and theta goes towards 1/0.7."""
    law = Law(rate=STRIBECK, element=OBSERVED)
    weak = STRIBECK.__class__(coulomb=4.2, breakaway=5.25, stribeck_velocity=0.05, viscous=1.4)
    fixed = lugre_observer(weak, OBSERVED, BristleObserver(), share=1.0)
    adaptive = lugre_observer(weak, OBSERVED, BristleObserver(corner=20.0, adaptation=3.0), share=1.0)
    none, _ = tracked(nothing(), law)
    before, _ = tracked(fixed, law)
    after, _ = tracked(adaptive, law)
    if JIT:
        assert after < 0.75 * before < 0.75 * none


def test_the_disturbance_observer_cancels_what_the_model_misses_up_to_its_limit():
    law = Law(rate=STRIBECK, element=OBSERVED)
    model = Law(rate=Coulomb(coulomb=4.0), element=HaywardArmstrong(stiffness=K))
    plain, _ = tracked(by_law(model, share=1.0), law)
    results = {}
    for limit in (0.5, 20.0):
        observer = DisturbanceObserver(inertia=0.7, bandwidth=40.0, limit=limit)
        results[limit], record = tracked(disturbance_observer(model, observer, share=1.0), law)
        assert np.abs(record.compensation).max() <= 4.0 + limit + 1e-9
    if JIT:
        assert results[20.0] < 0.6 * plain
        assert results[20.0] < results[0.5] < plain


# ---------------------------------------------------------------------------------------------------------- its theory

increments = st.lists(st.floats(-1e-3, 1e-3), min_size=1, max_size=60)
decays = st.floats(0.0, 800.0)
starts = st.floats(-6.0, 6.0)
EXAMPLES = 150 if JIT else 10


@cache
def rows_of(alpha, F_n, F_p):
    law = Law(
        rate=CoulombViscous(coulomb_positive=F_p, coulomb_negative=F_n),
        element=Decaying(stiffness=K, decay_rate=alpha),
    )
    return FrictionEstimator(law=law).row(), law.row()


def core(f, dp, alpha, F_n=6.0, F_p=6.0):
    """Return the torque of the decaying contact one tick on, by the kernel that everything uses."""
    row, p = rows_of(alpha, F_n, F_p)
    return friction_.tick(row, 0, p, np.array([f, 0.0]), np.zeros(1), 0, dp, T, (0.0, 0.0), 20.0)


@settings(max_examples=EXAMPLES)
@given(dp=increments, alpha=decays, f=starts, g=starts)
def test_it_contracts(dp, alpha, f, g):
    """Two that see the same motion come together by 1/(1 + T alpha) a tick; with alpha = 0 they do not part."""
    for step in dp:
        before = abs(f - g)
        f, g = core(f, step, alpha), core(g, step, alpha)
        assert abs(f - g) <= before / (1.0 + T * alpha) * (1.0 + 1e-12) + 1e-14


@settings(max_examples=EXAMPLES)
@given(dp=increments, alpha=decays, f=starts)
def test_as_a_friction_it_is_output_strictly_passive(dp, alpha, f):
    """Storage f^2/2K: it grows by no more than f dp - T alpha f^2/K a tick."""
    for step in dp:
        after = core(f, step, alpha)
        stored = (after * after - f * f) / (2.0 * K)
        assert stored <= after * step - T * alpha * after * after / K + 1e-15
        f = after


@settings(max_examples=EXAMPLES)
@given(v=st.floats(-2.0, 2.0), alpha=st.floats(5.0, 800.0))
def test_at_constant_velocity_it_is_viscous_up_to_a_threshold(v, alpha):
    """f = min(F, K v/alpha): below alpha F/K a damping of K/alpha."""
    f = 0.0
    for _ in range(int(20.0 / np.log1p(T * alpha)) + 1 if JIT else 2000):
        f = core(f, v * T, alpha)
    assert f == pytest.approx(np.sign(v) * min(6.0, K * abs(v) / alpha), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("alpha", [20.0, 500.0])
def test_at_rest_it_lets_go(alpha):
    f = 6.0
    for k in range(1, 40):
        f = core(f, 0.0, alpha)
        assert f == pytest.approx(6.0 * (1.0 + T * alpha) ** -k, rel=1e-12)


def path(turns, fine):
    """Return positions from turn to turn in equal small steps [rad]."""
    pieces = [np.zeros(1)]
    for a, b in zip([0.0, *turns], turns, strict=False):
        n = max(1, int(np.ceil(abs(b - a) / fine)))
        pieces.append(a + (b - a) * np.arange(1, n + 1) / n)
    return np.concatenate(pieces)


def taken(q, R, compensator, real):
    """Return the energy that a real contact and its compensator together take out of the motion, up to each tick [J].

    Both are springs with sliders, along a path; `real`, `compensator`: stiffness and bound.
    """
    forces = []
    for stiffness, F in (compensator, real):
        law = Law(rate=Coulomb(coulomb=F), element=HaywardArmstrong(stiffness=stiffness))
        p, x, row, s = law.row(), law.state(), FrictionEstimator(law=law).row(), np.zeros(1)
        f = [
            friction_.tick(row, 0, p, x, s, 0, step, T, (0.0, 0.0), 20.0) for step in np.diff(q, prepend=q[0])
        ]
        forces.append(np.array(f))
    total = forces[1] - R * forces[0]
    return np.concatenate([[0.0], np.cumsum(0.5 * (total[1:] + total[:-1]) * np.diff(q))])


F_C, K_C = 6.0, 1e4
R_C = F_C / K_C  # presliding distance of the real joint


@settings(max_examples=60 if JIT else 3)
@given(
    turns=st.lists(st.floats(-4.0, 4.0), min_size=1, max_size=8),
    R=st.floats(0.5, 1.3),
    share=st.floats(0.0, 1.0),
    later=st.floats(1.0, 3.0),
)
def test_together_they_are_passive_where_the_joint_yields_first(turns, R, share, later):
    """R F <= F_c and F/K >= F_c/K_c: no path from rest gets energy out of joint and compensator; R itself may exceed 1."""
    F = share * F_C / R
    if F < 1e-3:
        return
    K_ = F / (later * R_C)
    q = R_C * path(turns, 0.02)
    energy = taken(q, R, (K_, F), (K_C, F_C))
    assert energy.min() >= -1e-3 * F_C * R_C


@pytest.mark.parametrize(
    ("R", "K_", "F", "size"),
    [(0.95, 2.0 * K_C, F_C, 0.8), (0.9, 1.5 * K_C, F_C, 0.9), (1.1, K_C, F_C, 3.0), (1.01, K_C, F_C, 60.0)],
)
def test_otherwise_a_cycle_gains_energy(R, K_, F, size):
    """A contact stiffer than the joint's between the two presliding distances; R F > F_c in large strokes."""
    cycles = 4
    q = R_C * path([size, -size] * (2 * cycles), 0.02 if size < 10 else 0.5)
    energy = taken(q, R, (K_, F), (K_C, F_C))
    ends = energy[-1] - energy[energy.size // 2]
    assert ends < 0.0


@pytest.mark.parametrize("R", [0.5, 0.8, 0.9])
def test_a_cycle_feeds_itself_only_up_to_the_bound(R):
    """Injected <= 4 R F a, taken 4 F (a - r_c), quasi-statically: beyond a = r_c/(1 - R) a cycle always costs energy.

    The worst compensator is rigid and sees the motor's side, the joint's own contact yields by r_c.
    """
    bound = R_C / (1.0 - R)
    for a, gains in ((0.9 * bound, True), (1.1 * bound, False)):
        q = path([a, -a] * 6, 0.02 * R_C)
        energy = taken(q, R, (1e4 * K_C, F_C), (K_C, F_C))
        cycle = 2 * (path([2.0 * a], 0.02 * R_C).size - 1)
        assert (energy[-1] < energy[-1 - cycle]) == gains


@settings(max_examples=200 if JIT else 20)
@given(
    damping=st.floats(0.0, 3.0).map(lambda x: 10.0**x),
    stiffer=st.floats(0.2, 2.0),
    alpha=st.floats(0.5, 800.0),
    mass=st.floats(0.02, 2.0),
)
def test_a_joint_stuck_on_its_load_is_stable_as_routh_says(damping, stiffer, alpha, mass):
    """M p'' = -K_c p - D p' + f, f' = K p' - alpha f: stable iff D (K_c - K + D alpha + M alpha^2) > M alpha K."""
    K_ = stiffer * K_C
    A = np.array([[0.0, 1.0, 0.0], [-K_C / mass, -damping / mass, 1.0 / mass], [0.0, K_, -alpha]])
    margin = damping * (K_C - K_ + damping * alpha + mass * alpha**2) - mass * alpha * K_
    if abs(margin) > 1e-6 * mass * alpha * K_:
        assert (np.linalg.eigvals(A).real.max() < 0.0) == (margin > 0.0)


# ------------------------------------------------------------------------------------------------------------ refusals


def test_bad_compensators_are_refused():
    law = Law(rate=Coulomb(coulomb=5.0))
    for bad in (
        lambda: Compensator(share=-0.1),
        lambda: Compensator(share=np.nan),
        lambda: Compensator(share=np.inf),
        lambda: Compensator(friction=FrictionEstimator(law=law), dither=Dither()),
        lambda: Dither(share=1.5),
        lambda: Dither(frequency=0.0),
        lambda: Dither(mode="other"),  # type: ignore[arg-type]
        lambda: Pulses(height=-1.0),
        lambda: BristleObserver(lowest=1.1),
        lambda: lugre_observer(STRIBECK, OBSERVED, BristleObserver(gain=np.nan)),
        lambda: Compensator(friction=ha(STRIBECK, K), extra=BristleObserver()),
        lambda: DisturbanceObserver(inertia=1.0, limit=0.0),
        lambda: DisturbanceObserver(inertia=-1.0, limit=1.0),
        lambda: FrictionEstimator(law=law, fast_decay=500.0),
        lambda: alg_fe2(STRIBECK, K, -1.0),
        lambda: alg_fe2(STRIBECK, K, 0.01, switch_rate=0.0),
    ):
        with pytest.raises(InvalidInput):
            bad()
