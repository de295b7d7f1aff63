"""Stated errors of a search against the scatter of its estimates, under white, coloured and unsteady noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from backdrive import Joint, Log, identify
from backdrive.identification.dynamic.covariance import search_covariance
from backdrive.identification.noise import LONGEST

N, DRAWS = 6000, 150


def columns(n: int = N) -> np.ndarray:
    """Return the derivatives of a joint that moves to and fro, (n, 4)."""
    v = np.sin(np.linspace(0.0, 60.0, n)) + 0.6 * np.sin(np.linspace(1.0, 140.0, n))
    return np.stack([np.sign(v), v, np.gradient(v) * 100.0, np.ones(n)], axis=1)


def coloured(rng: np.random.Generator, n: int, colour: float) -> np.ndarray:
    """Return an AR(1) of unit variance, (n,)."""
    white = rng.standard_normal(n)
    return lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white, zi=[white[0] * colour])[0]


def scores(noise_of, X: np.ndarray, instants: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return errors by stated standard errors, (DRAWS, p), and the latter by the scatter of the estimates, (DRAWS, p)."""
    rng, fit = np.random.default_rng(3), np.linalg.pinv(X)
    found, stated = [], []
    for _ in range(DRAWS):
        e = noise_of(rng)
        found.append(fit @ e)
        left = X @ found[-1] - e
        free, weight = np.ones(X.shape[1], dtype=bool), np.ones(len(e))
        matrix = search_covariance(X, left, weight, free, instants=instants).matrix
        stated.append(np.sqrt(np.diag(matrix)))
    return np.array(found) / np.array(stated), np.array(stated) / np.std(found, axis=0)


@pytest.mark.parametrize("colour", [0.0, 0.9, 0.98])
def test_the_stated_errors_are_those_of_the_estimates(colour):
    z, _ = scores(lambda rng: coloured(rng, N, colour), columns())
    assert np.all(np.sqrt(np.mean(z**2, axis=0)) < 1.15)
    assert np.all(np.sqrt(np.mean(z**2, axis=0)) > 0.75)
    assert 0.91 < np.mean(np.abs(z) < 1.96) < 0.99


def test_white_noise_does_not_widen_the_errors():
    X = columns()
    free, weight = np.ones(4, dtype=bool), np.ones(N)
    plain, ratio = np.sqrt(np.diag(np.linalg.inv(X.T @ X))), []
    for seed in range(40):
        e = np.random.default_rng(seed).standard_normal(N)
        left = X @ np.linalg.lstsq(X, e, rcond=None)[0] - e
        ratio.append(np.sqrt(np.diag(search_covariance(X, left, weight, free).matrix)) / plain)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.03)


def test_gaps_and_records_count():
    counted = np.ones(N, dtype=bool)
    counted[np.arange(N) % 50 < 12] = False  # samples about reversals
    rows = np.flatnonzero(counted)
    instants = rows + (rows >= N // 2) * LONGEST

    def noise_of(rng: np.random.Generator) -> np.ndarray:
        return np.concatenate([coloured(rng, N // 2, 0.98) for _ in range(2)])[rows]

    z, _ = scores(noise_of, columns()[rows], instants)
    assert np.all(np.sqrt(np.mean(z**2, axis=0)) < 1.15)


def test_noise_where_a_parameter_acts_counts_there():
    X = np.column_stack([columns(), np.zeros(N)])
    X[2000:2600, 4] = 1.0  # acts for a while, in which the noise is large and slow
    size = np.where(X[:, 4] > 0.0, 10.0, 1.0)

    def noise_of(rng: np.random.Generator) -> np.ndarray:
        return size * np.where(X[:, 4] > 0.0, coloured(rng, N, 0.9), rng.standard_normal(N))

    _, stated = scores(noise_of, X)
    assert np.median(stated[:, 4]) > 0.6


def crossing_log(seed: int, width: float = 0.04) -> Log:
    """Return a log of fast and slow motion whose friction crosses zero over a range of speeds: 2 tanh(v / width) + 0.5 v."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 30.0, 0.005)
    slow = 0.05 * np.tanh(4.0 * np.sin(0.4 * np.pi * t))
    v = np.where(t < 20.0, 1.5 * np.sin(0.4 * np.pi * t) * (0.6 + 0.4 * np.cos(0.7 * t)), slow)
    position = 0.005 * np.cumsum(v)
    torque = 0.2 * np.gradient(v, 0.005) + 2.0 * np.tanh(v / width) + 0.5 * v
    noisy = torque + 0.06 * rng.standard_normal(t.size)
    return Log(
        time=t, joints=(Joint(name="joint", unit="rad"),), position=position[:, None], torque=noisy[:, None]
    )


def test_a_straight_line_leaves_out_a_smooth_crossing_of_zero():
    z = []
    for seed in range(5):
        joint = identify(crossing_log(seed), law="coulomb-viscous").model.joints[0]
        error = joint.law.rate.coulomb_positive - 2.0
        z.append(error / joint.standard_errors["coulomb_positive"])
    assert np.sqrt(np.mean(np.square(z))) < 2.0


def build_up_log(seed: int, width: float = 0.004) -> Log:
    """Return a log of a joint whose friction of 2 N.m changes its sign over a distance after each reversal, as a bristle bends."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 30.0, 0.005)
    waves = [(k, rng.uniform(0.0, 6.3)) for k in (1.0, 2.3, 4.1, 7.7)]
    v = sum(np.cos(0.44 * k * t + phase) for k, phase in waves) * 0.4
    position = 0.005 * np.cumsum(v)
    way, friction = 0.0, np.empty(t.size)
    for i, speed in enumerate(v):
        way += 0.005 * (speed - abs(speed) * way / width)  # Dahl's bristle
        friction[i] = 2.0 * way / width
    torque = 0.2 * np.gradient(v, 0.005) + friction + 0.5 * v + 0.06 * rng.standard_normal(t.size)
    return Log(
        time=t, joints=(Joint(name="joint", unit="rad"),), position=position[:, None], torque=torque[:, None]
    )


def test_a_straight_line_leaves_out_the_build_up_of_friction_after_reversals():
    z = []
    for seed in range(5):
        joint = identify(build_up_log(seed), law="coulomb-viscous").model.joints[0]
        error = joint.law.rate.coulomb_positive - 2.0
        z.append(error / joint.standard_errors["coulomb_positive"])
    assert np.sqrt(np.mean(np.square(z))) < 2.5


@pytest.mark.parametrize("width", [11, 20, 400])
def test_residuals_of_bins_of_any_width_are_neighbours(width):
    rng, n = np.random.default_rng(1), 1500
    X, residual = columns(n), coloured(rng, n, 0.4)
    at = np.arange(n) + 2 * LONGEST * (np.arange(n) >= 900)  # two records

    def errors(instants):
        return search_covariance(X, residual, np.ones(n), np.ones(4, dtype=bool), instants=instants).matrix

    np.testing.assert_allclose(errors(at * width), errors(at), rtol=0.02)
