"""The estimators' numbers beyond single ticks: gains from their equations, ticks of another length, rows anywhere in a table."""

from math import copysign, cos, exp, inf, log, nan, sin

import numba as nb
import numpy as np
import pytest

from backdrive.control import Admittance, admittance
from backdrive.control.admittance import tick as admit
from backdrive.control.compensators import Dither, alg_fc2, disturbance_observer, impulsive, lugre_observer
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.compensators import dither as dither_
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators import Adaptation, AdaptiveFriction, RecursiveLeastSquares, sliding_mode
from backdrive.control.estimators import external as external_
from backdrive.control.estimators import friction as friction_row
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, alg_fe2
from backdrive.control.estimators.friction import tick as friction_tick
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.control.estimators.sliding_mode import motion as filtered
from backdrive.engine import Axis, drives, servo
from backdrive.engine import axis as axis_
from backdrive.errors import InvalidInput
from backdrive.laws import (
    Coulomb,
    CoulombViscous,
    Decaying,
    Law,
    LoadTemperature,
    LuGre,
    MaxwellSlip,
    StribeckGauss,
)
from backdrive.status import Status

pytestmark = pytest.mark.skipif(
    not nb.config.DISABLE_JIT, reason="runs with NUMBA_DISABLE_JIT=1, as .ci/run does"
)
T = 1e-3
RATE = CoulombViscous(coulomb_positive=7.0, coulomb_negative=5.0, viscous_positive=3.0, viscous_negative=2.0)
N = 60
Q = 0.3 + 0.02 * np.sin(np.arange(N) / 7.0) + 1e-4 * np.cos(2.0 * np.arange(N))
U = 3.0 * np.cos(np.arange(N) / 5.0)


# ------------------------------------------------------------------------------------------- external force


def kalman(M, T, rate, count):
    """Stationary gains of x = (q, v, d), d a random walk of `rate`/M a root second, q in steps of `count`: Riccati, iterated."""
    A = np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    W, R = np.diag([0.0, 0.0, (rate / M) ** 2 * T]), count**2 / 12.0
    P = np.diag([R, R / T**2, R / T**4])
    for _ in range(4000):
        K = P[:, 0] / (P[0, 0] + R)
        P = A @ (P - np.outer(K, P[0])) @ A.T + W
        P = 0.5 * (P + P.T)
    return P[:, 0] / (P[0, 0] + R)


def threefold(L, T):
    """Gains that put all three poles at b = exp(-L T): the estimate's error e follows (z - b)^3."""
    b = exp(-L * T)
    A = np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    K = np.array([1.0 - b**3, 1.5 * (1.0 - b) ** 2 * (1.0 + b) / T, (1.0 - b) ** 3 / T**2])
    poles = np.linalg.eigvals((np.eye(3) - np.outer(K, [1.0, 0.0, 0.0])) @ A)
    assert np.abs(poles) == pytest.approx(b, rel=1e-4)
    return K


def observed(K, n, q, dt, M, z):
    """Advance the observer z of q, v, d by one tick: predicted by the torque n, corrected by the position q."""
    step = np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    z = step @ z + n / M * np.array([0.5 * dt * dt, dt, 0.0])
    return z + K * (q - z[0])


@pytest.mark.parametrize("method", ["extended", "kalman"])
def test_an_observers_gains_are_those_of_its_poles_or_its_noise(method):
    M, L, rate, count = 1.7, 60.0, 30.0, 2e-5
    made = ExternalForce(inertia=M, method=method, bandwidth=L, force_rate=rate, encoder_count=count)
    pole = made.row(T)[4]
    K = threefold(pole, T) if method == "extended" else kalman(M, T, rate, count)
    lag = pole if method == "extended" else -log(1.0 - K[0]) / (3.0 * T)
    force, _ = made.run(Q, U, T)
    z = np.array([Q[0], 0.0, 0.0])
    for k in range(N):
        z = observed(K, U[k - 1] if k else 0.0, Q[k], T, M, z)
        assert force[k] == pytest.approx(M * z[2], rel=2e-6, abs=1e-6)
    # a tick of another length has the gains of its poles from a tenth more or less on
    for stretch, own in (
        (0.5, True),
        (0.899, True),
        (0.901, False),
        (1.0, False),
        (1.099, False),
        (1.101, True),
        (3.0, True),
    ):
        c, s, dt = made.row(T), made.start(0.3), stretch * T
        z = np.array([0.3, 0.0, 0.0])
        for k in range(5):
            q = 0.3 + 0.01 * k * k
            K_now = threefold(lag, dt) if own else K * np.array([1.0, T / dt, (T / dt) ** 2])
            z = observed(K_now, 4.0, q, dt, M, z)
            law = made.friction.law
            got = external_.tick(
                c, 0, law.row(), law.state(), s, 0, q, 0.0, dt, 4.0, 0.0, (0.0, 0.0), 20.0, 1.0
            )
            assert got == (pytest.approx(M * z[2], rel=2e-6), 0.0)


@pytest.mark.parametrize("gravity", [(0.0, 0.0), (4.0, 0.0), (1.0, 0.0), (0.0, -3.0), (0.0, 1.0)])
def test_gravity_of_either_kind_and_known_torques_are_taken_off(gravity):
    A, B = gravity
    known = 0.5 * np.sin(np.arange(N) / 3.0)
    for method in METHODS:
        plain = ExternalForce(inertia=1.2, method=method)
        full = ExternalForce(inertia=1.2, method=method, gravity_sin=A, gravity_cos=B)
        weight = A * np.sin(Q) + B * np.cos(Q)
        # gravity is known torque; what acts before the first command is what holds the joint
        wanted, _ = plain.run(Q, U, T, known + weight)
        got, _ = full.run(Q, U, T, known)
        start = of_the_first_tick(plain, weight[0])
        assert got - wanted == pytest.approx(start, rel=1e-6, abs=1e-9)
        assert full.run(Q, U, T)[0] == pytest.approx(full.run(Q, U, T, np.zeros(N))[0], abs=0.0)


def of_the_first_tick(estimator, weight):
    """What the estimate answers to a torque in the first tick alone: its response to known = -weight there."""
    known = np.zeros(N)
    known[0] = weight
    still, zero = np.full(N, 0.3), np.zeros(N)
    c, s, law, out = estimator.row(T), estimator.start(0.3), estimator.friction.law, []
    for k in range(N):
        out.append(
            external_.tick(
                c, 0, law.row(), law.state(), s, 0, still[k], 0.0, T, zero[k], known[k], (0.0, 0.0), 20.0, 1.0
            )[0]
        )
    return np.array(out)


def test_along_a_log_the_law_sees_the_motors_torque_at_20_degrees():
    """F = 2 + 0.4 |u/2| + 0.05 T: the load is the command of the tick before, nothing from outside."""
    rate = LoadTemperature(coulomb=2.0, coulomb_load=0.4, stribeck_temperature=0.05, stribeck_velocity=1e5)
    made = ExternalForce(inertia=1.0, friction=FrictionEstimator(law=Law(rate=rate)))
    _, friction = made.run(Q, U, T)
    acted = np.r_[U[0], U[:-1]]
    assert friction[1:] == pytest.approx(
        (np.sign(np.diff(Q)) * (2.0 + 0.2 * np.abs(acted[1:]) + 1.0)), rel=1e-6
    )
    assert friction[0] == 0.0


def test_series_of_one_length_are_asked_for():
    made = ExternalForce(inertia=1.0)
    for q, u, known in ((3, 4, None), (3, 3, 4), (0, 0, None)):
        with pytest.raises(InvalidInput, match="one length"):
            made.run(np.zeros(q), np.zeros(u), T, None if known is None else np.zeros(known))
    with pytest.raises(InvalidInput, match="one length"):
        made.run(np.zeros((2, 2)), np.zeros((2, 2)), T)
    assert [x.shape for x in made.run(np.zeros(1), np.zeros(1), T)] == [(1,), (1,)]


def test_where_an_estimator_begins_and_what_moves_with_the_encoders_zero():
    for method in METHODS:
        made = ExternalForce(inertia=1.3, method=method)
        c, s = made.row(T), made.start(0.4)
        law = made.friction.law

        def run(s, zero, steps, c=c, law=law):
            return [
                external_.tick(
                    c, 0, law.row(), law.state(), s, 0, zero + Q[k], Q[k] - Q[k - 1] if k else 0.0, T, U[k], 0.0,
                    (0.0, 0.0), 20.0, 1.0,
                )[0]
                for k in steps
            ]  # fmt: skip

        first = run(made.start(Q[0]), 0.0, range(N))
        moved = made.start(Q[0])
        half = run(moved, 0.0, range(20))
        external_.shift(c, 0, moved, 0, -2.5)
        assert half + run(moved, -2.5, range(20, N)) == pytest.approx(first, rel=1e-6, abs=1e-6)
        external_.restart(c, 0, moved, 0, 5.0 + Q[0])
        assert run(moved, 5.0, range(N)) == pytest.approx(first, rel=1e-6, abs=1e-6)
        external_.restart(c, 0, s, 0, -0.7)
        assert s == pytest.approx(made.start(-0.7), abs=0.0)
        assert s[[0, 6]].tolist() == [-0.7, -0.7 if method in ("extended", "kalman") else 0.0]


# ------------------------------------------------------------------------------------------ rows anywhere


def padded(array, before, behind, value):
    return np.r_[np.full(before, value), array, np.full(behind, value)]


@pytest.mark.parametrize("value", [0.0, 2.0, -7.7])
def test_rows_and_states_may_lie_anywhere_in_a_table(value):
    """What stands before and behind them is neither read nor written."""
    rate = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0)
    adaptive = Dither(share=0.5, mode="adaptive", count=1e-4, window=0.01, growth=0.3)
    compensators = [
        alg_fc2(rate, 3e3, 0.05, dither=adaptive),
        impulsive(rate, 3e3, Pulses(height=9.0, wait=0.004, tolerance=1e-3)),
        alg_fc2(rate, 3e3, 0.05, dither=Dither(mode="reset")),
        lugre_observer(rate, LuGre(stiffness=3e3, damping=4.0), BristleObserver(gain=0.5, adaptation=2.0)),
        disturbance_observer(
            Law(rate=rate, element=Decaying(stiffness=3e3)),
            DisturbanceObserver(inertia=1.0, limit=5.0, gravity_sin=1.0, gravity_cos=2.0),
        ),
    ]
    q = np.where(np.arange(N) % 30 > 18, 0.31, Q)
    dp = np.diff(q, prepend=q[0])
    for made in compensators:
        c, s, law = made.row(T), made.start(q[0]), made.friction.law
        wide_c, wide_s = padded(c, 9, 9, value), padded(s, 8, 8, value)
        p, x, other_p, other_x = law.row(), law.state(), law.row(), law.state()
        for k in range(N):
            more = (q[k], dp[k], T, k * T, 2e-3 * copysign(1.0, k - 30), 0.01, U[k], (0.0, 0.0), 20.0, False)
            one = compensator_.tick(c, 0, p, x, s, 0, *more)
            assert compensator_.tick(wide_c, 9, other_p, other_x, wide_s, 8, *more) == one
            if k == 40:
                compensator_.shift(c, 0, s, 0, 0.2)
                compensator_.shift(wide_c, 9, wide_s, 8, 0.2)
            if k == 50:
                compensator_.relax(c, 0, x, s, 0)
                compensator_.relax(wide_c, 9, other_x, wide_s, 8)
                assert not x.any()
            if k == 55:
                compensator_.restart(c, 0, s, 0, 0.2)
                compensator_.restart(wide_c, 9, wide_s, 8, 0.2)
            assert wide_s == pytest.approx(padded(s, 8, 8, value), abs=0.0)
        if made.dither is not None:
            for stuck in (True, False):
                more = (stuck, -4.0, 5.0, 0.3, T, 0.7, False)
                c, s = made.dither.row(), np.full(5, 0.25)
                assert dither_.tick(
                    padded(c, 9, 9, value), 9, padded(s, 8, 8, value), 8, *more
                ) == dither_.tick(c, 0, s, 0, *more)
    for method in METHODS:
        for A, B in ((1.0, 2.0), (0.0, 2.0), (1.0, 0.0)):
            made = ExternalForce(
                inertia=1.3, method=method, friction=alg_fe2(rate, 3e3, 0.05), gravity_sin=A, gravity_cos=B
            )
            c, s, law = made.row(T), made.start(q[0]), made.friction.law
            wide_c, wide_s = padded(c, 9, 9, value), padded(s, 8, 8, value)
            p, x, other_p, other_x = law.row(), law.state(), law.row(), law.state()
            for k in range(N):
                more = (q[k], dp[k], T if k % 9 else 2.0 * T, U[k], 0.2, (0.0, 0.0), 20.0, 0.9)
                one = external_.tick(c, 0, p, x, s, 0, *more)
                assert external_.tick(wide_c, 9, other_p, other_x, wide_s, 8, *more) == one
                if k == 40:
                    external_.shift(c, 0, s, 0, 0.2)
                    external_.shift(wide_c, 9, wide_s, 8, 0.2)
                if k == 50:
                    external_.restart(c, 0, s, 0, 0.2)
                    external_.restart(wide_c, 9, wide_s, 8, 0.2)
                assert wide_s == pytest.approx(padded(s, 8, 8, value), abs=0.0)
    for way in ("position", "velocity", "cascade"):
        c, s = MotionFilter(way=way).row(), np.array([q[0], 0.0, 0.0, 0.0, 0.0])
        wide_c, wide_s = padded(c, 9, 9, value), padded(s, 8, 8, value)
        for k in range(N):
            assert filtered(wide_c, 9, wide_s, 8, q[k], dp[k], T) == filtered(c, 0, s, 0, q[k], dp[k], T)
    a = Admittance(inertia=2.0, viscosity=5.0, proportional=900.0, derivative=40.0, limit=30.0)
    c, s = a.row(), a.start(0.3)
    wide_c, wide_s = padded(c, 9, 9, value), padded(s, 8, 8, value)
    for k in range(N):
        assert admit(wide_c, 9, wide_s, 8, U[k], q[k], T) == admit(c, 0, s, 0, U[k], q[k], T)


def test_rows_and_states_are_as_long_as_they_are_said_to_be():
    law, a = (
        alg_fe(RATE, 1e3),
        Admittance(inertia=1.0, viscosity=1.0, proportional=1.0, derivative=1.0, limit=1.0),
    )
    axis = Axis(law=law.law, inertia=1.0)
    assert (a.row().size, a.start(0.0).size) == (admittance.ROW, admittance.STATES)
    assert (MotionFilter().row().size, 5) == (sliding_mode.ROW, sliding_mode.STATES)
    assert (Dither().row().size, 5) == (dither_.ROW, dither_.STATES)
    assert axis.at(0.0).size == axis_.STATES and servo.STATES == 3 and drives.STATES == 4
    assert friction_row.ROW == law.row().size == 8
    assert (external_.ROW, external_.STATES) == (10 + 5 + 8, 5 + 1 + 4)


def test_relaxed_a_bristle_keeps_what_it_has_learned_and_an_observer_nothing():
    rate = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05)
    for made, kept in (
        (lugre_observer(rate, LuGre(stiffness=3e3), BristleObserver(gain=0.5, adaptation=2.0)), True),
        (disturbance_observer(Law(rate=rate), DisturbanceObserver(inertia=1.0, limit=5.0)), False),
        (impulsive(rate, 3e3, Pulses(height=9.0)), False),
    ):
        begin, extra = compensator_.S_EXTRA, made.start(0.3)[compensator_.S_EXTRA :]
        assert extra.tolist() == [0.0, 1.0 if kept else 0.0, *[0.0] * (extra.size - 2)]
        s, x = np.arange(1.0, made.start(0.3).size + 1), np.ones(4)
        before = s.copy()
        compensator_.relax(made.row(T), 0, x, s, 0)
        assert x.tolist() == [0.0] * 4 and s[:begin].tolist() == before[:begin].tolist()
        assert s[begin:].tolist() == [0.0, before[begin + 1] if kept else 0.0, *[0.0] * (extra.size - 2)]


# -------------------------------------------------------------------------------------- filter, friction, level


def braked(u1, u2, x, G, H):
    """The closed form at the head of `estimate.sliding_mode`."""
    e, s = u1 - x, G * T
    w = -2.0 * G * e / (s + (s * s + 2.0 * G * abs(e)) ** 0.5)
    low, high = sorted((-H * s, u2, -s))[1], sorted((s, u2, H * s))[1]
    u2 -= sorted((low, u2 - w, high))[1]
    return u1 + T * u2, u2


@pytest.mark.parametrize("way", ["position", "velocity", "cascade"])
def test_the_filter_brakes_harder_than_it_speeds_up(way):
    made = MotionFilter(way=way, gain=30.0, ratio=1.6, second_gain=200.0, second_ratio=4.0)
    n = 900
    q = np.where(np.arange(n) % 200 < 60, 0.5, -0.1) + 2e-3 * np.arange(n) % 0.4
    v, a = made.run(q, T)
    one, two, ratios = (q[0], 0.0), (0.0, 0.0), set()
    for k in range(n):
        before = one[1]
        one = braked(*one, q[k], 30.0, 1.6)
        ratios.add(round(abs(one[1] - before) / (30.0 * T), 6))
        slope = (q[k] - q[k - 1]) / T if k else 0.0
        two = braked(*two, slope if way == "velocity" else one[1], 200.0, 4.0)
        wanted = (one[1], (one[1] - before) / T) if way == "position" else two
        assert (v[k], a[k]) == pytest.approx(wanted, rel=1e-9, abs=1e-12)
    assert {1.0, 1.6} <= ratios
    empty = made.run(np.zeros(0), T)
    assert [x.shape for x in empty] == [(0,), (0,)]


def test_what_a_friction_estimator_takes_where_nothing_is_said():
    law = alg_fe(RATE, 1e4).law
    assert FrictionEstimator(law=law, fast_decay=300.0).row()[2:].tolist() == [
        len(law.row()) - 1,
        20.0,
        300.0,
        10.0,
        0.0,
        0.0,
    ]
    assert FrictionEstimator(law=law).row()[2:5].tolist() == [0.0, 20.0, 20.0]
    plain = FrictionEstimator(law=Law(rate=RATE, element=MaxwellSlip(stiffness=(1e3,), share=(1.0,))))
    assert plain.row()[:5].tolist() == [0.0, 10.0, 0.0, 0.0, 0.0]
    assert alg_fe2(RATE, 1e4, 0.2).switch_rate == 10.0
    # the weight comes and goes by r_W T a tick, and stays within 0 and 1
    made = alg_fe2(RATE, 1e4, 0.2, 20.0, 400.0, 300.0)
    c, p, x, s = made.row(), made.law.row(), made.law.state(), np.zeros(1)
    for dp, w in (
        (3e-4, 0.3),
        (3e-4, 0.6),
        (-3e-4, 0.9),
        (3e-4, 1.0),
        (0.0, 0.7),
        (2e-4, 0.4),
        (0.0, 0.1),
        (0.0, 0.0),
    ):
        friction_tick(c, 0, p, x, s, 0, dp, T, (0.0, 0.0), 20.0)
        assert (s[0], p[-1]) == pytest.approx((w, 20.0 + w * 380.0))


def test_settings_of_an_adaptation():
    good = {"slowest": 0.02}
    for name in ("slowest", "settle", "time", "floor", "dead_zone", "lower", "upper", "start"):
        for wrong in (-0.1, nan, inf, "1", [1.0]):
            with pytest.raises(InvalidInput):
                Adaptation(**(good | {name: wrong}))
    for name in ("slowest", "settle", "time", "floor", "dead_zone"):
        for value in (1e-6, 0.5, 30.0):
            assert getattr(Adaptation(**(good | {name: value})), name) == value
    with pytest.raises(InvalidInput):
        Adaptation(slowest=0.02, floor=0.0)
    assert Adaptation(slowest=0.02, dead_zone=0.0).dead_zone == 0.0
    for name, wrong in (("lower", 1.01), ("start", 1.01), ("start", 0.49), ("upper", 0.99), ("lower", 0.0)):
        with pytest.raises(InvalidInput):
            Adaptation(**(good | {name: wrong}))
    # F is the mean of both directions: half of it, and a twentieth, unless given
    assert Adaptation(slowest=0.02).row(Law(rate=RATE)) == pytest.approx(
        (5.0, 0.02, 0.05, 3.0, 0.3, 0.5, 1.0)
    )
    none = Law(rate=Coulomb(coulomb=0.0))
    for some in ({}, {"floor": 1.0}, {"dead_zone": 0.1}):
        with pytest.raises(InvalidInput, match="no Coulomb torque"):
            Adaptation(slowest=0.02, **some).row(none)
    assert Adaptation(slowest=0.02, floor=1.0, dead_zone=0.1).row(none)[3:5] == (1.0, 0.1)


def test_joints_of_an_adaptive_friction_fail_alone():
    laws = [Law(rate=RATE), Law(rate=Coulomb(coulomb=4.0)), Law(rate=Coulomb(coulomb=4.0))]
    model = AdaptiveFriction(laws, interval=T, floor=1.0, time=0.01, lower=0.5, upper=2.0)
    zero, q = np.zeros(3), np.zeros(3)
    assert model.tick(zero, zero) == Status.OK
    q = q + 1e-3
    assert model.tick(q, np.array([8.0, nan, 12.0])) == Status.NOT_FINITE
    assert model.codes.tolist() == [Status.OK, Status.NOT_FINITE, Status.OK]
    g = 1e-3 / (0.01 + 1e-3)
    F = 7.0 + 3.0
    wanted = [1.0 + g * (8.0 - F) * F / (1.0 + F * F), 1.0, 1.0 + g * (12.0 - 4.0) * 4.0 / (1.0 + 16.0)]
    assert model.level.tolist() == pytest.approx(wanted)
    assert model.torque.tolist() == pytest.approx([wanted[0] * F, 0.0, wanted[2] * 4.0])
    for _ in range(3):
        q = q + 1e-3
        status = model.tick(q, np.array([8.0, 4.0, 80.0]))
    assert (status, model.level[2]) == (Status.SATURATED, 2.0)
    assert model.codes.tolist() == [Status.OK, Status.OK, Status.SATURATED]
    q = q + 1e-3
    assert model.tick(q, np.array([8.0, nan, 80.0])) == Status.NOT_FINITE
    assert model.tick(q, np.array([nan, 4.0, 80.0])) == Status.NOT_FINITE
    for few in (zero[:2], np.zeros(4)):
        assert model.tick(few, zero) == model.tick(zero, few) == Status.NOT_FINITE
        assert model.codes.tolist() == [Status.NOT_FINITE] * 3
    assert model.tick(q, zero, 11.0 * T) == Status.BAD_INTERVAL
    assert model.codes.tolist() == [Status.BAD_INTERVAL] * 3
    model.reset()
    assert [x.tolist() for x in (model.level, model.torque, model.codes)] == [[1.0] * 3, [0.0] * 3, [0] * 3]
    assert model.tick(q + 5.0, zero) == Status.OK
    assert model.torque.tolist() == [0.0] * 3  # the first reading is where it rests
    slow = AdaptiveFriction(laws[1], interval=T, floor=1.0, time=0.01, slowest=0.5)
    for dp, learns in ((4.99e-4, False), (5.01e-4, True), (-4.99e-4, False), (-5.01e-4, True)):
        slow.reset()
        slow.tick(np.zeros(1), np.zeros(1))
        slow.tick(np.array([dp]), np.array([copysign(9.0, dp)]))
        assert bool(slow.level[0] > 1.0) is learns
    known = AdaptiveFriction(laws[1], interval=T, floor=1.0)
    known.tick(np.zeros(1), np.zeros(1))
    known.tick(np.array([1e-3]), np.array([1e3]))
    assert known.level[0] == pytest.approx(1.0 + 1e-3 / 1.001 * 996.0 * 4.0 / 17.0)
    for k in range(40):
        known.tick(np.array([2e-3 + 1e-3 * k]), np.array([1e3]))
    assert known.level[0] == 3.0
    for k in range(90):
        known.tick(np.array([0.05 + 1e-3 * k]), np.array([-1e3]))
    assert known.level[0] == 0.3


# --------------------------------------------------------------------------------------- recursive least squares


def rls(names=("coulomb", "viscous"), **more):
    return RecursiveLeastSquares(names, **({"spread": 2.0, "noise": 0.5} | more))


def fed(made, v, tau, a=0.0, q=0.0, J=1):
    return made.tick(*[np.full(J, x) for x in (q, v, a, tau)])


def test_what_a_recursive_estimator_takes_where_nothing_is_said():
    said = rls(start=0.0, dead_zone=1e-3, forgetting=0.9995, gate=5.0, limit=inf, joints=1)
    made = rls()
    for k in range(40):
        v, tau = 0.7 * sin(k), 9.0 * cos(0.7 * k) + (60.0 if k % 9 == 8 else 0.0)
        v = 9e-4 if k % 10 == 3 else 1.1e-3 if k % 10 == 4 else v
        assert fed(made, v, tau) == fed(said, v, tau)
        assert made.estimate == pytest.approx(said.estimate, abs=0.0)
        assert made.uncertainty() == pytest.approx(said.uncertainty(), abs=0.0)


def test_a_regressor_saturates_at_its_dead_zone_and_friction_is_not_learned_within():
    for name, low, high in (
        ("coulomb", -1.0, 1.0),
        ("coulomb_positive", 0.0, 1.0),
        ("coulomb_negative", -1.0, 0.0),
    ):
        for v in (-0.3, -0.1, -0.04, 0.0, 0.04, 0.1, 0.3):
            made = rls((name,), start=2.0, dead_zone=0.1)
            assert fed(made, v, 50.0) == Status.OK
            x = min(max(v / 0.1, low), high)
            assert made.torque[0] == pytest.approx(made.estimate[0, 0] * x)
            assert bool(made.estimate[0, 0] != 2.0) is (abs(v) > 0.1 and x != 0.0)
    other = rls(("viscous",), start=2.0, dead_zone=0.1)
    fed(other, 0.05, 50.0)
    assert other.estimate[0, 0] > 2.0


def test_one_sample_of_one_parameter_by_hand():
    """h = x s/n, e = (tau - x theta)/n: theta + s h e/(1 + h^2), of an error beyond gate sqrt(1 + h^2) what the gate is."""
    s, n, gate = 3.0, 0.5, 4.0
    for x, tau in ((0.2, 1.0), (2.0, -3.0), (2.0, 500.0), (-1.5, 500.0), (0.1, -90.0)):
        made = RecursiveLeastSquares(("viscous",), spread=s, noise=n, start=0.5, gate=gate)
        fed(made, x, tau)
        h, e = x * s / n, (tau - x * 0.5) / n
        c = min(1.0, gate * (1.0 + h * h) ** 0.5 / abs(e))
        assert made.estimate[0, 0] == pytest.approx(0.5 + s * h * c * e / (1.0 + h * h))
        w = c / (1.0 + (1.0 - c) * h * h)
        assert made.uncertainty()[0, 0] == pytest.approx(s * (1.0 / (1.0 + w * h * h)) ** 0.5)


def test_what_one_parameter_was_known_by_is_forgotten_where_a_sample_stands_out_of_the_noise():
    """P <- P/m, m = 1 - (1 - lambda)(1 - P), where |h| >= 1, and P <- P/(1 + h^2 P)."""
    for size in (0.9, 0.99, *np.linspace(1.01, 9.0, 25)):
        made, h, P = rls(("viscous",), forgetting=0.8), size**0.5, 1.0
        for _ in range(4):
            fed(made, h * 0.5 / 2.0, 0.0)
            P /= 1.0 - 0.2 * (1.0 - P) if size >= 1.0 else 1.0
            P /= 1.0 + size * P
            assert made.uncertainty()[0, 0] == pytest.approx(2.0 * P**0.5)


def test_what_is_beyond_numbers_is_not_learned_and_each_joint_fails_alone():
    made = rls(joints=3, limit=[0.5, 9.0, 9.0], start=0.1)
    assert made.tick(np.zeros(3), np.full(3, 0.2), np.zeros(3), np.zeros(3)) == Status.OK
    before, spread = made.estimate.copy(), made.uncertainty()
    for wild in (1e250, -1e250, nan, inf):
        assert (
            made.tick(np.zeros(3), np.full(3, 0.2), np.zeros(3), np.array([0.1, wild, 0.1]))
            == Status.NOT_FINITE
        )
        assert made.codes.tolist() == [0, Status.NOT_FINITE, 0]
        assert made.estimate[1] == pytest.approx(before[1], abs=0.0)
        assert made.uncertainty()[1] == pytest.approx(spread[1], abs=0.0)
    for part in range(4):
        for size in (2, 4):
            rows = [np.zeros(3) for _ in range(4)]
            rows[part] = np.zeros(size)
            assert made.tick(*rows) == Status.NOT_FINITE and made.codes.tolist() == [Status.NOT_FINITE] * 3
    for speed in (1.0, -1.0):
        for _ in range(30):
            status = made.tick(np.zeros(3), np.full(3, speed), np.zeros(3), speed * np.array([6.0, 1.0, 1.0]))
        assert (status, made.codes.tolist()) == (Status.SATURATED, [Status.SATURATED, 0, 0])
        assert (made.torque[0], made.friction[0]) == (0.5 * speed, 0.5 * speed)
    status = made.tick(np.zeros(3), np.full(3, 1.0), np.zeros(3), np.array([6.0, nan, 1.0]))
    assert (status, made.codes.tolist()) == (Status.NOT_FINITE, [Status.SATURATED, Status.NOT_FINITE, 0])
    made.reset()
    assert [x.tolist() for x in (made.torque, made.friction, made.codes)] == [[0.0] * 3] * 3
    assert made.estimate.tolist() == [[0.1, 0.1]] * 3 and made.uncertainty() == pytest.approx(2.0)


def test_ranges_of_a_recursive_estimators_settings():
    for name, ends in {
        "spread": (0.0, inf), "noise": (0.0, inf), "dead_zone": (0.0, inf), "gate": (0.0, inf), "forgetting": (0.5, None),
    }.items():  # fmt: skip
        for wrong in (*ends, -1.0, nan):
            if wrong is not None:
                for value in (wrong, [0.6, wrong]) if name != "spread" else (wrong, [[0.6, wrong]] * 2):
                    with pytest.raises(InvalidInput, match=f"'{name}'"):
                        rls(**({"joints": 2, name: value}))
        assert rls(**{name: 0.501})
    assert rls(forgetting=1.0) and rls(noise=0.01) and rls(limit=0.01)
    for wrong in (1.0 + 1e-9, 2.0):
        with pytest.raises(InvalidInput, match="'forgetting'"):
            rls(forgetting=wrong)
    for wrong in ([1.0, 0.0], [1.0, -1.0], [nan, 1.0], [1.0] * 3, [[1.0, 1.0]], -0.5):
        with pytest.raises(InvalidInput, match="limit"):
            rls(joints=2, limit=wrong)
    for wrong in (0, -1, nan, 0.5):
        with pytest.raises(InvalidInput, match="joints"):
            rls(joints=wrong)
    for names in (("coulomb_positive", "coulomb_negative", "offset", "viscous"), ("viscous", "viscous"), ()):
        with pytest.raises(InvalidInput, match="regressors"):
            rls(names)
    for names in (
        ("coulomb_positive", "coulomb_negative"),
        ("coulomb", "offset"),
        ("coulomb_positive", "offset"),
    ):
        assert rls(names).names == names
    assert rls(start=[-3.0, 4.0], joints=2).estimate.tolist() == [[-3.0, 4.0]] * 2
