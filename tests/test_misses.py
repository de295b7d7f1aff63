"""What a fitted curve misses at a speed counts in its error there."""

from __future__ import annotations

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.identification.misses import FEWEST, PASSES, Misses, _end_of_slowest, _sizes, misses_at

RATE = 250.0


def recorded(peak: float, speed: float = 0.25, noise: float = 0.05, seed: int = 0) -> Log:
    """Return a log of a joint with a Stribeck peak [N.m] that falls over a speed [rad/s]."""
    t = np.arange(round(30.0 * RATE)) / RATE
    w = 2.0 * np.pi * np.array([0.21, 0.47, 1.1])
    size = np.array([0.5, 0.25, 0.08])
    q, v, a = ((size * w**k * np.sin(np.outer(t, w) + k * np.pi / 2)).sum(axis=1) for k in range(3))
    tau = 0.2 * a + np.sign(v) * (3.0 + peak * np.exp(-((v / speed) ** 2))) + 0.6 * v
    tau = tau + noise * np.random.default_rng(seed).standard_normal(t.size)
    return Log(time=t, joints=(Joint(name="a"),), position=q[:, None], torque=tau[:, None])


def off(log: Log, peak: float, speed: float = 0.25, **options) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return speeds from the stated lowest one on, the curve's errors by stated ones, and the latter [N.m], (n,) each."""
    found = identify(log, method="motion", **options)
    curve, lowest = found.evidence[0].curve, found.model.joints[0].validity.lowest_speed
    assert lowest is not None
    kept = np.abs(curve.velocity) >= lowest
    v, error = np.abs(curve.velocity[kept]), curve.standard_error[kept]
    truth = 3.0 + peak * np.exp(-((v / speed) ** 2)) + 0.6 * v
    return v, (np.abs(curve.torque[kept]) - truth) / error, error


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_straight_line_is_not_sure_where_a_peak_begins(seed):
    v, z, _ = off(recorded(1.5, seed=seed), 1.5, law="coulomb-viscous")
    assert np.abs(z[v < 0.2 * v.max()]).max() < 4.0


def test_a_straight_line_that_holds_stays_as_sure():
    v, z, error = off(recorded(0.0), 0.0)
    fast = v > 0.2 * v.max()
    assert error[fast].max() < 0.02
    assert np.abs(z).max() < 3.0


def test_a_mean_residual_counts_less_its_noise_and_beyond_chance_alone():
    rng = np.random.default_rng(1)
    run = np.repeat(np.arange(12), 10)
    group = np.zeros(run.size, dtype=int)
    noise = rng.standard_normal(12)[run] * 0.1 + 0.05 * rng.standard_normal(run.size)
    error = np.std([noise[run == k].mean() for k in range(12)], ddof=1) / np.sqrt(12)
    quiet = _sizes(noise, group, run, 1, 0)[0]
    assert quiet == 0.0
    ((found,), _) = _sizes(noise + 1.0, group, run, 1, 0)
    assert found == pytest.approx(np.sqrt((1.0 + noise.mean()) ** 2 - error**2), rel=1e-3)
    slight = noise - noise.mean() + 1.5 * error  # likely by chance; at the slowest speeds it counts
    assert _sizes(slight, group, run, 1, 0)[0] == 0.0
    assert _sizes(slight, group, run, 1, 1)[0] == pytest.approx(np.sqrt(1.5**2 - 1.0) * error)


def test_one_long_pass_shows_nothing():
    group = np.zeros(200, dtype=int)
    assert _sizes(np.ones(200), group, np.zeros(200, dtype=int), 1, 1)[0] == 0.0
    assert _end_of_slowest(np.linspace(0.1, 1.0, 200), group) == np.inf


def test_the_slowest_range_has_enough_bins_of_enough_passes():
    run = np.repeat(np.arange(10), 20)
    speed = np.tile(np.linspace(0.1, 2.0, 20), 10) + 0.01 * run
    end = _end_of_slowest(speed, run)
    below = speed <= end
    assert np.count_nonzero(below) >= FEWEST
    assert np.unique(run[below]).size >= PASSES
    assert end < 0.25


def test_misses_lie_between_ranges_and_go_on_beyond():
    one = Misses(speeds=np.array([[0.1, 0.3], [0.2, 0.4]]), sizes=np.array([[1.0, 0.0], [0.5, 0.1]]))
    np.testing.assert_allclose(one.at(np.array([0.05, 0.2, 0.5, -0.1, -0.3])), [1.0, 0.5, 0.0, 0.5, 0.3])
    wide = one.beside(lambda v: np.full(v.size, 0.3))
    np.testing.assert_allclose(wide(np.array([0.2])), [np.hypot(0.3, 0.5)])


@pytest.mark.parametrize(("missed", "held"), [((0.3, 0.3), 0.0), ((0.0, 0.3), 0.14), ((0.0, 9.0), 0.14)])
def test_a_curve_that_misses_the_slowest_ranges_holds_behind_them(missed, held):
    """Also where it misses all of them: then it holds from the end of those that may be left out."""
    random, rows = np.random.default_rng(0), np.arange(4000)
    speed = np.tile(np.r_[np.linspace(0.1, 2.0, 20), np.linspace(2.0, 0.1, 20)], 100)
    way = np.where(rows // 40 % 2, -1.0, 1.0)
    off = np.where((speed >= missed[0]) & (speed < missed[1]), 0.5, 0.0) + 0.05 * random.standard_normal(
        rows.size
    )
    found = misses_at(rows, way * speed, way * off, 0.1, True)
    assert found.held == pytest.approx(held, abs=0.02)


def test_a_peak_below_the_speeds_of_the_curve_is_said():
    """The joint passes slow speeds too shortly to be fitted there, but often enough to show a peak."""

    def said(peak: float, seed: int) -> list[str]:
        warnings = identify(recorded(peak, 0.06, seed=seed), method="motion").model.joints[0].warnings
        return [w for w in warnings if "a Stribeck peak. Add slow motion" in w]

    for seed in range(3):
        (sentence,) = said(2.0, seed)
        assert "higher than the curve" in sentence
        assert said(0.0, seed) == []
