"""A joint's friction level over repeated identifications: is it constant, and where is it now?

    x_i = x_(i-1) + w_i,  w_i ~ N(0, q (t_i - t_(i-1)));      y_i = x_i + e_i,  e_i ~ N(0, s_i^2)

y_i is the level of the i-th identification, s_i its standard error, q the variance of the level's random walk per unit of time.
Kalman's filter and Rauch's smoother give the level and its error for every q of a grid. The results are averaged with the
likelihood as weight, since a single best q from a dozen identifications would make the intervals too narrow. The test for a
change does not use that model. If the level is constant, sum (y_i - mean)^2 / s_i^2 is chi-square with n - 1 degrees of
freedom. A second test is that of the slope of a straight line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.drift.change import ALARM, REACH, chance

# values of q, relative to the mean of s_i^2 divided by the mean interval [-]
GRID = np.concatenate([[0.0], np.geomspace(1e-3, 1e2, 31)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """The level over time.

    Attributes:
        time: of each identification, as given, (n,).
        level: smoothed [unit of y], (n,).
        error: standard error of `level`, (n,).
        wander: mean of q, the variance of the level's steps per unit of time.
        chi_square: of a constant level, with `degrees` of freedom.
        probability: of a chi-square at least as large if the level is constant [-].
        slope: of a straight line, its standard error, and the probability of a slope at least as large by chance.
        alarm: probability below which a difference counts as a change [-].
    """

    time: np.ndarray
    level: np.ndarray
    error: np.ndarray
    wander: float
    chi_square: float
    probability: float
    slope: tuple[float, float, float]
    alarm: float = ALARM

    @property
    def degrees(self) -> int:
        """Degrees of freedom of the test of a constant level."""
        return self.time.size - 1

    @property
    def is_significant(self) -> bool:
        """Whether the level was not constant, by either test at half the alarm each."""
        return min(self.probability, self.slope[2]) < 0.5 * self.alarm

    @property
    def verdict(self) -> str:
        """The answer in words."""
        now = f"{self.level[-1]:.3g} +- {REACH * self.error[-1]:.2g}"
        if not self.is_significant:
            return f"no significant change over {self.time.size} identifications, now {now}"
        return (
            f"has changed by {self.level[-1] - self.level[0]:+.3g} since the first identification, now {now}"
        )


def track(
    time: Sequence[float] | np.ndarray,
    level: Sequence[float] | np.ndarray,
    error: Sequence[float] | np.ndarray,
    *,
    alarm: float = ALARM,
) -> Track:
    """Track a level over repeated identifications.

    Args:
        time: of each identification, increasing, in any unit, (n,).
        level: result of each identification, for example the friction at a speed [N.m or N], (n,).
        error: standard error of each level [unit of the level], (n,).
        alarm: probability of a false alarm [-].

    Raises:
        InvalidInput: fewer than three identifications, different lengths, times not increasing, or no standard errors.
    """
    t, y, s = (np.asarray(x, dtype=np.float64) for x in (time, level, error))
    if t.ndim != 1 or not t.shape == y.shape == s.shape or t.size < 3:
        raise InvalidInput(
            f"{t.size} instants, {y.size} levels and {s.size} errors.",
            remedy="Give the same number of each, at least three; two are compared by `change_of`.",
        )
    if not (np.isfinite(t).all() and np.isfinite(y).all() and np.all(np.diff(t) > 0)):
        raise InvalidInput("Instants or levels are not finite and in order.", remedy="Sort them by time.")
    if not np.all(np.isfinite(s) & (s > 0)):
        raise InvalidInput(
            "An identification has no standard error.",
            remedy="Identify it again, not by the literal procedure.",
        )
    weight = 1.0 / s**2
    chi_square = float(weight @ (y - (weight @ y) / weight.sum()) ** 2)
    X = np.column_stack([np.ones(t.size), t - t.mean()]) / s[:, None]
    covariance = np.linalg.inv(X.T @ X)
    slope = float((covariance @ (X.T @ (y / s)))[1])
    deviation = float(np.sqrt(covariance[1, 1]))
    unit = float(np.mean(s**2) / np.mean(np.diff(t)))
    tried = [_smooth(t, y, s, unit * g) for g in GRID]
    likelihood = np.array([one[0] for one in tried])
    share = np.exp(likelihood - likelihood.max())
    share /= share.sum()
    levels, variances = np.array([one[1] for one in tried]), np.array([one[2] for one in tried])
    mean = share @ levels
    variance = share @ (variances + (levels - mean) ** 2)
    return Track(
        time=t,
        level=mean,
        error=np.sqrt(variance),
        wander=float(unit * (share @ GRID)),
        chi_square=chi_square,
        probability=chance(chi_square, t.size - 1),
        slope=(slope, deviation, chance((slope / deviation) ** 2, 1)),
        alarm=alarm,
    )


def _smooth(t: np.ndarray, y: np.ndarray, s: np.ndarray, q: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the logarithm of the likelihood, the smoothed levels and their variances."""
    mean, variance, before = y.copy(), s**2, s**2
    before = before.copy()
    x, P, total = float(y[0]), float(s[0] ** 2), 0.0
    for i in range(1, t.size):
        P += q * float(t[i] - t[i - 1])
        before[i] = P
        spread = P + float(s[i] ** 2)
        miss = float(y[i]) - x
        total -= 0.5 * (np.log(spread) + miss**2 / spread)
        x += P / spread * miss
        P *= float(s[i] ** 2) / spread
        mean[i], variance[i] = x, P
    for i in range(t.size - 2, -1, -1):  # Rauch, Tung & Striebel, AIAA Journal 3(8), 1965
        gain = variance[i] / before[i + 1] if before[i + 1] > 0 else 1.0
        mean[i] += gain * (mean[i + 1] - mean[i])
        variance[i] += gain**2 * (variance[i + 1] - before[i + 1])
    return total, mean, variance
