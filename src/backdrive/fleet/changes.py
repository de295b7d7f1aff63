"""Detection of a change in an autocorrelated series: its significance, its shape and its begin.

    y = X b + h z_tau(t) + e,   e_i = rho^(t_i - t_(i-1)) e_(i-1) + w_i

X is a constant and the temperature, and z_tau a step at tau or a ramp from tau on. The noise e is correlated from day to day,
so ordinary p-values are far too small. The series is whitened with rho; then the t-statistic of h is computed for every tau.
Its largest value over all tau and both shapes is compared with that of series without a change. Such series are made of the
residuals of all joints: the signs of whole blocks of days are flipped at random (wild bootstrap by blocks: Liu 1988; Shao
2010). So the comparison includes the correlation that remains after whitening (Andrews & Monahan 1992).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BLOCK = 5  # days whose signs are flipped together
EDGE = 4  # days before the first and after the last tau
GRID = 60  # taus that are searched
LEAST = 14  # least length of a history that is tested [day]
OUTLIER = 5.0  # robust standard deviations from its neighbours at which a day is cut [-]
NEIGHBOURS = 7  # days of a running median
MOST = 0.97  # of rho
TRUE, DRAWN = 15, 400  # grid of correlations, and series for each, that measure the bias of the estimate
FEW = 20  # least number of joints for using the correlation over two days
CLEAR = 4.0  # difference of fit, in variances, that decides between the shapes [-]


@dataclass(frozen=True, eq=False)
class Series:
    """A whitened series ready to be searched.

    Attributes:
        day: of the values, (n,).
        y: parts side by side, whitened, (n, P).
        base: orthonormal basis of constant and temperature, whitened, (n, k).
        rho: correlation of neighbouring days [-].
        design: constant and temperature as they are, (n, k).
    """

    day: np.ndarray
    y: np.ndarray
    base: np.ndarray
    rho: float
    design: np.ndarray

    @property
    def freedom(self) -> int:
        """Degrees of freedom beside constant, temperature and a change."""
        return self.day.size - self.base.shape[1] - 1

    def residual(self) -> np.ndarray:
        """Return the residual of constant and temperature, (n, P)."""
        return self.y - self.base @ (self.base.T @ self.y)


@dataclass(frozen=True, kw_only=True)
class Onset:
    """A change and when it began.

    Attributes:
        shape: `ramp` or `step`.
        sure: whether the other shape fits clearly worse.
        day: of its begin, since 1970-01-01.
        interval: 95 % of it, days since 1970-01-01.
        size: of the change until the last day, in the unit of the series.
        error: its standard error.
    """

    shape: str
    sure: bool
    day: float
    interval: tuple[float, float]
    size: float
    error: float


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
    """Return the autocorrelations of the residuals of constant, temperature and a slow curve at one and two days [-], (2, c);
    biased low.

    Args:
        day: of the values, (n,).
        values: columns, (n, c).
        design: constant and temperature, (n, k).
    """
    t = (day - day.mean()) / max(np.ptp(day), 1.0)
    base, _ = np.linalg.qr(np.column_stack([design, t, t**2, t**3]))
    e = values - base @ (base.T @ values)
    result = np.zeros((2, values.shape[1]))
    for lag in (1, 2):
        near = day[lag:] - day[:-lag] <= lag + 0.5
        if near.sum() >= 5:
            both = 0.5 * np.sum((e[lag:] ** 2 + e[:-lag] ** 2)[near], axis=0)
            result[lag - 1] = np.sum((e[lag:] * e[:-lag])[near], axis=0) / np.maximum(both, 1e-300)
    return result


def persistence(correlations: np.ndarray) -> float:
    """Return the day-to-day correlation without the noise of single days: c_2 / c_1 of the medians of (2, c) [-]."""
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


def series(day: np.ndarray, values: np.ndarray, design: np.ndarray, rho: float) -> Series:
    """Return values (n, P) and design (n, k) of a joint whitened with its correlation."""
    whiten = whitener(day, rho)
    base, _ = np.linalg.qr(whiten(design))
    return Series(day, whiten(values), base, rho, design)


def onsets(day: np.ndarray, count: int) -> np.ndarray:
    """Return the days that are tried as the begin of a change, about as many as asked for."""
    inner = day[EDGE:-EDGE]
    return inner[np.unique(np.linspace(0, inner.size - 1, min(count, inner.size)).round().astype(int))]


def shapes(day: np.ndarray, taus: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return ramps that end at 1 and steps to 1, from each tau on, (n, m) each."""
    since = day[:, None] - taus
    ramp = np.maximum(since, 0.0) / np.maximum(day[-1] - taus, 1.0)
    return ramp, (since >= 0.0).astype(float)


def directions(one: Series, taus: np.ndarray) -> np.ndarray:
    """Return ramps and steps side by side, whitened, free of constant and temperature, of unit length, (n, 2 m)."""
    Z = whitener(one.day, one.rho)(np.hstack(shapes(one.day, taus)))
    length = np.linalg.norm(Z, axis=0)
    Z -= one.base @ (one.base.T @ Z)
    left = np.linalg.norm(Z, axis=0)
    keep = left > 0.05 * length  # directions that temperature explains almost completely are excluded
    return Z[:, keep] / left[keep]


def largest(W: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the largest squared correlation of each column of residuals with a direction, (c,)."""
    total = np.einsum("ij,ij->j", residual, residual)
    return np.max((W.T @ residual) ** 2, axis=0, initial=0.0) / np.where(total > 0, total, 1.0)


def statistic(correlation_squared: np.ndarray, freedom: int) -> np.ndarray:
    """Return minus the logarithm of a single t-test's p-value, so that histories of any length compare [-]."""
    from scipy.special import betainc

    x = np.clip(1.0 - correlation_squared, 1e-12, 1.0)  # p of a t-test by the regularised beta function
    return -np.log(np.maximum(betainc(0.5 * freedom, 0.5, x), 1e-290))


def flip_signs(residual: np.ndarray, base: np.ndarray, draws: np.random.Generator, count: int) -> np.ndarray:
    """Return residuals with the signs of blocks flipped, the same of all parts, free of the base again, (n, P, count)."""
    n = residual.shape[0]
    block = max(1, min(BLOCK, n // 12))
    blocks = -(-(n + block) // block)
    signs = draws.integers(0, 2, (blocks, count)).astype(float) * 2.0 - 1.0
    shift = int(draws.integers(block))
    s = np.repeat(signs, block, axis=0)[shift : shift + n]
    R = (residual[:, :, None] * s[:, None, :]).reshape(n, -1)
    R -= base @ (base.T @ R)
    return R.reshape(n, residual.shape[1], count)


def date_change(one: Series, part: int) -> Onset:
    """Return shape and begin of the change of a part, with an interval by its likelihood.

    A ramp's begin is a regular parameter: days whose fit is worse by less than the 95 % point of F(1, df). That of a step is
    not: -2 ln(1 - sqrt(0.95)) of the likelihood ratio (Yao 1987; Siegmund 1988).

    Args:
        one: the series.
        part: number of the part.
    """
    from scipy.special import stdtrit

    y = one.residual()[:, part]
    low, high = one.day[EDGE] - 1.0, one.day[-EDGE - 1] + 1.0
    taus = np.arange(low, high + 0.5)
    whiten = whitener(one.day, one.rho)
    fits = []
    for Z in shapes(one.day, taus):
        W = whiten(Z)
        W = W - one.base @ (one.base.T @ W)
        squares = np.maximum(np.einsum("ij,ij->j", W, W), 1e-12)
        amount = (W.T @ y) / squares
        fits.append((y @ y - amount**2 * squares, amount, squares))
    freedom = max(one.freedom - 1, 1)
    best = [float(rest.min()) for rest, _, _ in fits]
    clear = CLEAR * min(best) / freedom
    kind = int(
        best[1] + clear < best[0]
    )  # a ramp may be as steep as a step, so a step is chosen only if it fits clearly better
    rest, amount, squares = fits[kind]
    at = int(np.argmin(rest))
    variance = best[kind] / freedom
    reach = (float(stdtrit(freedom, 0.975)) ** 2, -2.0 * np.log(1.0 - np.sqrt(0.95)))[kind]
    inside = taus[rest <= best[kind] + reach * variance]
    return Onset(
        shape=("ramp", "step")[kind],
        sure=abs(best[0] - best[1]) > clear,
        day=float(taus[at]),
        interval=(float(inside.min()), float(inside.max())),
        size=float(amount[at]),
        error=float(np.sqrt(variance / squares[at])),
    )
