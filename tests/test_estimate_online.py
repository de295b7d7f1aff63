"""Estimators for a torque loop: what they promise, whatever comes in."""

import sys

import numba as nb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from _kinds import one_of_a_kind
from backdrive.control.estimators import REGRESSORS, AdaptiveFriction, RecursiveLeastSquares
from backdrive.engine import rollout
from backdrive.engine.tick import Tick
from backdrive.errors import InvalidInput, UnknownName
from backdrive.laws import M3, Coulomb, Dahl, Law, LuGre, StribeckGauss
from backdrive.laws.examples import ELEMENT_EXAMPLES, example
from backdrive.status import Status

JIT = not nb.config.DISABLE_JIT
EXAMPLES = 40 if JIT else 4
LENGTH = 300 if JIT else 60
DT = 1e-3
ALL = ("coulomb_positive", "coulomb_negative", "viscous", "inertia", "gravity_sin", "gravity_cos")
TRUE = np.array([5.0, 4.0, 2.0, 0.8, 3.0, -6.0])


def motion(n, seed=0):
    """Return position, velocity, acceleration of a few sines."""
    rng = np.random.default_rng(seed)
    t, w = np.arange(n) * DT, rng.uniform(2.0, 12.0, 5)
    phase, size = rng.uniform(0.0, 6.3, 5), 1.0 / w
    turn = w * t[:, None] + phase
    return (
        (size * np.sin(turn)).sum(1),
        (size * w * np.cos(turn)).sum(1),
        -(size * w * w * np.sin(turn)).sum(1),
    )


def columns(q, v, a):
    s = np.sign(v)
    return np.stack([np.maximum(s, 0), np.minimum(s, 0), v, a, np.sin(q), np.cos(q)], axis=1)


def feed(estimator, q, v, a, y):
    rows = np.empty((4, 1))
    for sample in zip(q, v, a, y, strict=True):
        rows[:, 0] = sample
        estimator.tick(*rows)


# ---------------------------------------------------------------------------------------- recursive least squares


def test_without_forgetting_it_is_least_squares_with_a_prior():
    n = 2000 if JIT else 300
    q, v, a = motion(n)
    y = columns(q, v, a) @ TRUE + 0.2 * np.random.default_rng(1).normal(size=n)
    rls = RecursiveLeastSquares(
        ALL, spread=3.0, start=1.0, noise=0.2, dead_zone=0.05, forgetting=1.0, gate=1e9
    )
    feed(rls, q, v, a, y)
    used = np.abs(v) > 0.05
    X = columns(q, v, a)[used]
    information = X.T @ X / 0.04 + np.eye(6) / 9.0
    expected = 1.0 + np.linalg.solve(information, X.T @ (y[used] - X @ np.ones(6)) / 0.04)
    assert rls.estimate[0] == pytest.approx(expected, rel=1e-6)
    assert rls.uncertainty()[0] == pytest.approx(np.sqrt(np.diag(np.linalg.inv(information))), rel=1e-6)
    assert rls.estimate[0] == pytest.approx(TRUE, abs=0.4 if JIT else 4.0)


def test_joints_do_not_see_each_other():
    n = 200
    logs = [motion(n, seed) for seed in range(3)]
    together = RecursiveLeastSquares(ALL, spread=3.0, noise=0.1, joints=3)
    for k in range(n):
        q, v, a = (np.array([log[i][k] for log in logs]) for i in range(3))
        together.tick(q, v, a, columns(q, v, a) @ TRUE)
    for j, log in enumerate(logs):
        alone = RecursiveLeastSquares(ALL, spread=3.0, noise=0.1)
        feed(alone, *log, columns(*log) @ TRUE)
        assert np.all(alone.estimate[0] == together.estimate[j])
        assert alone.torque[0] == together.torque[j]


@pytest.mark.skipif(not JIT, reason="one formula, two ways to run it")
def test_plain_and_compiled_ticks_agree(monkeypatch):
    from backdrive.control.estimators import recursive

    logs = motion(300)
    compiled = RecursiveLeastSquares(ALL, spread=3.0, noise=0.1)
    feed(compiled, *logs, columns(*logs) @ TRUE)
    for name in ("tick", "learn", "regressor"):
        monkeypatch.setattr(recursive, name, getattr(recursive, name).py_func)
    plain = RecursiveLeastSquares(ALL, spread=3.0, noise=0.1)
    feed(plain, *logs, columns(*logs) @ TRUE)
    assert plain.estimate == pytest.approx(compiled.estimate, rel=1e-9)


@pytest.mark.skipif(not JIT, reason="60 000 ticks")
def test_it_follows_friction_that_drifts():
    n = 60_000
    q, v, a = motion(n)
    drift = np.linspace(1.0, 0.7, n)
    level = TRUE[None] * np.stack([drift, drift, *[np.ones(n)] * 4], axis=1)
    y = np.sum(columns(q, v, a) * level, axis=1) + 0.2 * np.random.default_rng(0).normal(size=n)
    rls = RecursiveLeastSquares(ALL, spread=5.0, noise=0.2, dead_zone=0.05, forgetting=0.998)
    feed(rls, q, v, a, y)
    assert rls.estimate[0, :2] == pytest.approx(0.7 * TRUE[:2], rel=0.05)
    assert rls.estimate[0, 2:] == pytest.approx(TRUE[2:], abs=0.15)


@pytest.mark.skipif(not JIT, reason="200 000 ticks")
def test_cruising_for_minutes_forgets_nothing_and_winds_nothing_up():
    """Plain exponential forgetting would have lost inertia and the other direction long before."""
    q, v, a = motion(5000)
    rls = RecursiveLeastSquares(ALL, spread=5.0, noise=0.2, dead_zone=0.05, forgetting=0.999)
    rng = np.random.default_rng(0)
    feed(rls, q, v, a, columns(q, v, a) @ TRUE + 0.2 * rng.normal(size=q.size))
    before, unsure = rls.estimate.copy(), rls.uncertainty()
    n = 100_000
    cruise = 0.3 + 0.01 * np.arange(n) * DT, np.full(n, 0.5), np.zeros(n)
    feed(rls, *cruise, columns(*cruise) @ TRUE + 0.2 * rng.normal(size=n))
    assert rls.estimate[0, 3] == pytest.approx(before[0, 3], abs=0.05)
    assert rls.uncertainty()[0, 3] == pytest.approx(unsure[0, 3], rel=0.2)
    rest = np.zeros(n), np.zeros(n), np.zeros(n)
    before = rls.estimate.copy()
    feed(rls, *rest, rng.normal(size=n))
    assert np.all(rls.estimate == before)  # at rest friction may be anything
    feed(rls, q, v, a, columns(q, v, a) @ TRUE)
    assert rls.estimate[0] == pytest.approx(TRUE, abs=0.1)


@settings(max_examples=EXAMPLES)
@given(
    st.integers(0, 2**32 - 1), st.floats(0.5, 1.0, exclude_min=True), st.floats(-6.0, 6.0), st.integers(1, 6)
)
def test_the_covariance_never_exceeds_the_priors(seed, forgetting, decades, n):
    rng = np.random.default_rng(seed)
    rls = RecursiveLeastSquares(ALL[:n], spread=3.0, noise=0.1, forgetting=forgetting)
    towards = rng.normal(size=4)
    for _ in range(LENGTH):
        if rng.random() < 0.05:
            towards = rng.normal(size=4) * 10.0 ** (decades * rng.random())
        rls.tick(*(towards + 1e-3 * rng.normal(size=4))[:, None])
        P = rls._P.reshape(n, n)
        assert np.trace(P) <= n * (1.0 + 1e-9)
        assert np.all(np.isfinite(P))
    assert np.all(np.isfinite(rls.estimate))


@settings(max_examples=EXAMPLES)
@given(st.integers(0, 2**32 - 1), st.floats(0.8, 1.0), st.floats(0.5, 20.0))
def test_without_noise_the_weighted_error_falls(seed, forgetting, gate):
    """V = d' P^-1 d, in every tick, and |d|^2 <= n V(0)."""
    rng = np.random.default_rng(seed)
    names, true = ("coulomb", "viscous", "inertia", "offset"), rng.uniform(-3.0, 3.0, 4)
    rls = RecursiveLeastSquares(
        names, spread=3.0, noise=1.0, dead_zone=1e-6, forgetting=forgetting, gate=gate
    )
    first = before = np.sum((true / 3.0) ** 2)
    for _ in range(60):
        q, v, a = rng.normal(size=3)
        y = true @ [np.sign(v), v, a, 1.0]
        rls.tick(*np.array([q, v, a, y])[:, None])
        d = (rls.estimate[0] - true) / 3.0
        now = d @ np.linalg.solve(rls._P.reshape(4, 4), d)
        assert now <= before * (1.0 + 1e-7) + 1e-12
        assert d @ d <= 4.0 * first * (1.0 + 1e-9)
        before = now


@settings(max_examples=EXAMPLES)
@given(st.lists(st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 4), max_size=12))
def test_nothing_is_raised_and_what_comes_out_is_finite(samples):
    rls = RecursiveLeastSquares(ALL, spread=3.0, noise=0.1, limit=50.0)
    feed(rls, *motion(20), np.ones(20))
    for sample in samples:
        held, estimate = rls.torque.copy(), rls.estimate.copy()
        with np.errstate(all="ignore"):
            status = rls.tick(*np.array(sample)[:, None])
        if not np.all(np.isfinite(sample)):
            assert status is Status.NOT_FINITE
            assert np.all(rls.torque == held) and np.all(rls.estimate == estimate)
        assert np.all(np.isfinite(rls.torque)) and np.all(np.isfinite(rls.estimate))
        assert abs(rls.torque[0]) <= 50.0 and abs(rls.friction[0]) <= 50.0


@settings(max_examples=EXAMPLES)
@given(st.integers(0, 2**32 - 1), st.floats(1.0, 1e9), st.floats(0.5, 20.0))
def test_no_sample_moves_the_estimate_far(seed, jump, gate):
    rng = np.random.default_rng(seed)
    rls = RecursiveLeastSquares(ALL, spread=3.0, noise=0.1, gate=gate)
    for _ in range(20):
        before = rls.estimate / 3.0
        rls.tick(*(rng.normal(size=4) * (1.0, 1.0, 1.0, jump))[:, None])
        assert np.linalg.norm(rls.estimate / 3.0 - before) <= gate * np.sqrt(6.0) * (1.0 + 1e-9)


def test_a_contact_counts_less_and_a_limit_is_told():
    q, v, a = motion(2000 if JIT else 300)
    y = columns(q, v, a) @ TRUE
    rls = RecursiveLeastSquares(ALL, spread=5.0, noise=0.2, limit=3.0)
    feed(rls, q, v, a, y)
    before = rls.estimate.copy()
    status = rls.tick(*np.array([0.1, 1.0, 0.0, 1e4])[:, None])
    assert np.max(np.abs(rls.estimate - before)) < (0.2 if JIT else 12.0)
    assert status is Status.SATURATED
    assert abs(rls.friction[0]) == 3.0
    short = np.zeros(0)
    assert rls.tick(short, short, short, short) is Status.NOT_FINITE
    rls.reset()
    assert np.all(rls.estimate == 0.0) and rls.torque[0] == 0.0


def test_settings_of_least_squares_are_checked():
    fine = {"spread": 1.0, "noise": 0.1}
    for names in ((), ("coulomb", "coulomb"), ("coulomb", "coulomb_positive"), (*ALL, "offset")):
        with pytest.raises(InvalidInput):
            RecursiveLeastSquares(names, **fine)
    with pytest.raises(UnknownName):
        RecursiveLeastSquares(("stiction",), **fine)
    for wrong in (
        {"spread": 0.0},
        {"spread": (1.0, 2.0, 3.0)},
        {"noise": np.nan},
        {"forgetting": 0.2},
        {"limit": 0.0},
        {"joints": 0},
        {"dead_zone": -1.0},
    ):
        with pytest.raises(InvalidInput):
            RecursiveLeastSquares(("coulomb", "viscous"), **(fine | wrong))
    assert all(len(entry) == 2 for entry in REGRESSORS.values())


@pytest.mark.skipif(not JIT, reason="plain Python makes numbers")
def test_a_tick_allocates_nothing():
    rls = RecursiveLeastSquares(ALL, spread=3.0, noise=0.1)
    adaptive = AdaptiveFriction(example("stribeck-gauss+gms"), interval=DT, floor=0.5)
    row = np.ones(1)
    for tick in (lambda: rls.tick(row, row, row, row), lambda: adaptive.tick(row, row)):
        tick()
        before = sys.getallocatedblocks()
        for _ in range(1000):
            tick()
        assert sys.getallocatedblocks() - before < 10


# ------------------------------------------------------------------------------------------------ adaptive level


LAW = Law(
    rate=StribeckGauss(coulomb=4.0, breakaway=5.0, stribeck_velocity=0.05, viscous=1.0),
    element=LuGre(stiffness=1e4, damping=20.0, fading=0.05),
)


def run(adaptive, q, y):
    """Return level and torque at every sample."""
    out, rows = np.empty((q.size, 2)), np.empty((2, 1))
    for k in range(q.size):
        rows[0, 0], rows[1, 0] = q[k], y[k]
        adaptive.tick(rows[0], rows[1])
        out[k] = adaptive.level[0], adaptive.torque[0]
    return out.T


def friction(law, q, level=None, load=None):
    """Return the torque of a law tick by tick, its Coulomb part scaled (StribeckGauss)."""
    laws, out, dp = Tick(law, dt=DT), np.empty(q.size), np.diff(q, prepend=q[:1])
    if load is not None:
        laws.load[0] = load
    row = laws._arrays[0][0]
    dry = row[1:3].copy()
    for k in range(q.size):
        if level is not None:
            row[1:3] = dry * level[k]
        out[k] = laws.tick(dp[k : k + 1])[0]
    return out


@settings(max_examples=EXAMPLES)
@given(
    st.sampled_from(one_of_a_kind(sorted(ELEMENT_EXAMPLES))),
    st.integers(0, 2**32 - 1),
    st.floats(0.3, 3.0),
    st.floats(0.3, 3.0),
    st.floats(0.0, 2.0),
    st.floats(1e-3, 10.0),
)
def test_the_error_of_the_level_never_grows(name, seed, true, start, noise, time):
    rng = np.random.default_rng(seed)
    law, size = example(name), 10.0 ** rng.uniform(-5.0, 0.0)
    q = np.cumsum(size * rng.normal(size=LENGTH)) * np.repeat(rng.random(LENGTH // 20) < 0.7, 20)
    f = friction(law, q)
    y = true * f + noise * rng.uniform(-1.0, 1.0, LENGTH)
    adaptive = AdaptiveFriction(law, interval=DT, time=time, floor=0.5, dead_zone=noise, start=start)
    level, torque = run(adaptive, q, y)
    apart = np.abs(np.concatenate([[start], level]) - true)
    assert np.all(np.diff(apart) <= 1e-12)
    assert torque == pytest.approx(level * f, rel=1e-9, abs=1e-9)
    if noise == 0.0:  # the rate that is promised
        learned = np.abs(f) >= 0.5
        g = DT / (time + DT)
        assert np.all(apart[1:][learned] <= (1.0 - 0.5 * g) * apart[:-1][learned] + 1e-12)


def drifting(n, change):
    """Return a slow to-and-fro, the torque of the law with its Coulomb part scaled."""
    t = np.arange(n) * DT
    q = 0.3 * np.sin(1.5 * t) + 0.05 * np.sin(6.0 * t)
    return q, friction(LAW, q, change(t))


@pytest.mark.skipif(not JIT, reason="20 000 ticks")
def test_a_coulomb_torque_that_falls_by_30_percent_is_followed():
    """Drift over 20 s: within 5 % at all times. A jump: within 5 % after 4 time constants of 0.5 s."""
    rng = np.random.default_rng(0)
    for change, after in (
        (lambda t: np.interp(t, [0.0, 20.0], [1.0, 0.7]), 0.0),
        (lambda t: np.where(t < 5.0, 1.0, 0.7), 7.0),
    ):
        q, y = drifting(20_000, change)
        adaptive = AdaptiveFriction(LAW, interval=DT, time=0.5, floor=1.0, dead_zone=0.1)
        _, torque = run(adaptive, q, y + 0.1 * rng.uniform(-1.0, 1.0, q.size))
        slides = np.abs(y) > 2.5
        late = slides & (np.arange(q.size) * DT >= after)
        apart = np.abs(torque - y)[late] / np.abs(y)[late]
        assert np.sqrt(np.mean(apart**2)) < 0.05
        fixed = np.abs(rollout(LAW, q=q, dt=DT) - y)[late] / np.abs(y)[late]
        assert np.sqrt(np.mean(apart**2)) < 0.25 * np.sqrt(np.mean(fixed**2))


def test_a_joint_at_rest_teaches_nothing():
    adaptive = AdaptiveFriction(LAW, interval=DT, floor=1.0)
    level, torque = run(adaptive, np.zeros(50), np.full(50, 3.0))
    assert np.all(level == 1.0) and np.all(torque == 0.0)


def test_the_level_stays_within_its_bounds_and_says_so():
    adaptive = AdaptiveFriction(LAW, interval=DT, floor=1.0, time=1e-3, lower=0.5, upper=2.0)
    q = 1e-3 * np.arange(100.0)
    run(adaptive, q, np.full(100, 100.0))
    assert adaptive.level[0] == 2.0
    assert Status(adaptive.codes[0]) is Status.SATURATED
    run(adaptive, q + q[-1], np.full(100, -100.0))
    assert adaptive.level[0] == 0.5
    adaptive.reset()
    assert adaptive.level[0] == 1.0 and adaptive.torque[0] == 0.0


def test_bad_samples_hold_and_the_next_good_one_bridges_them():
    law = Law(rate=Coulomb(coulomb=5.0), element=Dahl(stiffness=1e4))
    q = 1e-5 * np.arange(40.0)
    whole, holed = (AdaptiveFriction(law, interval=DT, floor=10.0) for _ in range(2))
    run(whole, q, 0.0 * q)
    rows = np.zeros((2, 1))
    for k in range(40):
        rows[0, 0] = np.nan if k in (10, 11) else q[k]
        held = holed.torque[0]
        if k == 20:
            assert holed.tick(*rows, 1.0) is Status.BAD_INTERVAL
            assert holed.torque[0] == held
        elif k == 21:
            assert holed.tick(*rows, float("nan")) is Status.BAD_INTERVAL
        else:
            status = holed.tick(*rows)
            assert status is (Status.NOT_FINITE if k in (10, 11) else Status.OK)
            assert k not in (10, 11) or holed.torque[0] == held
    assert holed.torque[0] == pytest.approx(whole.torque[0], rel=1e-3)
    assert holed.tick(np.zeros(0), np.zeros(0)) is Status.NOT_FINITE


@settings(max_examples=EXAMPLES)
@given(
    st.sampled_from(one_of_a_kind(sorted(ELEMENT_EXAMPLES))),
    st.lists(
        st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 2, st.floats(-1.0, 1.0)), max_size=12
    ),
)
def test_whatever_comes_in_level_and_torque_stay_finite(name, samples):
    adaptive = AdaptiveFriction([example(name), LAW], interval=DT, floor=0.5)
    rows = np.zeros((2, 2))
    for q, y, dt in samples:
        rows[0], rows[1] = q, y
        with np.errstate(all="ignore"):
            status = adaptive.tick(rows[0], rows[1], dt)
        assert isinstance(status, Status)
        assert np.all(np.isfinite(adaptive.torque))
        assert np.all((adaptive.level >= 0.3) & (adaptive.level <= 3.0))


def test_a_law_that_sees_the_load_gets_it():
    law = Law(rate=M3(coulomb=4.0, viscous=0.0, load=0.1))
    adaptive = AdaptiveFriction(law, interval=DT, floor=1.0, time=1e9)
    adaptive.load[0] = 20.0, -20.0
    run(adaptive, np.array([0.0, 1e-3]), np.zeros(2))
    expected = friction(law, np.array([0.0, 1e-3]), load=(20.0, -20.0))[-1]
    assert expected > 4.5
    assert adaptive.torque[0] == pytest.approx(expected)
    adaptive.load[0] = np.nan
    held = adaptive.torque[0]
    assert adaptive.tick(np.array([2e-3]), np.zeros(1)) is Status.NOT_FINITE
    assert adaptive.torque[0] == held


def test_settings_of_the_level_are_checked():
    fine = {"interval": DT, "floor": 1.0}
    for wrong in (
        {"interval": 0.0},
        {"time": -1.0},
        {"floor": 0.0},
        {"dead_zone": -1.0},
        {"lower": 2.0, "upper": 1.0},
        {"start": 9.0},
        {"floor": (1.0, 2.0)},
    ):
        with pytest.raises(InvalidInput):
            AdaptiveFriction(LAW, **(fine | wrong))
    with pytest.raises(InvalidInput):
        AdaptiveFriction([], **fine)
