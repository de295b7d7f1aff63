"""The delay of the measured torque behind the motion, found by repeated fits with shifted motion.

To first order, a delay appears as jerk times inertia. Only that column is used; the effects of friction and gravity are
neglected. So the delay is known only where inertia is significant. Encoder errors in the jerk reduce its coefficient; the
change of the coefficient from one delay to another shows by how much. The delay is where the coefficient is zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification import design, noise, regression
from backdrive.identification.delay_bins import DelayStretch, bins_at_delay
from backdrive.identification.lateness import delay as shift_of
from backdrive.identification.motion_bins import Bins
from backdrive.identification.residual import residual_of
from backdrive.identification.signals import Signals

ROUNDS = 10  # of fits, each along the motion of some delay
STEP = 0.01  # longest change of the delay from one to the next [s]
LONG = 0.015  # a delay is sought by shifts too if it may be so long [s]
WORTH = 0.75  # and taken if the residual falls to that share [-]
NEAR = 0.3, 0.01  # two estimates of a delay agree to that share of it, or to that time [s]
LEVER = 0.002  # distance of two delays that measures the reduced response of the jerk [s]
SHARES = 0.3, 1.5  # limits of that response during the search [-]
KNOWN = 2.0  # a delay is known if its standard error is at most so many sampling intervals [-]
MOST = 0.99  # correlation of the noise of neighbouring bins that is reckoned with [-]
SURE = 5.0  # a delay takes part though it is not known well, if it is so many standard errors longer than an interval [-]
OPPOSITE, SLIGHT = -0.48, -0.1  # the most negative one, and one from which on it is reckoned with [-]
FELT = 3.0  # inertia is significant if it is so many standard errors above zero [-]
SHOWN = 0.05  # least response of the jerk to a delay [-]
CORNERS, OF_JERK = (
    (50.0, 100.0),
    (30.0, 40.0),
)  # low pass of motion and of jerk, whose errors of the encoder hide a delay: at first, and near it [Hz]


@dataclass(frozen=True, kw_only=True)
class Slip:
    """A delay of the torque.

    Attributes:
        delay: of the torque behind the motion [s]; the start value if the data do not determine it.
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
    def is_known(self) -> bool:
        """Whether standard errors may be stated beside it."""
        return self.error <= self.least

    def is_fitted(self, coarse: float | None) -> bool:
        """Return whether it takes part in a fit: it is known, or surely long.

        Args:
            coarse: what `coarse_delay` returns [s].
        """
        return self.is_known or is_long(self.delay, self.error, self.period, coarse)


def is_long(delay: float, error: float, period: float, coarse: float | None) -> bool:
    """Return whether a delay that is not known to a sampling interval is surely longer than one, so that it is better corrected.

    Args:
        delay: as estimated [s].
        error: its standard error [s].
        period: sampling interval [s].
        coarse: what `coarse_delay` returns [s].
    """
    sure = abs(delay) > SURE * error + period
    return sure and coarse is not None and abs(delay - coarse) < max(NEAR[0] * abs(coarse), NEAR[1])


def coarse_delay(stretches: Sequence[Signals]) -> float | None:
    """Return the delay at which torque is best explained, to a hundredth of a second [s]; None where it is not long.

    A search along the jerk may end at a wrong root, or at none, if the delay is long against the motion.

    Args:
        stretches: of one joint.
    """
    means = residual_of([(s, s.torque, s.torque, True) for s in stretches])
    shift = None if means is None else shift_of(means)
    return None if shift is None or abs(shift[0]) < LONG or shift[1] > WORTH else shift[0]


def seek_slip(
    stretches: Sequence[Signals],
    knots: np.ndarray,
    full: design.Candidate,
    seconds: float,
    start: float = 0.0,
    near: bool = False,
    rough: bool = False,
) -> Slip:
    """Return the delay of the torque.

    Args:
        stretches: of one joint.
        knots: of the fine basis [rad/s or m/s], (k,).
        full: candidate with inertia and jerk that the delay is sought with.
        seconds: of the bins [s].
        start: delay from which on it is sought [s].
        near: that is nearly the delay, which higher frequencies then tell better.
        rough: of the error it only matters whether it is finite.
    """
    period = 1.0 / stretches[0].rate
    open_ = Slip(delay=start, error=np.inf, period=period)
    inertia, jerk = full.terms.index("inertia"), full.terms.index("jerk")
    slow = [DelayStretch(s, seconds, CORNERS[near], OF_JERK[near]) for s in stretches]
    delay, share, correlation = start, 1.0, 0.0
    tried: list[tuple[float, float]] = []
    while len(tried) < ROUNDS:
        bins = bins_at_delay(slow, delay, knots, full)
        if not tried:  # tells how the noise is correlated; if it is not, there is nothing to repeat
            theta = fit(bins)
            correlation = neighbours(bins.y - bins.X @ theta, bins.used)
        if tried or correlation != 0.0:
            bins = bins.whiten(correlation)
            theta = fit(bins)
        if not theta[inertia] > 0.0:
            return replace(open_, correlation=correlation)
        tried.append((delay, float(theta[jerk] / theta[inertia])))
        delay, share, done = _next(tried)
        if done:
            break
    covariance = noise.covariance_of_fit(bins.X, bins.y - bins.X @ theta, bins.used)
    felt = theta[inertia] > FELT * float(np.sqrt(covariance[inertia, inertia]))
    if not (felt and share > SHOWN):
        return replace(open_, correlation=correlation)
    variance = float(covariance[jerk, jerk])
    if not rough:
        every = bins_at_delay(slow, tried[-1][0], knots).whiten(correlation).equations()
        blocks = regression.sandwich(every.map_columns(full.spread), theta)
        variance = 0.5 * (variance + float(blocks[jerk, jerk]))
    error = float(np.sqrt(variance) / theta[inertia] / share)
    return Slip(delay=delay, error=error, period=period, correlation=correlation)


def _next(tried: list[tuple[float, float]]) -> tuple[float, float, bool]:
    """Return the next delay to try, the response of the jerk there [-], and whether the search has converged.

    If the jerk's coefficient changes sign between two delays, the delay lies between them. The response is not constant, so
    it is taken between two delays close to the solution.

    Args:
        tried: delays, and what the jerk showed to be left of them [s].
    """
    if len(tried) == 1:
        return _beyond(*tried[0], LEVER), 1.0, False
    ordered = sorted(tried)
    around = [(a, b) for a, b in zip(ordered, ordered[1:], strict=False) if a[1] > 0.0 >= b[1]]
    if not around:
        (before, had), (delay, left) = tried[-2:]
        share = float(np.clip((had - left) / (delay - before), *SHARES))
        return _beyond(delay, left / share, 0.5 * LEVER), 0.0, False
    (low, more), (high, less) = min(around, key=lambda pair: pair[1][0] - pair[0][0])
    share = (more - less) / (high - low)
    delay = low + more / share
    if high - low <= 1.5 * LEVER:
        return delay, share, True
    if delay - low < high - delay:  # a little beyond, so that the two delays enclose the solution
        return min(delay + 0.5 * LEVER, 0.5 * (delay + high)), share, False
    return max(delay - 0.5 * LEVER, 0.5 * (delay + low)), share, False


def _beyond(delay: float, left: float, least: float) -> float:
    """Return a delay with what is left of it, no smaller a step than the least and no longer than `STEP` [s]."""
    return delay + math.copysign(min(max(abs(left), least), STEP), left)


def with_slip(choice: design.Choice, change: np.ndarray, slip: Slip) -> design.Choice:
    """Return a choice with the delay of its motion as one of its terms, and with the delay's error added to all others.

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


def fit(bins: Bins) -> np.ndarray:
    """Return the coefficients of all columns by Huber's loss, (p,)."""
    return regression.robust_solution(bins.X, bins.y, bins.used.astype(float))


def neighbours(residual: np.ndarray, used: np.ndarray) -> float:
    """Return the correlation of neighbouring residuals [-], 0 where it is slightly negative.

    Args:
        residual: of the fit, (n,).
        used: False where a sample did not take part, (n,).
    """
    width = regression.HUBER * regression.robust_spread(residual[used])
    score = np.clip(residual, -width, width)
    both = used[1:] & used[:-1]
    product, square = (float(np.mean(x)) for x in (score[1:][both] * score[:-1][both], score[used] ** 2))
    correlation = float(np.clip(product / square, OPPOSITE, MOST)) if square > 0.0 else 0.0
    return 0.0 if SLIGHT < correlation < 0.0 else correlation
