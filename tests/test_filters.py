"""Tests for filters.py."""

import numpy as np
import pytest

from backdrive import filters
from backdrive.errors import InvalidInput

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


def test_derivative_is_exact_on_parabolas_inside():
    np.testing.assert_allclose(filters.derivative(T**2, 1 / RATE)[1:-1], 2 * T[1:-1], atol=1e-9)


def test_shift_moves_later_and_broken_samples_interpolate():
    x = np.arange(6.0)
    np.testing.assert_allclose(filters.shift(x, 2)[2:], x[:-2])
    np.testing.assert_allclose(filters.shift(x, -0.5)[:-1], x[:-1] + 0.5)


@pytest.mark.parametrize(("cutoff", "rate"), [(0.0, 100.0), (-1.0, 100.0), (10.0, 0.0), (10.0, float("nan"))])
def test_senseless_corners_are_refused(cutoff, rate):
    with pytest.raises(InvalidInput):
        filters.low_pass(T, cutoff, rate)


def test_decimate_keeps_every_tenth():
    assert filters.decimate(T, 10).size == 400
    np.testing.assert_array_equal(filters.decimate(T, 1), T)
