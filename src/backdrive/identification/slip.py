"""The delay of the measured torque behind the motion, sought by fitting the motion of a moment before again and again.

To first order a delay shows as jerk times inertia. That column alone tells it: what friction and gravity would add is taken for
granted and not seen, so that a delay is known only where inertia is felt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification import design, noise, regression
from backdrive.identification.delay import delayed
from backdrive.identification.motion_bins import Bins, bin_means
from backdrive.identification.signals import Signals

ROUNDS = 8  # of fits, each along the motion that the one before left
STEP = 0.01  # longest change of the delay in a round [s]
DONE = 0.02  # a change below this share of an interval ends the rounds [-]
KNOWN = 2.0  # a delay is known that has a standard error of at most so many intervals [-]
MOST = 0.99  # correlation of the noise of neighbouring bins that is reckoned with [-]
FELT = 3.0  # inertia is felt that is so many standard errors above zero [-]


@dataclass(frozen=True, kw_only=True)
class Slip:
    """A delay of the torque.

    Attributes:
        delay: of the torque behind the motion [s]; 0 where nothing tells it.
        error: its standard error [s]; infinite where nothing tells it.
        period: sampling interval [s].
        correlation: of the noise of neighbouring bins [-].
    """

    delay: float
    error: float
    period: float
    correlation: float = 0.0

    @property
    def least(self) -> float:
        """Standard error up to which it counts as known [s]: two sampling intervals."""
        return KNOWN * self.period

    @property
    def fitted(self) -> bool:
        """Whether it takes part in a fit."""
        return self.error <= self.least


def seek_slip(
    stretches: Sequence[Signals], knots: np.ndarray, full: design.Candidate, seconds: float
) -> Slip:
    """Return the delay of the torque.

    Args:
        stretches: of one joint.
        knots: of the fine basis [rad/s or m/s], (k,).
        full: candidate with inertia and jerk that the delay is sought with.
        seconds: of the bins [s].
    """
    period = 1.0 / stretches[0].rate
    open_ = Slip(delay=0.0, error=np.inf, period=period)
    inertia, jerk = full.terms.index("inertia"), full.terms.index("jerk")
    delay = correlation = 0.0
    for round_ in range(ROUNDS):
        raw = bin_means([delayed(s, delay) for s in stretches], knots, seconds=seconds)
        bins = raw.whitened(correlation)
        theta, covariance = fit(bins, full.spread)
        correlation = neighbours(raw.y - raw.X @ full.spread @ theta, raw.used)
        error = np.sqrt(np.diag(covariance)[[inertia, jerk]])
        if not theta[inertia] > FELT * error[0]:
            return replace(open_, correlation=correlation)
        step = float(theta[jerk] / theta[inertia])
        delay += float(np.clip(step, -STEP, STEP))
        if abs(step) < DONE * period and round_ > 0:
            break
    late = Slip(delay=delay, error=float(error[1] / theta[inertia]), period=period, correlation=correlation)
    return late if late.fitted else replace(late, delay=0.0)


def fit(bins: Bins, spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of a candidate by Huber's loss, and their covariance, (r,) and (r, r)."""
    X = bins.X @ spread
    w = regression.robust_weights(X, bins.y, bins.used.astype(float))
    weighted = X * w[:, None]
    theta = regression.solve(weighted.T @ X, weighted.T @ bins.y)
    return theta, covariance_of(bins, spread, theta)


def covariance_of(bins: Bins, spread: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return the covariance of a candidate's coefficients under the correlation of what they leave, (r, r)."""
    X = bins.X @ spread
    residual = bins.y - X @ theta
    width = regression.HUBER * regression.robust_spread(residual[bins.used])
    return noise.covariance_of_fit(X, residual, bins.used, width)


def neighbours(residual: np.ndarray, used: np.ndarray) -> float:
    """Return the correlation of neighbouring residuals [-], 0 where it is not positive.

    Args:
        residual: of the fit, (n,).
        used: False where a sample did not take part, (n,).
    """
    width = regression.HUBER * regression.robust_spread(residual[used])
    score = np.clip(residual, -width, width)
    both = used[1:] & used[:-1]
    product, square = (float(np.mean(x)) for x in (score[1:][both] * score[:-1][both], score[used] ** 2))
    return float(np.clip(product / square, 0.0, MOST)) if square > 0.0 else 0.0
