"""Growth of friction with the gravity that a joint carries, from sweeps of the assembled arm.

Let friction grow by mu_d if the motor lifts the load, and by mu_b if the load drives the motor back. The mean torques are then

    along +q:   F_p(V) + g + mu |g|  + delta g        mu = (mu_d + mu_b) / 2
    along -q:  -F_n(V) + g - mu |g|  + delta g        delta = (mu_d - mu_b) / 2

since sgn(v) mu_d |g| for v g > 0 and sgn(v) mu_b |g| for v g < 0 together equal sgn(v) mu |g| + delta g. Thus mu is equal in both
directions and follows from the half difference, if the posture changes |g|. The other part, delta, acts exactly like a factor on
gravity, so no posture of the same arm determines it. Only a known payload (`payload_growth`) does: its apparent weight is
1 + delta times its true one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.sweep_equations import LOAD, WORST_CONDITION, Equations, equations
from backdrive.identification.sweep_knots import SweepKnots
from backdrive.identification.terms import GRAVITY

SIGNIFICANT = 4.0  # least significance of a growth [standard error]
LEAST = 0.01  # least change of friction with the load over the sweeps, relative to the friction [-]
MOST = 0.5  # largest growth of a gear's friction [-]
ROUNDS = 4  # number of iterations, in each of which the load follows from the last estimate of gravity


@dataclass(frozen=True, kw_only=True, eq=False)
class Growth:
    """The growth of friction with the gravity that the joint carries.

    Attributes:
        slope: mu, mean of mu_d and mu_b, and its standard error [-].
        gravity: a and b of a sin q + b cos q [N.m], (2,).
        carried: mean magnitude of the load in the sweeps [N.m].
    """

    slope: tuple[float, float]
    gravity: np.ndarray
    carried: float

    def sentence(self) -> str:
        """Return the result in words."""
        value, error = self.slope
        return (
            f"Friction grows by {value:.4f} +- {error:.4f} of the load that the joint carries; the curve is "
            f"that under {self.carried:.3g} N.m, of which {value * self.carried:.2g} +- {error * self.carried:.1g} N.m are this "
            "growth. Only a known payload can separate lifting from lowering the load."
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PayloadGrowth:
    """The growth of friction with the load, for a motor that drives the load, and for a load that drives the motor back.

    Attributes:
        driving: mu_d and its standard error [-].
        driven: mu_b and its standard error [-].
        gravity: a and b of the arm without payload, a sin q + b cos q [N.m], (2,).
        gravity_error: their standard errors [N.m], (2,).
        positive: friction without load at the knots along +q [N.m], (K,).
        negative: friction without load at the knots along -q [N.m], (K,).
        error_pos: standard errors of `positive` [N.m], (K,).
        error_neg: standard errors of `negative` [N.m], (K,).
        velocity: the knots [rad/s], (K,).
        condition: of the equations [-].
        covariance: of `positive`, `negative`, `gravity`, `driving` and `driven`, (2 K + 4, 2 K + 4).
    """

    driving: tuple[float, float]
    driven: tuple[float, float]
    gravity: np.ndarray
    gravity_error: np.ndarray
    positive: np.ndarray
    negative: np.ndarray
    error_pos: np.ndarray
    error_neg: np.ndarray
    velocity: np.ndarray
    condition: float
    covariance: np.ndarray


def growth(eqs: Equations, curves: str, terms: Sequence[str], theta: np.ndarray) -> Growth | None:
    """Return the growth of friction with gravity if it is significant, or else None.

    Args:
        eqs: of all sweeps.
        curves: as in `Equations.spread`.
        terms: gravity and the other fitted terms.
        theta: solution of the equations without growth.
    """
    K = eqs.V.size
    friction = float(np.mean(theta[: 2 * K]))
    for _ in range(ROUNDS):
        gravity = theta[2 * K : 2 * K + 2]
        size = eqs.load(eqs.X[: eqs.levels, 2 * K : 2 * K + 2] @ gravity)
        if not np.ptp(size) > LEAST * friction:
            return None
        loaded = eqs.with_load_growth(gravity)
        # scaled, for the condition number
        scaled = replace(loaded, X=np.column_stack([loaded.X[:, :-1], loaded.X[:, -1] / float(size.max())]))
        if not scaled.condition(curves, (*terms, LOAD)) <= WORST_CONDITION:
            return None
        theta, covariance = loaded.solve(curves, (*terms, LOAD))
    value, error = float(theta[-1]), float(np.sqrt(max(covariance[-1, -1], 0.0)))
    if not value > SIGNIFICANT * error or not value * np.ptp(size) > LEAST * friction:
        return None
    return Growth(slope=(value, error), gravity=gravity, carried=float(size.mean()))


def payload_growth(
    knots: Sequence[SweepKnots], payloads: Sequence[tuple[float, float]], *, name: str = "joint"
) -> PayloadGrowth:
    """Return the growth of friction with the load in both directions of power, from sweeps with and without a known payload.

    Args:
        knots: one entry per sweep.
        payloads: s and c of the payload's gravity s sin q + c cos q in each sweep; (0, 0) without one [N.m].
        name: of the joint, for messages.

    Raises:
        InvalidInput: the number of payloads and sweeps differs, or all payloads are equal.
        NotIdentifiable: the sweeps do not separate curve, gravity, growth and payload, or the growth is impossibly large.
    """
    weights = np.array(payloads, dtype=np.float64)
    if weights.shape != (len(knots), 2) or not np.isfinite(weights).all():
        raise InvalidInput(
            f"{weights.shape} payloads for {len(knots)} sweeps.",
            remedy="Give the sine and the cosine part of each [N.m].",
        )
    if not np.ptp(weights, axis=0).any():
        raise InvalidInput(
            f"Joint '{name}': all sweeps carry the same payload.",
            remedy="Repeat one without it, or with another one; without a known change of weight, a difference "
            "between lifting and lowering looks like a change of gravity.",
        )
    eqs = equations(knots)
    K, n = eqs.V.size, eqs.levels
    of_sweep = np.repeat(np.arange(len(knots)), [2 * k.V.size for k in knots])
    center, level = np.array([k.center for k in knots]), np.array([k.level for k in knots])
    carried = level * (weights[:, 0] * np.sin(center) + weights[:, 1] * np.cos(center))
    sign = eqs.X[:n, :K].sum(axis=1) + eqs.X[:n, K : 2 * K].sum(axis=1)
    spread = eqs.spread("own", (*GRAVITY, LOAD))
    base, weight = (eqs.X @ spread)[:n], eqs.weight[:n]
    payload = carried[of_sweep]
    delta, inverse, X = 0.0, base, base
    theta = np.linalg.lstsq(base[:, : 2 * K + 2], eqs.y[:n] - payload, rcond=1e-10)[0]  # without growth
    for _ in range(2 * ROUNDS):
        gravity = theta[2 * K : 2 * K + 2] / (1.0 + delta)
        size = eqs.load(base[:, 2 * K : 2 * K + 2] @ gravity + payload)
        X = np.column_stack([base[:, :-1], sign * size, payload])
        inverse = np.linalg.pinv(X * weight[:, None], rcond=1e-12)
        theta = inverse @ ((eqs.y[:n] - payload) * weight)
        delta = float(theta[-1])
    scaled = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    singular = np.linalg.svd(scaled, compute_uv=False)
    condition = float(singular[0] / max(singular[-1], 1e-300))
    if not condition <= WORST_CONDITION:
        raise NotIdentifiable(
            f"Joint '{name}': the sweeps do not tell growth with the load from the rest (condition {condition:.0f}).",
            remedy="Sweep about three distant centers, each with and without the payload.",
        )
    covariance = inverse @ inverse.T
    if not max(abs(theta[-2]), abs(theta[-1])) < MOST:
        raise NotIdentifiable(
            f"Joint '{name}': friction would grow by {theta[-2] + theta[-1]:.3g} of what the motor lifts and by "
            f"{theta[-2] - theta[-1]:.3g} of what drives it back, which no gear does.",
            remedy="Look at the payloads: s of s sin q comes first, c of c cos q second [N.m], one entry a log in their order.",
        )
    spread = np.eye(theta.size)
    spread[2 * K : 2 * K + 2] /= 1.0 + delta
    spread[-2:, -2:] = [1.0, 1.0], [1.0, -1.0]
    theta, covariance = spread @ theta, spread @ covariance @ spread.T
    deviation = np.sqrt(np.diag(covariance))
    found = list(zip(theta.tolist(), deviation.tolist(), strict=True))
    return PayloadGrowth(
        driving=found[-2],
        driven=found[-1],
        gravity=theta[2 * K : 2 * K + 2],
        gravity_error=deviation[2 * K : 2 * K + 2],
        positive=theta[:K],
        negative=theta[K : 2 * K],
        error_pos=deviation[:K],
        error_neg=deviation[K : 2 * K],
        velocity=eqs.V,
        condition=condition,
        covariance=covariance,
    )
