"""The delay of the measured torque behind the motion, sought by fitting the motion of a moment before again and again.

To first order a delay shows as jerk times inertia. That column alone tells it: what friction and gravity would add is taken for
granted and not seen, so that a delay is known only where inertia is felt. A jerk with errors of the encoder in it shows less than
there is: by how much, the change of its coefficient from one delay to another tells, and the delay is where that is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification import design, noise, regression
from backdrive.identification.delay import delayed
from backdrive.identification.motion_bins import Bins, bin_means
from backdrive.identification.signals import Signals
from backdrive.logs.filters import low_pass

ROUNDS = 5  # of fits, each along the motion that the ones before left
STEP = 0.01  # longest change of the delay in a round [s]
LEVER = 0.002  # change of the delay from which is told how much of it the jerk shows [s]
DONE = 0.1  # a change below this share of an interval ends the rounds [-]
KNOWN = 2.0  # a delay is known that has a standard error of at most so many intervals [-]
MOST = 0.99  # correlation of the noise of neighbouring bins that is reckoned with [-]
FELT = 3.0  # inertia is felt that is so many standard errors above zero [-]
SHOWN = 0.05  # share of a delay that jerk shows, at least [-]
CORNER, OF_JERK = 50.0, 30.0  # low pass of motion and of jerk, whose errors of the encoder hide a delay [Hz]


@dataclass(frozen=True, kw_only=True)
class Slip:
    """A delay of the torque.

    Attributes:
        delay: of the torque behind the motion [s]; that from which on it was sought where nothing tells it.
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
    stretches: Sequence[Signals],
    knots: np.ndarray,
    full: design.Candidate,
    seconds: float,
    start: float = 0.0,
) -> Slip:
    """Return the delay of the torque.

    Args:
        stretches: of one joint.
        knots: of the fine basis [rad/s or m/s], (k,).
        full: candidate with inertia and jerk that the delay is sought with.
        seconds: of the bins [s].
        start: delay from which on it is sought [s].
    """
    period = 1.0 / stretches[0].rate
    open_ = Slip(delay=start, error=np.inf, period=period)
    inertia, jerk = full.terms.index("inertia"), full.terms.index("jerk")
    slow = [_smooth(s) for s in stretches]
    delay, share, correlation = start, 1.0, 0.0
    for round_ in range(ROUNDS):
        raw = bin_means([delayed(s, delay) for s in slow], knots, seconds=seconds)
        if round_ == 0:  # only tells how the noise is correlated
            theta = fit(raw, full.spread)
            correlation = neighbours(raw.y - raw.X @ full.spread @ theta, raw.used)
        bins = raw.whitened(correlation)
        theta = fit(bins, full.spread)
        if not theta[inertia] > 0.0:
            return replace(open_, correlation=correlation)
        left = float(theta[jerk] / theta[inertia])
        if round_ == 0:
            later = bin_means([delayed(s, delay + LEVER) for s in slow], knots, seconds=seconds)
            after = fit(replace(later, used=raw.used).whitened(correlation), full.spread)
            share = (left - float(after[jerk] / after[inertia])) / LEVER if after[inertia] > 0.0 else 0.0
            if not share > SHOWN:
                return replace(open_, correlation=correlation)
        step = float(np.clip(left / share, -STEP, STEP))
        delay += step
        if abs(step) < DONE * period:
            break
    X = bins.X @ full.spread
    covariance = noise.covariance_of_fit(X, bins.y - X @ theta, bins.used)
    if not theta[inertia] > FELT * float(np.sqrt(covariance[inertia, inertia])):
        return replace(open_, correlation=correlation)
    blocks = regression.sandwich(bins.equations().mapped(full.spread), theta)
    variance = 0.5 * float(covariance[jerk, jerk] + blocks[jerk, jerk])
    error = float(np.sqrt(variance) / theta[inertia] / share)
    return Slip(delay=delay, error=error, period=period, correlation=correlation)


def _smooth(s: Signals) -> Signals:
    """Return signals whose motion is that of low frequencies."""
    return replace(
        s,
        velocity=low_pass(s.velocity, CORNER, s.rate),
        acceleration=low_pass(s.acceleration, CORNER, s.rate),
        jerk=low_pass(s.jerk, OF_JERK, s.rate),
        position=None if s.position is None else low_pass(s.position, CORNER, s.rate),
    )


def with_slip(choice: design.Choice, change: np.ndarray, slip: Slip) -> design.Choice:
    """Return a choice with the delay that its motion was taken at as one of its terms, and the error of that in all others.

    Args:
        choice: without a delay.
        change: of its coefficients with the delay, (r,).
        slip: the delay.
    """
    candidate, k = choice.candidate, len(choice.candidate.terms)
    both = np.insert(change, k, choice.coefficients[candidate.terms.index("inertia")])
    alone = np.insert(np.insert(choice.covariance, k, 0.0, axis=0), k, 0.0, axis=1)
    return replace(
        choice,
        candidate=candidate.with_term("jerk"),
        coefficients=np.insert(choice.coefficients, k, 0.0),
        covariance=alone + slip.error**2 * np.outer(both, both),
        left_out=np.insert(choice.left_out, k, 0.0, axis=1),
    )


def fit(bins: Bins, spread: np.ndarray) -> np.ndarray:
    """Return the coefficients of a candidate by Huber's loss, (r,)."""
    X = bins.X @ spread
    w = regression.robust_weights(X, bins.y, bins.used.astype(float))
    weighted = X * w[:, None]
    return regression.solve(weighted.T @ X, weighted.T @ bins.y)


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
