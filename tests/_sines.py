"""A motion of three sines."""

import numpy as np

RATE = 1000.0  # Hz


def sines(rng: np.random.Generator, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return time, position, velocity and acceleration of three sines of random phases."""
    t = np.arange(round(RATE * seconds)) / RATE
    q, v, a = np.zeros((3, t.size))
    for hertz, size in ((0.11, 0.9), (0.31, 0.4), (0.83, 0.1)):
        w, phase = 2.0 * np.pi * hertz, rng.uniform(0.0, 2.0 * np.pi)
        q += size * np.sin(w * t + phase)
        v += size * w * np.cos(w * t + phase)
        a -= size * w * w * np.sin(w * t + phase)
    return t, q, v, a
