"""Faster ways give what the usual ones of NumPy do: quantiles, bases, waves, sums of windows, and headers of arrays."""

from __future__ import annotations

import io

import numpy as np
import pytest

from backdrive.identification.projection import inverse_of, orthonormal
from backdrive.identification.residual import TURN
from backdrive.identification.waves import sums_by_place, waves_at
from backdrive.logs.health._motion import _skip, running, sparse
from backdrive.logs.quantiles import at_rank, median, quantile
from backdrive.logs.readers import npz


@pytest.mark.parametrize("n", [1, 2, 3, 10, 999, 1000])
def test_quantiles_are_those_of_numpy(n):
    x = np.random.default_rng(n).standard_normal(n)
    assert median(x) == pytest.approx(np.median(x), rel=1e-14)
    for share in (0.0, 0.005, 0.37, 0.9, 0.995, 1.0):
        assert quantile(x, share) == pytest.approx(np.quantile(x, share), rel=1e-14, abs=1e-15)
    x[n // 2] = np.nan
    assert np.isnan(median(x)) and np.isnan(quantile(x, 0.9)) and np.isnan(quantile(x[:0], 0.5))


@pytest.mark.parametrize("n", [1000, 1001, 5000, 40_000])
@pytest.mark.parametrize("kind", ["drawn", "sorted", "equal", "few", "infinite", "far", "unknown"])
def test_a_rank_of_a_series_and_the_next_are_found(n, kind):
    rng = np.random.default_rng(n)
    x = {
        "drawn": rng.standard_normal(n),
        "sorted": np.sort(rng.standard_normal(n)),
        "equal": np.full(n, 3.0),
        "few": rng.integers(0, 3, n).astype(float),
        "infinite": np.where(rng.uniform(size=n) < 0.3, np.inf, -rng.uniform(size=n)),
        "far": 1e200 * rng.standard_normal(n),
        "unknown": np.where(rng.uniform(size=n) < 0.1, np.nan, rng.standard_normal(n)),
    }[kind]
    ordered, before = np.sort(x), x.copy()
    for rank in (0, 1, n // 3, (n - 1) // 2, round(0.79 * n), n - 2, n - 1):
        wanted = ordered[rank], ordered[-1] if np.isnan(ordered[-1]) else ordered[min(rank + 1, n - 1)]
        assert np.array_equal(at_rank(x, rank), wanted, equal_nan=True)
    assert np.array_equal(x, before, equal_nan=True)
    assert quantile(x, 0.3) == pytest.approx(np.quantile(x, 0.3), nan_ok=True)


@pytest.mark.parametrize("apart", [1.0, 1e-4, 1e-9, 0.0])
def test_a_basis_spans_the_columns_and_leaves_out_what_depends_on_others(apart):
    draws = np.random.default_rng(5).standard_normal((300, 4))
    columns = np.column_stack([draws[:, :3], 20.0 * (draws[:, 0] + apart * draws[:, 3])])
    basis, wanted = orthonormal(columns), 4 if apart > 1e-6 else 3
    assert basis.shape == (300, wanted)
    assert basis.T @ basis == pytest.approx(np.eye(wanted), abs=1e-12)
    assert basis @ (basis.T @ columns) == pytest.approx(columns, abs=1e-7)


def test_small_matrices_are_inverted_unless_they_are_nearly_singular():
    for matrix in (np.array([[4.0]]), np.array([[2.0, 0.3], [0.3, 0.5]])):
        assert inverse_of(matrix) == pytest.approx(np.linalg.inv(matrix))
    for matrix in (np.zeros((1, 1)), np.ones((2, 2)), np.eye(3)):
        assert inverse_of(matrix) is None


@pytest.mark.parametrize("count", [1, 3, 16, 17, 50])
def test_waves_are_sines_and_cosines_of_each_wave_number(count):
    position, waves = np.linspace(-1.0, 2.0, 40), 2.1 + 0.7 * np.arange(count)
    numbers: list[int] = []
    for rows, sine, cosine in waves_at(position, 2.1, 0.7, count):
        phase = waves[rows, None] * position
        assert sine == pytest.approx(np.sin(phase), abs=1e-12)
        assert cosine == pytest.approx(np.cos(phase), abs=1e-12)
        numbers += range(count)[rows]
    assert numbers == list(range(count))


@pytest.mark.parametrize("width", [3, 5, 11, 31, 101])
def test_running_means_are_three_convolutions(width):
    x, box = np.random.default_rng(width).standard_normal(400), np.ones(width) / width
    wanted = x
    for _ in range(3):
        wanted = np.convolve(wanted, box, "valid")
    assert running(x, width) == pytest.approx(wanted, abs=1e-13)


@pytest.mark.parametrize("value", [np.arange(3.0), np.zeros((2, 5), np.float32), np.array(4), np.asfortranarray(np.ones((2, 3))),
                                   np.ones(3, ">f8"), np.ones(2, bool), np.zeros(2, [("a", "f8")])])  # fmt: skip
def test_a_header_is_read_as_numpy_reads_it(value):
    file = io.BytesIO()
    np.save(file, value)
    file.seek(0)
    version = np.lib.format.read_magic(file)
    at = file.tell()
    wanted = np.lib.format.read_array_header_1_0(file)
    file.seek(at)
    assert npz._header(file, version) == wanted


@pytest.mark.parametrize("width", [0.05, 0.4, 1e-9])
def test_rows_at_the_same_place_are_added(width):
    rng = np.random.default_rng(8)
    position, series = rng.uniform(-1.0, 2.0, 500), rng.standard_normal((500, 3))
    places, sums = sums_by_place(position, series, width)
    if width < 1e-6:  # as many intervals as positions
        assert places is position and sums is series
        return
    cell = np.floor((position - position.min()) / width).astype(int)
    assert np.array_equal(np.unique(cell).size, places.size)
    for k, one in enumerate(np.unique(cell)):
        assert places[k] == pytest.approx(position[cell == one].mean())
        assert sums[k] == pytest.approx(series[cell == one].sum(axis=0))


@pytest.mark.parametrize("count", [3, 17, 60])
def test_the_best_wave_is_that_of_all_positions(count):
    """The search adds means at nearly the same place; brute force does not."""
    rng, n = np.random.default_rng(count), 3000
    position = 1.2 * np.sin(np.linspace(0.0, 60.0, n))
    wave = 2.0 * np.pi * count / np.ptp(position)
    error = 0.3 * np.sin(wave * position + 0.4) + rng.standard_normal(n)
    tried = wave * np.linspace(0.8, 1.2, 161)
    turn = TURN / tried[-1]
    places, sums = sums_by_place(position, np.column_stack([error, np.ones(n)]), turn)
    exact, fast = (
        [np.abs(np.exp(1j * w * x) @ e) for w in tried] for x, e in ((position, error), (places, sums[:, 0]))
    )
    assert np.argmax(fast) == np.argmax(exact)
    assert max(fast) == pytest.approx(max(exact), rel=0.03)


@pytest.mark.parametrize("width", [3, 7, 15, 31, 61, 301])
@pytest.mark.parametrize("reach", [0, 7, 20])
def test_means_of_some_samples_are_those_of_all(width, reach):
    rng = np.random.default_rng(width + reach)
    smooth = running(rng.standard_normal(30 * width + 2 * reach + 500), max(width // 3, 1) | 1)
    x = np.array([smooth, np.sign(np.sin(np.arange(smooth.size) / (2.0 * width)))])
    skip = _skip(width)
    assert width // 2 % skip == 0 and (skip > 1 or width < 31)
    every = sparse(x, width, reach)
    some = sparse(x[:, reach % skip :: skip], width, reach, skip, x.shape[1])
    assert some.shape == every.shape
    assert some[0] == pytest.approx(every[0], abs=0.01 * smooth.std())
    assert some[1] == pytest.approx(every[1], abs=0.8 * skip / width if skip > 1 else 1e-12)  # where it jumps
    whole = np.array([running(row, width) for row in x])[:, reach : x.shape[1] - 3 * (width - 1) - reach]
    assert every == pytest.approx(whole[:, :: width // 2], abs=1e-9)
