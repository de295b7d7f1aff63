"""Weighted, bounded, robust least squares for a whole arm, with weak priors and standard errors from left-out blocks.

The coefficients are the base parameters of the bodies, followed by every joint's own terms. Joints share the bodies, so each
joint is weighted by its noise. Wide priors determine what the motion does not: bodies near the description, curves smooth and
nearly equal in both directions. Except at reversals, a constant difference between the directions cannot be separated from a
torque offset. By convention it counts as offset: averaged over the knots at which the joint slides, a curve is equal in both
directions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from backdrive.identification import regression, robust
from backdrive.identification.arm_errors import blocks_of, errors_of_fit
from backdrive.identification.arm_terms import Rows, Terms
from backdrive.identification.quality import JUDGED_BELOW
from backdrive.robot import Robot

ROUNDS = 12  # largest number of iterations of weights and load
SETTLED = 1e-4  # change of the torque below which the iterations end, relative to its noise [-]
WILD = 2.0  # residuals above this size get less weight (Huber) [standard deviation]
ROUGH = 0.3  # prior standard deviation of a curve's bend, relative to the joint's RMS torque [-]
UNLIKE = 0.05  # prior standard deviation of the directions' difference, relative to the RMS torque [-]
LEVEL = 3.0  # prior standard deviation of the friction, relative to the joint's RMS torque [-]
LOAD = 0.3  # prior standard deviation of the load friction [-]
STRONG = 1e4  # weight of the convention on the offset, relative to the data [-]
NONE = 1e-12  # replaces an upper bound of zero, which must be positive
MEMORY = 2.0  # longest correlation of the residuals [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """The fitted coefficients.

    Attributes:
        beta: base parameters [kg, kg.m, kg.m^2], (b,).
        own: coefficients of each joint's terms, J arrays (2 k + 3,).
        errors: standard errors of `own`, J arrays; those of coefficients at a bound are as if they were freed.
        pushed: distance of the free estimate below a lower bound [standard error], 0 for free coefficients, J arrays
            (2 k + 3,).
        told: share of each base parameter's prior variance that the data removed [-], (b,).
        condition: of the rigid-body columns at unit length [-].
        joint: covariance of all coefficients, bodies first, zero for those at a bound, (p, p).
        noise: standard deviation of the filtered torque's noise [N.m or N], (J,).
    """

    beta: np.ndarray
    own: list[np.ndarray]
    errors: list[np.ndarray]
    pushed: list[np.ndarray]
    told: np.ndarray
    condition: float
    joint: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    noise: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def first(self) -> np.ndarray:
        """Index of each joint's first own coefficient among all, and the number of all, (J + 1,)."""
        return self.beta.size + np.concatenate([[0], np.cumsum([own.size for own in self.own])]).astype(int)

    @property
    def bodies(self) -> np.ndarray:
        """Covariance of the base parameters, (b, b)."""
        return self.joint[: self.beta.size, : self.beta.size]

    @property
    def level(self) -> np.ndarray:
        """Covariance of the base parameters, followed by the joints' offsets, (b + J, b + J)."""
        offsets = np.r_[: self.beta.size, self.first[1:] - 3]
        return self.joint[np.ix_(offsets, offsets)]

    @property
    def everything(self) -> np.ndarray:
        """Covariance of all coefficients, bodies first, (p, p); each one at a bound is treated as if it alone were freed."""
        variances = np.concatenate([np.zeros(self.beta.size), *(e**2 for e in self.errors)])
        return self.joint + np.diag(np.where(np.diag(self.joint) > 0.0, 0.0, variances))

    def covariance(self, j: int) -> np.ndarray:
        """Return the covariance of a joint's own coefficients, (2 k + 3, 2 k + 3)."""
        own = slice(*self.first[j : j + 2])
        return self.joint[own, own]

    def with_bodies(self, beta: np.ndarray) -> Solution:
        """Return the conditional estimate of all coefficients for given base parameters, (b,), within the bounds."""
        b, own = self.beta.size, []
        change = np.linalg.solve(self.bodies, beta - self.beta)
        for j, before in enumerate(self.own):
            shared = self.joint[slice(*self.first[j : j + 2]), :b]
            after = np.maximum(before + shared @ change, np.minimum(before, 0.0))
            after[-3] = before[-3] + shared[-3] @ change
            own.append(after)
        return replace(self, beta=beta, own=own)


def spread_of(robot: Robot) -> np.ndarray:
    """Return the expected deviation of each standard parameter from the description's, (10 J,).

    It is the mass of the arm for a mass, times a link's length for a first moment, times its square for an inertia.
    """
    mass = float(robot.parameters[::10].sum()) or float(len(robot.joints))
    lengths = [float(np.linalg.norm(m.translation)) for m in list(robot.model.jointPlacements)[1:]]
    length = float(np.mean(lengths)) or 0.1
    return np.tile(mass * length ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2]), len(robot.joints))


def solve_arm(
    rows: Rows,
    robot: Robot,
    terms: Sequence[Terms],
    refill: Callable[[np.ndarray], None],
    loaded: np.ndarray,
) -> Solution:
    """Fit all coefficients.

    Args:
        rows: filtered and thinned.
        robot: the description, near which the bodies are expected.
        terms: of every joint.
        refill: function that writes the load columns of `rows` for new base parameters.
        loaded: mask of the joints that may have load friction, (J,).
    """
    b, J = rows.bodies.shape[2], len(terms)
    first = b + np.concatenate([[0], np.cumsum([t.size for t in terms])]).astype(int)
    scale = np.array([_rms(rows.torque[:, j], rows.weight[:, j]) for j in range(J)])
    start, precision = _prior(rows, robot, terms, scale)
    low, high = _bounds(b, terms, loaded)
    huber, noise = np.ones_like(rows.weight), 0.1 * scale
    x, fitted = start.copy(), np.zeros_like(rows.torque)
    for _ in range(ROUNDS):
        gram, moment = _normal(rows, first, rows.weight * huber / noise**2, start)
        held = precision + _alike(gram, first, terms)
        x = start + _minimise_within(gram + held, moment, low - start, high - start)
        before = fitted
        fitted = _predict(rows, first, x)
        error = rows.torque - fitted
        noise = np.array([_noise(error[:, j], rows.weight[:, j], scale[j]) for j in range(J)])
        huber = robust.huber_weights(error, WILD * noise)
        change = (fitted - before) * rows.weight / noise
        if np.sqrt(np.mean(change**2)) < SETTLED:
            break
        if any(loaded):
            refill(x[:b])
    blocks = _blocks(rows, first, rows.weight * huber / noise**2, x)
    free = (x > low) & (x < high)
    sure = errors_of_fit(blocks, held, held @ (start - x), free)
    errors = np.where(free, np.sqrt(np.diag(sure.covariance)), sure.loose)
    prior = np.diag(np.linalg.inv(precision[:b, :b]))
    return Solution(
        beta=x[:b],
        own=[x[first[j] : first[j + 1]] for j in range(J)],
        errors=[errors[first[j] : first[j + 1]] for j in range(J)],
        pushed=[sure.pushed[first[j] : first[j + 1]] for j in range(J)],
        told=1.0 - np.diag(sure.covariance)[:b] / prior,
        condition=regression.condition(blocks.gram.sum(axis=0)[:b, :b]),
        joint=sure.covariance,
        noise=noise,
    )


def sandwich(gram: np.ndarray, scores: np.ndarray, held: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return the covariance of penalised least squares, zero for coefficients at a bound, (p, p).

    Args:
        gram: of the weighted rows, (p, p).
        scores: covariance of the data's part of the gradient, (p, p).
        held: precision of the priors, (p, p).
        free: coefficients that are at no bound, (p,).
    """
    pick, covariance = np.ix_(free, free), np.zeros_like(gram)
    inverse = regression.invert((gram + held)[pick], 1e-15)
    covariance[pick] = inverse @ (scores + held)[pick] @ inverse
    return covariance


def expect(
    rows: Rows, robot: Robot, terms: Sequence[Terms], noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the covariance of a fit to given rows for white noise of the torque, without load friction.

    Args:
        rows: filtered and thinned, with the torque that the motion requires.
        robot: the description.
        terms: of every joint.
        noise: standard deviation of the filtered torque's noise [N.m or N], (J,).

    Returns:
        Covariance of all coefficients, (p, p), and its part due to noise, (p, p); the rest is due to the priors.
    """
    b, J = rows.bodies.shape[2], len(terms)
    first = b + np.concatenate([[0], np.cumsum([t.size for t in terms])]).astype(int)
    scale = np.array([_rms(rows.torque[:, j], rows.weight[:, j]) for j in range(J)])
    start, precision = _prior(rows, robot, terms, scale)
    gram, _ = _normal(rows, first, rows.weight / noise**2, start)
    held = precision + _alike(gram, first, terms)
    free = np.ones(first[-1], dtype=bool)
    free[first[1:] - 1] = False
    swell = max(
        1.0, rows.rate / (2.0 * JUDGED_BELOW)
    )  # white noise below a corner frequency f has 2 f independent values per second
    by_noise = sandwich(gram, swell * gram - held, held, free)
    return sandwich(gram, swell * gram, held, free), by_noise


def _rms(x: np.ndarray, weight: np.ndarray) -> float:
    used = x[weight > 0]
    return float(np.sqrt(np.mean(used**2))) or 1.0 if used.size else 1.0


def _noise(error: np.ndarray, weight: np.ndarray, scale: float) -> float:
    """Return a robust standard deviation, at least the rounding error of a fit in float64."""
    return max(robust.robust_spread(error, weight), 1e-6 * scale) if np.any(weight > 0) else scale


def _predict(rows: Rows, first: np.ndarray, x: np.ndarray) -> np.ndarray:
    fitted = rows.bodies @ x[: first[0]]
    for j, own in enumerate(rows.friction):
        fitted[:, j] += own @ x[first[j] : first[j + 1]]
    return fitted


def _normal(
    rows: Rows, first: np.ndarray, weight: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations for the deviation from `start`."""
    b = first[0]
    gram, moment = np.zeros((first[-1], first[-1])), np.zeros(first[-1])
    for j, own in enumerate(rows.friction):
        used = weight[:, j] > 0
        columns = np.hstack([rows.bodies[used, j], own[used]])
        place = np.concatenate([np.arange(b), np.arange(first[j], first[j + 1])])
        weighted = columns * weight[used, j, None]
        gram[np.ix_(place, place)] += weighted.T @ columns
        moment[place] += weighted.T @ (rows.torque[used, j] - columns @ start[place])
    return gram, moment


def _blocks(rows: Rows, first: np.ndarray, weight: np.ndarray, x: np.ndarray) -> regression.Blocks:
    """Return the normal equations for the deviation from `x` in each block of time, for all joints together."""
    block = blocks_of(len(rows.torque), rows.rate)
    parts = []
    for k in range(block[-1] + 1):
        inside = block == k
        some = replace(
            rows,
            bodies=rows.bodies[inside],
            friction=[own[inside] for own in rows.friction],
            torque=rows.torque[inside],
        )
        parts.append(_normal(some, first, weight[inside], x))
    count = np.bincount(block, weights=np.count_nonzero(weight > 0, axis=1))
    gram, moment = (np.array(part) for part in zip(*parts, strict=True))
    return regression.Blocks(gram=gram, moment=moment, power=np.zeros(count.size), rows=count)


def _prior(
    rows: Rows, robot: Robot, terms: Sequence[Terms], scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and precision (inverse covariance) of the coefficients' prior."""
    relation = robot.base.relation
    b = relation.shape[0]
    size = b + sum(t.size for t in terms)
    start, precision = np.zeros(size), np.zeros((size, size))
    start[:b] = relation @ robot.parameters
    precision[:b, :b] = np.linalg.inv((relation * spread_of(robot) ** 2) @ relation.T)
    at = b
    for j, t in enumerate(terms):
        k = t.knots.size
        gap, one, zero = np.diff(t.knots), np.eye(k), np.zeros((k, k))
        bend = np.diff(np.diff(one, axis=0) / gap[:, None], axis=0)
        bend *= np.sqrt((gap[:-1] + gap[1:]) / 2 * t.knots[-1])[:, None] / ROUGH
        alike, level = one / UNLIKE, one / LEVEL
        wish = np.block([[bend, zero[2:]], [zero[2:], bend], [alike, -alike], [level, zero], [zero, level]])
        own = np.zeros((t.size, t.size))
        own[: 2 * k, : 2 * k] = wish.T @ wish / scale[j] ** 2
        brisk = _rms(rows.friction[j][:, 2 * k + 1], rows.weight[:, j])
        own[2 * k, 2 * k] += 1 / scale[j] ** 2
        own[2 * k + 1, 2 * k + 1] += (brisk / scale[j]) ** 2
        own[2 * k + 2, 2 * k + 2] += 1 / LOAD**2
        precision[at : at + t.size, at : at + t.size] = own
        at += t.size
    return start, precision


def _alike(gram: np.ndarray, first: np.ndarray, terms: Sequence[Terms]) -> np.ndarray:
    """Return a precision, large compared with that of the data, that makes both directions equal on average."""
    precision = np.zeros_like(gram)
    for j, t in enumerate(terms):
        k = t.knots.size
        row = np.zeros(t.size)
        share = t.sliding / np.count_nonzero(t.sliding)
        row[:k], row[k : 2 * k] = share, -share
        own = slice(first[j], first[j + 1])
        precision[own, own] = STRONG * max(float(np.diag(gram)[own][: 2 * k].sum()), 1.0) * np.outer(row, row)
    return precision


def _bounds(b: int, terms: Sequence[Terms], loaded: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds: friction dissipates, inertias are positive, and a gear loses no more than it transmits."""
    low, high = [np.full(b, -np.inf)], [np.full(b, np.inf)]
    for t, load in zip(terms, loaded, strict=True):
        own_low, own_high = np.zeros(t.size), np.full(t.size, np.inf)
        own_low[-3] = -np.inf
        own_high[-1] = 1.0 if load else NONE
        low.append(own_low)
        high.append(own_high)
    return np.concatenate(low), np.concatenate(high)


def _minimise_within(gram: np.ndarray, moment: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the minimiser of x'Gx/2 - m'x between the bounds."""
    from scipy.linalg import cholesky, solve_triangular
    from scipy.optimize import lsq_linear

    size = np.sqrt(np.diag(gram))
    upper = cholesky(gram / np.outer(size, size))
    right = solve_triangular(upper, moment / size, trans=1)
    free = solve_triangular(upper, right)
    if np.all((free >= low * size) & (free <= high * size)):
        return free / size
    found = lsq_linear(upper, right, (low * size, high * size), method="bvls", tol=1e-14)
    return np.clip(found.x / size, low, high)


def correlation_length(error: np.ndarray, rate: float) -> float:
    """Return the number of correlated residuals that equal one independent residual (Bartlett window), at least 1."""
    width = min(max(int(MEMORY * rate), 1), error.size - 1) + 1
    power = float(error @ error)
    return max(1.0, float(regression.long_run(error[None], width)[0, 0]) / power) if power > 0.0 else 1.0
