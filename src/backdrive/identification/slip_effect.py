"""What an error of the torque's delay does to the coefficients of a fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from backdrive.identification import design, regression, robust
from backdrive.identification.motion_bins import Bins
from backdrive.identification.slip import Slip


def response(bins: Bins, change: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return by how much a fit changes if the motion is delayed further, with Huber's weights held, (r,).

    Args:
        bins: with the candidate's columns, which were fitted.
        change: of the torque that it predicts, as white as the bins [N.m or N], (n,).
        coefficients: of the fit, (r,).
    """
    residual = bins.y - bins.X @ coefficients
    width = robust.HUBER * robust.robust_spread(residual[bins.used])
    weighted = bins.X * (bins.used * robust.huber_weights(residual, width))[:, None]
    return regression.solve(weighted.T @ bins.X, -weighted.T @ change)


def with_slip(choice: design.Choice, change: np.ndarray, slip: Slip) -> design.Choice:
    """Return a choice with the delay of its motion as one of its terms, and with the delay's error added to all others.

    Args:
        choice: without a delay.
        change: of the coefficients for one standard error of the delay, (r,).
        slip: the delay.
    """
    candidate, k = choice.candidate, len(choice.candidate.terms)
    both = np.insert(change, k, slip.error * choice.coefficients[candidate.terms.index("inertia")])
    alone = np.insert(np.insert(choice.covariance, k, 0.0, axis=0), k, 0.0, axis=1)
    return replace(
        choice,
        candidate=candidate.with_term("jerk"),
        coefficients=np.insert(choice.coefficients, k, 0.0),
        covariance=alone + np.outer(both, both),
        left_out=np.insert(choice.left_out, k, 0.0, axis=1),
    )
