"""Residuals that repeat with the motion: their errors do not shrink with the number of cycles. Joints and truth are made here."""

import numpy as np
import pytest

from backdrive import Log, identify
from backdrive.identification.lag_products import sums
from backdrive.identification.noise import covariance_of_scores
from backdrive.identification.repeats import with_repeats

CYCLES, EACH = 12, 150


def scatter(share: float, draws: int = 60) -> np.ndarray:
    """Return the estimates of three coefficients by their stated errors, where a share of the noise's power repeats, (draws, 3)."""
    n, rng = CYCLES * EACH, np.random.default_rng(5)
    phase = 2.0 * np.pi * np.arange(n) / EACH
    X = np.column_stack([np.ones(n), np.sin(phase), np.sign(np.sin(phase + 0.3))])
    inverse, used = np.linalg.inv(X.T @ X), np.ones(n, dtype=bool)
    found = []
    for _ in range(draws):
        noise = np.sqrt(share) * np.tile(rng.standard_normal(EACH), CYCLES)
        noise += np.sqrt(1.0 - share) * rng.standard_normal(n)
        theta = inverse @ X.T @ noise
        middle, _ = covariance_of_scores(X, noise - X @ theta, used, inverse)
        found.append(theta / np.sqrt(np.diag(inverse @ middle @ inverse)))
    return np.array(found)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8])
def test_errors_hold_where_residuals_repeat(share):
    assert 0.8 < np.sqrt(np.mean(scatter(share) ** 2)) < 1.25


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_noise_that_does_not_repeat_gets_no_further_lags(correlation):
    near = correlation ** np.arange(40.0)
    for seed in range(40):
        noise = np.random.default_rng(seed).standard_normal(2000)
        for k in range(1, noise.size):
            noise[k] += correlation * noise[k - 1]
        total, counts = sums(np.stack([noise, np.ones(noise.size)]), noise.size)
        assert with_repeats(near, total, counts).size == near.size


def log_of(seed: int, rate: float = 1000.0, amplitude: float = 1.0) -> Log:
    """Return a log of a motion that repeats, of a joint with inertia 1, Coulomb friction 5, viscous 3 and gravity 10 sin q."""
    rng, t = np.random.default_rng(seed), np.arange(int(30 * rate)) / rate
    a, phase, w = rng.standard_normal(6), rng.uniform(0.0, 2.0 * np.pi, 6), 0.8 * np.pi * np.arange(1, 7)
    angle = np.outer(t, w) + phase
    size = amplitude / np.abs(np.cos(angle) @ a).max()
    q, v, acceleration = (
        size * f(angle) @ (a * w**k) for f, k in ((np.sin, -1), (np.cos, 0), (lambda x: -np.sin(x), 1))
    )
    torque = acceleration + 10.0 * np.sin(q) + 5.0 * np.sign(v) + 3.0 * v + 0.1 * rng.standard_normal(t.size)
    count = 2.0 * np.pi / 2**19
    return Log.from_arrays(time=t, position=count * np.round(q / count), torque=torque)


def worst(log: Log) -> tuple[float, float]:
    """Return how far the curve is from the truth at its knots, and inertia and gravity, by stated errors."""
    friction = identify(log, method="motion").model.joints[0]
    rate, errors = friction.law.rate, friction.standard_errors
    if hasattr(rate, "velocity"):
        truth = 5.0 + 3.0 * np.array(rate.velocity)
        curve = [
            (np.array(getattr(rate, way)) - truth) / errors[way]
            for way in ("positive", "negative")
            if way in errors
        ]
    else:
        curve = [
            [(getattr(rate, f"{name}_positive") - truth) / errors[f"{name}_positive"]]
            for name, truth in (("coulomb", 5.0), ("viscous", 3.0))
        ]
    rest = [
        (friction.dynamics[name].value - truth) / friction.dynamics[name].standard_error
        for name, truth in (("inertia", 1.0), ("gravity_sin", 10.0))
    ]
    return float(np.abs(np.concatenate(curve)).max()), float(np.abs(rest).max())


def test_intervals_of_a_joint_hold_where_the_encoder_rounds_alike_in_each_cycle():
    far = np.array([worst(log_of(seed, amplitude=2.0)) for seed in range(8)])
    assert np.median(far[:, 0]) < 2.0 and far.max() < 4.5


@pytest.mark.parametrize("rate", [50.0, 100.0])
def test_inertia_and_gravity_are_unbiased_at_low_sampling_rates(rate):
    far = np.array([worst(log_of(seed, rate, 2.0))[1] for seed in range(6)])
    assert np.median(far) < 2.0 and far.max() < 4.0
