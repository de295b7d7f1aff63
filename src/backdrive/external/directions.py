"""The direction of a wrench that the joints of an arm do not feel in a posture, and its description in words.

A wrench w with J' w = 0 moves no joint. Where the arm is close to such a posture, the estimate along w is that of the damping P
instead of the joints. So w is the direction of the largest share of the damping,

    lambda = max  w' P w / w' (P + J S^-1 J') w,       w = P^-1/2 u,     u: first eigenvector of P^1/2 cov P^1/2

This includes directions that only joints at rest feel, whose torques are hardly known.
"""

from __future__ import annotations

import numpy as np

AXES = ("x", "y", "z")
ALONG = 0.97  # cosine to an axis from which on a direction is called by its name [-]
PART = 0.1  # share of the direction from which on force or moment is named [-]


def blind_directions(covariance: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """Return the direction that is felt least, (n, 6).

    Its damped size `w' P w` is 1, and its component that is largest in this measure is positive.

    Args:
        covariance: of the wrench, (n, 6, 6).
        damping: P, inverse variances [1/N^2, 1/(N.m)^2], (6,).
    """
    root = np.sqrt(damping)
    _, vectors = np.linalg.eigh(root[:, None] * covariance * root)
    u = vectors[:, :, -1]
    first = np.argmax(np.abs(u), axis=1)
    u = u * np.sign(np.take_along_axis(u, first[:, None], axis=1))
    return u / root


def usual_direction(directions: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the direction that most of several lie along, (6,), and the mean square of its cosine with them [-].

    Args:
        directions: of `blind_directions`, at least one, (n, 6).
        damping: P, (6,).
    """
    root = np.sqrt(damping)
    u = directions * root
    values, vectors = np.linalg.eigh(u.T @ u / len(u))
    main = vectors[:, -1] * np.sign(vectors[np.argmax(np.abs(vectors[:, -1])), -1])
    return main / root, float(values[-1])


def direction_words(direction: np.ndarray, damping: np.ndarray) -> str:
    """Describe a direction of the wrench, such as "force along y of the base".

    Args:
        direction: force [N] and moment [N.m], (6,).
        damping: P, by which force and moment are compared, (6,).
    """
    size = direction**2 * damping
    share = float(np.sum(size[:3]) / np.sum(size))
    force, moment = direction[:3], direction[3:]
    if share >= 1.0 - PART:
        return f"force along {_axis(force)} of the base"
    if share <= PART:
        return f"moment along {_axis(moment)} of the base"
    lever = float(np.linalg.norm(moment) / np.linalg.norm(force))
    if force[np.argmax(np.abs(force))] < 0.0:
        force, moment = -force, -moment
    return (
        f"force along {_axis(force)} of the base together with a moment along {_axis(moment)} "
        f"({lever:.2g} N.m per N)"
    )


def _axis(vector: np.ndarray) -> str:
    """Return the name of the axis that a vector lies along, or its components, of length 1."""
    unit = vector / np.linalg.norm(vector)
    k = int(np.argmax(np.abs(unit)))
    if abs(unit[k]) >= ALONG:
        return ("-" if unit[k] < 0.0 else "") + AXES[k]
    return f"({', '.join(f'{x:.2f}' for x in np.round(unit, 2) + 0.0)})"
