"""Motions of the independent six-axis arm without contact, and hands that push it."""

from __future__ import annotations

import numpy as np
from _arm_truth import POSTURE, REACH, SPEED, TICK, J
from scipy.signal import fftconvolve


def free_motion(
    seconds: float,
    rng: np.random.Generator,
    *,
    rests: float = 0.12,
    slow: float = 0.2,
    scale: float = 1.0,
) -> np.ndarray:
    """Return a smooth motion of all joints with reversals, rests and a slow part, every tick, (n, 6).

    Each joint follows a sum of sines. A progress along them stands still, creeps or runs in turns of some seconds.

    Args:
        seconds: how long.
        rng: of phases and turns.
        rests: share of the time at rest.
        slow: share of the time at a tenth of the speed.
        scale: on reach.
    """
    n = round(seconds / TICK)
    pace, k = np.empty(n), 0
    while k < n:
        stretch = round(rng.uniform(1.5, 4.0) / TICK)
        kind = rng.uniform()
        pace[k : k + stretch] = 0.0 if kind < rests else (0.1 if kind < rests + slow else 1.0)
        k += stretch
    pace[: round(0.7 / TICK)] = 0.0
    width = round(0.4 / TICK)
    window = np.hanning(width + 2)[1:-1]
    window = np.convolve(window, window)
    padded = np.concatenate([np.full(window.size // 2, pace[0]), pace, np.full(window.size // 2, pace[-1])])
    smooth = fftconvolve(padded, window / window.sum(), mode="valid")[:n]
    smooth[smooth < 1e-6] = 0.0
    progress = np.cumsum(smooth) * TICK
    reference = np.zeros((n, J))
    for j in range(J):
        weight = 0.0
        for base in (0.07, 0.17, 0.33, 0.55):
            f = base * rng.uniform(0.8, 1.25)
            share = rng.uniform(0.5, 1.0) / base**0.5
            reference[:, j] += share * np.sin(2.0 * np.pi * f * progress + rng.uniform(0.0, 2.0 * np.pi))
            weight += share
        reference[:, j] *= scale * REACH[j] / weight
        top = np.abs(np.diff(reference[:, j])).max() / TICK
        reference[:, j] = POSTURE[j] + reference[:, j] * min(1.0, SPEED[j] / max(top, 1e-9))
    return reference


def pushes(
    seconds: float,
    rng: np.random.Generator,
    *,
    force: float = 30.0,
    moment: float = 2.0,
    pause: tuple[float, float] = (0.8, 2.5),
    length: tuple[float, float] = (0.4, 2.0),
    rise: float = 0.08,
) -> np.ndarray:
    """Return wrenches of a hand that pushes in random directions, with pauses, every tick, (n, 6).

    Args:
        seconds: how long.
        rng: of directions and times.
        force: greatest [N].
        moment: greatest [N.m].
        pause: shortest and longest [s].
        length: shortest and longest of a push [s].
        rise: time of rise and fall [s].
    """
    n = round(seconds / TICK)
    wrench, k = np.zeros((n, 6)), round(1.5 / TICK)
    while k < n:
        m = round(rng.uniform(*length) / TICK)
        t = np.arange(m) * TICK
        shape = np.clip(np.minimum(t, m * TICK - t) / rise, 0.0, 1.0)
        shape = shape * shape * (3.0 - 2.0 * shape)
        way = rng.normal(size=(2, 3))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        size = rng.uniform(0.3, 1.0, 2) * (force, moment)
        part = wrench[k : k + m]
        part += (shape[:, None] * (size[:, None] * way).reshape(6))[: part.shape[0]]
        k += m + round(rng.uniform(*pause) / TICK)
    return wrench
