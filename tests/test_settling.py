"""Inertia by a coarse encoder under coloured noise, and friction that builds up over a way after each reversal."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from backdrive.identification.motion import identify_motion
from backdrive.identification.motion_bins import Bins
from backdrive.identification.settling import SURE, _by_residual
from backdrive.identification.signals import prepare, turns, way_since_reversal
from backdrive.logs.filters import low_pass
from backdrive.logs.log import Joint, Log
from backdrive.model import JointFriction

RATE = 1000.0
WAVES = ((0.8, 0.9, 0.0), (0.4, 2.3, 1.0), (0.2, 6.1, 2.0))  # rad, rad/s, rad
INERTIA, COULOMB, VISCOUS = 0.3, 1.0, 0.4


def joint_log(
    seed: int,
    bend: float = 0.0,
    step: float = 0.0,
    colour: float = 0.98,
    sd: float = 0.02,
    rest: float = 0.0,
) -> Log:
    """Return the log of a joint whose friction is complete so long a way after a reversal [rad], as a spring's.

    Every fifth turning point lasts for a rest [s].
    """
    rng = np.random.default_rng(seed)
    t = np.arange(round(30.0 * RATE)) / RATE
    q = sum(a * np.sin(w * t + p) for a, w, p in WAVES)
    v = sum(a * w * np.cos(w * t + p) for a, w, p in WAVES)
    acceleration = -sum(a * w * w * np.sin(w * t + p) for a, w, p in WAVES)
    if rest:
        turns = (np.flatnonzero(np.diff(np.sign(v)) != 0) + 1)[::5]
        held = np.repeat(turns, round(rest * RATE))
        q = np.insert(q, held, q[held])
        v, acceleration = np.insert(v, held, 0.0), np.insert(acceleration, held, 0.0)
        t = np.arange(q.size) / RATE
    z = [0.0]
    for change in np.diff(q).tolist():
        z.append(min(max(z[-1] + change, -bend), bend))
    level = np.array(z) / bend if bend else np.sign(v)
    white = rng.standard_normal(t.size)
    white[0] = 0.0
    wander = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white)
    torque = INERTIA * acceleration + COULOMB * level + VISCOUS * v + sd * wander
    position = np.round(q / step) * step if step else q
    return Log(time=t, joints=(Joint(name="j", unit="rad"),), position=position, torque=torque)


@cache
def friction_of(seed: int, **options: float) -> JointFriction:
    """Return what is found in a log, once for all numbers."""
    return identify_motion([joint_log(seed, **options)], "j", law="coulomb-viscous")[0]


def scores(name: str, truth: float, **options) -> np.ndarray:
    """Return errors of a number over several logs, by its stated error."""
    made = []
    for seed in range(4):
        friction = friction_of(seed, **options)
        if name in friction.dynamics:
            estimate = friction.dynamics[name]
            made.append((estimate.value - truth) / estimate.standard_error)
        else:
            made.append((getattr(friction.law.rate, name) - truth) / friction.standard_errors[name])
    return np.array(made)


def test_the_encoder_does_not_draw_the_inertia_to_zero_under_coloured_noise():
    """Whitening weighs high frequencies, where an encoder's steps are most of the acceleration."""
    assert abs(scores("inertia", INERTIA, step=4e-5).mean()) < 0.8


@pytest.mark.parametrize("bend", [0.0, 0.01, 0.02, 0.06])  # a stroke is 0.37 rad
def test_friction_that_builds_up_over_a_way_is_left_out(bend):
    for name, truth in (("coulomb_positive", COULOMB), ("viscous_positive", VISCOUS)):
        z = scores(name, truth, bend=bend, step=4e-6)
        assert abs(z.mean()) < 2.0 and np.abs(z).max() < 4.0  # 14 where nothing is left out


def test_friction_that_builds_up_over_a_way_is_no_delay():
    """A friction that lags by a distance looks like late torque."""
    z = scores("time_slip", 0.0, bend=0.01, step=4e-6, colour=0.0)
    assert abs(z.mean()) < 1.5 and np.abs(z).max() < 4.0  # -1.6 where build-up is looked for after the delay


def test_rests_do_not_hide_that_friction_builds_up():
    """The steps of an encoder let the velocity change its sign thousands of times in a rest, over hardly any distance."""
    log = joint_log(0, step=4e-6, rest=4.0)
    (s,), (moving,) = prepare(log, "j"), prepare(joint_log(0, step=4e-6), "j")
    reversals = turns(s.velocity).size
    assert reversals > 3 * turns(moving.velocity).size
    assert way_since_reversal(s)[1] == pytest.approx(way_since_reversal(moving)[1], rel=0.3)
    for name, truth in (("coulomb_positive", COULOMB), ("viscous_positive", VISCOUS)):
        z = scores(name, truth, bend=0.01, step=4e-6, rest=4.0)
        assert abs(z.mean()) < 2.0 and np.abs(z).max() < 4.0


def test_the_way_since_a_reversal_is_that_of_the_motion():
    (s,) = prepare(joint_log(0), "j")
    way, middle = way_since_reversal(s)
    turns = np.flatnonzero(np.diff(np.sign(s.velocity)) != 0) + 1
    a, b = turns[1], turns[2]
    assert way[b - 1] == pytest.approx(abs(s.position[b] - s.position[a]), rel=0.02)
    assert way[a] < 0.01 * way[b - 1]
    assert middle == pytest.approx(np.median(np.abs(np.diff(s.position[turns]))), rel=0.3)


@pytest.mark.parametrize("seed", range(4))
def test_a_build_up_of_several_bins_is_left_out(seed):
    """Where it makes neighbouring bins alike, whitening reverses its sign: the friction was 1.5 and 3.5 % too small."""
    rng, bend = np.random.default_rng(seed), 0.02
    t = np.arange(0.0, 20.0, 1.0 / RATE)
    v, begin = np.zeros(t.size), 0.3
    for top in (0.4, 0.8, 1.2, 1.6):
        for way in (1.0, -1.0):
            end = begin + rng.uniform(1.4, 1.7)
            v += way * top * np.clip(np.minimum(t - begin, end - t) / 0.2, 0.0, 1.0)
            begin = end + 0.3
    q = low_pass(np.cumsum(v) / RATE, 8.0, RATE)
    v = np.gradient(q, 1.0 / RATE)
    z = np.zeros(t.size)
    for k in range(1, t.size):
        z[k] = np.clip(z[k - 1] + q[k] - q[k - 1], -bend, bend)
    torque = INERTIA * np.gradient(v, 1.0 / RATE) + COULOMB * z / bend + VISCOUS * v
    torque += 0.03 * rng.standard_normal(t.size)
    log = Log(time=t, joints=(Joint(name="j", unit="rad"),), position=q, torque=torque)
    friction, _ = identify_motion([log.rows(slice(None, None, 10))], "j", law="coulomb-viscous")
    assert friction.law.rate.coulomb_positive == pytest.approx(COULOMB, abs=0.01)
    assert friction.law.rate.viscous_positive == pytest.approx(VISCOUS, abs=0.02)


@pytest.mark.parametrize("seed", [0, 2])
def test_a_ripple_over_the_position_is_no_build_up(seed):
    """Ripples of 7 a turn: 0.45 of a stroke was left out, and the curve was 9 and 8 % off."""
    rng, t = np.random.default_rng(1000 + seed), np.arange(15000) / 500.0
    w, phase, size = (
        2.0 * np.pi * rng.uniform(0.15, 1.5, 3),
        rng.uniform(0.0, 2.0 * np.pi, 3),
        rng.uniform(0.5, 1.0, 3),
    )
    size *= 0.8 / size.sum()
    q, v = (
        size @ np.sin(np.outer(w, t) + phase[:, None]),
        (size * w) @ np.cos(np.outer(w, t) + phase[:, None]),
    )
    torque = 0.5 * -(size * w**2) @ np.sin(np.outer(w, t) + phase[:, None]) + 1.5 * np.sign(v) + 0.8 * v
    torque += 0.2 * np.sin(7.0 * q) + 0.05 * rng.standard_normal(t.size)
    friction, _ = identify_motion(
        [Log(time=t, joints=(Joint(name="j", unit="rad"),), position=q, torque=torque)], "j"
    )
    at = np.array([-0.8, -0.3, 0.3, 0.8]) * float(np.quantile(np.abs(v), 0.999))
    assert friction.law.torque(at) == pytest.approx(1.5 * np.sign(at) + 0.8 * at, rel=0.03)


@pytest.mark.parametrize("late", [0.0, 0.15])
def test_what_a_band_would_explain_is_told_by_the_residual(late):
    """As by a fit with the band among its columns, without that fit."""
    rng, n = np.random.default_rng(5), 2000
    X = np.column_stack([rng.standard_normal((n, 3)), np.sign(rng.standard_normal(n))])
    band = X[:, 3] * (rng.uniform(size=n) < 0.05)
    used = rng.uniform(size=n) < 0.9
    y = X @ [1.0, -2.0, 0.5, 3.0] - late * band + 0.3 * rng.standard_normal(n)
    bins = Bins(X=X, y=y, used=used, speed=np.ones(n), blocks=8)
    both = np.column_stack([X, band])[used]
    theta, power = np.linalg.lstsq(both, y[used], rcond=None)[:2]
    error = np.sqrt(power[0] / (used.sum() - 5) * np.linalg.inv(both.T @ both)[-1, -1])
    left = y - X @ np.linalg.lstsq(X[used], y[used], rcond=None)[0]
    left[~used] = np.nan
    got = _by_residual(bins, left, band)
    assert got == pytest.approx(theta[-1] / error, rel=0.05, abs=0.05)
    assert (got < -SURE) == (late > 0.0)
