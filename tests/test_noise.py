"""Tests for identification/noise.py: errors of sums of correlated samples, against matrices written out and known processes."""

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from backdrive.identification import lag_products, noise
from backdrive.identification.noise import Noise, noise_of, taper
from backdrive.identification.signals import prepare
from backdrive.identification.sweep import sweep_knots
from backdrive.identification.sweep_delay import sweep_delay
from backdrive.identification.sweep_windows import windows
from backdrive.laws import CoulombViscous, Law
from backdrive.plans import Sweep
from backdrive.simulation.machines import joint_1
from backdrive.simulation.open_loop import simulate

RHO = np.array([1.0, 0.5, 0.1, -0.2])
DRY = Law(
    rate=CoulombViscous(
        coulomb_positive=8.0, coulomb_negative=8.0, viscous_positive=3.0, viscous_negative=3.0
    )
)


def matrix(n):
    return toeplitz(np.r_[RHO, np.zeros(n - RHO.size)])


def test_the_covariance_of_sums_is_that_of_the_matrix_written_out():
    z = np.random.default_rng(0).standard_normal((3, 40))
    found = Noise(correlation=RHO, size=np.array([7.0, 1.5]), widening=np.ones(2)).covariance(z, 1)
    assert found == pytest.approx(1.5**2 * z @ matrix(40) @ z.T, rel=1e-12)


@pytest.mark.parametrize("degree", [1, 3])
def test_what_a_fit_takes_from_the_products_is_that_of_the_projected_matrix(degree):
    Q = noise._basis(np.sin(np.linspace(1.0, 2.0, 40)), degree)
    P = np.eye(40) - Q @ Q.T
    missing = matrix(40) - P @ matrix(40) @ P
    expected = [np.trace(missing, lag) for lag in range(12)]
    assert noise._fit_loss(Q, lag_products.products(Q, 12), RHO) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("weights", [np.ones(1), np.array([1.0, 0.6, 0.2]), np.array([1.0, -0.5])])
def test_the_error_of_a_mean_is_that_of_a_moving_average_process(weights):
    rng, lengths = np.random.default_rng(3), (400, 200, 100, 60, 40) * 2
    speeds = [np.cos(np.linspace(-0.6, 0.6, n)) for n in lengths]
    found = []
    for _ in range(60):
        runs = [np.convolve(rng.standard_normal(n + weights.size - 1), weights, "valid") for n in lengths]
        left = noise_of(runs, speeds)
        means = [left.covariance(np.full((1, n), 1.0 / n), i)[0, 0] for i, n in enumerate(lengths)]
        found.append(means / left.widening**2)
    autocovariance = np.convolve(weights, weights[::-1])[weights.size - 1 :]
    for n, value in zip(lengths, np.mean(found, axis=0), strict=True):
        rho = np.r_[autocovariance, np.zeros(n - weights.size)]
        assert value == pytest.approx(toeplitz(rho).sum() / n**2, rel=0.12)


def test_weights_are_one_as_far_as_a_correlation_is_seen_and_fall_from_there():
    seen = np.array([1.0, 0.5, 0.3, 0.0, 0.4] + [0.001] * 30)
    wanted = np.array([1.0, 0.5, 0.3, 0.0, 0.4, 0.001 * 0.75, 0.001 * 0.5, 0.001 * 0.25])
    assert taper(seen, 10_000) == pytest.approx(wanted)
    assert taper(np.array([1.0] + [0.001] * 30), 10_000) == pytest.approx([1.0])


def test_noise_without_a_size_and_runs_of_a_few_samples_do_no_harm():
    silent = noise_of([np.zeros(30), np.zeros(5)], [np.arange(30.0), np.arange(5.0)], degree=3)
    assert silent.covariance(np.ones((1, 30)), 0)[0, 0] == pytest.approx(0.0, abs=1e-24)
    short = noise_of([np.array([0.1, -0.2, 0.3])], [np.ones(3)])
    assert np.isfinite(short.covariance(np.ones((1, 3)), 0)).all()


def test_knots_and_delay_scatter_as_much_as_their_errors_say():
    delay, plan = 2e-3, Sweep(np.deg2rad(20.0), 2.0, 5)
    plant = joint_1().replace(law=DRY, torque_noise=0.2, delay=delay)
    torque, stated, delays = [], [], []
    for seed in range(36):
        log = simulate(plant, plan, seed=seed)
        knots = sweep_knots(log, 0, delay=delay)
        torque.append(np.concatenate([knots.F_pos, knots.F_neg]))
        stated.append(np.concatenate([knots.error_pos, knots.error_neg]))
        parts = prepare(log, 0)
        delays.append(sweep_delay(parts, windows(log, 0, log.plan, parts)))
    ratio = np.std(torque, axis=0, ddof=1) / np.sqrt(np.mean(np.square(stated), axis=0))
    assert 0.9 < ratio.mean() < 1.1
    assert np.mean(delays, axis=0)[0] == pytest.approx(delay, abs=0.04e-3)
    scatter = np.std(delays, axis=0, ddof=1)[0] / np.mean(delays, axis=0)[1]
    assert 0.75 < scatter < 1.25  # of 36


def test_few_independent_samples_widen_as_student_s_quantile_does():
    rng = np.random.default_rng(4)
    lengths = (2000, 30)
    runs = [rng.standard_normal(n) for n in lengths]
    left = noise_of(runs, [np.linspace(-1.0, 1.0, n) for n in lengths])
    freedom = np.array(lengths) / (1.0 + 2.0 * left.correlation[1:].sum()) + 10.0 - 2.0
    assert left.widening == pytest.approx(stats.t.ppf(0.99865, freedom) / 3.0, rel=1e-4)
    assert left.widening[0] < 1.005 < left.widening[1]


def test_what_a_fit_takes_from_white_noise_is_the_sum_along_each_diagonal_of_its_hat_matrix():
    random = np.random.default_rng(5)
    X = random.standard_normal((40, 4))
    X[10:15] = 0.0  # samples that are not used
    inverse = np.linalg.inv(X.T @ X)
    hat = X @ inverse @ X.T
    wanted = [np.trace(hat, offset=lag) for lag in range(30)]
    each = lag_products.transforms(X, 30)
    assert lag_products.white_loss(each, inverse, 30) == pytest.approx(wanted, abs=1e-12)


def test_a_short_log_s_fit_of_smooth_terms_scatters_as_it_says():
    t = np.linspace(0.0, 1.0, 130)
    X = np.column_stack([np.cos(k * np.pi * t) for k in range(8)])
    random, used = np.random.default_rng(6), np.ones(t.size, dtype=bool)
    scaled = []
    for _ in range(600):
        e = random.standard_normal(t.size)
        theta = np.linalg.lstsq(X, e, rcond=None)[0]
        scaled.append(theta / np.sqrt(np.diag(noise.covariance_of_fit(X, e - X @ theta, used))))
    # 1.11 where the autocovariance of the residuals is taken for that of the noise
    assert 0.93 < np.sqrt(np.mean(np.square(scaled))) < 1.04
    assert 0.93 < np.mean(np.abs(scaled) < 1.96) < 0.965


def test_what_a_fit_takes_of_coloured_noise_is_that_of_the_projected_matrix():
    rng, n = np.random.default_rng(7), 60
    used = rng.uniform(size=n) < 0.8
    X = rng.standard_normal((n, 3)) * used[:, None]
    inverse = np.linalg.inv(X.T @ X)
    G = matrix(n) * np.outer(used, used)
    H = X @ inverse @ X.T
    missing = G - (np.eye(n) - H) @ G @ (np.eye(n) - H)
    expected = [np.trace(missing, lag) for lag in range(12)]
    assert noise._loss_of_colour(X, used, inverse, RHO, 12) == pytest.approx(expected, abs=1e-12)


def test_errors_of_a_fit_to_slow_noise_cover_what_they_promise():
    """Coefficients of slow columns under an autoregression that forgets in 50 samples: the mean squared error is the stated one."""
    rng, n, z = np.random.default_rng(11), 3000, []
    t = np.arange(n) / 200.0
    X = np.column_stack([np.ones(n), *(np.sin(2.0 * np.pi * f * t + f) for f in (0.2, 0.35, 0.6, 1.0, 1.7))])
    inverse = np.linalg.inv(X.T @ X)
    for _ in range(150):
        drawn = rng.standard_normal(n) * np.sqrt(1.0 - 0.98**2)
        drawn[0] /= np.sqrt(1.0 - 0.98**2)
        e = lfilter([1.0], [1.0, -0.98], drawn)
        theta = inverse @ X.T @ e
        covariance = noise.covariance_of_fit(X, e - X @ theta, np.ones(n, dtype=bool))
        z.append(theta / np.sqrt(np.diag(covariance)))
    assert float(np.sqrt(np.mean(np.square(z)))) == pytest.approx(1.0, abs=0.1)
    assert float(np.mean(np.abs(z) < 1.96)) == pytest.approx(0.95, abs=0.03)


def test_errors_hold_where_runs_are_shorter_than_the_noise_remembers():
    """Of slow noise in a few short runs, the correlation is seen to a part of its length only."""
    rng, sizes, far = np.random.default_rng(12), 2 * [207, 110, 75, 55, 44], []
    speeds = [1.0 - np.linspace(-1.0, 1.0, n) ** 2 for n in sizes]
    for _ in range(100):
        runs = [autoregression(rng, n, 0.95) for n in sizes]
        found = noise_of(runs, speeds)
        for k in (0, 5):
            mean = np.full((1, sizes[k]), 1.0 / sizes[k])
            far.append(runs[k].mean() / np.sqrt(found.covariance(mean, k)[0, 0]))
    assert np.mean(np.abs(far) > 3.0) <= 0.05  # 0.095 by what is seen of the correlation
    assert 0.3 < np.median(np.abs(far)) < 0.9


def autoregression(rng, size, correlation):
    e, x = rng.standard_normal(size + 200), np.zeros(size + 200)
    for k in range(1, x.size):
        x[k] = correlation * x[k - 1] + e[k]
    return x[200:]
