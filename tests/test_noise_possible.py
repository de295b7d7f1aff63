"""The covariance of sums of correlated noise: never one that no noise can have."""

import numpy as np

from backdrive.identification.noise import LEAST, Noise


def test_a_correlation_that_no_noise_has_gives_a_possible_covariance():
    """A truncated correlation gave a sum of weights a negative variance, and an inertia without a number."""
    n = np.arange(200)
    noise = Noise(correlation=np.array([1.0, 0.0, -0.9, 0.0, 0.75]), size=np.ones(1), widening=np.ones(1))
    found = []
    for w in np.linspace(0.05, 1.5, 30):
        z = np.array([np.cos(w * n) + 2.0, np.cos(w * n + 0.3) + 2.0, np.ones(200)])
        full = sum(
            c * (z[:, : 200 - h] @ z[:, h:].T + (h > 0) * z[:, h:] @ z[:, : 200 - h].T)
            for h, c in enumerate(noise.correlation)
        )
        found.append(np.linalg.eigvalsh(0.5 * (full + full.T)).min())
        C = noise.covariance(z, 0)
        assert np.linalg.eigvalsh(C).min() > 0.0
        beyond = 0.5 * (full + full.T) - LEAST * z @ z.T
        if np.linalg.eigvalsh(beyond).min() > 0.0:
            assert np.allclose(C, 0.5 * (full + full.T), rtol=1e-9)
    assert min(found) < 0.0 < max(found)
