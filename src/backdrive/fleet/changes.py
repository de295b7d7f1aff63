"""Detection of a change in an autocorrelated series: its significance, its shape and its start.

    y = X b + h z_tau(t) + e,   e_i = rho^(t_i - t_(i-1)) e_(i-1) + w_i

X is a constant and the temperature, and z_tau a step at tau or a ramp from tau on. The noise e is correlated from day to day,
so ordinary p-values are far too small. The series is whitened with rho; then the t-statistic of h is computed for every tau.
Its largest value over all tau and both shapes is compared with that of series without a change. Such series are made of the
residuals of all joints: the signs of whole blocks of days are flipped at random (wild bootstrap by blocks: Liu 1988; Shao
2010). So the comparison includes the correlation that remains after whitening (Andrews & Monahan 1992). The best change is
subtracted from a joint that is named: blocks of its course would look like changes of any sign.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from backdrive.fleet.autocorrelation import whitener

BLOCK = 5  # days whose signs are flipped together
EDGE = 4  # days before the first and after the last tau
GRID = 60  # taus that are searched
LEAST = 14  # least length of a history that is tested [day]
STEP_GAIN = 6.0  # variances by which a step must fit better than a ramp, as it fits noise better; so both err equally often [-]
SUSPECT = 9.0  # statistic from which draws are also made without a joint's own change [-]
CLEAR = 4.0  # variances beyond it, to either side, from which the shape is sure [-]


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
        day: of its start, since 1970-01-01.
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


def series(day: np.ndarray, values: np.ndarray, design: np.ndarray, rho: float) -> Series:
    """Return values (n, P) and design (n, k) of a joint whitened with its correlation."""
    whiten = whitener(day, rho)
    base, _ = np.linalg.qr(whiten(design))
    return Series(day, whiten(values), base, rho, design)


def onsets(day: np.ndarray, count: int) -> np.ndarray:
    """Return the days that are tried as the start of a change, about as many as asked for."""
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


def without_change(W: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the residuals without the best direction of each part, (n, P)."""
    amount = W.T @ residual
    best = np.argmax(np.abs(amount), axis=0)
    return residual - W[:, best] * np.take_along_axis(amount, best[None], axis=0)


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
    """Return residuals with the signs of blocks flipped, the same of all parts, free of the base again, (n, P, count).

    Before, each block gets back the variance that the regression on the base took from it, `(I - H_b)^(-1/2) r_b` with the
    leverages H_b (Bell & McCaffrey 2002): without this, sums over blocks were 5 % too small.
    """
    n, P = residual.shape
    block = max(1, min(BLOCK, n // 12))
    blocks = -(-(n + block) // block)
    signs = draws.integers(0, 2, (blocks, count)).astype(float) * 2.0 - 1.0
    shift = int(draws.integers(block))
    whole = np.zeros((blocks * block, P + base.shape[1]))
    whole[shift : shift + n] = np.hstack([residual, base])
    R, B = np.split(whole.reshape(blocks, block, -1), [P], axis=2)
    lever, V = np.linalg.eigh(B.transpose(0, 2, 1) @ B)
    lever = np.clip(lever, 1e-12, 0.9)
    BV = B @ V
    gain = (((1.0 - lever) ** -0.5 - 1.0) / lever)[:, :, None]
    R = R + BV @ (gain * (BV.transpose(0, 2, 1) @ R))
    drawn = (R[:, :, :, None] * signs[:, None, None, :]).reshape(blocks * block, -1)[shift : shift + n]
    drawn -= base @ (base.T @ drawn)
    return drawn.reshape(n, P, count)


def null_statistics(
    one: Series, W: np.ndarray, residual: np.ndarray, draws: np.random.Generator, count: int
) -> np.ndarray:
    """Return the largest statistic over directions and parts of each of the residuals with flipped signs, (count,)."""
    flipped = flip_signs(residual, one.base, draws, count)
    n, P, _ = flipped.shape
    highest = largest(W, flipped.reshape(n, -1)).reshape(P, count).max(axis=0)
    return statistic(highest, one.freedom)


def date_change(one: Series, part: int) -> Onset:
    """Return shape and start of the change of a part, with an interval from its likelihood.

    A ramp's begin is a regular parameter: days whose fit is worse by less than the 95 % point of F(1, df). That of a step is
    not: -2 ln(1 - sqrt(0.95)) of the likelihood ratio (Yao 1987; Siegmund 1988). If the shape is unclear, the interval
    includes that of the other shape.

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
    variances = [rest / freedom for rest in best]
    gain = (best[0] - best[1]) / min(variances) - STEP_GAIN
    kind, sure = int(gain > 0), abs(gain) > CLEAR
    reach = (float(stdtrit(freedom, 0.975)) ** 2, -2.0 * np.log(1.0 - np.sqrt(0.95)))
    inside = [taus[fits[k][0] <= best[k] + reach[k] * variances[k]] for k in ((kind,) if sure else (0, 1))]
    rest, amount, squares = fits[kind]
    at = int(np.argmin(rest))
    return Onset(
        shape=("ramp", "step")[kind],
        sure=sure,
        day=float(taus[at]),
        interval=(float(min(i.min() for i in inside)), float(max(i.max() for i in inside))),
        size=float(amount[at]),
        error=float(np.sqrt(variances[kind] / squares[at])),
    )
