"""From the velocity-torque pairs of one or several sweeps to a friction curve and what is not friction.

Beside the friction, the pairs hold gravity at the center of their stroke and any offset of the torque signal. The half sum of the
two directions shows these together with whatever differs between the directions. Only sweeps about several centers tell gravity
from a constant difference, and nothing tells an offset of the torque signal from one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.identification.curves import hats
from backdrive.identification.sweep_knots import MERGED, SweepKnots, clamped
from backdrive.laws import Polyline

SIGNIFICANT = 4.0  # standard errors from which on something is taken to be there [-]
UNEQUAL = 0.03  # share of the friction from which on the directions are taken to differ [-]
WORST_CONDITION = (
    500.0  # beyond it, gravity and a constant difference of the directions are not told apart [-]
)
TERMS = ("gravity_sin", "gravity_cos", "offset")


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepFit:
    """What the pairs of one or several sweeps say.

    Attributes:
        law: the friction curve.
        symmetric: one curve serves both directions.
        error_pos: standard errors at the law's knots along +q [N.m or N], (m,).
        error_neg: standard errors along -q [N.m or N], (m,).
        terms: of `TERMS`, as far as found: value and standard error [N.m or N].
        condition: of telling gravity from a constant difference of the directions [-]; infinite without gravity.
        warnings: in sentences.
    """

    law: Polyline
    symmetric: bool
    error_pos: np.ndarray
    error_neg: np.ndarray
    terms: dict[str, tuple[float, float]]
    condition: float
    warnings: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Equations:
    """Linear equations of all pairs: unknown are the friction at V along +q and -q, and `TERMS`.

    Attributes:
        V: knots [rad/s or m/s], (K,).
        X: coefficients, (r, 2 K + 3).
        y: mean torques, then slopes of gravity where known, (r,).
        weight: inverse standard errors, (r,).
        levels: how many of the equations are mean torques.
    """

    V: np.ndarray
    X: np.ndarray
    y: np.ndarray
    weight: np.ndarray
    levels: int

    def spread(self, curves: str, terms: Sequence[str]) -> np.ndarray:
        """Return the map from free unknowns to all.

        Args:
            curves: `equal` in both directions, their `own`, or `balanced`: own, with no difference on average.
            terms: those of `TERMS` that take part.
        """
        K = self.V.size
        one = np.eye(K)
        if curves == "equal":
            shape = np.vstack([one, one])
        elif curves == "balanced":
            uneven = np.linalg.svd(np.ones((1, K)))[2][1:].T
            shape = np.block([[one, uneven], [one, -uneven]])
        else:
            shape = np.eye(2 * K)
        full = np.zeros((2 * K + len(TERMS), shape.shape[1] + len(terms)))
        full[: 2 * K, : shape.shape[1]] = shape
        for column, term in enumerate(terms):
            full[2 * K + TERMS.index(term), shape.shape[1] + column] = 1.0
        return full

    def condition(self, curves: str, terms: Sequence[str]) -> float:
        """Return the condition number of the mean torques' equations [-]."""
        X = self.X[: self.levels] @ self.spread(curves, terms)
        singular = np.linalg.svd(X, compute_uv=False)
        wide = X.shape[0] < X.shape[1] or singular[-1] <= 1e-12 * singular[0]
        return float("inf") if wide else float(singular[0] / singular[-1])

    def solve(self, curves: str, terms: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Return all unknowns, (2 K + 3,), and their covariance."""
        spread = self.spread(curves, terms)
        X = (self.X @ spread) * self.weight[:, None]
        scale = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
        inverse = spread @ (np.linalg.pinv(X / scale, rcond=1e-10) / scale[:, None])
        return inverse @ (self.y * self.weight), inverse @ inverse.T


def equations(knots: Sequence[SweepKnots]) -> Equations:
    """Return the equations of the pairs of one or several sweeps; speeds that nearly agree share a knot."""
    speeds = np.sort(np.concatenate([k.V for k in knots]))
    part = np.cumsum(np.concatenate([[0], np.diff(speeds) > MERGED * speeds[-1]])).astype(int)
    V = np.bincount(part, speeds) / np.bincount(part)
    K = V.size
    X, y, error, slopes = [], [], [], []
    for k in knots:
        center = k.center if np.isfinite(k.center) else 0.0
        sides = (1.0, k.V_pos, k.F_pos, k.error_pos, 0), (-1.0, k.V_neg, k.F_neg, k.error_neg, K)
        for sign, speed, torque, deviation, first in sides:
            rows = np.zeros((speed.size, 2 * K + len(TERMS)))
            rows[:, first : first + K] = sign * hats(speed, V)
            rows[:, 2 * K :] = k.level * np.sin(center), k.level * np.cos(center), 1.0
            X.append(rows)
            y.append(sign * torque)
            error.append(deviation)
        if k.slope[1] > 0:
            row = np.zeros((1, 2 * K + len(TERMS)))
            row[0, 2 * K : 2 * K + 2] = k.level * np.cos(center), -k.level * np.sin(center)
            slopes.append((row, k.slope))
    levels = sum(e.size for e in error)
    deviation = np.concatenate([*error, [s[1] for _, s in slopes]])
    known = np.isfinite(deviation) & (deviation > 0)
    least = 0.1 * np.median(deviation[known]) if known.any() else 1.0
    return Equations(
        V=V,
        X=np.concatenate([*X, *(row for row, _ in slopes)]),
        y=np.concatenate([*y, [s[0] for _, s in slopes]]),
        weight=1.0 / np.where(known, np.maximum(deviation, least), least),
        levels=levels,
    )


def fit(knots: Sequence[SweepKnots], *, unit: str, name: str, symmetric: bool | None = None) -> SweepFit:
    """Return the curve through the pairs of sweeps of one joint.

    Args:
        knots: one entry a sweep.
        unit: the joint's, `rad` or `m`.
        name: the joint's, for messages.
        symmetric: True: one curve for both directions; False: one each; None: one unless they plainly differ.
    """
    eqs = equations(knots)
    K = eqs.V.size
    said = [w for k in knots for w in k.warnings]
    gravity = ("gravity_sin", "gravity_cos")
    terms: tuple[str, ...] = gravity if unit == "rad" and _has_gravity(knots) else ("offset",)
    condition = eqs.condition("own", terms) if terms == gravity else float("inf")
    curves, kept = "balanced", terms
    if condition <= WORST_CONDITION:
        curves = "own"
    elif unit == "m" and eqs.solve("own", ())[0][: 2 * K].min() >= 0:
        curves, kept = "own", ()
    theta, covariance = eqs.solve(curves, kept)
    if symmetric is None:
        symmetric = not _differ(theta, covariance, K)
    if symmetric:
        if terms == gravity and eqs.condition("equal", TERMS) <= WORST_CONDITION:
            terms = TERMS
        theta, covariance = eqs.solve("equal", terms)
    else:
        terms = kept
        said.append(_attribution(name, unit, knots, curves, condition))
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if np.isnan(knots[0].error_pos).all():
        deviation[:] = np.nan  # the literal procedure knows no errors
    law = clamped(eqs.V, theta[:K], theta[K : 2 * K])
    if len(law.velocity) > K:
        said.append(
            f"Joint '{name}': the first section of the curve reaches below zero at rest, where it was cut off."
        )
    shapes = hats(np.array(law.velocity), eqs.V)
    error_pos, error_neg = (np.sqrt((shapes**2) @ deviation[i : i + K] ** 2) for i in (0, K))
    values = dict(zip(TERMS, zip(theta[2 * K :], deviation[2 * K :])))
    return SweepFit(
        law=law,
        symmetric=bool(symmetric),
        error_pos=error_pos,
        error_neg=error_neg,
        terms={t: (float(values[t][0]), float(values[t][1])) for t in terms},
        condition=condition,
        warnings=tuple(dict.fromkeys(said)),
    )


def _has_gravity(knots: Sequence[SweepKnots]) -> bool:
    """Say whether the torque depends on the position: within a stroke, or from center to center."""
    slopes = [abs(k.slope[0]) > SIGNIFICANT * k.slope[1] for k in knots]
    biases = np.array([k.bias for k in knots])
    error = max(float(np.sqrt(np.mean(k.error**2) / k.V.size)) for k in knots)
    return any(slopes) or bool(np.ptp(biases) > SIGNIFICANT * error)


def _differ(theta: np.ndarray, covariance: np.ndarray, K: int) -> bool:
    """Say whether the curves of the two directions differ, beyond their errors and by more than little."""
    up, down = theta[:K], theta[K : 2 * K]
    map_ = np.hstack([np.eye(K), -np.eye(K)])
    error = np.sqrt(np.maximum(np.diag(map_ @ covariance[: 2 * K, : 2 * K] @ map_.T), 0.0))
    size = np.sqrt(np.mean((0.5 * (up + down)) ** 2))
    plain = np.sqrt(np.mean((up - down) ** 2)) > UNEQUAL * size
    return bool(plain and np.any(np.abs(up - down) > SIGNIFICANT * error))


def _attribution(name: str, unit: str, knots: Sequence[SweepKnots], curves: str, condition: float) -> str:
    bias = float(np.mean([k.bias for k in knots]))
    torque = "N.m" if unit == "rad" else "N"
    if np.isfinite(condition) and curves == "own":
        return (
            f"Joint '{name}': its centers tell the constant difference of the directions from gravity (condition "
            f"{condition:.0f}); an offset of the torque signal would look the same as such a difference."
        )
    if curves == "own":
        return (
            f"Joint '{name}': offset unattributed: half the constant difference of the directions, {bias:.3g} {torque}, "
            "is given to the friction; an offset of the torque signal or a constant pull would look the same."
        )
    return (
        f"Joint '{name}': offset unattributed: {bias:.3g} {torque} may be gravity, an offset of the torque signal or a constant "
        "difference of the directions; it is given to the former two. Sweeps about three distant centers tell gravity apart."
    )
