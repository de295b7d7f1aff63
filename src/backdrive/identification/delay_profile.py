"""Whether the fit's loss supports a delay and its error: the loss of fits with delays around it, as a parabola.

A search along the jerk may end at a wrong root if noise is correlated or the jerk responds weakly. The loss of a fit without the
jerk is least at the true delay, and exceeds that by the square of the distance, in standard errors. Where the minimum is elsewhere,
the delay is moved there; where the loss rises much more slowly, the error is enlarged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification import design, robust
from backdrive.identification.delay_bins import DelayStretch, bins_at_delay
from backdrive.identification.whitening import Colour

APART = 3.0  # distance of the three delays [standard error]
CENTRED = 1.0  # largest distance of the minimum from a delay that is kept [standard error]
ROUGHLY = 3.0  # the same of a delay that a clearer jerk tells, by more than the loss does [standard error]
ROUNDS = 6  # largest number of parabolas
FLAT = 0.02  # least curvature of a parabola that has a minimum, relative to that of the standard error [-]
AGREES = 0.4  # least curvature with which the standard error is kept, likewise [-]
STEADY = 3.0  # largest change of the loss by the acceleration's error [squared standard deviation]
NORMAL = 0.82  # rise of Huber's loss relative to that of the squares, with normal residuals [-]


def refine_delay(
    stretches: Sequence[DelayStretch],
    knots: np.ndarray,
    candidate: design.Candidate,
    delay: float,
    error: float,
    colour: Colour,
    centred: float = CENTRED,
    false: Sequence[float] = (),
) -> tuple[float, float]:
    """Return a delay that minimises the loss, or nearly so, and an error that its profile supports [s]; infinite without either.

    Args:
        stretches: of one joint.
        knots: of the fine basis [rad/s or m/s], (k,).
        candidate: of the fit, with inertia, without jerk.
        delay: as estimated [s].
        error: its standard error [s].
        colour: of the noise of neighbouring bins.
        centred: largest distance of the minimum from a delay that is kept [standard error].
        false: error of the acceleration's means, as from `MotionError.between_means`.
    """
    if false and _unsteady(stretches, knots, candidate, delay, colour, false) > STEADY:
        return delay, error
    apart = error
    for _ in range(ROUNDS):
        delays = delay + APART * apart * np.array([-1.0, 0.0, 1.0])
        low, middle, high = _losses(stretches, knots, candidate, delays, colour)
        if not np.isfinite(low + middle + high):
            break  # without noise
        curvature = (low + high - 2.0 * middle) / (2.0 * APART**2 * NORMAL)
        off = (low - high) / (4.0 * APART * NORMAL * max(curvature, FLAT))
        if curvature > FLAT:
            told = float(apart / np.sqrt(curvature))
            sure = error if told**2 * AGREES < error**2 else told
            if abs(off) * apart <= centred * sure:
                return delay, sure
        delay += float(np.clip(off, -APART, APART)) * apart
        if abs(off) > APART or not curvature > FLAT:
            apart *= 2.0
    return delay, np.inf


def _unsteady(
    stretches: Sequence[DelayStretch],
    knots: np.ndarray,
    candidate: design.Candidate,
    delay: float,
    colour: Colour,
    false: Sequence[float],
) -> float:
    """Return by how much the acceleration's error changes the loss from delay to delay [squared standard deviation]."""
    bins = bins_at_delay(stretches, delay, knots, candidate).whiten(colour)
    theta = robust.robust_solution(bins.X, bins.y, bins.used.astype(float))
    spread = robust.robust_spread((bins.y - bins.X @ theta)[bins.used])
    c = max(colour.correlation, 0.0)
    whitened = (false[0] * (1.0 + c**2) - 2.0 * c * false[1]) / (1.0 - c**2)
    inertia = theta[candidate.terms.index("inertia")]
    return 2.0 * float(abs(inertia) * np.sqrt(whitened * np.count_nonzero(bins.used)) / spread)


def _losses(
    stretches: Sequence[DelayStretch],
    knots: np.ndarray,
    candidate: design.Candidate,
    delays: np.ndarray,
    colour: Colour,
) -> np.ndarray:
    """Return Huber's loss of fits with some delays [s], by the variance of the noise, (k,); NaN without noise."""
    each = [bins_at_delay(stretches, delay, knots, candidate) for delay in delays]
    used = np.logical_and.reduce([bins.used for bins in each])
    residuals, theta = [], None
    for bins in each:
        whitened = replace(bins, used=used).whiten(colour)
        theta = robust.robust_solution(whitened.X, whitened.y, whitened.used.astype(float), start=theta)
        residuals.append((whitened.y - whitened.X @ theta)[whitened.used])
    spread = min(robust.robust_spread(residual) for residual in residuals)
    if not spread > 0.0:
        return np.full(len(each), np.nan)
    return np.array(
        [np.sum(robust.huber_loss(np.abs(residual) / spread, robust.HUBER)) for residual in residuals]
    )
