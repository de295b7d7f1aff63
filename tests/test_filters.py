"""Tests for filters.py."""

import numpy as np
import pytest

from backdrive.errors import InvalidInput
from backdrive.logs import filters

RATE = 1000.0
T = np.arange(4000) / RATE


def test_low_pass_keeps_slow_and_takes_fast_without_delay():
    slow, fast = np.sin(2 * np.pi * 2.0 * T), np.sin(2 * np.pi * 200.0 * T)
    got = filters.low_pass(slow + fast, 20.0, RATE)
    np.testing.assert_allclose(got[500:-500], slow[500:-500], atol=2e-3)


def test_low_pass_of_columns_is_that_of_each():
    x = np.stack([T, T**2], axis=1)
    np.testing.assert_allclose(filters.low_pass(x, 10.0, RATE)[:, 1], filters.low_pass(x[:, 1], 10.0, RATE))


def test_gain_at_the_corner_is_one_half_after_both_passes():
    x = np.sin(2 * np.pi * 20.0 * T)
    got = filters.low_pass(x, 20.0, RATE)
    assert np.max(np.abs(got[1000:-1000])) == pytest.approx(0.5, abs=0.005)


def test_derivative_is_exact_on_quartics_two_samples_from_the_ends_and_multiplies_waves_by_its_gain():
    np.testing.assert_allclose(
        filters.derivative(T**4, 1 / RATE)[2:-2], 4 * T[2:-2] ** 3, rtol=1e-8, atol=1e-9
    )
    frequency = np.array([0.01, 0.05, 0.2])
    wave = np.sin(2.0 * np.pi * np.outer(np.arange(200), frequency))
    slope = np.cos(2.0 * np.pi * np.outer(np.arange(200), frequency)) * filters.gain_of_derivative(frequency)
    np.testing.assert_allclose(filters.derivative(wave, 1.0)[2:-2], slope[2:-2], atol=1e-12)


def test_derivative_is_exact_on_parabolas_inside():
    np.testing.assert_allclose(filters.derivative(T**2, 1 / RATE)[1:-1], 2 * T[1:-1], atol=1e-9)


@pytest.mark.parametrize(("cutoff", "rate"), [(0.0, 100.0), (-1.0, 100.0), (10.0, 0.0), (10.0, float("nan"))])
def test_senseless_corners_are_refused(cutoff, rate):
    with pytest.raises(InvalidInput):
        filters.low_pass(T, cutoff, rate)


@pytest.mark.parametrize("cutoff", [5.0, 40.0, 200.0])
def test_low_pass_is_that_of_scipy_away_from_the_ends(cutoff):
    from scipy.signal import butter, sosfiltfilt

    x = np.cumsum(np.random.default_rng(0).standard_normal(T.size))
    expected = sosfiltfilt(butter(4, cutoff, fs=RATE, output="sos"), x)
    got = filters.low_pass(x, cutoff, RATE)
    inner = slice(800, -800)
    np.testing.assert_allclose(got[inner], expected[inner], atol=1e-6 * np.ptp(x))


def test_a_straight_line_passes_unchanged_to_its_very_ends():
    np.testing.assert_allclose(filters.low_pass(3.0 - 2.0 * T, 5.0, RATE), 3.0 - 2.0 * T, atol=1e-2)


@pytest.mark.parametrize("n", [2, 3, 7, 50, 999])
def test_short_signals_keep_their_length_and_constants(n):
    np.testing.assert_allclose(filters.low_pass(np.full(n, 3.0), 2.0, RATE), 3.0, atol=1e-12)


@pytest.mark.parametrize("n", [2, 3, 97, 1000, 1025, 123457])
def test_fft_length_is_small_and_smooth(n):
    length = rest = filters.fft_length(n)
    for factor in (2, 3, 5):
        while rest % factor == 0:
            rest //= factor
    assert rest == 1
    assert n <= length <= max(2, 1.35 * n)
    assert length % 2 == 0


@pytest.mark.parametrize(
    ("cutoff", "order"), [(100.0, 4), (7.0, 4), (40.0, 2), (40.0, 8), (440.0, 4), (440.0, 8)]
)
def test_a_long_series_is_filtered_in_pieces_as_if_whole(monkeypatch, cutoff, order):
    x = np.cumsum(np.random.default_rng(3).standard_normal((2, 70_000)), axis=1)
    monkeypatch.setattr(filters, "CIRCLE", 1 << 20)
    whole = filters.low_pass_rows(x, cutoff, 1000.0, order)
    monkeypatch.setattr(filters, "CIRCLE", 1 << 11)
    pieces = filters.low_pass_rows(x, cutoff, 1000.0, order)
    np.testing.assert_allclose(pieces, whole, atol=2e-13 * np.abs(whole).max(), rtol=0.0)
    assert np.array_equal(filters.low_pass_rows(x.tolist(), cutoff, 1000.0, order), pieces)


@pytest.mark.parametrize("n", [1000, 9880, 70_000])
def test_a_log_that_ends_elsewhere_and_at_speed_bends_neither_end(n):
    t = np.arange(n) / RATE
    w = np.pi * np.round(1.4 * t[-1]) / t[-1]  # so that the sine is odd about both ends
    filtered = filters.low_pass(3.0 * t / t[-1] + 0.5 * np.sin(w * t), 50.0, RATE)
    acceleration = filters.derivative(filters.derivative(filtered, 1.0 / RATE), 1.0 / RATE)
    assert acceleration[2:-2] == pytest.approx(-0.5 * w**2 * np.sin(w * t[2:-2]), abs=0.01)
