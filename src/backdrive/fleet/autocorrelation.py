"""Correlation of friction from day to day: its estimate without bias, and the whitening of a series with it."""

from __future__ import annotations

import numpy as np

OUTLIER = 5.0  # robust standard deviations from its neighbours at which a day is cut [-]
NEIGHBOURS = 7  # days of a running median
MOST = 0.97  # of rho
TRUE, DRAWN = 15, 400  # grid of correlations, and series for each, that measure the bias of the estimate
FEW = 20  # least number of joints for using the correlation over two days


def cut_outliers(values: np.ndarray) -> np.ndarray:
    """Return the values with outlying single days clipped towards their neighbours, (n, P)."""
    n = values.shape[0]
    padded = np.pad(values, ((NEIGHBOURS // 2,) * 2, (0, 0)), mode="reflect") if n > NEIGHBOURS else values
    if n > NEIGHBOURS:
        middle = np.median(np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS, axis=0), axis=-1)
    else:
        middle = np.broadcast_to(np.median(values, axis=0), values.shape)
    apart = values - middle
    scale = 1.4826 * np.median(np.abs(apart), axis=0)
    reach = OUTLIER * np.where(scale > 0, scale, np.inf)
    return middle + np.clip(apart, -reach, reach)


def correlation(day: np.ndarray, values: np.ndarray, design: np.ndarray) -> np.ndarray:
    """Return the autocorrelations of the residuals of constant, temperature and a slow curve from one log to the next and to
    the one after it [-], (2, c); biased low. Pairs further apart than usual do not count.

    Args:
        day: of the values, (n,).
        values: columns, (n, c).
        design: constant and temperature, (n, k).
    """
    t = (day - day.mean()) / max(np.ptp(day), 1.0)
    base, _ = np.linalg.qr(np.column_stack([design, t, t**2, t**3]))
    e = values - base @ (base.T @ values)
    result = np.zeros((2, values.shape[1]))
    usual = max(float(np.median(np.diff(day))), 1.0)
    for lag in (1, 2):
        near = day[lag:] - day[:-lag] <= (lag + 0.5) * usual
        if near.sum() >= 5:
            both = 0.5 * np.sum((e[lag:] ** 2 + e[:-lag] ** 2)[near], axis=0)
            result[lag - 1] = np.sum((e[lag:] * e[:-lag])[near], axis=0) / np.maximum(both, 1e-300)
    return result


def persistence(correlations: np.ndarray) -> float:
    """Return the correlation of successive logs without the noise of single days: c_2 / c_1 of the medians of (2, c) [-]."""
    one, two = np.median(correlations, axis=1)
    return float(np.clip(two / one, 0.0, MOST)) if one > 0.05 else 0.0


def true_correlation(
    found: np.ndarray, day: np.ndarray, design: np.ndarray, sizes: np.ndarray, seed: int
) -> np.ndarray:
    """Return the unbiased correlation of every joint, shrunk towards the fleet's value, (m,).

    Bias and scatter are measured on simulated series with known correlations and the same estimator (Andrews, Econometrica
    61, 1993). With at least `FEW` joints, the correlation over two days separates the noise of single days, such as that of a
    thermometer, from the noise that persists.

    Args:
        found: of `correlation`, (2, m).
        day: days of a typical history of the fleet, (n,).
        design: its constant and temperature, (n, k).
        sizes: days of every joint, (m,).
        seed: of the drawn series.
    """
    draws = np.random.default_rng(seed)
    true = np.linspace(0.0, MOST, TRUE)
    estimates, scatter, share = np.empty((3, TRUE))
    for i, rho in enumerate(true):
        carry = rho ** np.diff(day)
        e = draws.standard_normal((day.size, DRAWN))
        for k in range(1, day.size):
            e[k] = carry[k - 1] * e[k - 1] + np.sqrt(1.0 - carry[k - 1] ** 2) * e[k]
        drawn = correlation(day, cut_outliers(e), design)
        estimates[i], share[i] = np.median(drawn[0]), persistence(drawn)
        scatter[i] = 1.4826 * np.median(np.abs(drawn[0] - estimates[i]))
    estimates, share = np.maximum.accumulate(estimates), np.maximum.accumulate(share)
    scatter /= np.maximum(np.gradient(estimates, true), 0.1)
    middle = float(np.median(found[0]))
    chance = np.interp(middle, estimates, scatter) * np.sqrt(day.size / sizes)
    rho = shrink(np.interp(found[0], estimates, true), chance)
    if sizes.size < FEW:
        return rho
    more = np.interp(persistence(found), share, true) - np.interp(middle, estimates, true)
    return np.clip(rho + max(float(more), 0.0), 0.0, MOST)


def shrink(estimates: np.ndarray, chance: np.ndarray) -> np.ndarray:
    """Return correlations shrunk towards the fleet's median, according to their random scatter (empirical Bayes), (m,).

    Args:
        estimates: of each joint, free of bias, (m,).
        chance: standard deviation of each by chance, (m,).
    """
    center = float(np.median(estimates))
    spread = 1.4826 * float(np.median(np.abs(estimates - center)))
    between = max(spread**2 - float(np.median(chance)) ** 2, 0.0)
    weight = between / (between + chance**2) if between > 0 else np.zeros_like(chance)
    return np.clip(center + weight * (estimates - center), 0.0, MOST)


def whitener(day: np.ndarray, rho: float):
    """Return a function that whitens columns of an AR(1) process seen on these days, (n, ...)."""
    gap = np.diff(day)
    carry = rho**gap
    scale = np.sqrt(np.maximum(1.0 - carry**2, 1e-6)) / np.sqrt(max(1.0 - rho**2, 1e-6))

    def whiten(columns: np.ndarray) -> np.ndarray:
        c, s = (a.reshape(-1, *(1,) * (columns.ndim - 1)) for a in (carry, scale))
        first = columns[:1] * np.sqrt(max(1.0 - rho**2, 1e-6))
        return np.concatenate([first, (columns[1:] - c * columns[:-1]) / s])

    return whiten
