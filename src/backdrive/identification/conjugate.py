"""The combination of a Gaussian estimate with a Gaussian prior (conjugate update), and the distance of both.

The prior states a few numbers y ~ N(m, S). The estimate theta, with covariance C, has y = h(theta) with the Jacobian H. Then

    G = H C H' + S,   K = C H' G^-1
    theta + K (m - h),   (I - K H) C (I - K H)' + K S K'

and the squared distance is (m - h)' G^-1 (m - h). Directions of theta on which the prior says nothing change only as far as the
estimate correlates them with the others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

FEWEST = 0.5  # least n - k - 2 that is taken


@dataclass(frozen=True, kw_only=True)
class Update:
    """A Gaussian estimate after a prior.

    Attributes:
        mean: of the estimate, (m,).
        covariance: of it, (m, m).
        distance: of estimate and prior (Mahalanobis) [-].
        degrees: of freedom of the distance.
        p: probability of a larger distance by chance [-].
    """

    mean: np.ndarray
    covariance: np.ndarray
    distance: float
    degrees: int
    p: float


def conjugate(
    theta: np.ndarray,
    C: np.ndarray,
    H: np.ndarray,
    h: np.ndarray,
    m: np.ndarray,
    S: np.ndarray,
    robots: int | None = None,
) -> Update:
    """Return the combination of an estimate with a prior, as given at the top of this module.

    With a covariance from n robots, the distance is Hotelling's: its tails are those of the F distribution. In the combination S is
    then multiplied by (n - 1) / (n - k - 2), so that its inverse has the right mean (inverse Wishart); few robots would otherwise
    seem too much alike.

    Args:
        theta: estimate, (m,).
        C: its covariance, (m, m).
        H: Jacobian of the numbers that the prior states, (k, m).
        h: these numbers by the estimate, (k,).
        m: these numbers by the prior, (k,).
        S: covariance of the prior, (k, k).
        robots: from which S was estimated; None: S is exact.
    """
    from scipy.special import chdtrc, fdtrc

    own = H @ C @ H.T
    root = _inverse_root(own + S)
    k = len(root)
    squared = float(np.sum((root @ (m - h)) ** 2))
    if robots is not None:
        S = S * (1.0 + (k + 1.0) / max(robots - k - 2.0, FEWEST))
        root = _inverse_root(own + S)
    K = C @ H.T @ root.T @ root
    rest = np.eye(theta.size) - K @ H
    after = rest @ C @ rest.T + K @ S @ K.T
    if robots is None or robots <= k:
        p = float(chdtrc(k, squared))
    else:
        p = float(fdtrc(k, robots - k, squared * (robots - k) / (k * (robots - 1))))
    return Update(
        mean=theta + K @ (m - h),
        covariance=0.5 * (after + after.T),
        distance=math.sqrt(squared),
        degrees=k,
        p=p,
    )


def _inverse_root(G: np.ndarray) -> np.ndarray:
    """Return a matrix whose square is the (pseudo-)inverse of a covariance: R' R = G^-1, (rank, k)."""
    scale = np.sqrt(np.maximum(np.diag(G), 1e-300))  # numbers of different units
    values, vectors = np.linalg.eigh(G / np.outer(scale, scale))
    kept = values > 1e-12 * values.max()
    return (vectors[:, kept] / np.sqrt(values[kept])).T / scale
