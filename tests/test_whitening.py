"""Tests for identification/whitening.py against the whole covariance matrix."""

import numpy as np
import pytest
from scipy.signal import lfilter

from backdrive.identification.motion_bins import Bins
from backdrive.identification.whitening import (
    LAGS,
    WHITE,
    Colour,
    as_noise,
    before_fit,
    colour_of,
    neighbours,
    of_means,
    whiten,
    whiten_both,
)

RNG = np.random.default_rng(4)


@pytest.fixture(autouse=True)
def begin_anew():
    """Draw the same for a test whichever others ran before it."""
    RNG.bit_generator.state = np.random.default_rng(4).bit_generator.state


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
    whole = bins.whiten(Colour(0.8))
    monkeypatch.setattr("backdrive.identification.whitening.PIECE", 7)
    assert np.array_equal(bins.whiten(Colour(0.8)).X, whole.X) and np.array_equal(
        bins.whiten(Colour(0.8)).y, whole.y
    )
    assert np.array_equal(whiten(bins.X[:1], np.ones(0, dtype=int), 0.8), bins.X[:1])
    assert whiten(bins.X[:0], np.ones(0, dtype=int), 0.8).shape == (0, 2)


@pytest.mark.parametrize("share", [0.6, 1.0])
def test_bins_that_are_not_used_stay_as_they_are(share):
    used = RNG.uniform(size=400) < share
    bins = Bins(
        X=RNG.standard_normal((400, 2)), y=RNG.standard_normal(400), used=used, speed=np.ones(400), blocks=8
    )
    white, at = bins.whiten(Colour(0.7)), np.flatnonzero(used)
    assert np.array_equal(white.X[~used], bins.X[~used]) and np.array_equal(white.y[~used], bins.y[~used])
    assert np.array_equal(white.X[used], whiten(bins.X[used], np.diff(at), 0.7))
    assert np.array_equal(white.y[used], whiten(bins.y[used], np.diff(at), 0.7))
    assert bins.whiten(WHITE) is bins


def test_the_correlation_of_neighbours_looks_over_no_gap():
    series = np.array([1.0, 2.0, -1.0, 3.0])
    assert neighbours(series, np.array([1, 2, 1])) == pytest.approx((2.0 - 3.0) / 2 / np.mean(series**2))
    assert neighbours(series, np.array([2, 2, 2])) == 0.0 == neighbours(series[:0], np.zeros(0))


def ar_and_difference(correlation: float, size: float, n: int) -> np.ndarray:
    """Return an AR(1), and beside it a difference of white noise, as the means of an acceleration from an encoder have it."""
    rng = np.random.default_rng(8)
    slow = lfilter([np.sqrt(1.0 - correlation**2)], [1.0, -correlation], rng.standard_normal(n))
    return slow + size * np.diff(rng.standard_normal(n + 1))


def test_what_rounding_adds_does_not_hide_the_correlation_of_the_torque_s_noise():
    n, correlation, size = 40_000, 0.8, 0.5
    both, used = ar_and_difference(correlation, size, n), np.ones(n, dtype=bool)
    level = np.ones((n, 1))
    false = 2.0 * size**2, -(size**2), 0.0, 0.0
    hidden = (correlation - size**2) / (1.0 + 2.0 * size**2)
    assert colour_of(both, used, level).correlation == pytest.approx(hidden, abs=0.03)
    found = colour_of(both, used, level, false)
    assert found.correlation == pytest.approx(correlation, abs=0.04)
    assert found.rounding == pytest.approx(false, abs=0.04)
    # an error far below the noise is left out, one that exceeds the residual makes no nonsense, and a negative correlation stays
    assert colour_of(both, used, level, tuple(1e-3 * x for x in false)).rounding == ()
    # one that would leave a correlation of more than one explains something else: what the model lacks
    assert colour_of(both, used, level, (100.0, -50.0, 0.0, 0.0)) == colour_of(both, used, level)
    alone = np.diff(RNG.standard_normal(n))
    assert colour_of(alone, used[1:], level[1:], false) == colour_of(alone, used[1:], level[1:])


@pytest.mark.parametrize("gaps", [False, True])
def test_both_noises_are_whitened_by_the_inverse_root_of_their_covariance(gaps):
    colour = Colour(0.9, (0.8, -0.45, 0.06, -0.01))
    at = np.flatnonzero(RNG.uniform(size=300) < 0.7) if gaps else np.arange(300)
    apart = np.abs(at[:, None] - at[None, :])
    covariance = colour.correlation**apart + np.append(colour.rounding, 0.0)[np.minimum(apart, LAGS)]
    rows = RNG.standard_normal((at.size, 3))
    wanted = np.sqrt(1.8) * np.linalg.solve(np.linalg.cholesky(covariance), rows)
    assert whiten_both(rows, at, colour) == pytest.approx(wanted, abs=1e-10)
    assert whiten_both(rows[:1], at[:1], colour) == pytest.approx(rows[:1])


def test_pieces_of_both_noises_begin_anew(monkeypatch):
    used = RNG.uniform(size=5000) < 0.9
    y = ar_and_difference(0.9, 0.6, 5000)
    bins = Bins(X=y[:, None].copy(), y=y, used=used, speed=np.ones(5000), blocks=8)
    colour = Colour(0.9, (0.72, -0.36, 0.0, 0.0))
    white = bins.whiten(colour)
    assert np.array_equal(white.X[:, 0], white.y) and np.array_equal(white.y[~used], y[~used])
    assert np.std(white.y[used]) == pytest.approx(np.std(y), rel=0.1)
    assert abs(neighbours(white.y[used], np.diff(np.flatnonzero(used)))) < 0.03
    monkeypatch.setattr("backdrive.identification.motion_bins.PIECE", 700)
    off = np.flatnonzero(np.abs(bins.whiten(colour).y - white.y) > 1e-3)
    assert 0 < off.size < 300


def test_products_by_lag_are_those_of_some_noise():
    difference = 2.0, -1.0, 0.0, 0.0
    assert as_noise(np.array(difference)) == (pytest.approx(2.002), *difference[1:])
    for seed in range(50):
        rng = np.random.default_rng(seed)
        found = np.array(as_noise(np.append(4.0, rng.uniform(-4.0, 4.0, LAGS - 1))))
        at = np.flatnonzero(rng.uniform(size=80) < 0.8)
        apart = np.abs(at[:, None] - at[None, :])
        covariance = np.append(found, 0.0)[np.minimum(apart, LAGS)]
        assert np.linalg.eigvalsh(covariance).min() > 0.0
        assert np.all(
            np.isfinite(whiten_both(rng.standard_normal((at.size, 2)), at, Colour(0.0, tuple(found))))
        )


def test_the_correlation_before_a_fit_is_that_of_the_noise():
    """Against matrices written out: what is expected of a fit's residuals gives back the noise's correlation."""
    n, correlation = 300, 0.9
    t = np.arange(n)
    used = np.sin(t / 3.0) > -0.8
    columns = np.column_stack([np.ones(n), *(np.sin(t / k + k) for k in (10.0, 20.0, 35.0, 70.0))])
    Q = np.zeros(columns.shape)
    Q[used] = np.linalg.qr(columns[used])[0]
    P = np.diag(used.astype(float)) - Q @ Q.T
    left = P @ correlation ** np.abs(t[:, None] - t) @ P
    beside = np.count_nonzero(used[1:] & used[:-1])
    found = (np.trace(left, 1) / beside) / (np.trace(left) / np.count_nonzero(used))
    assert found < correlation - 0.03
    assert before_fit(found, columns, used) == pytest.approx(correlation, abs=2e-3)
    assert before_fit(0.0, columns, used) == 0.0
    many = np.ones((60_000, 1))
    assert before_fit(0.9, many, np.ones(60_000, dtype=bool)) == 0.9


@pytest.mark.parametrize(("sample", "width"), [(0.98, 10), (0.9, 4), (0.98, 7)])
@pytest.mark.parametrize("gaps", [False, True])
def test_means_of_an_autoregression_are_white_after_it(sample, width, gaps):
    """Against the covariance of means that is written out; an autoregression of the means leaves a tenth of it."""
    count = 120
    lag = np.abs(np.subtract.outer(np.arange(count * width), np.arange(count * width)))
    mean = np.kron(np.eye(count), np.ones(width) / width)
    covariance = mean @ sample**lag @ mean.T
    beside = covariance[0, 1] / covariance[0, 0]
    at = np.flatnonzero(RNG.uniform(size=count) < 0.8) if gaps else np.arange(count)
    covariance = covariance[np.ix_(at, at)]
    colour = of_means(beside, width)
    assert colour.correlation == pytest.approx(sample**width)
    white = whiten_both(np.eye(at.size), at, colour)
    after = white @ covariance @ white.T / covariance[0, 0]
    assert after == pytest.approx(np.eye(at.size), abs=1e-6)
    slow = np.ones(at.size) @ whiten(np.eye(at.size), np.diff(at), beside)
    taken = slow @ covariance @ slow / covariance[0, 0] / at.size
    assert abs(taken - 1.0) > 0.05


def test_single_samples_and_faint_correlations_are_left_as_they_are():
    assert of_means(0.9, 1) == Colour(0.9)
    assert of_means(0.2, 10) == Colour(0.2)


@pytest.mark.parametrize("correlation", [0.6, 0.9])
def test_clipping_hides_no_correlation(correlation):
    """Residuals are clipped at Huber's width, which takes more of a product than of a square."""
    rng, n = np.random.default_rng(1), 400_000
    noise = lfilter([1.0], [1.0, -correlation], rng.standard_normal(n))
    found = colour_of(noise, np.ones(n, dtype=bool), np.ones((n, 1)))
    assert found.correlation == pytest.approx(correlation, abs=0.003)


def test_a_correlation_below_its_standard_error_is_none():
    n, used, level = 2500, np.ones(2500, dtype=bool), np.ones((2500, 1))
    for _ in range(20):
        x = lfilter([1.0], [1.0, -0.02], RNG.standard_normal(n))
        large = 1.345 * 1.4826 * np.median(np.abs(x))
        clipped = np.clip(x, -large, large)
        correlation = (clipped[1:] @ clipped[:-1]) / (clipped @ clipped)
        if abs(correlation - 0.95 / np.sqrt(n)) > 0.1 / np.sqrt(n):  # clipping hides up to a twentieth
            assert (colour_of(x, used, level) == WHITE) == (correlation < 0.95 / np.sqrt(n))
