"""Tests for identification/regression.py and curves.py against textbook results and brute force."""

import numpy as np
import pytest
from scipy.optimize import minimize

from backdrive.identification import curves, regression, robust

RNG = np.random.default_rng(1)
X = RNG.standard_normal((240, 3)) * [1.0, 10.0, 0.01]
THETA = np.array([1.0, -2.0, 300.0])
Y = X @ THETA + 0.1 * RNG.standard_normal(240)
BLOCK = regression.block_index(240, 8)
BLOCKS = regression.accumulate(X, Y, np.ones(240), BLOCK, 8)


def test_solution_is_that_of_numpy():
    expected = np.linalg.lstsq(X, Y, rcond=None)[0]
    np.testing.assert_allclose(
        regression.solve(BLOCKS.gram.sum(0), BLOCKS.moment.sum(0)), expected, rtol=1e-9
    )


def test_left_out_losses_are_those_of_refitting():
    losses = regression.block_losses(BLOCKS, regression.leave_one_out_solutions(BLOCKS))
    for b in range(8):
        rest = b != BLOCK
        theta = np.linalg.lstsq(X[rest], Y[rest], rcond=None)[0]
        expected = np.sum((Y[~rest] - X[~rest] @ theta) ** 2)
        assert losses[b] == pytest.approx(expected, rel=1e-6)


def test_mapping_the_equations_is_mapping_the_regressor():
    spread = RNG.standard_normal((3, 2))
    direct = regression.accumulate(X @ spread, Y, np.ones(240), BLOCK, 8)
    np.testing.assert_allclose(BLOCKS.map_columns(spread).gram, direct.gram, rtol=1e-9, atol=1e-9)


def test_standard_errors_cover_the_truth_under_correlated_noise():
    """Noise that lasts 20 samples: naive errors would be 4 times too small; the blocks' are not."""
    inside, trials = 0, 200
    for seed in range(trials):
        generator = np.random.default_rng(seed)
        n = 2000
        design = np.stack([np.ones(n), np.sin(np.arange(n) / 7.0)], axis=1)
        noise = np.repeat(generator.standard_normal(n // 20), 20)
        y = design @ [1.0, 2.0] + noise
        blocks = regression.accumulate(design, y, np.ones(n), regression.block_index(n, 20), 20)
        theta = regression.solve(blocks.gram.sum(0), blocks.moment.sum(0))
        error = np.sqrt(regression.sandwich(blocks, theta)[0, 0])
        inside += abs(theta[0] - 1.0) < 2 * error
    assert inside / trials > 0.88  # normal theory: 0.954, less for 20 blocks


def test_huber_ignores_wild_samples():
    y = Y.copy()
    y[::20] += 1000.0
    w = robust.robust_weights(X, y, np.ones(240))
    theta = regression.solve((X * w[:, None]).T @ X, (X * w[:, None]).T @ y)
    np.testing.assert_allclose(theta, THETA, rtol=0.05)


def huber_cost(theta, X, y, width):
    size = np.abs(y - X @ theta)
    return np.where(size <= width, 0.5 * size**2, width * (size - 0.5 * width)).sum()


@pytest.mark.parametrize("wild", [0.0, 0.1, 0.35])
@pytest.mark.parametrize("start", [None, 30.0])
def test_a_robust_fit_is_the_least_of_huber_s_loss(wild, start):
    rng = np.random.default_rng(7)
    X = rng.standard_normal((2000, 4)) * [1.0, 10.0, 0.01, 1.0]
    y = X @ [1.0, -2.0, 300.0, 0.5] + 0.1 * rng.standard_normal(2000)
    y += 5.0 * rng.standard_normal(2000) * (rng.uniform(size=2000) < wild)
    begin = None if start is None else np.full(4, start)
    theta = robust.robust_solution(X, y, np.ones(2000), rounds=30, start=begin)
    width = robust.HUBER * 1.4826 * float(np.median(np.abs(y - X @ theta)))
    best = minimize(
        huber_cost, theta, args=(X, y, width), method="Powell", options={"xtol": 1e-10, "ftol": 1e-14}
    )
    step = robust.SETTLED * width / np.linalg.norm(X, axis=0)
    assert theta == pytest.approx(best.x, abs=3.0 * float(step.max()), rel=1e-6)
    weights = robust.robust_weights(X, y, np.ones(2000), rounds=30)
    assert weights == pytest.approx(robust.huber_weights(y - X @ theta, width), abs=1e-3)


@pytest.mark.parametrize("share", [0.0, 0.05, 0.15])
def test_a_robust_fit_is_exact_after_few_rounds(share):
    rng = np.random.default_rng(3)
    X = rng.standard_normal((3000, 6))
    y = X @ np.arange(6.0) + 0.1 * rng.standard_normal(3000)
    y += 3.0 * rng.standard_normal(3000) * (rng.uniform(size=3000) < share)
    w = rng.uniform(0.2, 1.0, size=3000) * (rng.uniform(size=3000) < 0.9)
    theta = robust.robust_solution(X, y, w, rounds=4)
    residual = y - X @ theta
    width = robust.HUBER * robust.robust_spread(residual, w)
    pull = X.T @ (w * np.clip(residual, -width, width))
    assert np.abs(pull).max() < 2e-4 * width * np.sqrt(3000)  # by reweighting alone, up to 1e-3


@pytest.mark.parametrize("kind", ["spikes", "bursts", "cauchy", "leverage"])
def test_a_robust_fit_stays_with_the_many(kind):
    """Newton's method cycles on such data: weights are iterated until the solution is near."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        X, noise = rng.standard_normal((1000, 3)), 0.1 * rng.standard_normal(1000)
        if kind == "spikes":
            noise[rng.choice(1000, 20, replace=False)] = 1e3 * rng.standard_normal(20)
        elif kind == "bursts":
            for first in rng.integers(0, 950, size=4):
                noise[first : first + 50] += 300.0
        elif kind == "cauchy":
            noise = 0.1 * rng.standard_cauchy(1000)
        else:
            X[:8] *= 30.0
            noise[:8] = 20.0 * rng.standard_normal(8)
        theta = robust.robust_solution(X, X @ [1.0, 2.0, 3.0] + noise, np.ones(1000))
        assert theta == pytest.approx([1.0, 2.0, 3.0], abs=0.5 if kind == "leverage" else 0.05), seed


def test_a_column_that_wild_rows_alone_determine_does_not_run_away():
    X = np.stack([np.ones(200), (np.arange(200) < 3).astype(float)], axis=1)
    y = 0.1 * np.random.default_rng(2).standard_normal(200)
    y[:3] = [50.0, -40.0, 8.0]
    theta = robust.robust_solution(X, y, np.ones(200), rounds=50)
    assert theta[0] == pytest.approx(0.0, abs=0.02)
    assert theta[1] == pytest.approx(8.0, abs=0.5)  # nearly the median of the three


def test_every_coarse_curve_is_exact_on_the_fine_basis():
    knots = 2.0 * np.array(curves.SHARES)
    v = np.linspace(-2.5, 2.5, 501)
    coarse = {name: knots[list(keep)] for name, keep in curves.COARSE.items()}
    for form in curves.forms(knots, coarse, both_directions=True):
        r = form.spread.shape[1]
        c = np.abs(RNG.standard_normal(r))
        k = form.knots.size
        positive, negative = (c, c) if form.symmetric else (c[:k], c[k:])
        law = curves.to_law(form, c)
        got = curves.basis(v, knots) @ form.spread @ c
        inside = np.abs(v) <= 2.0
        np.testing.assert_allclose(got[inside & (v != 0)], law.torque(v)[inside & (v != 0)], atol=1e-12)
        assert float(law.torque(1e-12)) == pytest.approx(positive[0], abs=1e-9)
        assert float(law.torque(-1e-12)) == pytest.approx(-negative[0], abs=1e-9)


def test_a_falling_line_is_no_negative_viscosity():
    form = curves.forms(np.array([0.0, 1.0]), {"line": np.array([0.0, 1.0])}, both_directions=False)[0]
    law = curves.to_law(form, np.array([2.0, 1.0]))
    assert law.rate.NAME == "polyline"
    assert float(law.torque(0.5)) == 1.5


def test_a_column_of_one_block_alone_is_left_out_with_it():
    rng = np.random.default_rng(4)
    X, block = rng.standard_normal((400, 3)), np.repeat(np.arange(8), 50)
    X[block != 5, 2] = 0.0
    X[block == 6, 2] = 1e-97  # as whitening leaves behind a bin
    X[block == 5, 1] = 0.0
    y = X @ [1.0, -2.0, 3.0] + 0.1 * rng.standard_normal(400)
    whole, without = regression.solutions(regression.accumulate(X, y, np.ones(400), block, 8))
    assert whole == pytest.approx([1.0, -2.0, 3.0], abs=0.05)
    assert without[:, :2] == pytest.approx(np.tile([1.0, -2.0], (8, 1)), abs=0.05)
    assert abs(without[5, 2]) < 10.0 and np.delete(without[:, 2], 5) == pytest.approx(3.0, abs=0.1)


def test_equations_without_some_rows_are_those_of_the_others():
    rng, n = np.random.default_rng(11), 400
    X, y, w = rng.standard_normal((n, 3)), rng.standard_normal(n), rng.uniform(0.1, 1.0, n)
    block = regression.block_index(n, 8)
    out = (rng.uniform(size=n) < 0.3) | (block == 2)  # nothing is left of one block
    whole = regression.accumulate(X, y, w, block, 8)
    left = whole.less(regression.accumulate_rows(X, y, w[out], np.flatnonzero(out), block, 8))
    wanted = regression.accumulate(X, y, w * ~out, block, 8)
    for name in ("gram", "moment", "power"):
        assert getattr(left, name) == pytest.approx(getattr(wanted, name), abs=1e-12)
    assert left.rows == pytest.approx(wanted.rows) and left.rows[2] == 0.0


def test_robust_equations_are_those_of_the_robust_weights():
    rng, n = np.random.default_rng(12), 400
    X = rng.standard_normal((n, 3))
    y = X @ [1.0, 2.0, 3.0] + rng.standard_t(2.0, n)
    block, w = regression.block_index(n, 8), (rng.uniform(size=n) < 0.8).astype(float)
    blocks, weights = robust.robust_blocks(X, y, w, block, regression.accumulate(X, y, w, block, 8))
    assert weights == pytest.approx(robust.robust_weights(X, y, w), abs=1e-9)
    assert weights.min() == 0.0 and 0.0 < weights[w > 0].min() < 1.0
    wanted = regression.accumulate(X, y, weights, block, 8)
    assert blocks.gram == pytest.approx(wanted.gram) and blocks.moment == pytest.approx(wanted.moment)
    assert blocks.power == pytest.approx(wanted.power) and blocks.rows == pytest.approx(wanted.rows)
