"""The linear equations of the pairs of several sweeps: a curve for each direction, gravity, a constant, growth with the load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification.curves import hats
from backdrive.identification.sweep_knots import MERGED, SweepKnots
from backdrive.identification.terms import GRAVITY
from backdrive.plans.centres import UNSEEN

# condition number above which gravity is not separated from a constant difference of the directions [-]
WORST_CONDITION = 500.0
DETERMINED = 1e-4  # least singular value of determined unknowns, relative to the largest one [-]
TERMS = (*GRAVITY, "offset")
LOAD = "load_dependence"
ALL = (*TERMS, LOAD)


@dataclass(frozen=True, kw_only=True, eq=False)
class Equations:
    """Linear equations of all pairs, for the friction at V along +q and -q and the terms `ALL`.

    Attributes:
        V: knots [rad/s or m/s], (K,).
        X: coefficients, (r, 2 K + 4); those of the load are 0 until gravity is known (`with_load_growth`).
        y: mean torques, then slopes of gravity where known, (r,).
        weight: inverse standard errors, (r,).
        swing: largest inertial torque within the samples of each mean torque [N.m or N], (levels,).
        levels: number of equations for mean torques, which come first.
    """

    V: np.ndarray
    X: np.ndarray
    y: np.ndarray
    weight: np.ndarray
    swing: np.ndarray
    levels: int

    def spread(self, curves: str, terms: Sequence[str]) -> np.ndarray:
        """Return the matrix from free unknowns to all unknowns.

        Args:
            curves: `equal`: one curve for both directions; `own`: one each; `balanced`: one each, with equal means.
            terms: fitted terms of `ALL`.
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
        full = np.zeros((2 * K + len(ALL), shape.shape[1] + len(terms)))
        full[: 2 * K, : shape.shape[1]] = shape
        for column, term in enumerate(terms):
            full[2 * K + ALL.index(term), shape.shape[1] + column] = 1.0
        return full

    def with_load_growth(self, gravity: np.ndarray) -> Equations:
        """Return the equations with a column for friction that grows with the load, 1 N.m for every N.m of load.

        Args:
            gravity: a and b of a sin q + b cos q [N.m], (2,).
        """
        K = self.V.size
        X = self.X.copy()
        forwards = X[: self.levels, :K].sum(axis=1) + X[: self.levels, K : 2 * K].sum(axis=1)
        X[: self.levels, -1] = forwards * self.load(X[: self.levels, 2 * K : 2 * K + 2] @ gravity)
        return replace(self, X=X)

    def load(self, gravity: np.ndarray) -> np.ndarray:
        """Return the mean magnitude of the load |g + I a| over the samples of each mean torque [N.m], (levels,).

        The acceleration is taken as uniformly distributed. If gravity is smaller than the swing, the load changes its sign.

        Args:
            gravity: g of each [N.m], (levels,).
        """
        size, swing = np.abs(gravity), np.maximum(self.swing, 1e-300)
        return np.where(size >= swing, size, 0.5 * (size**2 / swing + swing))

    def condition(self, curves: str, terms: Sequence[str]) -> float:
        """Return the condition number of the mean torques' equations [-].

        A component of gravity that is zero at all centers need not be separated, so it does not count. There is one for two
        centers half a turn apart.
        """
        X = self.X[: self.levels] @ self.spread(curves, terms)
        both = [i for i, term in enumerate(terms, X.shape[1] - len(terms)) if term in GRAVITY]
        if len(both) == 2:
            left, size, _ = np.linalg.svd(X[:, both], full_matrices=False)
            if size[1] < UNSEEN * size[0]:
                X = np.column_stack([np.delete(X, both, axis=1), left[:, 0] * size[0]])
        singular = np.linalg.svd(X, compute_uv=False)
        wide = X.shape[0] < X.shape[1] or singular[-1] <= 1e-12 * singular[0]
        return float("inf") if wide else float(singular[0] / singular[-1])

    def determines(self, curves: str, terms: Sequence[str]) -> bool:
        """Return whether all equations, slopes of gravity included, determine the unknowns."""
        X = (self.X @ self.spread(curves, terms)) * self.weight[:, None]
        scaled = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
        singular = np.linalg.svd(scaled, compute_uv=False)
        return X.shape[0] >= X.shape[1] and bool(singular[-1] > DETERMINED * singular[0])

    def solve(self, curves: str, terms: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Return all unknowns, (2 K + 4,), and their covariance."""
        spread = self.spread(curves, terms)
        X = (self.X @ spread) * self.weight[:, None]
        scale = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
        inverse = spread @ (np.linalg.pinv(X / scale, rcond=1e-10) / scale[:, None])
        return inverse @ (self.y * self.weight), inverse @ inverse.T

    def excess(self, theta: np.ndarray, curves: str, terms: Sequence[str]) -> float:
        """Return the variance of the equations' residuals, divided by the stated one, at least 1 [-].

        This is the square of Birge's ratio (Physical Review 40, 1932); it includes errors of the weights and of the model.

        Args:
            theta: all unknowns, (2 K + 4,).
            curves: option of the solution; see `spread`.
            terms: fitted terms of `ALL`.
        """
        freedom = self.y.size - self.spread(curves, terms).shape[1]
        miss = (self.y - self.X @ theta) * self.weight
        return max(1.0, float(miss @ miss) / freedom) if freedom > 0 else 1.0


def equations(knots: Sequence[SweepKnots]) -> Equations:
    """Return the equations of the pairs of one or several sweeps; nearly equal speeds share a knot."""
    speeds = np.sort(np.concatenate([k.V for k in knots]))
    part = np.cumsum(np.concatenate([[0], np.diff(speeds) > MERGED * speeds[-1]])).astype(int)
    V = np.bincount(part, speeds) / np.bincount(part)
    K = V.size
    X, y, error, swing, slopes = [], [], [], [], []
    for k in knots:
        center = k.center if np.isfinite(k.center) else 0.0
        sides = (1.0, k.V_pos, k.F_pos, k.error_pos, 0), (-1.0, k.V_neg, k.F_neg, k.error_neg, K)
        for sign, speed, torque, deviation, first in sides:
            rows = np.zeros((speed.size, 2 * K + len(ALL)))
            rows[:, first : first + K] = sign * hats(speed, V)
            rows[:, 2 * K : 2 * K + 3] = k.level * np.sin(center), k.level * np.cos(center), 1.0
            X.append(rows)
            y.append(sign * torque)
            error.append(deviation)
            inertia = k.inertia[0] if np.isfinite(k.inertia[0]) else 0.0
            swing.append(np.zeros(speed.size) if k.swing is None else max(inertia, 0.0) * k.swing)
        if k.slope[1] > 0:
            row = np.zeros((1, 2 * K + len(ALL)))
            row[0, 2 * K : 2 * K + 2] = np.cos(center), -np.sin(center)
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
        swing=np.concatenate(swing),
        levels=levels,
    )
