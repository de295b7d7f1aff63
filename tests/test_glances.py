"""What a glance at the means of a log rules out, the whole log rules out too."""

import numpy as np

from backdrive.identification import ramp, sweep_windows
from backdrive.identification.ramp_branches import BRANCH, CUTOFF
from backdrive.logs import filters
from backdrive.logs.resolution import white_noise


def lines(rng, rate):
    """Return a torque of straight lines between changing heights, after a rest or none, rounded or not, with noise, (n,)."""
    heights = np.r_[0.0, (-1.0) ** np.arange(rng.integers(2, 9)) * rng.uniform(0.5, 1.0)]
    parts = [
        np.linspace(a, b, round(rate * 10.0 ** rng.uniform(-0.4, 1.0)))
        for a, b in zip(heights, heights[1:], strict=False)
    ]
    torque = np.concatenate([np.zeros(round(rate * rng.choice([0.0, 1.0]))), *parts])
    if rng.random() < 0.3:
        torque = filters.low_pass(torque, min(5.0, 0.1 * rate), rate)
    step = 10.0 ** rng.uniform(-4.0, -2.0)
    return step * np.round(
        (torque + 10.0 ** rng.uniform(-5.0, -1.7) * rng.standard_normal(torque.size)) / step
    )


def test_no_glance_takes_straight_ramps_for_something_else():
    rng, straight = np.random.default_rng(4), 0
    for _ in range(150):
        rate = 10.0 ** rng.uniform(2.0, 3.5)
        torque = lines(rng, rate)
        noise, smooth = white_noise(torque), filters.low_pass(torque, min(CUTOFF, 0.1 * rate), rate)
        span = float(np.ptp(smooth))
        turns, far = sweep_windows.turning_points(smooth, BRANCH * span), ramp.STRAIGHT * span + noise
        if ramp._are_straight(smooth, turns, ramp.EDGE * rate, far, but_first=True):
            straight += 1
            assert ramp._may_ramp(torque, noise, 1.0 / rate)
    assert straight > 100


def test_a_glance_sees_that_a_motion_is_no_ramp():
    t = np.arange(20_000) / 1e3
    torque = 3.0 * np.sign(np.cos(6.0 * t)) + np.sin(2.6 * t)
    assert not ramp._may_ramp(torque, 0.0, 1e-3)


def test_no_glance_takes_equal_strokes_for_others():
    rng = np.random.default_rng(5)
    for _ in range(60):
        rate, cycles = 10.0 ** rng.uniform(2.0, 3.5), int(rng.integers(4, 12))
        ends = np.r_[0.0, np.cumsum(10.0 ** rng.uniform(0.3, 0.9) / np.arange(1, cycles + 1))]
        t = np.arange(0.0, ends[-1], 1.0 / rate)
        position = -np.cos(2.0 * np.pi * np.interp(t, ends, np.arange(cycles + 1)))
        position += 10.0 ** rng.uniform(-5.0, -2.0) * rng.standard_normal(t.size)
        cutoff = min(sweep_windows.SMOOTH, 0.05 * rate)
        x = filters.low_pass(position, cutoff, rate)
        turns = [sweep_windows.turning_points(x, share * float(np.ptp(x))) for share in sweep_windows.TRIED]
        assert any(sweep_windows._equal_strokes(x[turn], 8) for turn in turns)
        assert sweep_windows._may_sweep(position, cutoff, rate, 8)


def test_a_glance_sees_that_strokes_differ():
    t = np.arange(20_000) / 1e3
    assert not sweep_windows._may_sweep(np.sin(3.0 * t) + np.sin(4.7 * t + 1.0), 25.0, 1e3, 8)
