"""Whether two fits agree, by draws of coloured noise: least squares against that with the true covariance."""

import numpy as np
import pytest

from backdrive.identification.agreement import agree


def fits(draws: int, shift: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how far an efficient fit is from a plain one, (draws, 2), and the standard errors of both, (2,) each."""
    n, rng = 120, np.random.default_rng(3)
    lags = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    covariance = 0.95**lags
    X = np.column_stack([np.sign(np.sin(0.31 * np.arange(n))), np.linspace(-1.0, 1.0, n)])
    noise = np.linalg.cholesky(covariance) @ rng.standard_normal((n, draws))
    noise += shift * np.abs(np.sin(0.31 * np.arange(n)))[:, None] * X[:, :1]  # what the columns lack
    plain = np.linalg.pinv(X)
    inverse = np.linalg.inv(covariance)
    best = np.linalg.solve(X.T @ inverse @ X, X.T @ inverse)
    errors = [np.sqrt(np.diag(map_ @ covariance @ map_.T)) for map_ in (plain, best)]
    return ((best - plain) @ noise).T, errors[0], errors[1]


def test_two_fits_of_the_same_law_agree():
    moved, before, after = fits(400)
    assert np.all(after < before)
    assert np.mean([agree(m, before, after) for m in moved]) > 0.99


def test_the_difference_is_as_large_as_its_variance_says():
    moved, before, after = fits(4000)
    assert moved.std(axis=0) == pytest.approx(np.sqrt(before**2 - after**2), rel=0.05)


def test_what_the_law_lacks_moves_one_of_them():
    moved, before, after = fits(100, shift=20.0)
    assert not any(agree(m, before, after) for m in moved)


def test_errors_of_numbers_from_other_samples_add():
    before, after = np.array([1.0]), np.array([0.9])
    moved = np.array([4.0])
    assert not agree(moved, before, after)
    assert agree(moved, before, after, np.array([True]))
