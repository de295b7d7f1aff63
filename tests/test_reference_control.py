"""Compensators and estimators against their printed equations, tick by tick in plain Python and numpy.

Without the compiler: each kernel would be compiled once more for being called alone. That compiled and plain code give the
same numbers is told elsewhere (test_loop.py, test_compensate.py).
"""

from math import copysign, cos, exp, inf, nan, pi, sin, sqrt

import numba as nb
import numpy as np
import pytest

from backdrive.control import Admittance, JointLoop, Loop
from backdrive.control.admittance import tick as admit
from backdrive.control.compensators import (
    Dither,
    alg_fc,
    alg_fc2,
    aung,
    by_law,
    disturbance_observer,
    impulsive,
    lugre_observer,
    mahvash_okamura,
)
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.compensators import dither as dither_
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators import Adaptation, AdaptiveFriction, RecursiveLeastSquares
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, alg_fe2, between_counts, ct, ha
from backdrive.control.estimators.friction import tick as friction_tick
from backdrive.control.estimators.level import adapt, learn
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.errors import InvalidInput
from backdrive.laws import Coulomb, CoulombViscous, Decaying, Law, LuGre, Sigmoid, StribeckGauss
from backdrive.status import Status

pytestmark = pytest.mark.skipif(
    not nb.config.DISABLE_JIT, reason="runs with NUMBA_DISABLE_JIT=1, as .ci/run does"
)
T = 1e-3
RATE = CoulombViscous(coulomb_positive=7.0, coulomb_negative=5.0, viscous_positive=3.0, viscous_negative=2.0)


def curve(v):
    """The friction of RATE in motion."""
    return 7.0 + 3.0 * v if v > 0.0 else -5.0 + 2.0 * v if v < 0.0 else 0.0


def clip(x, lo, hi):
    return min(max(x, lo), hi)


def leaky(x, K, alpha, dp, dt):
    """Iwatani 2017, (3.12)-(3.21): torque of the decaying contact x under RATE, and the friction with the slider's viscosity."""
    f = clip((x + K * dp) / (1.0 + alpha * dt), -5.0, 7.0)
    v = (dp - (f - x) / K) / dt
    return f, f + (3.0 * v if v > 0.0 else 2.0 * v)


def wander(n, seed=0, step=2e-4):
    """Increments with strokes, reversals and rests, (n,)."""
    generator = np.random.default_rng(seed)
    k = np.arange(n)
    dp = step * np.sin(k / 9.0) * np.exp(generator.normal(0.0, 0.5, n))
    return np.where((k % 50 > 40) | (k < 2), 0.0, dp)


# ------------------------------------------------------------------------------------ the level, learned


def by_definition(theta, f, tau, dt, time, floor, d, lower, upper):
    """theta <- P(theta + g f e_d/(f_0^2 + f^2)), e_d = e - clip(e, -d, d), g = dt/(T + dt), where |f| >= f_0."""
    e = tau - theta * f
    e_d = e - clip(e, -d, d)
    g = dt / (time + dt)
    return theta if abs(f) < floor else clip(theta + g * f * e_d / (floor**2 + f**2), lower, upper)


def test_the_level_is_the_projected_gradient_with_a_dead_zone():
    settings = (T, 0.05, 3.0, 0.4, 0.5, 1.1)
    for theta in (0.5, 0.8, 1.1):
        for f in (-9.0, -3.0, -2.99, 0.0, 2.9, 3.0, 7.0):
            for e in (-300.0, -2.0, -0.41, -0.4, -0.1, 0.0, 0.3, 0.4, 0.42, 1.0, 400.0):
                wanted = by_definition(theta, f, theta * f + e, *settings)
                assert adapt(theta, f, theta * f + e, *settings) == pytest.approx(wanted, rel=1e-12)
    # d is taken off the error: from 1.0 N.m only 0.6 is learned
    assert adapt(1.0, 4.0, 5.0, T, T, 4.0, 0.4, 0.0, 9.0) == pytest.approx(1.0 + 0.5 * 4.0 * 0.6 / 32.0)


def test_in_the_loop_it_is_learned_after_sliding_and_from_what_a_level_explains():
    settle, rest = 0.05, (3.0, 0.4, 0.5, 1.1)
    for slid in (0.0, 0.049, 0.05, 0.2, nan):
        for f in (-8.0, 2.0, 5.0):
            for force in (-9.0, -5.2001, -5.2, -3.4, -1.0, 0.0, 0.5, 3.4, 3.4001, 1e9, nan):
                explained = abs(force) <= (1.1 - 0.5) * abs(f) + 0.4
                wanted = (
                    by_definition(0.9, f, 0.9 * f - force, T, 0.3, *rest)
                    if slid >= settle and explained
                    else 0.9
                )
                got = learn(0.9, f, force, slid, T, 0.3, settle, *rest)
                assert got == pytest.approx(wanted, rel=1e-12)


def test_what_an_adaptation_takes_from_the_law():
    flat = Law(rate=Coulomb(coulomb=8.0))
    given = Adaptation(slowest=0.02, settle=0.03, time=4.0, lower=0.4, upper=1.2, start=0.7)
    assert given.row(flat) == pytest.approx((4.0, 0.02, 0.03, 4.0, 0.4, 0.4, 1.2))  # F/2 and F/20
    own = Adaptation(slowest=0.02, floor=1.5, dead_zone=0.25)
    assert own.row(Law(rate=Sigmoid(span=2.0, steepness=9.0)))[3:5] == (1.5, 0.25)
    with pytest.raises(InvalidInput):
        Adaptation(slowest=0.02, floor=1.5).row(Law(rate=Sigmoid(span=2.0, steepness=9.0)))
    edges = {"slowest": inf, "settle": inf, "time": inf, "floor": inf, "dead_zone": inf, "upper": inf}
    for name, value in edges.items():
        with pytest.raises(InvalidInput):
            Adaptation(**({"slowest": 0.02} | {name: value}))
    for zero in ("slowest", "settle", "time", "floor", "lower"):
        with pytest.raises(InvalidInput):
            Adaptation(**({"slowest": 0.02} | {zero: 0.0}))
    same = Adaptation(slowest=0.02, lower=1.0, upper=1.0, start=1.0, dead_zone=0.0)
    assert (same.lower, same.upper, same.row(flat)[4]) == (1.0, 1.0, 0.0)


def test_adaptive_friction_tick_by_tick():
    K, alpha, time, floor, d, slowest = 4e4, 30.0, 0.02, 2.0, 0.3, 0.05
    model = AdaptiveFriction(
        alg_fe(RATE, K, alpha).law,
        interval=T,
        time=time,
        floor=floor,
        dead_zone=d,
        slowest=slowest,
        lower=0.6,
        upper=1.2,
    )
    assert model.tick(np.zeros(1), np.zeros(1)) == Status.OK
    q, x, level, since = 0.0, 0.0, 1.0, 0.0
    for k, dp in enumerate(wander(300).tolist()):
        q += dp
        tau, dt = 0.8 * curve(dp), T if k % 7 else 3.0 * T
        bad = k % 23 == 5
        since += dt
        status = model.tick(np.array([q]), np.array([nan if bad else tau]), dt)
        if bad:
            assert status == Status.NOT_FINITE
            continue
        gone = dp + (wander(300)[k - 1] if k % 23 == 6 else 0.0)
        x, f = leaky(x, K, alpha, gone, since)
        if abs(gone) >= slowest * since:
            level = by_definition(level, f, tau, since, time, floor, d, 0.6, 1.2)
        since = 0.0
        assert (model.level[0], model.torque[0]) == pytest.approx((level, level * f), rel=1e-9, abs=1e-12)
        assert status == (Status.SATURATED if level in (0.6, 1.2) else Status.OK)
    assert model.level[0] < 0.9
    before = model.torque[0], model.level[0]
    for dt in (T / 10.1, T * 10.1, -T, nan):
        assert model.tick(np.array([q]), np.zeros(1), dt) == Status.BAD_INTERVAL
        assert (model.torque[0], model.level[0]) == before
    assert model.tick(np.array([q]), np.zeros(1), 10.0 * T) == Status.OK
    model.reset()
    assert (model.level[0], model.torque[0], model.codes[0]) == (1.0, 0.0, 0)


def test_settings_of_adaptive_friction_joint_by_joint():
    laws = [alg_fe(RATE, 1e4).law, alg_fe(RATE, 2e4).law]
    good = {"interval": T, "floor": [1.0, 2.0], "dead_zone": [0.0, 0.1], "lower": 0.5, "upper": 1.5}
    assert AdaptiveFriction(laws, **good).level.tolist() == [1.0, 1.0]
    for name, values in {
        "floor": ([1.0, 0.0], [1.0, inf], [1.0] * 3), "dead_zone": ([0.1, -0.1], [0.1, inf], [0.1] * 3), "interval": (0.0, inf),
        "time": (0.0, inf), "lower": (-0.1, 1.5), "upper": (inf,), "start": (0.49, 1.51), "slowest": (-1.0, inf),
    }.items():  # fmt: skip
        for value in values:
            with pytest.raises(InvalidInput, match=name):
                AdaptiveFriction(laws, **(good | {name: value}))
    with pytest.raises(InvalidInput, match="no law"):
        AdaptiveFriction([], **good)
    assert AdaptiveFriction(laws, **(good | {"lower": 0.0, "start": 1.5})).level.tolist() == [1.5, 1.5]


# --------------------------------------------------------------------------------------- friction estimators


def test_the_decay_rate_goes_up_in_motion_and_down_at_rest():
    """Iwatani 2017, (4.20) corrected: w and alpha from V_W on, then (3.12)-(3.21)."""
    K, V_W, slow, fast, r = 3e4, 0.05, 20.0, 400.0, 60.0
    estimator = alg_fe2(RATE, K, V_W, slow, fast, r)
    c, p, x, s = estimator.row(), estimator.law.row(), estimator.law.state(), np.zeros(1)
    w, f = 0.0, 0.0
    for dp in [*wander(300, 1).tolist(), *[V_W * T] * 3, *[1.001 * V_W * T] * 30]:
        w = min(w + r * T, 1.0) if abs(dp) > V_W * T else max(w - r * T, 0.0)
        f, expected = leaky(f, K, (1.0 - w) * slow + w * fast, dp, T)
        got = friction_tick(c, 0, p, x, s, 0, dp, T, (0.0, 0.0), 20.0)
        assert (got, s[0]) == pytest.approx((expected, w), rel=1e-9, abs=1e-12)
    assert between_counts(0.01, 0.0, T) == 0.01
    assert between_counts(0.01, 5e-6, T) == pytest.approx(2.5 * 5e-6 / T)  # falls on the second count
    assert between_counts(0.0124, 5e-6, T) == pytest.approx(2.5 * 5e-6 / T)


def test_settings_of_friction_estimators():
    law = alg_fe(RATE, 1e4, 17.0).law
    assert (law.element.stiffness, law.element.decay_rate) == (1e4, 17.0)
    assert ct(RATE, 0.3).law.element.threshold == 0.3
    assert ha(RATE, 2e4).law.element.stiffness == 2e4
    two = alg_fe2(RATE, 1e4, 0.2)
    assert (two.law.element.decay_rate, two.fast_decay, two.switch_rate, two.threshold) == (
        20.0,
        500.0,
        10.0,
        0.2,
    )
    assert FrictionEstimator(law=law, fast_decay=0.0, threshold=0.0).fast_decay == 0.0
    for wrong in ({"fast_decay": -1.0}, {"fast_decay": inf}, {"switch_rate": 0.0}, {"switch_rate": inf}, {"threshold": -1.0},
                  {"threshold": inf}):  # fmt: skip
        with pytest.raises(InvalidInput):
            FrictionEstimator(**({"law": law, "fast_decay": 1.0} | wrong))
    with pytest.raises(InvalidInput, match="no decay rate"):
        FrictionEstimator(law=Law(rate=RATE), fast_decay=1.0)


# ------------------------------------------------------------------------------------------ sliding mode


def jin(u1, u2, x, G, H):
    """The set-valued backward Euler step, solved for u2 by bisection: sigma of the step's end decides its sign.

    u2+ - u2 in T (-(H + 1) G/2 sgn(sigma+) - (H - 1) G/2 sgn(u2+)), sigma = 2 G (u1 - x) + |u2| u2.
    """

    def excess(y):
        sigma = 2.0 * G * (u1 + T * y - x) + abs(y) * y
        push = (H + 1.0) / 2.0 * copysign(1.0, sigma) + (H - 1.0) / 2.0 * copysign(1.0, y)
        return y - u2 + T * G * push

    low, high = u2 - 2.0 * H * G * T - 1.0, u2 + 2.0 * H * G * T + 1.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)
    return u1 + T * high, high


@pytest.mark.parametrize("way", ["position", "velocity", "cascade"])
def test_the_filter_is_the_set_valued_backward_euler_step(way):
    f = MotionFilter(way=way, gain=40.0, ratio=2.5, second_gain=600.0, second_ratio=3.0)
    q = np.cumsum(wander(260, 2))
    v, a = f.run(q, T)
    first, second = (q[0], 0.0), (0.0, 0.0)
    for k in range(q.size):
        before = first[1]
        first = jin(*first, q[k], 40.0, 2.5)
        slope = (q[k] - q[k - 1]) / T if k else 0.0
        second = jin(*second, slope if way == "velocity" else first[1], 600.0, 3.0)
        wanted = (first[1], (first[1] - before) / T) if way == "position" else second
        assert (v[k], a[k]) == pytest.approx(wanted, rel=1e-6, abs=1e-8)


def test_settings_of_the_filter():
    assert MotionFilter.literal().row().tolist() == [0.0, 10.0, 2.0, 300.0, 2.0]
    assert MotionFilter().row().tolist() == [2.0, 100.0, 2.0, 300.0, 2.0]
    for wrong in ({"ratio": 1.0}, {"second_ratio": 1.0}, {"gain": 0.0}, {"second_gain": 0.0}, {"gain": inf}, {"ratio": inf},
                  {"way": "both"}):  # fmt: skip
        with pytest.raises(InvalidInput):
            MotionFilter(**wrong)


# --------------------------------------------------------------------------------------------- external force


def test_every_observer_is_its_equation_tick_by_tick():
    M, L, A, B, K, alpha = 1.7, 60.0, 4.0, -2.0, 3e4, 25.0
    n = 250
    generator = np.random.default_rng(5)
    q = 0.4 + np.cumsum(wander(n, 3))
    u, known = generator.normal(0.0, 4.0, n), generator.normal(0.0, 1.0, n)
    common = {
        "inertia": M, "bandwidth": L, "gravity_sin": A, "gravity_cos": B, "friction": alg_fe(RATE, K, alpha),
        "filter": MotionFilter(way="position", gain=40.0, ratio=2.5), "encoder_count": 1e-5, "force_rate": 30.0,
    }  # fmt: skip
    b = exp(-ExternalForce(method="extended", **common).row(T)[4] * T)
    gains = (1.0 - b**3, 1.5 * (1.0 - b) ** 2 * (1.0 + b), (1.0 - b) ** 3)
    found = {
        m: ExternalForce(method=m, **common).run(q, u, T, known)
        for m in ("direct", "momentum", "disturbance", "extended")
    }
    x, S, d_y, v_y, f = 0.0, 0.0, 0.0, 0.0, (q[0], 0.0)
    z = np.array([q[0], 0.0, 0.0])
    step = np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    for k in range(n):
        dp = q[k] - q[k - 1] if k else 0.0
        x, tau_f = leaky(x, K, alpha, dp, T)
        acted = u[k - 1] if k else known[0]  # what acted at the start is what holds the joint
        free = acted - known[k] - A * sin(q[k]) - B * cos(q[k]) - tau_f
        before, f = f[1], jin(*f, q[k], 40.0, 2.5)
        wanted = {"direct": M * (f[1] - before) / T - free}
        r = L * (M * dp / T - S - T * free) / (1.0 + L * T)
        S += T * (free + r)
        wanted["momentum"] = r
        a, v_y = (dp / T - v_y) / T, dp / T
        d_y = (d_y + L * T * (M * a - free)) / (1.0 + L * T)
        wanted["disturbance"] = d_y
        z = step @ z + free / M * np.array([0.5 * T * T, T, 0.0])
        z = z + (q[k] - z[0]) * np.array([gains[0], gains[1] / T, gains[2] / T**2])
        wanted["extended"] = M * z[2]
        for method, value in wanted.items():
            assert found[method][0][k] == pytest.approx(value, rel=1e-6, abs=1e-6), method
            assert found[method][1][k] == pytest.approx(tau_f, rel=1e-9, abs=1e-9)


def test_settings_of_the_estimator():
    good = {"inertia": 1.0}
    for name in ("inertia", "bandwidth", "force_rate", "encoder_count"):
        for wrong in (0.0, -1.0, inf, nan):
            with pytest.raises(InvalidInput):
                ExternalForce(**(good | {name: wrong}))
    for wrong in ({"method": "guess"}, {"gravity_sin": nan}, {"gravity_cos": inf}):
        with pytest.raises(InvalidInput):
            ExternalForce(**(good | wrong))
    with pytest.raises(InvalidInput, match="one length"):
        ExternalForce(**good).run(np.zeros(3), np.zeros(4), T)


# ------------------------------------------------------------------------------------- recursive least squares


def test_recursive_least_squares_is_its_matrix_form():
    names, spread, noise, lam, gate, v_0 = (
        ("coulomb", "viscous", "inertia", "offset"),
        [4.0, 2.0, 1.0, 3.0],
        0.3,
        0.98,
        3.0,
        0.05,
    )
    rls = RecursiveLeastSquares(
        names,
        spread=np.array(spread),
        noise=noise,
        forgetting=lam,
        gate=gate,
        dead_zone=v_0,
        start=0.5,
        limit=9.0,
    )
    n, generator = 4, np.random.default_rng(8)
    theta, P = np.full(n, 0.5), np.eye(n)
    for k in range(200):
        v, a = 0.8 * sin(k / 7.0), 3.0 * cos(k / 5.0)
        v = v_0 if k == 20 else v
        phi = np.array([clip(v / v_0, -1.0, 1.0), v, a, 1.0])
        tau = phi @ [5.0, 1.0, 0.5, -2.0] + generator.normal(0.0, 0.3) + (50.0 if k % 31 == 30 else 0.0)
        status = rls.tick(np.zeros(1), np.array([v]), np.array([a]), np.array([tau]))
        if abs(v) > v_0:
            h = phi * spread / noise
            e, z = (tau - phi @ theta) / noise, h @ P @ h
            if h @ h >= 1.0 and np.trace(P) < n:
                m = 1.0 - (1.0 - lam) * (1.0 - np.trace(P) / n)
                P = P + (1.0 - m) / m * np.outer(P @ h, P @ h) / z
                z = h @ P @ h
            c = min(1.0, gate * sqrt(1.0 + z) / abs(e))
            w = c / (1.0 + (1.0 - c) * z)
            theta = theta + np.array(spread) * (w * P @ h * e / (1.0 + w * z))
            P = P - w * np.outer(P @ h, P @ h) / (1.0 + w * z)
        assert rls.estimate[0] == pytest.approx(theta, rel=1e-7, abs=1e-9)
        assert rls.uncertainty()[0] == pytest.approx(np.sqrt(np.diag(P)) * spread, rel=1e-6)
        total, rubbing = phi @ theta, phi[:2] @ theta[:2]
        assert rls.torque[0] == pytest.approx(clip(total, -9.0, 9.0), rel=1e-7)
        assert rls.friction[0] == pytest.approx(clip(rubbing, -9.0, 9.0), rel=1e-7)
        assert status == (Status.SATURATED if max(abs(total), abs(rubbing)) > 9.0 else Status.OK)
    rls.reset()
    assert rls.estimate[0].tolist() == [0.5] * n and rls.uncertainty()[0] == pytest.approx(spread)


@pytest.mark.parametrize(
    ("name", "value"),
    [("coulomb", -1.0), ("coulomb_positive", 0.0), ("coulomb_negative", -1.0), ("viscous", -0.7), ("inertia", 1.9),
     ("gravity_sin", sin(0.4)), ("gravity_cos", cos(0.4)), ("offset", 1.0)],
)  # fmt: skip
def test_a_single_regressor_learns_its_factor(name, value):
    rls = RecursiveLeastSquares((name,), spread=1e3, noise=1e-3)
    row = [np.array([x]) for x in (0.4, -0.7, 1.9, 3.0 * value)]
    assert rls.tick(*row) == Status.OK
    assert rls.estimate[0, 0] == pytest.approx(3.0 if value else 0.0, rel=1e-6)
    back = [np.array([x]) for x in (0.4, 0.7, 1.9, 0.0)]
    friction = {"coulomb": 3.0, "coulomb_positive": 3.0, "viscous": 2.1}.get(name, 0.0)
    rls.tick(*[np.array([nan])] * 4)
    assert rls.torque[0] == pytest.approx(3.0 * value, rel=1e-6)
    assert rls.codes[0] == Status.NOT_FINITE
    still = RecursiveLeastSquares((name,), spread=1e-9, noise=1.0, start=3.0)
    still.tick(*back)
    assert still.friction[0] == pytest.approx(friction, rel=1e-6)


def test_settings_of_recursive_least_squares():
    good = {"spread": 1.0, "noise": 1.0}
    for wrong in ({"spread": 0.0}, {"noise": 0.0}, {"dead_zone": 0.0}, {"forgetting": 0.5}, {"forgetting": 1.1}, {"gate": 0.0},
                  {"limit": 0.0}, {"limit": nan}, {"joints": 0}, {"noise": inf}, {"start": inf}, {"spread": [1.0, 1.0]},
                  {"limit": [1.0, 1.0]}):  # fmt: skip
        with pytest.raises(InvalidInput):
            RecursiveLeastSquares(("coulomb",), **(good | wrong))
    assert RecursiveLeastSquares(("coulomb",), **good, forgetting=1.0, limit=inf).codes.tolist() == [0]
    for names in ((), ("coulomb", "coulomb"), ("coulomb", "coulomb_positive"), ("coulomb", "coulomb_negative"),
                  ("coulomb_positive", "coulomb_negative", "offset")):  # fmt: skip
        with pytest.raises(InvalidInput):
            RecursiveLeastSquares(names, **good)


# ------------------------------------------------------------------------------------------- compensators


def ticks(compensator, dp, *, dt=T, error=None, slope=None, applied=None, position=0.0):
    """Torque of a compensator along increments, (n,); the clock stands at k dt in tick k."""
    c, p, x, s = (
        compensator.row(dt),
        compensator.friction.law.row(),
        compensator.friction.law.state(),
        compensator.start(position),
    )
    zero, q, out = np.zeros(len(dp)), position, []
    error, slope, applied = (zero if a is None else a for a in (error, slope, applied))
    for k, step in enumerate(dp):
        q += step
        out.append(
            sum(
                compensator_.tick(
                    c,
                    0,
                    p,
                    x,
                    s,
                    0,
                    q,
                    step,
                    dt,
                    k * dt,
                    error[k],
                    slope[k],
                    applied[k],
                    (0.0, 0.0),
                    20.0,
                    False,
                )
            )
        )
    return np.array(out), s


def test_a_compensator_gives_its_share_of_the_contact_and_dithers_where_that_is_stuck():
    """Iwatani 2017, (3.27): R tau_f, and R_d ((F_p + F_n)/2 sin(Omega t) + (F_p - F_n)/2) while |K (p - q)| is inside."""
    K, alpha, R, R_d, hertz = 3e4, 25.0, 0.9, 0.4, 15.0
    dp = wander(300, 4)
    plain, _ = ticks(alg_fc(RATE, K, alpha, share=R), dp)
    fixed, _ = ticks(alg_fc(RATE, K, alpha, Dither(share=R_d, frequency=hertz), R), dp)
    again, _ = ticks(alg_fc(RATE, K, alpha, Dither(share=R_d, frequency=hertz, mode="reset"), R), dp)
    x, since = 0.0, 0.0
    for k, step in enumerate(dp.tolist()):
        x, f = leaky(x, K, alpha, step, T)
        stuck = -5.0 < x < 7.0

        def sine(t):
            return R_d * (6.0 * sin(2.0 * pi * hertz * t) + 1.0)

        assert plain[k] == pytest.approx(R * f, rel=1e-9, abs=1e-12)
        assert fixed[k] == pytest.approx(R * f + (sine(k * T) if stuck else 0.0), rel=1e-7, abs=1e-9)
        assert again[k] == pytest.approx(R * f + (sine(since) if stuck else 0.0), rel=1e-7, abs=1e-9)
        since = since + T if stuck else 0.0
    two, _ = ticks(alg_fc2(RATE, K, 0.05, alpha, 400.0, 60.0, share=R), dp)
    w, x = 0.0, 0.0
    for k, step in enumerate(dp.tolist()):
        w = min(w + 60.0 * T, 1.0) if abs(step) > 0.05 * T else max(w - 60.0 * T, 0.0)
        x, f = leaky(x, K, (1.0 - w) * alpha + w * 400.0, step, T)
        assert two[k] == pytest.approx(R * f, rel=1e-9, abs=1e-12)


def test_a_bristle_counts_as_sliding_from_98_percent_of_its_bound():
    """Dahl's bristle never reaches F: it dithers below 0.98 F."""
    law = Law(rate=Coulomb(coulomb=5.0), element=LuGre(stiffness=1e4))
    dp = np.full(120, 2e-5)
    with_, _ = ticks(by_law(law, share=1.0, dither=Dither(share=0.5, frequency=10.0)), dp)
    f = 0.0
    seen = set()
    for k, step in enumerate(dp):
        f = (f + 1e4 * step) / (1.0 + 1e4 * step / 5.0)
        expected = f + (0.5 * 5.0 * sin(2.0 * pi * 10.0 * k * T) if f < 0.98 * 5.0 else 0.0)
        seen.add(f < 0.98 * 5.0)
        assert with_[k] == pytest.approx(expected, abs=1e-9)
    assert seen == {True, False}


def test_the_dither_is_held_to_a_few_counts():
    """Its share grows by g after a window without a count, and falls by 2 g after one with more than `counts`."""
    d = Dither(share=0.5, mode="adaptive", count=1e-4, counts=2.0, window=0.01, growth=0.3)
    c, s = d.row(), np.zeros(5)
    share, q = 0.0, 0.0
    s[3:] = q
    for moved, change in ((0.0, 0.3), (0.4e-4, 0.3), (0.6e-4, 0.0), (2.4e-4, 0.0), (0.0, 0.3), (0.0, 0.1), (-2.6e-4, -0.6),
                          (5e-4, -0.4), (0.0, 0.3)):  # fmt: skip
        for k in range(10):
            wobble = q + moved * (1.0 if k in (4, 5) else 0.0)
            dither_.adapt(c, 0, s, 0, wobble, 0.00100001)
        share += change
        assert s[1] == pytest.approx(share, abs=1e-12)
    got = dither_.tick(c, 0, s, 0, True, -3.0, 5.0, 0.0, 1e-4, 0.01, False)
    assert got == pytest.approx(share * 0.5 * (4.0 * sin(2.0 * pi * 15.0 * 0.01) + 1.0))
    assert dither_.tick(c, 0, s, 0, False, -3.0, 5.0, 0.0, 1e-4, 0.01, False) == 0.0


def test_pulses_come_after_a_wait_off_the_reference_and_last_their_width():
    pulses = Pulses(height=20.0, width=0.004, wait=0.01, tolerance=1e-3)
    n = 60
    dp = np.zeros(n)
    dp[30] = 1e-6
    error = np.where(np.arange(n) < 40, 2e-3, -2e-3)
    error[45:] = 1e-3
    got, _ = ticks(impulsive(Coulomb(coulomb=1e-9), 1.0, pulses), dp, error=error)
    stuck, left, way, expected = 0, 0, 0.0, []
    for k in range(n):  # in ticks: 10 stuck ones, then 4 of pulse
        if left > 0:
            left, stuck = left - 1, 0
        else:
            stuck = stuck + 1 if dp[k] == 0.0 else 0
            if stuck >= 10 and abs(error[k]) > 1e-3:
                left, way, stuck = 3, copysign(1.0, error[k]), 0
                expected.append(20.0 * way)
                continue
            expected.append(0.0)
            continue
        expected.append(20.0 * way)
    assert got == pytest.approx(np.array(expected), abs=1e-6)
    assert {20.0, -20.0, 0.0} == set(expected)


def test_the_lugre_observer_is_its_equation():
    s_0, s_1, v_d, k_, corner, gamma, R = 2e4, 30.0, 0.1, 0.5, 15.0, 2.0, 0.9
    rate = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.5)
    observer = BristleObserver(gain=k_, corner=corner, adaptation=gamma, lowest=0.8, highest=1.15)
    n = 250
    dp, t = wander(n, 6), T * np.arange(n)
    error, slope = 2e-3 * np.sin(9.0 * t), 1.8e-2 * np.cos(9.0 * t)
    made = lugre_observer(rate, LuGre(stiffness=s_0, damping=s_1, fading=v_d), observer, R)
    got, _ = ticks(made, dp, error=error, slope=slope)
    f, theta = 0.0, 1.0
    for k, step in enumerate(dp.tolist()):
        v = step / T
        s = 4.0 + 2.0 * exp(-((v / 0.05) ** 2))
        e_f = slope[k] + corner * error[k]
        before, f = f, (f + s_0 * (step + T * k_ * e_f)) / (1.0 + s_0 * abs(step) / s)
        f = clip(f, min(-s, before), max(s, before))
        b = f + s_1 * exp(-((v / v_d) ** 2)) * (f - before) / (s_0 * T)
        theta = clip(theta + T * gamma * e_f * b, 0.8, 1.15)
        assert got[k] == pytest.approx(R * (theta * b + 1.5 * v), rel=1e-7, abs=1e-9)


def test_the_disturbance_observer_cancels_what_the_model_misses_up_to_its_limit():
    K, alpha, M, L, R, limit = 3e4, 25.0, 1.2, 30.0, 0.8, 2.0
    n = 200
    dp = wander(n, 7)
    applied = np.random.default_rng(1).normal(0.0, 3.0, n)
    law = Law(rate=RATE, element=Decaying(stiffness=K, decay_rate=alpha))
    observer = DisturbanceObserver(inertia=M, bandwidth=L, limit=limit, gravity_sin=2.0, gravity_cos=1.0)
    got, _ = ticks(disturbance_observer(law, observer, R), dp, applied=applied, position=0.3)
    q, x, v, y, seen = 0.3, 0.0, 0.0, 0.0, set()
    for k, step in enumerate(dp.tolist()):
        q += step
        x, f = leaky(x, K, alpha, step, T)
        n_ = applied[k] - f - 2.0 * sin(q) - cos(q)
        y = (y + L * T * (M * (step / T - v) / T - n_)) / (1.0 + L * T)
        v = step / T
        seen.add(abs(y) > limit)
        assert got[k] == pytest.approx(R * f - clip(y, -limit, limit), rel=1e-7, abs=1e-9)
    assert seen == {True, False}


def every_compensator():
    rate = StribeckGauss(
        coulomb=0.4, breakaway=0.6, stribeck_velocity=0.05, viscous=1.5
    )  # bounds below 1 N.m
    adaptive = Dither(share=0.5, mode="adaptive", count=1e-4, window=0.01, growth=0.3)
    return {
        "contact": alg_fc2(rate, 3e3, 0.05, share=0.9, dither=adaptive),
        "reset": alg_fc(rate, 3e3, dither=Dither(mode="reset"), share=0.9),
        "pulses": impulsive(rate, 3e3, Pulses(height=9.0), share=0.9),
        "lugre": lugre_observer(rate, LuGre(stiffness=3e3), BristleObserver(gain=0.5, adaptation=2.0), 0.9),
        "observer": disturbance_observer(
            Law(rate=rate, element=Decaying(stiffness=3e3)),
            DisturbanceObserver(inertia=1.0, limit=5.0, gravity_sin=1.0),
            0.9,
        ),
    }


@pytest.mark.parametrize("name", every_compensator())
def test_restarted_a_compensator_is_as_at_the_start_and_shifted_it_counts_from_another_zero(name):
    made = every_compensator()[name]
    dp, error = wander(160, 9), 2e-3 * np.cos(np.arange(160) / 20.0)
    c, zero = made.row(T), np.zeros(160)

    def run(s, p, x, q, steps, begin=0):
        out = []
        for k, step in enumerate(steps, begin):
            q += step
            out.append(
                sum(
                    compensator_.tick(
                        c, 0, p, x, s, 0, q, step, T, k * T, error[k], zero[k], 0.3, (0.0, 0.0), 20.0, False
                    )
                )
            )
        return np.array(out), q

    p, x, s = made.friction.law.row(), made.friction.law.state(), made.start(0.25)
    first, _ = run(s, p, x, 0.25, dp)
    if name != "observer":  # whose gravity is that of the position
        other_p, other_x, other = made.friction.law.row(), made.friction.law.state(), made.start(-1.5)
        moved, _ = run(other, other_p, other_x, -1.5, dp)
        assert moved == pytest.approx(first, rel=1e-9, abs=1e-12)
        half_p, half_x, half = made.friction.law.row(), made.friction.law.state(), made.start(0.25)
        begin, at = run(half, half_p, half_x, 0.25, dp[:77])
        compensator_.shift(c, 0, half, 0, 3.0)
        rest, _ = run(half, half_p, half_x, at + 3.0, dp[77:], 77)
        assert np.r_[begin, rest] == pytest.approx(first, rel=1e-7, abs=1e-9)
    compensator_.restart(c, 0, s, 0, 0.25)
    assert s == pytest.approx(made.start(0.25))
    again, _ = run(s, made.friction.law.row(), made.friction.law.state(), 0.25, dp)
    assert again == pytest.approx(first, rel=1e-12)


def test_dither_and_pulses_add_up_and_leave_one_another_alone():
    adaptive = Dither(share=0.5, mode="adaptive", count=1e-4, counts=1.0, window=0.008, growth=0.3)
    pulses = Pulses(height=9.0, width=0.003, wait=0.004)
    dp = np.where(np.arange(200) % 50 < 25, 0.0, 3e-5)
    error = np.full(200, 1e-3)
    plain = alg_fc(RATE, 3e3, share=0.9)
    parts = [
        ticks(plain.replace(**more), dp, error=error)[0]
        for more in ({}, {"dither": adaptive}, {"extra": pulses}, {"dither": adaptive, "extra": pulses})
    ]
    assert np.ptp(parts[1] - parts[0]) > 1.0 and np.ptp(parts[2] - parts[0]) == pytest.approx(9.0)
    assert parts[3] == pytest.approx(parts[1] + parts[2] - parts[0], abs=1e-12)


def test_a_bristle_follows_a_bound_of_any_size():
    rate = StribeckGauss(coulomb=0.4, breakaway=0.6, stribeck_velocity=0.05)
    made = lugre_observer(rate, LuGre(stiffness=3e3), BristleObserver(), 1.0)
    dp, f = wander(150, 10), 0.0
    got, _ = ticks(made, dp)
    for k, step in enumerate(dp.tolist()):
        s = 0.4 + 0.2 * exp(-((step / T / 0.05) ** 2))
        before, f = f, (f + 3e3 * step) / (1.0 + 3e3 * abs(step) / s)
        f = clip(f, min(-s, before), max(s, before))
        assert got[k] == pytest.approx(f, rel=1e-9, abs=1e-12)


def test_what_is_taken_where_nothing_is_said():
    """Iwatani 2017, 3.5.1 and 4.6: alpha 20/s, 500/s in motion, R_d = 0.3 at 15 Hz; G = 100, 300, H = 2; L = 100/s."""
    assert alg_fc(RATE, 1.0, share=0.9).friction.law.element.decay_rate == 20.0
    two = alg_fc2(RATE, 1.0, 0.1, share=0.9).friction
    assert (two.law.element.decay_rate, two.fast_decay, two.switch_rate) == (20.0, 500.0, 10.0)
    assert Dither().row() == pytest.approx([0.0, 0.3, 30.0 * pi, 1e-6, 2.0, 0.07, 0.1])
    assert Pulses(height=2.0).row(T, alg_fe(RATE, 1.0))[:5] == pytest.approx([1.0, 2.0, 0.003, 0.03, 0.0])
    assert BristleObserver().row(T, alg_fe(RATE, 1.0))[:7] == pytest.approx(
        [2.0, 0.0, 20.0, 0.0, 0.5, 1.5, 0.0]
    )
    assert DisturbanceObserver(inertia=2.0, limit=3.0).row(T, alg_fe(RATE, 1.0))[:7] == pytest.approx(
        [3.0, 3.0, 2.0, 2.0, 0.0, 0.0, 30.0]
    )
    external = ExternalForce(inertia=2.0)
    assert (external.bandwidth, external.force_rate, external.encoder_count) == (100.0, None, 1e-6)
    adaptation = Adaptation(slowest=0.1)
    assert (adaptation.settle, adaptation.time, adaptation.lower, adaptation.upper, adaptation.start) == (
        0.05,
        5.0,
        0.5,
        1.0,
        1.0,
    )
    contact = aung(RATE, 1e3, 4.0, 1e-4)
    assert (contact.dither.share, contact.dither.window, contact.dither.count) == (
        0.9,
        pytest.approx(1.05 / 15.0),
        1e-4,
    )
    assert (contact.friction.law.element.stiffness, contact.friction.law.element.damping) == (1e3, 4.0)
    beside = impulsive(RATE, 1e3, Pulses(height=2.0)).friction.law.element
    assert (beside.stiffness, beside.decay_rate) == (1e3, 20.0)
    mo = mahvash_okamura(RATE, 1e3, 0.8)
    assert (mo.share, mo.friction.law.element.stiffness, mo.friction.law.element.damping) == (0.8, 1e3, 0.0)


def test_settings_of_compensators():
    for wrong in (
        lambda: Dither(share=1.01), lambda: Dither(share=-0.01), lambda: Dither(growth=0.0), lambda: Dither(growth=1.01),
        lambda: Dither(frequency=0.0), lambda: Dither(count=0.0), lambda: Dither(counts=0.0), lambda: Dither(window=0.0),
        lambda: Dither(frequency=inf), lambda: Dither(mode="loud"), lambda: Pulses(height=0.0),
        lambda: Pulses(height=1.0, width=0.0), lambda: Pulses(height=1.0, wait=0.0),
        lambda: Pulses(height=1.0, tolerance=-1.0), lambda: Pulses(height=inf),
        lambda: BristleObserver(lowest=1.01), lambda: BristleObserver(lowest=-0.1), lambda: BristleObserver(highest=0.99),
        lambda: BristleObserver(highest=inf), lambda: BristleObserver(corner=-1.0), lambda: BristleObserver(adaptation=-1.0),
        lambda: BristleObserver(gain=inf), lambda: DisturbanceObserver(inertia=1.0, limit=0.0),
        lambda: DisturbanceObserver(inertia=1.0, limit=inf), lambda: DisturbanceObserver(inertia=0.0, limit=1.0),
        lambda: by_law(Law(rate=RATE), share=-0.1), lambda: by_law(Law(rate=RATE), dither=Dither()),
        lambda: lugre_observer(RATE, Decaying(stiffness=1.0)),
    ):  # fmt: skip
        with pytest.raises(InvalidInput):
            wrong()
    for right in (
        Dither(share=0.0),
        Dither(share=1.0, growth=1.0),
        BristleObserver(lowest=1.0, highest=1.0, corner=0.0),
    ):
        assert right is not None
    assert by_law(Law(rate=RATE), share=0.0).share == 0.0


# --------------------------------------------------------------------------------------------- admittance


def test_the_admittance_is_its_equation():
    """m v_d' + b v_d = tau_e, u = K_p (q_d - q) + K_d (v_d - v), within the limit."""
    a = Admittance(inertia=2.0, viscosity=5.0, proportional=900.0, derivative=40.0, limit=30.0)
    c, s = a.row(), a.start(0.2)
    q, q_d, v_d, seen = 0.2, 0.2, 0.0, set()
    for k in range(200):
        tau = 30.0 * sin(k / 11.0)
        before, q = q, q + 2e-4 * cos(k / 9.0)
        v_d = (v_d + T / 2.0 * tau) / (1.0 + 5.0 / 2.0 * T)
        q_d += T * v_d
        u = 900.0 * (q_d - q) + 40.0 * (v_d - (q - before) / T)
        seen.add(abs(u) > 30.0)
        assert admit(c, 0, s, 0, tau, q, T) == pytest.approx(clip(u, -30.0, 30.0), rel=1e-9, abs=1e-9)
    assert seen == {True, False}
    for name in ("inertia", "viscosity", "proportional", "derivative", "limit"):
        with pytest.raises(InvalidInput):
            Admittance(
                **(
                    {"inertia": 1.0, "viscosity": 1.0, "proportional": 1.0, "derivative": 1.0, "limit": 1.0}
                    | {name: -0.1}
                )
            )
    with pytest.raises(InvalidInput):
        Admittance(inertia=0.0, viscosity=0.0, proportional=0.0, derivative=0.0, limit=1.0)
    with pytest.raises(InvalidInput):
        Admittance(inertia=1.0, viscosity=0.0, proportional=0.0, derivative=0.0, limit=0.0)


# ------------------------------------------------------------------------------------------------- the loop


WITHIN = {
    "compensator": alg_fc(RATE, 5e4, share=0.9),
    "top_speed": 5.0,
    "limit": 18.0,
    "encoder_count": 1e-6,
}


def test_torque_and_estimate_fade_while_no_reading_is_believed():
    """By 1/(1 + fade T) a tick, so that 20 ticks of 1 ms at 50/s leave less than half."""
    external = ExternalForce(inertia=0.7, method="disturbance", friction=alg_fe(RATE, 5e4))
    loop = Loop(JointLoop(**WITHIN, external=external), interval=T)
    loop.reset(np.zeros(1))
    for k in range(300):
        loop.update(np.array([1e-3 * k]), np.array([2.0]))
    torque, force = [float(loop.torque[0])], [float(loop.external[0])]
    assert abs(torque[0]) > 3.0 and abs(force[0]) > 3.0
    for _ in range(20):
        assert loop.update(np.array([nan]), np.array([2.0])) != Status.OK
        torque.append(float(loop.torque[0]))
        force.append(float(loop.external[0]))
    for series in (torque, force):  # one bad reading is bridged
        expected = series[0] * 1.05 ** -np.maximum(np.arange(21) - 1.0, 0.0)
        assert series == pytest.approx(expected, rel=1e-9)


def test_a_loop_without_an_estimator_estimates_nothing():
    loop = Loop(JointLoop(**WITHIN), interval=T)
    loop.reset(np.zeros(1))
    for k in range(500):
        assert loop.update(np.array([1e-3 * k]), np.array([2.0])) == Status.OK
    assert loop.torque[0] > 3.0 and (loop.external[0], loop.friction[0]) == (0.0, 0.0)
