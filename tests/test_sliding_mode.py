"""The sliding-mode filter against the inclusion that it solves, and what it promises of steps and ramps."""

import numba as nb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backdrive.control.estimators.sliding_mode import MotionFilter, advance, motion
from backdrive.errors import InvalidInput
from backdrive.simulation.hand import minimum_jerk

JIT = not nb.config.DISABLE_JIT
T = 1e-3


def enumerated(u1, u2, x, G, H):
    """Return u2 of the next tick by trying every branch of the backward-Euler inclusion.

    y + T a sgn(sigma(y)) + T b sgn(y) contains u2,  sigma(y) = 2 G (u1 + T y - x) + |y| y,  a = (H + 1) G/2,  b = (H - 1) G/2.
    """
    e = u1 - x
    a, b = T * (H + 1.0) * G / 2.0, T * (H - 1.0) * G / 2.0
    way = -np.sign(e)
    s = T * G
    root = 0.0 if e == 0.0 else way * 2.0 * G * abs(e) / (s + np.hypot(s, np.sqrt(2.0 * G * abs(e))))

    def sigma(y):
        return 2.0 * G * (e + T * y) + abs(y) * y

    tried = []  # (by how much a branch misses its own condition, its y)
    for sign_sigma in (-1.0, 1.0):
        for sign_y in (-1.0, 1.0):
            y = u2 - a * sign_sigma - b * sign_y
            wrong = max(0.0, -sign_y * y, -sign_sigma * (y - root))
            tried.append((wrong, y))
        left = u2 - a * sign_sigma  # y = 0 off the surface
        tried.append((max(0.0, abs(left) - b, -sign_sigma * sigma(0.0)), 0.0))
    for sign_y in (-1.0, 1.0):  # on the surface
        tried.append((max(0.0, abs(u2 - root - b * sign_y) - a, -sign_y * root), root))
    tried.append((max(0.0, abs(u2) - a - b, abs(root)), 0.0))
    return min(tried)[1]


sizes = st.floats(-6.0, 2.0).map(lambda x: 10.0**x)
signed = st.tuples(st.sampled_from([-1.0, 0.0, 1.0]), sizes).map(lambda pair: pair[0] * pair[1])


@settings(max_examples=300 if JIT else 20)
@given(
    u1=signed,
    u2=signed,
    x=signed,
    G=st.floats(-1.0, 5.0).map(lambda x: 10.0**x),
    H=st.floats(1.001, 12.0),
)
def test_the_closed_form_solves_the_inclusion(u1, u2, x, G, H):
    u = np.array([u1, u2])
    advance(u, 0, x, G, H, T)
    expected = enumerated(u1, u2, x, G, H)
    assert u[1] == pytest.approx(expected, rel=1e-9, abs=1e-9 * (abs(u2) + H * G * T))
    assert u[0] == u1 + T * u[1]


def test_the_closed_form_solves_the_inclusion_many_times_more():
    rng = np.random.default_rng(0)
    for _ in range(5000 if JIT else 200):
        u1, u2, x = 10.0 ** rng.uniform(-5.0, 2.0, 3) * rng.choice([-1.0, 1.0], 3)
        G, H, u = 10.0 ** rng.uniform(-1.0, 5.0), rng.uniform(1.001, 12.0), np.array([u1, u2])
        advance(u, 0, x, G, H, T)
        assert u[1] == pytest.approx(enumerated(u1, u2, x, G, H), rel=1e-9, abs=1e-9 * (abs(u2) + H * G * T))


def response(x, G, H):
    u, out = np.zeros(2), np.empty((len(x), 2))
    for k, sample in enumerate(x):
        advance(u, 0, sample, G, H, T)
        out[k] = u
    return out


@pytest.mark.parametrize("H", [1.01, 1.5, 2.0, 5.0, 10.0])
@pytest.mark.parametrize(("X", "G"), [(1.0, 40.0), (-0.1, 10.0)])
def test_a_step_settles_in_time_and_does_not_overshoot(X, G, H):
    """In 2 sqrt(X/G), whatever H is: half of the way it accelerates at G, half it brakes at G."""
    out = response(np.full(1000, X), G, H)
    assert (np.sign(X) * out[:, 0]).max() <= abs(X) * (1.0 + 1e-12)
    settled = T * (1 + np.flatnonzero(np.abs(out[:, 0] - X) > 1e-6 * abs(X))[-1])
    assert settled == pytest.approx(2.0 * np.sqrt(abs(X) / G), abs=3.0 * T)
    assert np.abs(np.diff(out[:, 1])).max() <= G * T * (1.0 + 1e-9)


def test_too_fast_it_brakes_harder():
    """H G is for what is beyond the surface sigma = 0: here a step back while it is on its way."""
    for H in (1.5, 4.0):
        u = np.array([0.0, 3.0])
        advance(u, 0, -1.0, 10.0, H, T)
        assert u[1] == pytest.approx(3.0 - H * 10.0 * T, rel=1e-12)


@pytest.mark.parametrize("v", [0.5, -2.0])
def test_a_ramp_lags_by_its_speed_squared(v):
    G = 20.0
    x = v * T * np.arange(1, 2001)
    out = response(x, G, 2.0)
    assert x[-1] - out[-1, 0] == pytest.approx(v * abs(v) / (2.0 * G), rel=1e-9)
    assert out[-1, 1] == pytest.approx(v, rel=1e-9)
    stopped = response(np.concatenate([x, np.full(1000, x[-1])]), G, 2.0)[2000:, 0]
    assert (np.sign(v) * (stopped - x[-1])).max() <= 1e-12
    assert T * np.flatnonzero(np.abs(stopped - x[-1]) > 1e-6)[-1] == pytest.approx(abs(v) / G, abs=0.02)


def hand(n=6):
    """Return hand strokes of 0.1 m in 0.45 s, read by an encoder of 5 um, and their acceleration."""
    t = np.arange(round(n * 0.75 / T)) * T
    x, s = np.zeros(t.size), np.linspace(0.0, 1.0, 451)
    for i in range(n):
        begin, sign = round((0.2 + 0.75 * i) / T), 1.0 if i % 2 == 0 else -1.0
        x[begin : begin + 451] += sign * 0.1 * minimum_jerk(s)[0]
        x[begin + 451 :] += sign * 0.1
    return 5e-6 * np.round(x / 5e-6), np.gradient(np.gradient(x, T), T)


def test_three_ways_to_an_acceleration():
    """The size of the errors as published simulations of such strokes have them; the raw second difference for comparison."""
    q, true = hand(6 if JIT else 2)

    def error(a):
        return float(np.sqrt(np.mean((a[5:-5] - true[5:-5]) ** 2)))

    ways = {
        "literal": MotionFilter.literal(),
        "velocity": MotionFilter(way="velocity"),
        "velocity, G = 10": MotionFilter(way="velocity", second_gain=10.0),
        "cascade": MotionFilter(),
        "cascade, G = 300": MotionFilter(gain=300.0),
    }
    found = {name: error(way.run(q, T)[1]) for name, way in ways.items()}
    raw = error(np.diff(q, 2, prepend=[q[0], q[0]]) / T**2)
    assert found["cascade"] < 0.25
    assert found["cascade, G = 300"] < 0.25
    assert found["velocity"] < 0.27
    assert 0.5 < found["literal"] < 1.0
    assert found["velocity, G = 10"] > 1.2
    assert raw > 2.0


def test_the_literal_mode_differences_the_rate_of_one_filter():
    """Iwatani 2017, Sec. 4.6.1: G = 10, H = 2; the acceleration is bang-bang within [-H G, H G]."""
    literal = MotionFilter.literal()
    assert (literal.way, literal.gain, literal.ratio) == ("position", 10.0, 2.0)
    q, _ = hand(2)
    v, a = literal.run(q, T)
    out = response(q - q[0], 10.0, 2.0)
    assert v == pytest.approx(out[:, 1], abs=1e-12)
    assert a == pytest.approx(np.diff(out[:, 1], prepend=0.0) / T, abs=1e-9)
    assert np.abs(a).max() <= 20.0 + 1e-9


@pytest.mark.parametrize("way", ["position", "velocity", "cascade"])
def test_a_constant_velocity_has_no_acceleration(way):
    v, a = MotionFilter(way=way).run(0.3 + 0.2 * T * np.arange(3000), T)
    assert v[-1] == pytest.approx(0.2, rel=1e-9)
    assert a[-1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("dt", [4e-3, 1e-3, 1.25e-4])
def test_the_sampling_time_hardly_matters(dt):
    t = np.arange(round(2.0 / dt)) * dt
    q, true = 0.1 * np.sin(4.0 * t), -1.6 * np.sin(4.0 * t)
    a = MotionFilter().run(q, dt)[1]
    late = t > 0.5
    assert np.sqrt(np.mean((a - true)[late] ** 2)) < 0.25


def test_a_nan_stays_a_nan():
    u = np.array([0.0, 0.1])
    advance(u, 0, np.nan, 10.0, 2.0, T)
    assert np.isnan(u).all()


def test_without_the_compiler():
    row, states = MotionFilter().row(), []
    for step in (motion, getattr(motion, "py_func", motion)):
        u = np.zeros(5)
        for k in range(20):
            step(row, 0, u, 0, 1e-4 * k * k, 1e-4 * (2 * k - 1), T)
        states.append(u)
    assert states[0] == pytest.approx(states[1], rel=1e-14)


def test_bad_numbers_are_refused():
    for bad in (
        {"way": "both"},
        {"gain": 0.0},
        {"ratio": 1.0},
        {"second_gain": np.inf},
        {"second_ratio": np.nan},
    ):
        with pytest.raises(InvalidInput):
            MotionFilter(**bad)
    assert MotionFilter().run(np.zeros(0), T)[0].size == 0
