"""Tests for identification/whitening.py against the whole covariance matrix."""

import numpy as np
import pytest
from scipy.signal import lfilter

from backdrive.identification.motion_bins import Bins
from backdrive.identification.whitening import CLEAN, correlation_of, neighbours, whiten

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("correlation", [0.0, 0.6, 0.97])
def test_whitening_is_by_the_inverse_root_of_the_covariance(gaps, correlation):
    at = np.flatnonzero(RNG.uniform(size=300) < 0.7) if gaps else np.arange(300)
    covariance = correlation ** np.abs(at[:, None] - at[None, :]) if correlation else np.eye(at.size)
    rows = RNG.standard_normal((at.size, 3))
    wanted = np.linalg.solve(np.linalg.cholesky(covariance), rows)
    assert whiten(rows, np.diff(at), correlation) == pytest.approx(wanted, abs=1e-12)
    assert whiten(rows[:, 0], np.diff(at), correlation) == pytest.approx(wanted[:, 0], abs=1e-12)


def test_pieces_do_not_show(monkeypatch):
    used = RNG.uniform(size=500) < 0.8
    bins = Bins(
        X=RNG.standard_normal((500, 2)), y=RNG.standard_normal(500), used=used, speed=np.ones(500), blocks=8
    )
    whole = bins.whiten(0.8)
    monkeypatch.setattr("backdrive.identification.motion_bins.PIECE", 7)
    assert np.array_equal(bins.whiten(0.8).X, whole.X) and np.array_equal(bins.whiten(0.8).y, whole.y)
    assert np.array_equal(whiten(bins.X[:1], np.ones(0, dtype=int), 0.8), bins.X[:1])
    assert whiten(bins.X[:0], np.ones(0, dtype=int), 0.8).shape == (0, 2)


@pytest.mark.parametrize("share", [0.6, 1.0])
def test_bins_that_are_not_used_stay_as_they_are(share):
    used = RNG.uniform(size=400) < share
    bins = Bins(
        X=RNG.standard_normal((400, 2)), y=RNG.standard_normal(400), used=used, speed=np.ones(400), blocks=8
    )
    white, at = bins.whiten(0.7), np.flatnonzero(used)
    assert np.array_equal(white.X[~used], bins.X[~used]) and np.array_equal(white.y[~used], bins.y[~used])
    assert np.array_equal(white.X[used], whiten(bins.X[used], np.diff(at), 0.7))
    assert np.array_equal(white.y[used], whiten(bins.y[used], np.diff(at), 0.7))
    assert bins.whiten(0.0) is bins


def test_the_correlation_of_neighbours_looks_over_no_gap():
    series = np.array([1.0, 2.0, -1.0, 3.0])
    assert neighbours(series, np.array([1, 2, 1])) == pytest.approx((2.0 - 3.0) / 2 / np.mean(series**2))
    assert neighbours(series, np.array([2, 2, 2])) == 0.0 == neighbours(series[:0], np.zeros(0))


def test_what_rounding_adds_does_not_hide_the_correlation_of_the_torque_s_noise():
    """An AR(1), and the difference of white noise that the means of an acceleration from an encoder have."""
    rng = np.random.default_rng(8)
    n, correlation, size = 40_000, 0.8, 0.5
    slow = lfilter([np.sqrt(1.0 - correlation**2)], [1.0, -correlation], rng.standard_normal(n))
    rounding = size * np.diff(rng.standard_normal(n + 1))
    used = np.ones(n, dtype=bool)
    false = 2.0 * size**2, -(size**2)
    assert correlation_of(slow, used, CLEAN) == pytest.approx(correlation, abs=0.02)
    hidden = (correlation - size**2) / (1.0 + 2.0 * size**2)
    assert correlation_of(slow + rounding, used, CLEAN) == pytest.approx(hidden, abs=0.03)
    assert correlation_of(slow + rounding, used, false) == pytest.approx(correlation, abs=0.04)
    # negative correlation of rounding alone is not touched, and an error that is larger than the residual makes no nonsense
    assert correlation_of(rounding, used, false) == correlation_of(rounding, used, CLEAN) < -0.4
    assert 0.0 < correlation_of(slow, used, (100.0, -50.0)) <= 0.99
