"""Gains of the observers of position, velocity and external force, from poles or from noise, with the same lag for all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from backdrive._jit import jit
from backdrive.elementary import exp

if TYPE_CHECKING:
    from backdrive.control.estimators.external import ExternalForce


@jit
def threefold(L, T):
    """Return the gains, in ticks, of an observer of q, v, d with all poles at exp(-L T)."""
    b = exp(-L * T)
    return 1.0 - b * b * b, 1.5 * (1.0 - b) * (1.0 - b) * (1.0 + b), (1.0 - b) * (1.0 - b) * (1.0 - b)


def lag(gains: Sequence[float] | np.ndarray) -> float:
    """Return the lag of an observer with these gains for a force that grows at a constant rate [tick]."""
    predict = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    missed = np.array(
        [1.0 / 6.0, 0.5, 1.0]
    )  # errors of position, velocity and force after a tick in which the force grows by one
    correct = np.eye(3) - np.outer(gains, [1.0, 0.0, 0.0])
    return float(np.linalg.solve(np.eye(3) - correct @ predict, correct @ missed)[2])


def by_poles(estimator: ExternalForce, dt: float) -> tuple[float, float, float, float]:
    """Return the gains of an observer with all poles at b = exp(-p T), and p: they lag by 1/L + T.

    Three poles and the observer itself lag by 3 b/(1 - b) + 1 ticks, so that b = 1/(1 + 3 L T).
    """
    pole = float(np.log1p(3.0 * estimator.bandwidth * dt) / dt)
    return (*threefold(pole, dt), pole)


def stationary(estimator: ExternalForce, dt: float) -> tuple[float, float, float, float]:
    """Return the gains of the stationary Kalman filter for a random walk of d = tau_e/M, and the equivalent pole.

    Without a force rate, the gains are those that lag by 1/L + T. With r = (1 + L T/2)/(1 + 5 L T/2) they are a = 1 - r^2,
    b = 2 (2 - a) - 4 r and b^2/(2 a) (P. R. Kalata, IEEE Trans. Aerospace and Electronic Systems 20(2), 1984).
    """
    if estimator.force_rate is None:
        x = estimator.bandwidth * dt
        r = (1.0 + 0.5 * x) / (1.0 + 2.5 * x)
        a = 1.0 - r * r
        b = 2.0 * (2.0 - a) - 4.0 * r
        return a, b, b * b / (2.0 * a), float(-np.log(1.0 - a) / (3.0 * dt))
    walk = estimator.force_rate / estimator.inertia * np.sqrt(dt) * dt**2 / estimator.encoder_count
    return _riccati(walk, dt)


def _riccati(walk: float, dt: float) -> tuple[float, float, float, float]:
    """Return the stationary gains for a random walk of d, by `walk` [count/tick^2] per tick, and the equivalent pole."""
    from scipy.linalg import solve_discrete_are

    # lengths in counts and times in ticks, so that the equation is well scaled
    A = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    C = np.array([[1.0, 0.0, 0.0]])
    Q, R = np.diag([0.0, 0.0, walk**2]), np.array([[1.0 / 12.0]])
    P = solve_discrete_are(A.T, C.T, Q, R)
    K = (P @ C.T / (C @ P @ C.T + R)).ravel()
    # the pole: that of a triple pole with the same first gain
    return float(K[0]), float(K[1]), float(K[2]), float(-np.log(1.0 - K[0]) / (3.0 * dt))
