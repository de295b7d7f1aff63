"""From the velocity-torque pairs of one or several sweeps to a friction curve and the other terms.

Beside friction, the pairs contain gravity at the center of the stroke and any offset of the torque signal. The half sum of the
two directions is the sum of these and of any difference of friction between the directions. Only sweeps about several centers
separate gravity from a constant difference. No sweep separates an offset of the torque signal from a constant difference. See
`docs/theory/asymmetry.md`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification.curves import hats
from backdrive.identification.load_fit import growth
from backdrive.identification.sweep_equations import (
    ALL,
    LOAD,
    TERMS,
    WORST_CONDITION,
    Equations,
    equations,
)
from backdrive.identification.sweep_knots import SweepKnots, polyline_through
from backdrive.identification.terms import GRAVITY
from backdrive.laws import Polyline

SIGNIFICANT = 4.0  # least significance of a term [standard error]
UNEQUAL = 0.03  # least relative difference of unequal directions [-]
NEAR = 0.05  # least distance of different centers [rad or m]
REMEDY = (
    "To separate gravity, record sweeps about three distant centers, or a second one half a turn from the first (`backdrive "
    "plan sweep --centres auto`). Or choose another posture of the arm, such as one in which the axis is vertical."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepFit:
    """The fit to the pairs of one or several sweeps.

    Attributes:
        law: the friction curve.
        symmetric: whether both directions share one curve.
        error_pos: standard errors at the law's knots along +q [N.m or N], (m,).
        error_neg: standard errors along -q [N.m or N], (m,).
        terms: fitted terms of `TERMS`: value and standard error [N.m or N].
        condition: condition number for the separation of gravity from a constant difference of the directions [-]; infinite
            without gravity.
        warnings: in sentences.
        notes: remarks that are not warnings, in sentences.
        centers: of the sweeps [rad or m].
        covariance: of the torques at the law's knots, along +q first [(N.m)^2 or N^2], (2 m, 2 m).
        with_terms: covariance of these torques and the terms `ALL`, zero for terms not fitted, (2 m + 4, 2 m + 4).
        noise_gain: standard error of half the constant difference, divided by that of the half sum about one center [-]; NaN
            if the difference was not attributed.
        load: growth of the friction with the load and its standard error [-], and the load at which the law is valid [N.m];
            None if no growth is significant.
    """

    law: Polyline
    symmetric: bool
    error_pos: np.ndarray
    error_neg: np.ndarray
    terms: dict[str, tuple[float, float]]
    condition: float
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    centers: tuple[float, ...]
    covariance: np.ndarray
    with_terms: np.ndarray
    noise_gain: float = float("nan")
    load: tuple[float, float, float] | None = None

    def tells(self, center: float) -> bool:
        """Return whether the fit predicts the torque about a center, because gravity is identified or the center was swept."""
        near = any(abs(center - c) < NEAR for c in self.centers)
        return near or self.condition <= WORST_CONDITION or not set(GRAVITY) & set(self.terms)

    def constants(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the constant of each direction, the intercept of its first section at rest, and its standard error.

        The constants are F_p and F_n of (3.1). With a Stribeck peak at V_1 or below, they are not the Coulomb torque.

        Returns:
            Along +q and along -q, value and standard error [N.m or N].
        """
        V = np.array(self.law.velocity)
        m = V.size
        row = hats(np.zeros(1), V)[0]
        found = []
        for side, F in ((slice(0, m), self.law.positive), (slice(m, 2 * m), self.law.negative)):
            variance = row @ self.covariance[side, side] @ row
            found.append((float(row @ F), float(np.sqrt(max(variance, 0.0)))))
        return found[0], found[1]


def fit(  # noqa: PLR0912, PLR0915  (the steps of one method in a row)
    knots: Sequence[SweepKnots],
    *,
    unit: str,
    name: str,
    symmetric: bool | None = None,
    late: Sequence[SweepKnots] = (),
) -> SweepFit:
    """Return the curve through the pairs of sweeps of one joint.

    Args:
        knots: one entry per sweep.
        unit: of the joint, `rad` or `m`.
        name: of the joint, for messages.
        symmetric: True: one curve for both directions; False: one each; None: one unless they clearly differ.
        late: pairs for a drive delay off by its standard error, if the delay was estimated.
    """
    eqs = equations(knots)
    K = eqs.V.size
    said, notes = [w for k in knots for w in k.warnings], []
    condition, known = float("inf"), False
    terms: tuple[str, ...] = ("offset",)
    if unit == "rad":
        known = _has_gravity(knots)
        apart = eqs.condition("own", GRAVITY)
        if known or apart <= WORST_CONDITION:
            terms, condition = GRAVITY, apart
    curves, kept = "balanced", _with_constant(eqs, "balanced", terms)
    if condition <= WORST_CONDITION:
        curves, kept = "own", terms
    elif unit == "m" and eqs.solve("own", ())[0][: 2 * K].min() >= 0:
        curves, kept = "own", ()
    theta, covariance = eqs.solve(curves, kept)
    load = None
    if terms == GRAVITY and known and np.isfinite(knots[0].error_pos).all():
        load = growth(eqs, curves, kept, theta)
        if load is not None:
            eqs, kept = eqs.with_load_growth(load.gravity), (*kept, LOAD)
            theta, covariance = eqs.solve(curves, kept)
            notes.append(load.sentence())
    asked = symmetric is not None
    if symmetric is None:
        symmetric = not _differ(theta, covariance, K)
    told = condition <= WORST_CONDITION
    if symmetric and not asked and known and not told:
        held = "" if "offset" in kept else "; gravity holds that and any offset of the torque signal"
        said.append(
            f"Joint '{name}' has one curve for both directions, since its sweeps do not separate a constant "
            f"difference of the directions from gravity{held}. {REMEDY}"
        )
    weight = _same_weight(eqs, theta) if told and known and load is None else 0.0
    if weight > 0.0:
        notes.append(
            f"The gravity torque has the same size at all centers, {weight:.3g} N.m, so friction that grows with it would be "
            "part of the curve; a third center between them would show it."
        )
    if symmetric:
        kept = _with_constant(eqs, "equal", terms)
        kept = kept if load is None else (*kept, LOAD)
        curves = "equal"
        theta, covariance = eqs.solve(curves, kept)
    covariance = covariance * eqs.excess(theta, curves, kept)
    if late:
        moved = replace(eqs, y=equations(late).y).solve(curves, kept)[0] - theta
        covariance = covariance + np.outer(moved, moved)
    gain = _gain(knots, covariance, K) if curves == "own" and terms == GRAVITY else float("nan")
    if not symmetric:
        (notes if told else said).append(_attribution(name, unit, knots, curves, condition, gain))
    if np.isnan(knots[0].error_pos).all():
        covariance = np.full_like(covariance, np.nan)  # the literal procedure has no errors
    carried = 0.0 if load is None else load.carried
    at_load = np.vstack([np.eye(2 * K, theta.size), np.eye(theta.size)[2 * K :]])
    at_load[: 2 * K, -1] = carried  # the law is valid at the mean load of the sweeps
    theta, covariance = at_load @ theta, at_load @ covariance @ at_load.T
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    law = polyline_through(eqs.V, theta[:K], theta[K : 2 * K])
    if len(law.velocity) > K:
        said.append(
            f"Joint '{name}': the first section of the curve reaches below zero at rest, where it was cut off."
        )
    shapes = np.kron(np.eye(2), hats(np.array(law.velocity), eqs.V))
    shown = shapes @ covariance[: 2 * K, : 2 * K] @ shapes.T
    spread = np.zeros((len(shown) + len(ALL), len(theta)))
    spread[: len(shown), : 2 * K], spread[len(shown) :, 2 * K :] = shapes, np.eye(len(ALL))
    error_pos, error_neg = np.sqrt(np.maximum(np.diag(shown), 0.0)).reshape(2, -1)
    values: dict[str, tuple[float, float]] = {
        term: (float(theta[i]), float(deviation[i])) for i, term in enumerate(ALL, 2 * K)
    }
    return SweepFit(
        law=law,
        symmetric=bool(symmetric),
        error_pos=error_pos,
        error_neg=error_neg,
        terms={t: values[t] for t in kept if t != LOAD},
        condition=condition,
        warnings=tuple(dict.fromkeys(said)),
        notes=tuple(notes),
        centers=tuple(k.center for k in knots),
        covariance=shown,
        with_terms=spread @ covariance @ spread.T,
        noise_gain=gain,
        load=None if load is None else (*values[LOAD], carried),
    )


def _with_constant(eqs: Equations, curves: str, terms: tuple[str, ...]) -> tuple[str, ...]:
    """Return the terms, with a constant beside gravity if the equations determine both.

    Without this term, a real constant would make gravity's level at several centers inconsistent with its slopes inside the
    strokes, and would distort the curve.
    """
    if terms != GRAVITY or eqs.levels == len(eqs.y):
        told = terms == GRAVITY and eqs.condition(curves, TERMS) <= WORST_CONDITION
    else:
        told = eqs.determines(curves, TERMS)
    return TERMS if told else terms


def _same_weight(eqs: Equations, theta: np.ndarray) -> float:
    """Return the magnitude of gravity [N.m] if it is nearly the same at all centers, and friction may grow with it; 0 if not."""
    K = eqs.V.size
    size = np.abs(eqs.X[: eqs.levels, 2 * K : 2 * K + 2] @ theta[2 * K : 2 * K + 2])
    same = np.ptp(size) < 0.05 * size.max() and size.max() > 0.1 * np.mean(theta[: 2 * K])
    return float(size.mean()) if same else 0.0


def _gain(knots: Sequence[SweepKnots], covariance: np.ndarray, K: int) -> float:
    """Return the standard error of half the constant difference, divided by that of the half sum about one center [-]."""
    row = np.zeros(len(covariance))
    row[:K], row[K : 2 * K] = 0.5 / K, -0.5 / K
    one = np.mean([np.sum(k.error_pos**2 + k.error_neg**2) / (2.0 * k.V.size) ** 2 for k in knots])
    return float(np.sqrt(row @ covariance @ row / one))


def _has_gravity(knots: Sequence[SweepKnots]) -> bool:
    """Return whether the torque depends on the position, within a stroke or from center to center."""
    slopes = [abs(k.slope[0]) > SIGNIFICANT * k.slope[1] for k in knots]
    biases = np.array([k.bias for k in knots])
    error = max(float(np.sqrt(np.mean(k.error**2) / k.V.size)) for k in knots)
    return any(slopes) or bool(np.ptp(biases) > SIGNIFICANT * error)


def _differ(theta: np.ndarray, covariance: np.ndarray, K: int) -> bool:
    """Return whether the curves of the two directions differ significantly, and by at least `UNEQUAL`."""
    up, down = theta[:K], theta[K : 2 * K]
    map_ = np.hstack([np.eye(K), -np.eye(K)])
    error = np.sqrt(np.maximum(np.diag(map_ @ covariance[: 2 * K, : 2 * K] @ map_.T), 0.0))
    size = np.sqrt(np.mean((0.5 * (up + down)) ** 2))
    plain = np.sqrt(np.mean((up - down) ** 2)) > UNEQUAL * size
    return bool(plain and np.any(np.abs(up - down) > SIGNIFICANT * error))


def _attribution(
    name: str, unit: str, knots: Sequence[SweepKnots], curves: str, condition: float, gain: float
) -> str:
    bias = float(np.mean([k.bias for k in knots]))
    torque = "N.m" if unit == "rad" else "N"
    if np.isfinite(condition) and curves == "own":
        return (
            f"Its centers separate the constant difference of the directions from gravity (condition "
            f"{condition:.0f}, noise gain {gain:.2g}); an offset of the torque signal would look the same as such a difference."
        )
    if curves == "own":
        return (
            f"Joint '{name}': offset unattributed: half the constant difference of the directions, {bias:.3g} {torque}, "
            "is given to the friction; an offset of the torque signal or a constant pull would look the same."
        )
    return (
        f"Joint '{name}': offset unattributed: {bias:.3g} {torque} may be gravity, an offset of the torque signal or a constant "
        f"difference of the directions; it is given to the former two.{'' if unit == 'm' else ' ' + REMEDY}"
    )
