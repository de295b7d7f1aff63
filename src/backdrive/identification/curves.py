"""Candidate friction curves as linear maps of one fine basis of hat functions.

The fine basis has one hat function per knot and direction. Every coarser curve (fewer knots, a straight line, equal directions)
is an exact linear combination of its columns. All candidates are thus compared on one regressor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from backdrive._catalog import lookup
from backdrive.laws import CoulombViscous, Law, Polyline

#: Knots of the fine basis as shares of the top speed: dense where Stribeck curves bend.
SHARES = (0.0, 0.005, 0.015, 0.03, 0.06, 0.12, 0.25, 0.4, 0.6, 0.8, 1.0)

NEAR_ZERO = (-5e-324, 5e-324)  # limits of rest, where the basis jumps [rad/s or m/s]

#: Candidate curve, simplest first -> indices of its knots in SHARES.
COARSE: dict[str, tuple[int, ...]] = {
    "line": (0, 10),
    "3 sections": (0, 3, 6, 10),
    "5 sections": (0, 2, 4, 6, 8, 10),
    "7 sections": (0, 1, 3, 4, 5, 6, 8, 10),
    "10 sections": tuple(range(11)),
}


def from_speed(knots: np.ndarray, slowest: float) -> dict[str, tuple[int, ...]]:
    """Return the candidates of `COARSE` without knots below the slowest speed in the data; a line starts at rest.

    Args:
        knots: of the fine basis [rad/s or m/s], (K,).
        slowest: the knot at the slowest speed [rad/s or m/s].
    """
    first = int(np.argmin(np.abs(knots - slowest)))
    made = {"line": COARSE["line"]}
    for name, keep in COARSE.items():
        sections = (first, *(i for i in keep if i > first))
        if name != "line" and len(sections) > 1 and sections not in made.values():
            made[name] = sections
    return made


def of_law(law: str | None, shapes: dict[str, tuple[int, ...]] | None = None) -> dict[str, tuple[int, ...]]:
    """Return the candidates that a law allows: a line for Coulomb and viscous friction, several sections for a polyline.

    Args:
        law: `coulomb-viscous`, `polyline`, or None for all.
        shapes: name -> indices of knots in SHARES; None: `COARSE`.

    Raises:
        UnknownName: the law has no candidate curve.
    """
    shapes = shapes or COARSE
    if law is None:
        return shapes
    allowed = {
        "coulomb-viscous": {"line": shapes["line"]},
        "polyline": {k: v for k, v in shapes.items() if k != "line"},
    }
    return lookup(law, allowed, "law that curves are fitted with")


@dataclass(frozen=True, kw_only=True, eq=False)
class Form:
    """One candidate curve.

    Attributes:
        name: for messages.
        knots: speeds of its knots [rad/s or m/s], (k,).
        symmetric: both directions share one curve.
        spread: matrix from the form's coefficients to those of the fine basis, (2 K, k or 2 k).
    """

    name: str
    knots: np.ndarray
    symmetric: bool
    spread: np.ndarray


def hats(speed: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Return the hat functions at speeds >= 0, with the outer sections extrapolated, (n, k)."""
    columns = np.zeros((speed.size, knots.size))
    if knots.size == 1:
        columns[:] = 1.0
        return columns
    left, weight = _places(speed, knots)
    rows = np.arange(speed.size)
    columns[rows, left] = 1.0 - weight
    columns[rows, left + 1] = weight
    return columns


def _places(speed: np.ndarray, knots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of the knot below each speed, and the relative distance from it to the next knot, (n,) each."""
    left = np.searchsorted(knots[1:-1], speed, side="right")
    return left, (speed - knots[left]) / (knots[1:] - knots[:-1])[left]


def basis(velocity: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Return the fine basis, positive direction first: torque is its product with the knots' friction, (n, 2 k)."""
    shapes = hats(np.abs(velocity), knots)
    return np.hstack([shapes * (velocity > 0)[:, None], -shapes * (velocity < 0)[:, None]])


def basis_means(velocity: np.ndarray, knots: np.ndarray, width: int) -> np.ndarray:
    """Return the means of the fine basis over bins of neighbouring samples, (n / width, 2 k).

    The basis is linear between two knots. If a bin stays between them, its mean is the basis at the mean velocity.

    Args:
        velocity: of an integer number of bins [rad/s or m/s], (n,).
        knots: at least two [rad/s or m/s], (k,).
        width: of a bin [sample].
    """
    across = np.ascontiguousarray(velocity.reshape(-1, width).T)
    low, high = across.min(axis=0), across.max(axis=0)
    inner = np.concatenate([-knots[-2:0:-1], NEAR_ZERO, knots[1:-1]])
    between = np.searchsorted(inner, low, side="right") == np.searchsorted(inner, high)
    mean = np.ones(width) @ across / width
    total = np.zeros((mean.size, 2 * knots.size))
    flat = total.reshape(-1)
    at, here, after = _two_functions(mean, knots)
    at += 2 * knots.size * np.arange(mean.size)
    flat[at], flat[at + 1] = here, after
    crossing = np.flatnonzero(~between)
    if crossing.size:
        at, here, after = _two_functions(across.take(crossing, axis=1).ravel(), knots)
        at += np.tile(2 * knots.size * np.arange(crossing.size), width)
        size = 2 * knots.size * crossing.size
        sums = np.bincount(at, here, size) + np.bincount(at + 1, after, size)
        total[crossing] = sums.reshape(crossing.size, -1) / width
    return total


def _two_functions(velocity: np.ndarray, knots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the index of the first of two nonzero functions of the fine basis, its value and the next one's, (n,) each."""
    left, weight = _places(np.abs(velocity), knots)
    way = np.sign(velocity)
    after = way * weight
    return np.where(velocity < 0.0, left + knots.size, left), way - after, after


def forms(fine: np.ndarray, coarse: dict[str, np.ndarray], both_directions: bool) -> list[Form]:
    """Return the candidates on a fine basis.

    Args:
        fine: knots of the fine basis [rad/s or m/s], (K,).
        coarse: name -> knots of the curve, a subset of `fine`.
        both_directions: the data cover both directions; otherwise only symmetric forms are returned.
    """
    result = []
    for name, knots in coarse.items():
        one = hats(fine, knots)
        result.append(Form(name=name, knots=knots, symmetric=True, spread=np.vstack([one, one])))
        if both_directions:
            two = np.zeros((2 * len(fine), 2 * knots.size))
            two[: len(fine), : knots.size] = two[len(fine) :, knots.size :] = one
            result.append(Form(name=f"{name} by direction", knots=knots, symmetric=False, spread=two))
    return result


def to_law(form: Form, coefficients: np.ndarray) -> Law:
    """Return the law of a fitted form.

    A falling straight line is returned as line sections, since viscous friction cannot be negative.

    Args:
        form: the candidate.
        coefficients: friction at the form's knots, positive direction first [N.m or N], (k or 2 k,).
    """
    k = form.knots.size
    values = [coefficients[:k], coefficients[-k:]]
    if k == 2 and form.knots[0] == 0.0:
        viscous = [float((v[1] - v[0]) / form.knots[1]) for v in values]
        if min(viscous) >= 0.0 and min(v[0] for v in values) >= 0.0:
            law = CoulombViscous(
                coulomb_positive=values[0][0],
                coulomb_negative=values[1][0],
                viscous_positive=viscous[0],
                viscous_negative=viscous[1],
            )
            return Law(rate=law)
    law = Polyline(velocity=tuple(form.knots), positive=tuple(values[0]), negative=tuple(values[1]))
    return Law(rate=law)


def torques(form: Form, coefficients: np.ndarray, velocity: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return the torque at each velocity, by the law that `to_law` returns for a row of coefficients [N.m or N], (n,).

    Args:
        form: the candidate.
        coefficients: of several fits, (B, k or 2 k).
        velocity: [rad/s or m/s], (n,).
        row: index of the coefficients to use at each velocity, (n,).
    """
    k, knots = form.knots.size, form.knots
    values = np.stack([coefficients[:, :k], coefficients[:, -k:]], axis=1)
    if knots[0] > 0.0:  # the first section is extrapolated to a torque at rest >= 0
        slope = (values[..., 1] - values[..., 0]) / (knots[1] - knots[0])
        rest = np.maximum(values[..., 0] - slope * knots[0], 0.0)
        knots, values = np.r_[0.0, knots], np.concatenate([rest[..., None], values], axis=-1)
    left, weight = _places(np.abs(velocity), knots)
    at = (2 * row + (velocity < 0.0)) * knots.size + left
    flat = values.reshape(-1)
    before = flat.take(at)
    return np.sign(velocity) * (before + weight * (flat.take(at + 1) - before))


def sensitivity(form: Form, law: Law) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the names of a law's parameters, and their derivatives with respect to the form's coefficients, (r, k or 2 k).

    Args:
        form: the fitted form.
        law: result of `to_law` for this form.
    """
    k = form.knots.size
    both = np.eye(k) if form.symmetric else np.eye(2 * k)
    sides = {"positive": both[:k], "negative": both[-k:]}
    if isinstance(law.rate, Polyline):
        return knot_names(k), np.vstack(list(sides.values()))
    slope = np.array([-1.0, 1.0]) / form.knots[1]
    names = tuple(f"{what}_{side}" for what in ("coulomb", "viscous") for side in sides)
    return names, np.vstack(
        [*(rows[0] for rows in sides.values()), *(slope @ rows for rows in sides.values())]
    )


def knot_names(count: int) -> tuple[str, ...]:
    """Return the names of the torques at a polyline's knots, along +q first."""
    return tuple(f"{side}[{i}]" for side in ("positive", "negative") for i in range(count))


def constant_apart(k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the linear maps that remove a constant from two curves, so that both have the same friction at rest.

    Args:
        k: number of knots per curve; the coefficients of the positive direction come first.

    Returns:
        The row that gives the constant as product with the coefficients, (2 k,), and the matrix that gives the curves without
        it, (2 k, 2 k).
    """
    row = np.zeros(2 * k)
    row[0], row[k] = 0.5, -0.5
    return row, np.eye(2 * k) - np.outer(np.r_[np.ones(k), -np.ones(k)], row)


def error_of_curve(form: Form, covariance: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function from velocities [rad/s or m/s] to the curve's standard error [N.m or N].

    Args:
        form: the fitted curve.
        covariance: of its coefficients, (r, r).
    """

    def standard_error(velocity: np.ndarray) -> np.ndarray:
        shapes = hats(np.abs(velocity), form.knots)
        if not form.symmetric:
            shapes = np.hstack([shapes * (velocity > 0)[:, None], shapes * (velocity <= 0)[:, None]])
        return np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", shapes, covariance, shapes), 0.0))

    return standard_error


NEAR = 0.1  # share of the top speed within which friction of sliding hardly rises steeply [-]
RISE, STEEP = (
    0.25,
    5.0,
)  # a steep rise, by the friction before it, and by the slope of the curve as a whole [-]


def past_rise(law: Law, slowest: float) -> float:
    """Return the slowest speed of sliding, past a steep rise from rest: there elastic parts deflect, for want of better data.

    Args:
        law: the fitted law.
        slowest: speed of sliding in the data [rad/s or m/s].
    """
    if not isinstance(rate := law.rate, Polyline):
        return slowest
    knots = np.array(rate.velocity)
    level = 0.5 * (np.abs(rate.positive) + np.abs(rate.negative))
    for v, friction in zip(knots[:-1].tolist(), level.tolist(), strict=False):
        beside = (knots > v) & (knots <= v + NEAR * knots[-1])
        rise, slope = level - friction, (level.max() - friction) / (knots[-1] - v)
        if not np.any(beside & (rise > RISE * friction) & (rise > STEEP * slope * (knots - v))):
            return max(slowest, v)
    return slowest


PEAK = 0.25  # standard deviation of friction at rest, relative to the friction of the slowest sliding [-]


def widen_below(
    law: Law, slowest: float, standard_error: Callable[[np.ndarray], np.ndarray]
) -> Callable[[np.ndarray], np.ndarray]:
    """Return the standard error of a curve, increased below the slowest sliding, where a Stribeck peak is possible.

    Args:
        law: the fitted law.
        slowest: slowest speed of sliding in the data [rad/s or m/s].
        standard_error: standard error of the curve due to its coefficients.
    """

    def wider(velocity: np.ndarray) -> np.ndarray:
        level = np.abs(law.torque(np.where(velocity < 0.0, -slowest, slowest)))
        unseen = np.clip(1.0 - np.abs(velocity) / max(slowest, 1e-300), 0.0, 1.0)
        return np.hypot(standard_error(velocity), PEAK * unseen * level)

    return wider
