"""How a predicted torque changes with the delay of its motion, without bins of another delay.

The means of a delayed torque change by what enters a bin at its beginning, less what leaves it at its end, by its length. For a
small change of the delay, that is all that changes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.identification import design, regression
from backdrive.identification.delay_bins import DelayStretch
from backdrive.identification.motion_bins import Bins

NEAR = (
    0.1  # largest change of a delay with which a torque is taken to change in proportion [sampling interval]
)


def change_with_delay(
    stretches: Sequence[DelayStretch], delay: float, candidate: design.Candidate, coefficients: np.ndarray
) -> np.ndarray:
    """Return the derivative of the means of a predicted torque by the delay [N.m/s or N/s], (n,).

    Args:
        stretches: of one joint.
        delay: of the torque behind the motion [s].
        candidate: whose terms and curve give the torque.
        coefficients: of it, (r,).
    """
    each = [s.change(delay, candidate, coefficients) for s in stretches]
    return each[0] if len(each) == 1 else np.concatenate(each)


def bins_near(
    bins: Bins,
    at: float,
    delay: float,
    stretches: Sequence[DelayStretch],
    candidate: design.Candidate,
    theta: np.ndarray,
) -> Bins | None:
    """Return bins that give the same fits as those of a slightly other delay would; None if it is not near enough.

    They keep their columns. What the other delay changes of the predicted torque is taken from the measured one.

    Args:
        bins: of all columns, at a delay.
        at: that delay [s].
        delay: the other one [s].
        stretches: of one joint.
        candidate: that was fitted to them.
        theta: its coefficients, (r,).
    """
    rate = stretches[0].rate
    if abs(delay - at) * rate > NEAR or round(delay * rate) != round(at * rate):
        return None
    return bins.with_torque(bins.y - (delay - at) * change_with_delay(stretches, at, candidate, theta))


def response_by_one(
    bins: Bins, stretches: Sequence[DelayStretch], theta: np.ndarray, inertia: int, jerk: int
) -> float:
    """Return the response of the jerk to a delay [-] by one fit alone, from the change of its torque with time.

    A torque that is late by a short time d is that of the fit less d times its derivative. Other terms take a part of this, or
    make more of it. Where the joint is light, or the delay long, that may be nearly all.

    Args:
        bins: that were fitted, as they were before whitening.
        stretches: of one joint, from which the bins were computed.
        theta: coefficients of the fit, (p,).
        inertia: index of the inertia.
        jerk: index of the jerk.
    """
    torque = bins.X @ theta - bins.X[:, jerk] * theta[jerk]
    inside = bins.used[1:-1] & bins.used[2:] & bins.used[:-2]
    if len(stretches) > 1:
        part = np.repeat(np.arange(len(stretches)), [s.count for s in stretches])
        inside &= part[2:] == part[:-2]
    rows, apart = 1 + np.flatnonzero(inside), 2.0 * stretches[0].width / stretches[0].rate
    change, X = (torque[rows - 1] - torque[rows + 1]) / apart, bins.X[rows]
    return float(regression.solve(X.T @ X, X.T @ change)[jerk] / theta[inertia])
