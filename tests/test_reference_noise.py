"""The noise of residuals in runs, with every matrix written out: what a fit took from them, and the errors of sums."""

import numpy as np
import pytest

from backdrive.identification.noise import Noise, noise_of, taper


def lagged(a, h):
    """Sum of products of samples h apart, at lag h of a matrix or of a vector."""
    return np.trace(a, offset=h) if a.ndim == 2 else float(a[: a.size - h] @ a[h:])


def toeplitz(correlation, n):
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    return np.where(lag < correlation.size, np.r_[correlation, 0.0][np.minimum(lag, correlation.size)], 0.0)


def whole_then_falling(correlation, count):
    """Weight 1 up to the last lag seen before ten that are not, and a straight line to zero over as many more."""
    level, last, quiet = 2.0 * np.sqrt(np.log10(count) / count), 0, 0
    for lag in range(1, correlation.size):
        if abs(correlation[lag]) >= level:
            last, quiet = lag, 0
        else:
            quiet += 1
        if quiet == 10:
            break
    if last == 0:
        return correlation[:1]
    lags = np.arange(min(2 * last, correlation.size))
    return correlation[: lags.size] * np.minimum(1.0, 2.0 - lags / last)


def by_hand(residuals, velocities, degree):
    bases = [np.linalg.qr(np.vander(v - v.mean(), degree + 1))[0] for v in velocities]
    keep = [np.eye(len(Q)) - Q @ Q.T for Q in bases]
    left = [P @ r for P, r in zip(keep, residuals, strict=True)]
    power = np.array([np.mean(r**2) for r in left])
    lags = min(120, max(r.size for r in left))
    raw = np.array(
        [
            sum(lagged(r, h) / p if h < r.size else 0.0 for r, p in zip(left, power, strict=True))
            for h in range(lags)
        ]
    )
    correlation, kept = np.ones(1), np.ones(len(left))
    for _ in range(4):
        total, count = raw.copy(), np.zeros(lags)
        for i, P in enumerate(keep):
            n = len(P)
            G = toeplitz(correlation, n)
            lost = [lagged(G - P @ G @ P, h) if h < n else 0.0 for h in range(lags)]
            kept[i] = max(1.0 - lost[0] / n, 0.1)
            total += np.array(lost) / kept[i]
            count += np.maximum(n - np.arange(lags), 0) / kept[i]
        whole = total / count
        correlation = whole_then_falling(whole / whole[0], sum(r.size for r in left))
    first, count = correlation[1] if correlation.size > 1 else 0.0, sum(r.size for r in left)
    if first > 0.0 and count * (1.0 - first) / (1.0 + first) <= 50.0:  # too few to see it to its end
        regular = first ** np.arange(max(r.size for r in left))
        correlation = regular if sum(regular) > sum(correlation) else correlation
    own = power / kept
    independent = np.array([r.size for r in left]) / max(2.0 * sum(correlation) - 1.0, 1.0)
    mean = np.sum(independent * own) / np.sum(independent)
    weight = independent / (independent + 10.0)  # all runs together count as ten independent samples
    return correlation, np.sqrt(np.maximum(own, weight * own + (1.0 - weight) * mean))


def runs(sizes, memory, seed=0, scale=(1.0,)):
    generator = np.random.default_rng(seed)
    kernel = np.ones(memory) / np.sqrt(memory)
    noise = [
        scale[k % len(scale)] * np.convolve(generator.standard_normal(n + memory - 1), kernel, "valid")
        for k, n in enumerate(sizes)
    ]
    velocities = [1.0 - np.linspace(-1.0, 1.0, n) ** 2 + 0.1 * np.linspace(0.0, 1.0, n) for n in sizes]
    return noise, velocities


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize(
    ("sizes", "memory"),
    [((40, 25, 60, 33), 1), ((40, 25, 60, 33), 5), ((122, 12, 130), 9), ((6, 7, 8), 2), ((135,), 20)],
)
def test_noise_of_runs_is_what_its_matrices_say(sizes, memory, degree):
    residuals, velocities = runs(sizes, memory, scale=(1.0, 3.0))
    got = noise_of(residuals, velocities, degree)
    correlation, size = by_hand(residuals, velocities, degree)
    assert got.correlation == pytest.approx(correlation, abs=1e-8) and got.size == pytest.approx(size)
    if degree == 1:
        assert noise_of(residuals, velocities).size == pytest.approx(size)
    # what was fitted before does not matter
    fitted = [r + 5.0 - 2.0 * v for r, v in zip(residuals, velocities, strict=True)]
    assert noise_of(fitted, velocities, degree).size == pytest.approx(size)


def test_a_run_without_residuals_tells_nothing():
    residuals, velocities = runs((50, 40), 3)
    nothing = noise_of([*residuals, np.zeros(30)], [*velocities, np.linspace(0.0, 1.0, 30)])
    assert nothing.size[2] == 0.0 and np.all(nothing.size[:2] > 0.0)
    steady = noise_of([residuals[0]], [np.ones(50)])  # a constant velocity is a base like any other
    assert np.isfinite(steady.size).all()


@pytest.mark.parametrize("lags", [1, 4, 30])
def test_the_covariance_of_sums_is_the_quadratic_form(lags):
    correlation = np.maximum(1.0 - np.arange(lags) / 6.0, 0.05)
    noise = Noise(correlation=correlation, size=np.array([1.0, 3.0]), widening=np.array([1.0, 1.0]))
    z = np.random.default_rng(1).standard_normal((3, 20)) + 1.0
    wanted = z @ toeplitz(correlation, 20) @ z.T
    assert noise.covariance(z, 1) == pytest.approx(9.0 * wanted, rel=1e-9)
    assert noise.covariance(z, 0) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("share", [0.095, 0.105])
def test_a_sum_has_at_least_a_tenth_of_the_variance_of_white_noise(share):
    """A sum with less gets a tenth, and another one keeps its own.

    Neighbours that disagree by r leave 1 - 2 r of a long mean's variance; 1 - 2 r cos(pi / (n + 1)) at a half wave.
    """
    n = 40
    wave = np.sin(np.pi * np.arange(1, n + 1) / (n + 1))
    r = (1.0 - share) / (2.0 * np.cos(np.pi / (n + 1)))
    noise = Noise(correlation=np.array([1.0, -r]), size=np.array([2.0]), widening=np.ones(1))
    z = np.vstack([wave, (-1.0) ** np.arange(n)])
    got = noise.covariance(z, 0)
    wanted = z @ toeplitz(noise.correlation, n) @ z.T
    wanted[0, 0] = max(wanted[0, 0], 0.1 * z[0] @ z[0])
    assert got == pytest.approx(4.0 * wanted, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("times", "seen"), [(1.95, False), (2.05, True)])
def test_a_correlation_counts_from_twice_its_chance_level_on(times, seen):
    count = 500
    level = np.sqrt(np.log10(count) / count)
    correlation = np.r_[1.0, np.zeros(40)]
    correlation[3] = -times * level
    got = taper(correlation, count)
    assert got == pytest.approx(np.r_[correlation[:4], 0.0, 0.0] if seen else [1.0])
    for gap, found in ((10, True), (11, False)):  # ten lags of silence end it
        far = np.r_[1.0, 0.5, np.zeros(60)]
        far[1 + gap] = 0.5
        assert (taper(far, count).size > 2) is found
    for many in (2, 10):  # so few samples are counted as ten
        few = np.array([1.0, 2.0 * np.sqrt(1.0 / many) * 1.01, 0.0])
        assert taper(few, many).size == 2
    end = np.r_[1.0, np.full(9, 0.9)]
    assert taper(end, 1000) == pytest.approx(end)  # seen to the end: nothing falls
