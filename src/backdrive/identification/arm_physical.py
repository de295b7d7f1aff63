"""Physically consistent inertial parameters, chosen among all those with the same torques.

Joint torques determine only the base parameters beta = R theta. The least-squares theta may have a negative mass or an
impossible inertia. Then another theta with the same beta is used, so that all predictions stay the same. Among all theta
whose links have positive definite pseudo-inertias P_k, it has the least divergence from the description's P_k0,

    minimise  sum_k tr(P_k0^-1 P_k) - log det P_k     subject to R theta = beta

(Lee, Wensing & Park, T-RO 36, 2020: the same in any unit and frame). The problem is convex, and its objective is its own
barrier. A first search, for the largest s with P_k - s 1 > 0, finds a starting point, or shows that no bodies have these base
parameters. In that case the consistent parameters nearest to beta, by its covariance C, are computed,

    minimise  (R theta - beta)' C^-1 (R theta - beta) / 2 + mu sum_k (tr(P_k0^-1 P_k) - log det P_k),     mu small
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from backdrive.identification.pseudo_inertia import BASIS, pseudo_inertia
from backdrive.robot import PER_LINK, Robot

LEAST = 1e-7  # least eigenvalue of a body's pseudo-inertia, in units of the arm's mass and length [-]
TIGHTER = 10.0  # factor on the weight of s in each round of the search for a starting point [-]
ROUNDS, STEPS = 14, 60  # most rounds of the search for a starting point, and most steps of Newton's method
SETTLED = 1e-9  # squared Newton decrement below which a minimisation ends
WEIGHTS = 10.0 ** np.arange(6.0, -4.0, -1.0)  # values of mu, one per round
NEAR = 1e-3  # weight that keeps undetermined parameters near their initial values in the first search [-]


def possible(theta: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Return a mask of the links whose parameters are physically consistent, (J,).

    Args:
        theta: standard parameters [kg, kg.m, kg.m^2], (10 J,).
        spread: scale of each parameter in its unit, (10 J,).
    """
    return np.linalg.eigvalsh(_matrices(theta, spread))[:, 0] > 0.5 * LEAST


def standard_parameters(
    robot: Robot, beta: np.ndarray, spread: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return standard parameters with given base parameters, physically consistent if such parameters exist.

    Args:
        robot: the description; the result is as near to its bodies as possible.
        beta: base parameters, (b,).
        spread: expected deviation of each standard parameter from the description, in its unit, (10 J,).
        covariance: of the base parameters, (b, b).

    Returns:
        theta, (10 J,), and the squared distance of its base parameters from beta, divided by the distance that contains 95 %
        of all errors [-]. The distance is 0, and relation @ theta = beta, if physical bodies have these base parameters. Above
        1, errors do not explain the inconsistency; theta is then the least-squares solution nearest to the description, with
        relation @ theta = beta.
    """
    nearest = robot.base.standard(beta, robot.parameters, spread)
    if possible(nearest, spread).all():
        return nearest, 0.0
    _, size, rows = np.linalg.svd(robot.base.relation * spread)
    free = rows[
        np.count_nonzero(size > 1e-12 * size[0]) :
    ].T  # directions without effect on the torque, (10 J, d)
    wanted = np.linalg.inv(_matrices(robot.parameters, spread) + LEAST * np.eye(4))
    begin, slopes = _matrices(nearest, spread), _slopes(free)
    x = _interior(begin, slopes)
    if x is not None:
        x = _newton(x, begin, slopes, np.einsum("kij,kdji->d", wanted, slopes))
        return nearest + spread * (free @ x), 0.0
    theta = spread * _nearest_possible(robot.base.relation * spread, beta, covariance, wanted)
    change = robot.base.relation @ theta - beta
    distance = float(change @ np.linalg.solve(covariance, change) / chdtri(beta.size, 0.05))
    return (theta, distance) if distance <= 1.0 else (nearest, distance)


def _nearest_possible(
    relation: np.ndarray, beta: np.ndarray, covariance: np.ndarray, wanted: np.ndarray
) -> np.ndarray:
    """Return the physically consistent parameters [spread] with base parameters nearest to `beta`, (10 J,)."""
    J = len(wanted)
    slopes = _slopes(np.eye(PER_LINK * J))
    both = relation.T @ np.linalg.solve(covariance, np.column_stack([relation, -beta]))
    pull, cost = both[:, :-1], both[:, -1]
    divergence = np.einsum("kij,kdji->d", wanted, slopes)
    x = np.tile([1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 2.0, 0.0, 0.0, 2.0], J) / J  # all P_k are equal
    for mu in WEIGHTS:
        x = _newton(x, np.zeros((J, 4, 4)), slopes, cost / mu + divergence, pull / mu)
    return x


def _slopes(directions: np.ndarray) -> np.ndarray:
    """Return the derivatives of the links' matrices, (J, d, 4, 4), along directions of the parameters [spread], (10 J, d)."""
    return np.einsum("kpd,pij->kdij", directions.reshape(-1, PER_LINK, directions.shape[1]), BASIS)


def _matrices(theta: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Return the links' pseudo-inertias in units of the arm's mass and length, (J, 4, 4)."""
    return pseudo_inertia((theta / spread).reshape(-1, PER_LINK))


def _interior(begin: np.ndarray, slopes: np.ndarray) -> np.ndarray | None:
    """Return x at which all begin + sum_d x_d slopes_d are positive definite with a margin, (d,); None if there is none.

    Args:
        begin: matrices at x = 0, (J, 4, 4).
        slopes: derivatives with respect to x, (J, d, 4, 4).
    """
    J, d = slopes.shape[:2]
    down = np.broadcast_to(-np.eye(4), (J, 1, 4, 4))
    wider = np.concatenate([slopes, down], axis=1)  # the last unknown is s
    x = np.zeros(d + 1)
    x[-1] = float(np.linalg.eigvalsh(begin).min()) - 1.0
    weight, pull = 1.0, np.diag(np.append(np.full(d, NEAR), 0.0))
    for _ in range(ROUNDS):
        x = _newton(x, begin, wider, np.append(np.zeros(d), -weight), pull)
        if x[-1] > LEAST:
            return x[:-1]
        weight *= TIGHTER
    return None


def _newton(
    x: np.ndarray,
    begin: np.ndarray,
    slopes: np.ndarray,
    cost: np.ndarray,
    pull: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Return the minimiser of cost'x + x'(pull)x/2 - sum_k log det P_k(x) by damped Newton steps, (d,).

    Args:
        x: starting point at which all P_k are positive definite, (d,).
        begin: P_k at x = 0, (J, 4, 4).
        slopes: derivatives of P_k, (J, d, 4, 4).
        cost: linear coefficients, (d,).
        pull: quadratic coefficients, (d, d).
    """
    pull = np.zeros((x.size, x.size)) + pull
    for _ in range(STEPS):
        inverse = np.linalg.inv(begin + np.tensordot(x, slopes, axes=(0, 1)))
        parts = inverse[:, None] @ slopes
        slope = cost + pull @ x - np.einsum("kdii->d", parts)
        bend = np.einsum("kdij,keji->de", parts, parts) + pull
        scale = np.sqrt(np.diag(bend)) + 1e-300
        step = -np.linalg.lstsq(bend / np.outer(scale, scale), slope / scale, rcond=1e-15)[0] / scale
        decrement = max(float(-slope @ step), 0.0)
        size = 1.0 / (1.0 + np.sqrt(decrement))  # keeps all matrices positive definite (self-concordance)
        x = x + (step if decrement < 0.05 else size * step)
        if decrement < SETTLED:
            break
    return x
