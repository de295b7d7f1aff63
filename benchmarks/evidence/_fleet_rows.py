"""Rows of a fleet's results, drawn: joints that repeat badly, warm with the season and wear. Nothing of the package draws here."""

from __future__ import annotations

import numpy as np

DAYS, FIRST = 180, 20_454  # 2026-01-01, as days since 1970
REPEAT, CORRELATION, SEASON = 0.02, 0.6, 0.15
WEAR, LENGTH = 0.10, 60
SWING = 12.0  # of the temperature over the year [degC]


def correlated(draws: np.random.Generator, shape: tuple[int, int], rho: float) -> np.ndarray:
    """Return AR(1) noise of unit variance along the second axis."""
    e = draws.standard_normal(shape)
    for i in range(1, shape[1]):
        e[:, i] = rho * e[:, i - 1] + np.sqrt(1.0 - rho**2) * e[:, i]
    return e


def rows(
    seed: int, joints: int, share: float, *, thermometer: float = 0.0, step: float = 0.0
) -> dict[str, np.ndarray]:
    """Return constant and viscous part, temperature, (joints, days), which joints ramp and which step, (joints,).

    Args:
        seed: of the draws.
        joints: number of them.
        share: that ramps in the last 60 days.
        thermometer: standard deviation of its noise [degC]; it reads tenths.
        step: share that steps by as much, 60 days before the end.
    """
    draws = np.random.default_rng(seed)
    day = np.arange(DAYS)
    phase = draws.uniform(0.0, 2.0 * np.pi)  # the history begins at any time of the year
    season = -np.cos(2.0 * np.pi * day / 365.25 + phase)
    places = 25.0 + 2.0 * draws.standard_normal((joints, 1))
    T = places + SWING * season + 3.0 * correlated(draws, (joints, DAYS), 0.7)
    f = np.exp(-SEASON / SWING * (T - 25.0)) * (1.0 + REPEAT * correlated(draws, (joints, DAYS), CORRELATION))
    ramps, steps = np.zeros((2, joints), dtype=bool)
    chosen = draws.permutation(joints)
    ramps[chosen[: round(share * joints)]] = True
    steps[chosen[joints - round(step * joints) :]] = True
    begin = DAYS - LENGTH
    f[ramps] *= 1.0 + WEAR * np.clip((day - begin) / LENGTH, 0.0, None)
    f[steps] *= np.where(day >= begin, 1.0 + WEAR, 1.0)
    base = 1.0 + 0.05 * draws.standard_normal((joints, 2))
    reading = np.round(T + thermometer * draws.standard_normal(T.shape), 1)
    return {
        "constant": 3.0 * base[:, :1] * f,
        "viscous": 2.0 * base[:, 1:] * f,
        "temperature": reading,
        "ramps": ramps,
        "steps": steps,
        "begin": np.array(FIRST + begin),
    }
