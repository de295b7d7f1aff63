"""The oracle: least squares with the same terms and knots, by the true motion and the true covariance, the delay free.

The covariance is that of the whole equation: the noise of the torque, and the encoder's rounding, which enters the acceleration
and with it the torque by inertia times its second difference (what it does to the velocity is a hundredth of that). No fit can
know the acceleration better. `exact` is the same with an encoder that does not round.

The oracle takes friction to jump where the velocity changes its sign, and tells Coulomb from the torque a sample before and
after: in an AR(0.98) at 200 Hz that is several times as sure as all that goes before. The generator's friction crosses zero in a
few ms to 100 ms, by a law and width that are drawn, so that such a fit to its torque would be off by hundreds of its own errors.
Two more bounds tell what is left of that: `sliding`, the same where the joint slides for sure and its reference has no kink, and
`crossing`, all rows with the true course of the crossing known, which no fit knows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from _independent import TURN, Record
from scipy import sparse, stats
from scipy.linalg import cholesky_banded, solve_banded

MOVING = 1e-3  # slower samples than this share of the top speed are at rest [-]
SLOW, REVERSAL = (
    0.08,
    0.03,
)  # share of the top speed and time about a change of sign, without which it slides for sure [-], [s]
KINK = 100.0  # a bend of the acceleration is a kink if it is so many times the median one [-]
BAND = 4  # neighbours whose errors one position affects, after whitening [sample]
FLANK = 0.8  # a sweep uses samples faster than this share of a cycle's peak speed [-]


class Terms(NamedTuple):
    """What a result has.

    Attributes:
        knots: speeds, zero first where the curve has one there [rad/s].
        symmetric: one curve for both directions.
        alike: two curves that meet at rest, with a constant beside them.
        gravity: sin q and cos q take part.
        offset: a constant takes part.
        inertia: inertia and delay take part.
        flanks: only samples near the peaks of speed are used.
        freedom: degrees of freedom of the t quantile, at most those that the noise leaves.
    """

    knots: np.ndarray
    symmetric: bool
    alike: bool
    gravity: bool
    offset: bool
    inertia: bool
    flanks: bool
    freedom: float


class Oracle(NamedTuple):
    """Half widths of 95 % intervals.

    Attributes:
        curve: by direction and knot [N.m], (2, k).
        viscous: by direction [N.m s/rad], (2,).
        delay: standard error of the delay [s]; infinite where it is not determined.
    """

    curve: np.ndarray
    viscous: np.ndarray
    delay: float


def hats(speed: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Return hat functions whose outer sections go on, (n, k)."""
    if knots.size == 1:
        return np.ones((speed.size, 1))
    left = np.clip(np.searchsorted(knots, speed, side="right") - 1, 0, knots.size - 2)
    share = (speed - knots[left]) / (knots[left + 1] - knots[left])
    shapes = np.zeros((speed.size, knots.size))
    rows = np.arange(speed.size)
    shapes[rows, left], shapes[rows, left + 1] = 1.0 - share, share
    return shapes


def oracle(records: Sequence[Record], terms: Terms, kind: str = "jump") -> Oracle:
    """Return the oracle's half widths.

    Args:
        records: the logs.
        terms: of the result.
        kind: `jump`, the oracle; `exact`, that of an exact encoder; `sliding` and `crossing`, bounds for what can be known.
    """
    k = terms.knots.size
    X = np.vstack([_whitened(record, terms, kind) for record in records])
    scale = np.maximum(np.linalg.norm(X, axis=0), 1e-150)
    covariance = np.linalg.pinv((X / scale).T @ (X / scale), rcond=1e-12) / np.outer(scale, scale)
    freedom = min(terms.freedom, sum(_independent(record) for record in records) - X.shape[1])
    quantile = float(stats.t.ppf(0.975, freedom)) if freedom > 0 else np.inf
    curve = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    second = np.arange(k) if terms.symmetric else np.r_[0 if terms.alike else k, k + 1 : 2 * k]
    second[1:] -= terms.alike
    curves = [np.arange(k), second]
    slope = np.zeros(k)
    slope[0], slope[-1] = -1.0, 1.0
    slope /= max(float(terms.knots[-1] - terms.knots[0]), 1e-300)
    viscous = [np.sqrt(max(slope @ covariance[np.ix_(side, side)] @ slope, 0.0)) for side in curves]
    delay = np.inf
    if terms.inertia:
        delay = float(np.sqrt(covariance[-1, -1]) / records[0].joint.inertia)
    return Oracle(
        curve=quantile * np.stack([curve[side] for side in curves]),
        viscous=quantile * np.array(viscous),
        delay=delay,
    )


def _independent(record: Record) -> float:
    """Return as how many independent samples a mean of the noise counts, by which the methods choose their t quantile."""
    return record.time.size * (1.0 - record.logger.colour) / (1.0 + record.logger.colour)


def _whitened(record: Record, terms: Terms, kind: str) -> np.ndarray:
    """Return the regressor of one log with noise of unit variance, (n, p)."""
    q, v, a = record.motion
    shapes, level = hats(np.abs(v), terms.knots), np.sign(v)
    if kind == "crossing":
        level = _crossing(record)
    if terms.symmetric:
        curve = shapes * level[:, None]
    else:
        curve = np.hstack(
            [shapes * np.maximum(level, 0.0)[:, None], shapes * np.minimum(level, 0.0)[:, None]]
        )
        if terms.alike:
            k = terms.knots.size
            curve[:, 0] += curve[:, k]
            curve = np.delete(curve, k, axis=1)
    columns = [curve]
    if terms.offset:
        columns.append(np.ones((v.size, 1)))
    if terms.gravity:
        columns.append(np.stack([np.sin(q), np.cos(q)], axis=1))
    if terms.inertia:
        columns.append(np.stack([a, -np.gradient(a, 1.0 / record.logger.rate)], axis=1))
    X = np.hstack(columns)
    used = np.isfinite(record.position) & (np.abs(v) > MOVING * np.abs(v).max())
    if terms.flanks:
        used &= np.abs(v) > FLANK * _peak(v)
    if kind == "sliding":
        used &= _slides(v, record.logger.rate) & ~_kinks(a)
    rows = np.flatnonzero(used)
    if not rows.size:
        return X[:0]
    kept = record.logger.colour ** np.diff(rows)  # the correlation goes on across rows that are left out
    if kind in (
        "jump",
        "exact",
    ):  # but not for the oracle, which would tell Coulomb from both sides of each standstill
        kept[np.diff(rows) > 1] = 0.0
    size = np.sqrt(1.0 - kept**2)
    white = sparse.diags([np.r_[1.0, 1.0 / size], -kept / size], [0, -1], format="csr") / record.logger.noise
    return (
        white @ X[rows] if kind == "exact" or not terms.inertia else _beside_rounding(white, rows, record, X)
    )


def _beside_rounding(white: sparse.csr_matrix, rows: np.ndarray, record: Record, X: np.ndarray) -> np.ndarray:
    """Return rows of a regressor as the noise of the torque and the encoder's rounding together are white, (n, p).

    Rounding is white and enters by inertia times its second difference.

    Args:
        white: what makes the noise of the torque white, of unit variance, (n, n).
        rows: that are used.
        record: the log.
        X: regressor of all rows.
    """
    n, logger = len(X), record.logger
    each = record.joint.inertia * logger.rate**2 * TURN / (logger.counts * np.sqrt(12.0))
    moved = white @ (sparse.diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(n, n), format="csr") * each)[rows]
    covariance = moved @ moved.T + sparse.identity(rows.size)
    band = np.zeros((BAND + 1, rows.size))
    for k in range(min(BAND + 1, rows.size)):
        band[k, : rows.size - k] = covariance.diagonal(-k)
    lower = cholesky_banded(band, lower=True)
    return solve_banded((BAND, 0), lower, white @ X[rows])


def _crossing(record: Record) -> np.ndarray:
    """Return the true friction less its viscous part by its level while sliding, -1 to 1, (n,)."""
    (q, v, a), joint = record.motion, record.joint
    pull = joint.gravity[0] * np.sin(q) + joint.gravity[1] * np.cos(q) + joint.offset
    return (record.clean - joint.inertia * a - pull - joint.viscous * v) / joint.coulomb


def _slides(v: np.ndarray, rate: float) -> np.ndarray:
    """Say which samples are fast, and not near a change of sign, (n,)."""
    turns = np.flatnonzero(np.diff(np.sign(v)) != 0)
    used, reach = np.abs(v) >= SLOW * np.abs(v).max(), round(REVERSAL * rate)
    for turn in turns.tolist():
        used[max(turn + 1 - reach, 0) : turn + 1 + reach] = False
    return used


def _kinks(a: np.ndarray) -> np.ndarray:
    """Say which samples lie about a kink of the reference, where a fade ends, (n,): two samples whose jerk alone tells a delay."""
    bend = np.abs(np.diff(a, 2, prepend=a[0], append=a[-1]))
    far = np.flatnonzero(bend > KINK * np.median(bend))
    kinks = np.zeros(a.size, dtype=bool)
    for k in range(-2, 3):
        kinks[np.clip(far + k, 0, a.size - 1)] = True
    return kinks


def _peak(v: np.ndarray) -> np.ndarray:
    """Return the peak speed of the half cycle that each sample is in, (n,)."""
    half = np.cumsum(np.r_[0, np.diff(np.sign(v)) != 0])
    peak = np.zeros(half[-1] + 1)
    np.maximum.at(peak, half, np.abs(v))
    return peak[half]
