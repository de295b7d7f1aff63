"""The velocity-friction pairs of a sweep, and the line sections through them (Iwatani 2017, (2.8)-(2.9), (3.1))."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.identification.curves import hats
from backdrive.identification.evidence import sentences
from backdrive.identification.sweep_windows import Windows
from backdrive.laws import Polyline

MERGED = 0.01  # pairs closer than this share of the top speed become one [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepKnots:
    """Velocity-friction pairs of one sweep, slowest first; m of its N cycles were usable.

    F of each direction is the mean torque along it. It contains all constants, such as gravity at the center and an offset of
    the torque signal. `bias` is the part of the constant that both directions share.

    Attributes:
        V_pos: mean speed of the samples with motion along +q [rad/s or m/s], (m,).
        F_pos: mean torque along +q [N.m or N], (m,).
        V_neg: mean speed of the samples with motion along -q [rad/s or m/s], (m,).
        F_neg: mean torque along -q with its sign reversed [N.m or N], (m,).
        error_pos: standard errors of F_pos [N.m or N], (m,); NaN for the literal procedure.
        error_neg: standard errors of F_neg [N.m or N], (m,).
        count_pos: number of samples of each F_pos, (m,).
        count_neg: number of samples of each F_neg, (m,).
        center: mean position of the samples [rad or m]; NaN without position.
        level: mean of cos(q - center) over the samples [-].
        swing: largest acceleration of the samples used, (m,) [rad/s^2 or m/s^2].
        inertia: estimated inside the windows, and its standard error [kg.m^2 or kg].
        slope: of gravity over position at the center, and its standard error [N.m/rad]; NaN if it was not estimated.
        warnings: in sentences.
    """

    V_pos: np.ndarray
    F_pos: np.ndarray
    V_neg: np.ndarray
    F_neg: np.ndarray
    error_pos: np.ndarray
    error_neg: np.ndarray
    count_pos: np.ndarray
    count_neg: np.ndarray
    center: float = float("nan")
    level: float = 1.0
    swing: np.ndarray | None = None
    inertia: tuple[float, float] = (float("nan"), float("nan"))
    slope: tuple[float, float] = (float("nan"), float("nan"))
    warnings: tuple[str, ...] = ()

    @property
    def V(self) -> np.ndarray:
        """V_n, mean of both directions [rad/s or m/s], (m,)."""
        return 0.5 * (self.V_pos + self.V_neg)

    @property
    def F(self) -> np.ndarray:
        """F_n of (2.7i), half the difference of the directions [N.m or N], (m,)."""
        return 0.5 * (self.F_pos + self.F_neg)

    @property
    def error(self) -> np.ndarray:
        """Standard error of F_n [N.m or N], (m,)."""
        return 0.5 * np.hypot(self.error_pos, self.error_neg)

    @property
    def bias(self) -> float:
        """Half sum of the directions, mean over the pairs: gravity, offset and constant asymmetry [N.m or N]."""
        return float(np.mean(0.5 * (self.F_pos - self.F_neg)))


def sort_knots(knots: SweepKnots, joint: str | int, cycles: Windows, c: float) -> SweepKnots:
    """Return the pairs without empty windows, sorted by speed and merged, so that V_n strictly increases.

    Args:
        knots: one pair per cycle, NaN if it is empty.
        joint: name or column, for messages.
        cycles: of the sweep.
        c: share of a cycle's peak speed above which samples were used [-].

    Raises:
        NotIdentifiable: fewer than two pairs are left.
    """
    good = np.isfinite(knots.F_pos) & np.isfinite(knots.F_neg)
    order = np.flatnonzero(good)[np.argsort(knots.V[good])]
    V = knots.V[order]
    if order.size < 2:
        raise NotIdentifiable(
            f"Joint '{joint}': {order.size} of {good.size} cycles reach their speed in both directions.",
            remedy="Repeat the sweep with a larger stroke or a smaller top speed.",
        )
    part = np.cumsum(np.concatenate([[0], np.diff(V) > MERGED * V[-1]])).astype(int)
    empty = ", ".join(f"{n + 1} ({cycles.peak[n]:.3g})" for n in np.flatnonzero(~good))
    merged = order.size - part[-1] - 1
    remarks = sentences(
        (
            empty,
            f"Joint '{joint}': of cycles {empty} (peak speed) too few samples reach {c:g} of the peak speed in both directions; "
            "they were left out.",
        ),
        (merged, f"Joint '{joint}': {merged} pairs of nearly equal speed were merged."),
    )

    def mean(x, weight):
        return np.bincount(part, x[order] * weight[order]) / np.bincount(part, weight[order])

    up, down = knots.count_pos, knots.count_neg
    length = cycles.time[:, 1] - cycles.time[:, 0]
    # acceleration of a sine at the limit of the used samples
    swing = cycles.peak * 2.0 * np.pi * np.sqrt(1.0 - c * c) / np.where(length > 0.0, length, np.inf)
    return replace(
        knots,
        V_pos=mean(knots.V_pos, up),
        F_pos=mean(knots.F_pos, up),
        V_neg=mean(knots.V_neg, down),
        F_neg=mean(knots.F_neg, down),
        error_pos=np.sqrt(mean(knots.error_pos**2 * up, up) / np.bincount(part, up[order])),
        error_neg=np.sqrt(mean(knots.error_neg**2 * down, down) / np.bincount(part, down[order])),
        count_pos=np.bincount(part, up[order]).astype(int),
        count_neg=np.bincount(part, down[order]).astype(int),
        swing=mean(swing, up),
        warnings=(*cycles.warnings, *remarks),
    )


def to_polyline(knots: SweepKnots, symmetric: bool = True, constant: float = 0.0) -> Polyline:
    """Return the line sections through the pairs: Iwatani 2017, (2.8)-(2.9), or by direction (3.1).

    Args:
        knots: the pairs.
        symmetric: return one curve for both directions.
        constant: torque that is not friction, for curves by direction: gravity at the center, offset [N.m or N].

    Returns:
        The law, with intercepts at rest >= 0: if the first section would reach below zero, a knot at rest is added.
    """
    V = knots.V
    if symmetric:
        up = down = knots.F
    else:
        up = hats(V, knots.V_pos) @ (knots.F_pos - constant)
        down = hats(V, knots.V_neg) @ (knots.F_neg + constant)
    return polyline_through(V, up, down)


def polyline_through(V: np.ndarray, up: np.ndarray, down: np.ndarray) -> Polyline:
    """Return line sections through pairs, with intercepts F_0 >= 0 at rest.

    Args:
        V: speeds, strictly increasing [rad/s or m/s], (m,).
        up: friction along +q [N.m or N], (m,).
        down: magnitude of the friction along -q [N.m or N], (m,).
    """
    rest = [float(hats(np.zeros(1), V)[0] @ F) for F in (up, down)]
    if V[0] > 0 and min(rest) < 0:
        V = np.concatenate([[0.0], V])
        up, down = (np.concatenate([[max(r, 0.0)], F]) for r, F in zip(rest, (up, down), strict=True))
    return Polyline(velocity=tuple(V), positive=tuple(up), negative=tuple(down))
