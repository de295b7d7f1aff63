"""The delay of the measured torque behind the motion, estimated by repeated fits with shifted motion.

To first order, a delay appears as jerk times inertia. Only that column is used; the effects of friction and gravity are
neglected. The delay is therefore known only if inertia is significant. Encoder errors in the jerk reduce its coefficient; this
reduction follows from the change of the coefficient between two delays. At the true delay, the coefficient is zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification import design, noise, regression, robust
from backdrive.identification.delay_bins import DelayStretch, bins_at_delay
from backdrive.identification.delay_profile import CENTRED, ROUGHLY, refine_delay
from backdrive.identification.delay_slope import bins_near, response_by_one
from backdrive.identification.lateness import delay as shift_of
from backdrive.identification.motion_bins import Bins
from backdrive.identification.residual import residual_of
from backdrive.identification.signals import Signals
from backdrive.identification.whitening import WHITE, Colour, colour_of

FEW = 3  # largest number of repetitions of a robust fit for a rough delay
ROUNDS = 10  # largest number of fits, each with another delay
STEP = 0.01  # longest change of the delay from one fit to the next [s]
LONG = 0.015  # shortest delay that is also estimated by shifting the torque [s]
WORTH = 0.75  # largest residual after such a shift, relative to that without, for which it is used [-]
NEAR = 0.3, 0.01  # largest difference of two agreeing estimates of a delay, relative [-] and absolute [s]
# least distance of two delays that yields the response of the jerk [s] and [sampling interval]: closer ones differ by noise
LEVER, LEVER_SAMPLES = 0.002, 2.0
SHARES = 0.3, 1.5  # limits of the response of the jerk during the search [-]
CLEARLY = 0.5, 1.5  # limits of the response by one fit at which a rough delay needs no other fit [-]
BEYOND = (
    ROUNDS * STEP * SHARES[1]
)  # a remaining delay that no search reaches: there is hardly any inertia [s]
KNOWN = 1.9  # largest standard error of a known delay: two sampling intervals, less its own uncertainty [sampling interval]
SURE = 5.0  # least excess over one sampling interval of a poorly known delay that is used [standard error]
FELT = 3.0  # least significance of the inertia [standard error]
SHOWN = 0.05  # least response of the jerk to a delay that determines the delay [-]
CLOSE = (
    5.0  # least accuracy of a delay for which a clearer jerk is worth a search [accuracy of a known delay]
)
COLOURED = 0.3  # least correlation of neighbouring bins with which the loss is to support the delay [-]
Prepare = Callable[[Sequence[Signals], bool], list[DelayStretch]]
Chosen = tuple[design.Candidate, list[Signals], Bins | None, np.ndarray | None]


@dataclass(frozen=True, kw_only=True)
class Slip:
    """A delay of the torque.

    Attributes:
        delay: of the torque behind the motion [s]; the start value if the data do not determine it.
        error: its standard error [s]; infinite if the data do not determine the delay.
        period: sampling interval [s].
        colour: of the noise of neighbouring bins.
    """

    delay: float
    error: float
    period: float
    colour: Colour = WHITE

    @property
    def least(self) -> float:
        """Largest standard error of a known delay [s]."""
        return KNOWN * self.period

    @property
    def is_known(self) -> bool:
        """Whether the delay is known well enough to state standard errors."""
        return self.error <= self.least

    def is_fitted(self, coarse: float | None) -> bool:
        """Return whether the delay is used in a fit, because it is known or certainly long.

        Args:
            coarse: result of `coarse_delay` [s].
        """
        return self.is_known or is_long(self.delay, self.error, self.period, coarse)


def is_long(delay: float, error: float, period: float, coarse: float | None) -> bool:
    """Return whether a poorly known delay certainly exceeds a sampling interval, so that a correction is better than none.

    Args:
        delay: as estimated [s].
        error: its standard error [s].
        period: sampling interval [s].
        coarse: result of `coarse_delay` [s].
    """
    sure = abs(delay) > SURE * error + period
    return sure and coarse is not None and abs(delay - coarse) < max(NEAR[0] * abs(coarse), NEAR[1])


def coarse_delay(stretches: Sequence[Signals]) -> float | None:
    """Return the delay of the best fit to shifted torque, to a hundredth of a second [s]; None if it is not long.

    If the delay is long compared with the motion, a search along the jerk may end at a wrong root, or at none.

    Args:
        stretches: of one joint.
    """
    means = residual_of([(s, s.torque, s.torque, True) for s in stretches], means_alone=True)
    shift = None if means is None else shift_of(means)
    return None if shift is None or abs(shift[0]) < LONG or shift[1] > WORTH else shift[0]


def search_slip(
    stretches: Sequence[Signals],
    look: Sequence[Signals],
    knots: np.ndarray,
    full: design.Candidate,
    ready: Prepare,
    choose: Callable[[Slip, list[DelayStretch], bool], Chosen],
    false: tuple[float, ...] = (),
) -> tuple[Slip, float | None, list[Signals], list[DelayStretch], Bins | None]:
    """Return the delay of the torque, the result of `coarse_delay` if it was needed, the stretches that determined it, also as
    they were prepared, and their bins of all columns if these are at hand.

    Args:
        stretches: of one joint.
        look: windows of them for a rough delay, or all.
        knots: of the fine basis [rad/s or m/s], (k,).
        full: candidate with inertia, without jerk.
        ready: prepares stretches for many delays, with a jerk after a low pass, or with one that is clear of encoder errors.
        choose: gives the candidate for a rough delay, the stretches with those samples as sliding in which friction has built
            up, their bins of all columns at this delay where it has them, and the coefficients of its fit, from prepared stretches,
            which are all or those of `look`.
        false: error of the acceleration's means, as from `MotionError.between_means`.
    """
    coarse, widest = None, full.with_term("jerk")
    some, whole = ready(look, False), look is stretches
    slip = seek_slip(some, knots, widest, rough=True, false=false)
    if not (whole or slip.is_known):
        some, whole = ready(stretches, False), True
        slip = seek_slip(some, knots, widest, rough=True, false=false)
    if not (slip.is_known and abs(slip.delay) < LONG) and (coarse := coarse_delay(stretches)) is not None:
        some, whole = some if whole else ready(stretches, False), True
        slip = seek_slip(some, knots, widest, coarse, rough=True, false=false)
    at, (candidate, stretches, raw, fitted) = slip.delay, choose(slip, some, whole)
    begin = None if fitted is None else np.insert(fitted, len(candidate.terms), 0.0)  # no jerk yet
    if whole:
        some = [each.with_sliding(s.sliding) for each, s in zip(some, stretches, strict=True)]
    else:  # after the windows' bins are gone: long logs fill the memory
        some = ready(stretches, False)
    known = slip.colour if abs(slip.delay) <= slip.period else None  # it was found without a delay
    near = candidate.with_term("jerk")
    slip = seek_slip(some, knots, near, slip.delay, known, false=false, raw=raw, begin=begin)
    centred = CENTRED
    if not slip.is_known and slip.error < CLOSE * slip.least:
        clear = seek_slip(ready(stretches, True), knots, near, slip.delay, slip.colour)
        slip, centred = min((slip, CENTRED), (clear, ROUGHLY), key=lambda one: one[0].error)
    if slip.is_known and slip.colour.correlation > COLOURED:
        delay, error = refine_delay(
            some, knots, candidate, slip.delay, slip.error, slip.colour, centred, false
        )
        slip = replace(slip, delay=delay, error=error)
    if raw is not None and fitted is not None:
        raw = bins_near(raw, at, slip.delay, some, candidate, fitted)
    return slip, coarse, stretches, some, raw


def fix_slip(
    stretches: Sequence[DelayStretch],
    knots: np.ndarray,
    full: design.Candidate,
    delay: float,
    false: tuple[float, ...] = (),
) -> Slip:
    """Return a delay that the user knows, without an error, and the colour of the noise about a fit with it.

    Args:
        stretches: of one joint.
        knots: of the fine basis [rad/s or m/s], (k,).
        full: candidate with inertia, without jerk.
        delay: of the torque behind the motion [s].
        false: error of the acceleration's means, as from `MotionError.between_means`.
    """
    bins = bins_at_delay(stretches, delay, knots, full)
    theta = fit(bins)
    colour = colour_of(
        bins.y - bins.X @ theta, bins.used, bins.X, _in_torque(false, full, theta), stretches[0].width
    )
    return Slip(delay=delay, error=0.0, period=1.0 / stretches[0].rate, colour=colour)


def seek_slip(
    stretches: Sequence[DelayStretch],
    knots: np.ndarray,
    full: design.Candidate,
    start: float = 0.0,
    known: Colour | None = None,
    *,
    rough: bool = False,
    false: tuple[float, ...] = (),
    raw: Bins | None = None,
    begin: np.ndarray | None = None,
) -> Slip:
    """Return the delay of the torque.

    Args:
        stretches: of one joint.
        knots: of the fine basis [rad/s or m/s], (k,).
        full: candidate with inertia and jerk for the fits.
        start: initial delay of the search [s].
        known: colour of the noise of neighbouring bins; None: that about the first fit.
        rough: compute a rough standard error, which is sufficient to know whether it is finite.
        false: error of the acceleration's means, as from `MotionError.between_means`.
        raw: bins of all columns at `start`, if they are at hand.
        begin: coefficients of a similar fit, which save repetitions, (p,).
    """
    period = 1.0 / stretches[0].rate
    open_ = Slip(delay=start, error=np.inf, period=period)
    inertia, jerk = full.terms.index("inertia"), full.terms.index("jerk")
    delay, share, colour, theta = start, 1.0, known or WHITE, begin
    rounds = FEW if rough else robust.MANY
    lever = min(max(LEVER, LEVER_SAMPLES * period), STEP)
    tried: list[tuple[float, float]] = []
    while True:
        at_hand, raw = raw, None
        bins = at_hand.map_columns(full.spread) if at_hand else bins_at_delay(stretches, delay, knots, full)
        plain = bins if rough and not tried else None
        if known is None and not tried:  # for white noise, the fit need not be repeated
            theta = fit(bins, theta, rounds)
            colour = colour_of(
                bins.y - bins.X @ theta, bins.used, bins.X, _in_torque(false, full, theta), stretches[0].width
            )
        if theta is None or known is not None or tried or colour != WHITE:
            bins = bins.whiten(colour)
            if theta is not None and tried:  # the jerk makes up for less
                theta[jerk] -= theta[inertia] * (delay - tried[-1][0])
            theta = fit(bins, theta, rounds)
        if not theta[inertia] > 0.0:
            return replace(open_, colour=colour)
        tried.append((delay, float(theta[jerk] / theta[inertia])))
        if abs(tried[-1][1]) > BEYOND:
            return replace(open_, colour=colour)
        first = plain if colour.correlation < COLOURED else None
        share = response_by_one(first, stretches, theta, inertia, jerk) if first else 0.0
        if CLEARLY[0] < share < CLEARLY[1] and abs(tried[0][1]) <= lever * share:
            delay += tried[0][1] / share  # near enough for the search that begins there
            break
        delay, share, done = _next(tried, lever)
        if done or len(tried) == ROUNDS:
            break
        del bins  # long logs fill the memory
    residual = bins.y - bins.X @ theta
    if rough:
        covariance = regression.classical(bins.X[bins.used], residual[bins.used])
    else:
        covariance = noise.covariance_of_fit(bins.X, residual, bins.used, colour.independent)
    felt = theta[inertia] > FELT * float(np.sqrt(covariance[inertia, inertia]))
    if not (felt and share > SHOWN):
        return replace(open_, colour=colour)
    variance = float(covariance[jerk, jerk])
    if not rough:
        variance = max(variance, float(bins.sandwich(theta)[jerk, jerk]))
    error = float(np.sqrt(variance) / theta[inertia] / min(share, 1.0))
    if not rough:
        error = math.hypot(error, math.sqrt(between_samples(bins.X[bins.used], jerk, period)))
    return Slip(delay=delay, error=error, period=period, colour=colour)


def between_samples(X: np.ndarray, delay: int, period: float, width: int = 1) -> float:
    """Return the variance of a delay by what happens between samples [s^2].

    A jump of the acceleration between two samples looks alike wherever between them it is. A delay that few jumps tell is
    uncertain by a part of the sampling interval.

    Args:
        X: columns that were fitted, whitened if the fit was, (n, p).
        delay: index of the one by which the delay was found.
        period: sampling interval [s].
        width: number of rows that a bin has: a low pass spreads a jump over several samples.
    """
    others = np.delete(X, delay, axis=1)
    told = (X[:, delay] - others @ regression.solve(others.T @ others, others.T @ X[:, delay])) ** 2
    told = np.add.reduceat(told, np.arange(0, told.size, width))
    moments = max(float(told.sum() ** 2 / max((told**2).sum(), 1e-300)), 1.0)
    return period**2 / (6.0 * moments)


def _next(tried: list[tuple[float, float]], lever: float) -> tuple[float, float, bool]:
    """Return the next delay to try, the response of the jerk there [-], and whether the search has converged.

    If the jerk's coefficient changes sign between two delays, the delay lies between them. The response is not constant, so
    it is taken between two delays close to the solution.

    Args:
        tried: delays, and the remaining delay that the jerk's coefficient indicated for each [s].
        lever: least distance of two delays that yields the response [s].
    """
    if len(tried) == 1:
        return _beyond(*tried[0], lever), 1.0, False
    ordered = sorted(tried)
    around = [(a, b) for a, b in zip(ordered, ordered[1:], strict=False) if a[1] > 0.0 >= b[1]]
    if not around:
        (before, had), (delay, left) = tried[-2:]
        share = float(np.clip((had - left) / (delay - before), *SHARES))
        return _beyond(delay, left / share, 0.5 * lever), 0.0, False
    (low, more), (high, less) = min(around, key=lambda pair: pair[1][0] - pair[0][0])
    share = (more - less) / (high - low)
    delay = low + more / share
    if high - low <= 1.5 * lever:
        return delay, share, True
    if delay - low < high - delay:  # a little beyond, so that the two delays enclose the solution
        return min(delay + 0.5 * lever, 0.5 * (delay + high)), share, False
    return max(delay - 0.5 * lever, 0.5 * (delay + low)), share, False


def _beyond(delay: float, left: float, least: float) -> float:
    """Return a delay plus the remaining one, with a step between `least` and `STEP` [s]."""
    return delay + math.copysign(min(max(abs(left), least), STEP), left)


def fit(bins: Bins, start: np.ndarray | None = None, rounds: int = robust.MANY) -> np.ndarray:
    """Return the coefficients of all columns, fitted with Huber's loss, (p,).

    Args:
        bins: to fit.
        start: coefficients of a similar fit, (p,).
        rounds: largest number of repetitions.
    """
    return robust.robust_solution(bins.X, bins.y, bins.used.astype(float), rounds, start)


def _in_torque(false: tuple[float, ...], full: design.Candidate, theta: np.ndarray) -> tuple[float, ...]:
    """Return the products by lag of what the error of the acceleration's means adds to a residual."""
    square = float(theta[full.terms.index("inertia")]) ** 2
    return tuple(square * product for product in false)
