"""Weighted, bounded, robust least squares for a whole arm, with weak priors and honest standard errors.

Coefficients: the base parameters of the bodies, then every joint's own terms. Joints share the bodies, so each is weighted
by its noise. Wide priors hold what the motion does not determine: bodies near the description, curves smooth and nearly equal
in both directions. Except at reversals, a constant difference between the directions cannot be separated from a torque
offset. By convention it counts as offset: averaged over the knots at which the joint slides, a curve is equal in both directions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from backdrive.identification import regression
from backdrive.identification.arm_errors import blocks_of, errors_of_fit
from backdrive.identification.arm_terms import Rows, Terms
from backdrive.identification.quality import JUDGED_BELOW
from backdrive.robot import Robot

ROUNDS = 12  # of reweighting and of the load, at most
SETTLED = 1e-4  # the rounds end when torque changes by less than this share of its noise [-]
WILD = 2.0  # residuals beyond so many standard deviations count less (Huber)
ROUGH = 0.3  # expected bend of a friction curve, as a share of the joint's torque [-]
UNLIKE = 0.05  # expected difference of the two directions [the same]
LEVEL = 3.0  # expected friction [the same]
LOAD = 0.3  # expected load friction [-]
STRONG = 1e4  # weight of a convention relative to the data [-]
NONE = 1e-12  # stands for zero where a bound above zero is needed
MEMORY = 2.0  # residuals are taken to be correlated over this long [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """The fitted coefficients.

    Attributes:
        beta: base parameters [kg, kg.m, kg.m^2], (b,).
        own: coefficients of each joint's terms, J arrays (2 k + 3,).
        errors: their standard errors in the same order, at a bound as if it were let go, J arrays.
        pushed: how far the free estimate lies below a lower bound [standard error]; 0 for free coefficients,
            J arrays (2 k + 3,).
        told: share of each base parameter's prior variance that the data removed [-], (b,).
        condition: of the rigid-body columns at unit length [-].
        joint: covariance of all coefficients, bodies first, zero for what is at a bound, (p, p).
        noise: of the filtered torque [N.m or N], (J,).
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
        """Where each joint's own coefficients begin among all, and where the last ones end, (J + 1,)."""
        return self.beta.size + np.concatenate([[0], np.cumsum([own.size for own in self.own])]).astype(int)

    @property
    def bodies(self) -> np.ndarray:
        """Covariance of the base parameters, (b, b)."""
        return self.joint[: self.beta.size, : self.beta.size]

    @property
    def level(self) -> np.ndarray:
        """Covariance of the base parameters and, after them, of the joints' offsets, (b + J, b + J)."""
        offsets = np.r_[: self.beta.size, self.first[1:] - 3]
        return self.joint[np.ix_(offsets, offsets)]

    @property
    def everything(self) -> np.ndarray:
        """Covariance of all coefficients, bodies first, at a bound as if let go alone, (p, p)."""
        variances = np.concatenate([np.zeros(self.beta.size), *(e**2 for e in self.errors)])
        return self.joint + np.diag(np.where(np.diag(self.joint) > 0.0, 0.0, variances))

    def covariance(self, j: int) -> np.ndarray:
        """Return that of a joint's own coefficients, (2 k + 3, 2 k + 3)."""
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
    """Return how far each standard parameter may be expected from the description's, (10 J,).

    The whole mass for a mass, times a link's length for a first moment, and once more for an inertia.
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
        robot: whose description the bodies are expected near.
        terms: of every joint.
        refill: called with new base parameters, writes the load columns of `rows`.
        loaded: which joints may have load friction, (J,).
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
        huber = regression.huber_weights(error, WILD * noise)
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
    """Return the covariance of penalised least squares, zero for what is at a bound, (p, p).

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
    """Return the covariance that a fit of these rows would state for white noise of the torque, without load friction.

    Args:
        rows: filtered and thinned, with the torque that the motion takes.
        robot: the description.
        terms: of every joint.
        noise: of the filtered torque [N.m or N], (J,).

    Returns:
        Covariance of all coefficients, (p, p); its part that the noise makes, (p, p), the rest being what priors leave open.
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
    )  # white noise below a corner f has 2 f independent values a second
    by_noise = sandwich(gram, swell * gram - held, held, free)
    return sandwich(gram, swell * gram, held, free), by_noise


def _rms(x: np.ndarray, weight: np.ndarray) -> float:
    used = x[weight > 0]
    return float(np.sqrt(np.mean(used**2))) or 1.0 if used.size else 1.0


def _noise(error: np.ndarray, weight: np.ndarray, scale: float) -> float:
    """Robust standard deviation, never below what a float64 fit can mean."""
    return max(regression.robust_spread(error, weight), 1e-6 * scale) if np.any(weight > 0) else scale


def _predict(rows: Rows, first: np.ndarray, x: np.ndarray) -> np.ndarray:
    fitted = rows.bodies @ x[: first[0]]
    for j, own in enumerate(rows.friction):
        fitted[:, j] += own @ x[first[j] : first[j + 1]]
    return fitted


def _normal(
    rows: Rows, first: np.ndarray, weight: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations of the step away from `start`."""
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
    """Return the normal equations of the step away from `x` by block of time, of all joints together."""
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
    """Return the expected coefficients and the precision (inverse covariance) of that expectation."""
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
    """Return the precision that makes both directions equal on average, strong beside any data."""
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
    """Friction dissipates, a motor has inertia, and a gear loses no more than it transmits."""
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
    """Return how many correlated residuals count as one independent (Bartlett window), at least 1."""
    width = min(max(int(MEMORY * rate), 1), error.size - 1) + 1
    power = float(error @ error)
    return max(1.0, float(regression.long_run(error[None], width)[0, 0]) / power) if power > 0.0 else 1.0
