"""Friction from runs at constant velocity: one point per run and a curve through the points, judged by left-out runs.

A run's torque is a robust mean. Curves with more and more line sections are compared with a straight line per direction by
leave-one-out cross-validation over the runs. The result thus states whether a line suffices.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from scipy.special import fdtrc

from backdrive.errors import NotIdentifiable
from backdrive.identification import curves, regression
from backdrive.identification.bends import bend_covariance
from backdrive.identification.evidence import curve, sentences, verdict
from backdrive.identification.misses import NOTHING, Misses
from backdrive.identification.result import JointEvidence, Samples
from backdrive.identification.runs import LEAST_RUNS, Run, find_runs, gravity_of, without_gravity
from backdrive.identification.terms import GRAVITY, estimates
from backdrive.logs.log import Joint, Log
from backdrive.model import Covariance, JointFriction, Quality, Validity
from backdrive.model.covariance import errors_by_parameter

SECTIONS = (1, 2, 3, 4, 5, 6)  # tried numbers of line sections per direction
DIFFERENT = 0.1  # probability by which noise scatters the runs as much, below which they differ otherwise [-]
MOST_WITHIN = 20.0  # degrees of freedom by which the noise within the runs counts
SAME = 1.05  # largest ratio of the speeds of two runs that count as one speed [-]
CHANCE = 0.01  # probability of rejecting a straight line by chance [-]
ROUNDING = 1e-20  # share of the torque's mean square below which a misfit is ignored [-]


def _knots(speed: np.ndarray, sections: int) -> np.ndarray:
    """Return knots at quantiles of the speeds; for a straight line, zero and the largest speed."""
    if sections == 1:
        return np.array([0.0, speed.max()])
    return np.unique(np.quantile(speed, np.linspace(0.0, 1.0, sections + 1)))


def _most_knots(runs: int, directional: bool) -> float:
    """Return the largest number of knots per direction that leaves degrees of freedom for the errors."""
    return (0.3 if directional else 0.6) * runs


def _more_runs(runs: int, directional: bool, knots: int) -> str:
    """Return a sentence on the runs to record so that a curve with given knots per direction can be fitted."""
    enough = next(n for n in itertools.count(LEAST_RUNS) if _most_knots(n, directional) >= knots)
    words = f"Record at least {enough} runs at different speeds" + (
        ", in both directions" if directional else ""
    )
    if directional and _most_knots(runs, False) >= knots:
        words += "; or take friction as equal in both directions (`--symmetric`)"
    return f"{words}."


def _try_sections(v: np.ndarray, y: np.ndarray, both: bool, directional: bool) -> dict:
    """Return sections per direction -> form, regressor and the error of each run if it is left out."""
    tried = {}
    for sections in SECTIONS:
        knots = _knots(np.abs(v), sections)
        if knots.size != sections + 1 or sections + 1 > _most_knots(v.size, directional):
            continue
        form = curves.forms(knots, {"": knots}, both)[-1 if directional else 0]
        X = curves.basis(v, knots) @ form.spread
        if both and not directional:
            X = np.hstack([X, np.ones((v.size, 1))])
        if np.linalg.matrix_rank(X) == X.shape[1]:
            tried[sections] = (form, X, _leave_one_out(X, y))
    return tried


def compare_sections(runs: Sequence[Run]) -> dict[int, float]:
    """Return the RMS error of left-out runs [N.m or N], by the number of line sections per direction."""
    v, y = np.array([r.velocity for r in runs]), np.array([r.torque for r in runs])
    both = bool(np.any(v > 0) and np.any(v < 0))
    return {k: float(np.sqrt(np.mean(e**2))) for k, (_, _, e) in _try_sections(v, y, both, both).items()}


def _leave_one_out(X: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the error of each point in the fit to all other points, (n,)."""
    blocks = regression.accumulate(X, y, np.ones(y.size), np.arange(y.size), y.size)
    return y - np.einsum("ij,ij->i", X, regression.leave_one_out_solutions(blocks))


def identify_constant_velocity(
    logs: Sequence[Log], joint: str, *, symmetric: bool | None = None, law: str | None = None
) -> tuple[JointFriction, JointEvidence]:
    """Identify one joint from constant-velocity runs.

    Args:
        logs: each of one run, or with several plateaus.
        joint: name.
        symmetric: True: one curve for both directions and an offset; otherwise one curve each.
        law: `coulomb-viscous` or `polyline` to allow only that; None: chosen by left-out runs.

    Raises:
        NotIdentifiable: fewer than four runs are found.
    """
    runs = [run for log in logs for run in find_runs(log, joint)]
    about = logs[0].select(joint).on_joint_side().joints[0]
    if len(runs) < LEAST_RUNS:
        raise NotIdentifiable(
            f"Joint '{joint}': {len(runs)} constant-velocity runs are too few for a curve.",
            remedy=f"At least {LEAST_RUNS} are needed, in both directions (see `backdrive plan constant-velocity`).",
        )
    v = np.array([r.velocity for r in runs])
    y, within = (np.array([getattr(r, name) for r in runs]) for name in ("torque", "error"))
    gravity = gravity_of(runs)
    pulls = np.array([r.pull for r in runs]) if gravity else np.zeros((v.size, 2))
    pull = pulls @ gravity[0] if gravity else np.zeros(v.size)
    if gravity:
        level = [r for log in logs for r in find_runs(without_gravity(log, joint, gravity[0]), joint)]
        y, within = (np.array([getattr(r, name) for r in level]) for name in ("torque", "error"))
    both = bool(np.any(v > 0) and np.any(v < 0))
    directional = both and not symmetric
    lines = "line" in curves.of_law(law)
    tried = {
        k: t for k, t in _try_sections(v, y, both, directional).items() if law is None or (k == 1) == lines
    }
    if not tried:
        raise NotIdentifiable(
            f"Joint '{joint}': {v.size} runs at constant velocity do not determine a curve"
            f"{' for each direction' if directional else ''}.",
            remedy=_more_runs(v.size, directional, 3 if law is not None and not lines else 2),
        )
    sections, remark = _choose(tried, y, pulls, about.torque_unit)
    form, X, left_out = tried[sections]
    theta = regression.solve(X.T @ X, X.T @ y)
    covariance = _covariance(X, y - X @ theta, within)
    slow = _slow_miss(v, y - X @ theta, X.shape[1])
    r = form.spread.shape[1]
    covariance[:r, :r] += bend_covariance(form.knots, theta[:r], covariance[:r, :r])
    if gravity:  # gravity's error is common to all runs
        common = regression.invert(X.T @ X) @ X.T @ pulls
        covariance = covariance + common @ gravity[1] @ common.T
    curve_values, apart, rest = theta[:r], np.eye(r, theta.size), np.eye(theta.size)[r:]
    if theta.size == r and not form.symmetric and curve_values.min() < 0.0:
        # friction cannot drive the joint: a driving torque is gravity or a bias
        row, apart = curves.constant_apart(form.knots.size)
        curve_values, rest = apart @ theta, row[None]
    found = curves.to_law(form, curve_values)
    names, of_law = curves.sensitivity(form, found)
    names += ("offset",) * len(rest)
    spread = np.vstack([of_law @ apart, rest])
    curve_covariance, covariance = apart @ covariance @ apart.T, spread @ covariance @ spread.T
    errors = errors_by_parameter(names, covariance)
    values: dict[str, tuple[float, float]] = {}
    if gravity:
        values |= dict(zip(GRAVITY, zip(gravity[0], np.sqrt(np.diag(gravity[1])), strict=True), strict=True))
    if len(rest):
        values["offset"] = float((rest @ theta)[0]), errors.pop("offset")
    friction = JointFriction(
        joint=about,
        law=found,
        standard_errors=errors,
        dynamics=estimates(values, about.unit),
        covariance=Covariance.of(names, covariance),
        validity=Validity(velocity=(float(v.min()), float(v.max())), lowest_speed=float(np.abs(v).min())),
        fitted=_quality(y, y - X @ theta),
        held_out=_quality(y, left_out),
        method="constant-velocity",
        warnings=_warnings(runs, both, directional, "offset" in values, about),
    )
    of_curve, slowest = slow.beside(curves.error_of_curve(form, curve_covariance)), float(np.abs(v).min())
    samples = Samples(
        time=np.array([r.start for r in runs]),
        position=np.full(v.size, np.nan),
        velocity=v,
        torque=y + pull,
        friction=y - friction.dynamics["offset"].value if "offset" in values else y,
        predicted=X @ theta + pull,
        fitted=np.ones(v.size, dtype=bool),
    )
    return friction, JointEvidence(
        joint=about.name,
        samples=samples,
        curve=curve(friction, curves.widen_below(found, slowest, of_curve)),
        verdict=f"{verdict(friction)} {remark}",
    )


def _slow_miss(velocity: np.ndarray, residual: np.ndarray, unknowns: int) -> Misses:
    """Return what a curve misses at the slowest runs, where a Stribeck peak may begin; less the noise, and none at the next speed.

    Args:
        velocity: of the runs [rad/s or m/s], (n,).
        residual: of their torques [N.m or N], (n,).
        unknowns: number of fitted numbers.
    """
    speed, freedom = np.abs(velocity), max(velocity.size - unknowns, 1)
    slowest = speed <= SAME * speed.min()
    if slowest.all():
        return NOTHING
    noise = float(residual @ residual) / freedom / np.count_nonzero(slowest)
    mean = float(np.mean((np.sign(velocity) * residual)[slowest]))
    speeds = np.array([speed[slowest].mean(), speed[~slowest].min()])
    sizes = np.array([np.sqrt(max(mean**2 - noise, 0.0)), 0.0])
    return Misses(speeds=np.tile(speeds, (2, 1)), sizes=np.tile(sizes, (2, 1)))


def _covariance(X: np.ndarray, residual: np.ndarray, within: np.ndarray) -> np.ndarray:
    """Return the covariance of a fit to the runs' means, (p, p).

    A few means tell their scatter poorly, so their errors by the noise within the runs count too, by twenty degrees of freedom;
    not so if the means scatter by more (an F test), since the runs then differ by more than noise.

    Args:
        X: regressor, (n, p).
        residual: of the means [N.m or N], (n,).
        within: standard errors of the means by the noise within the runs [N.m or N], (n,).
    """
    freedom, power = len(X) - X.shape[1], float(np.mean(within**2))
    if freedom < 1 or not power > 0.0:
        return regression.classical(X, residual)
    scatter = float(residual @ residual) / freedom
    more = 0.0 if fdtrc(freedom, MOST_WITHIN, scatter / power) < DIFFERENT else MOST_WITHIN
    both = (freedom * scatter + more * power) / (freedom + more)
    return regression.widen_covariance(both * regression.invert(X.T @ X), freedom + more)


def _choose(tried: dict[int, tuple], y: np.ndarray, pulls: np.ndarray, unit: str) -> tuple[int, str]:
    """Return the number of sections and a sentence on the straight line.

    A curve is chosen if it predicts left-out runs better than a line, and an F test rejects the line. The level of the test
    is divided by the number of curves.

    Args:
        tried: form, regressor and errors of left-out runs by the number of sections.
        y: torque of the runs [N.m or N], (n,).
        pulls: sin q and cos q if gravity was subtracted, so that no curve fits the error of gravity; otherwise 0, (n, 2).
        unit: of the torque, for the sentence.
    """
    rms = {k: float(np.sqrt(np.mean(error**2))) for k, (_, _, error) in tried.items()}
    if 1 not in rms:
        best = min(rms, key=lambda k: rms[k])
        return best, f"{best} line sections per direction were fitted."
    beside = pulls[:, np.any(pulls, axis=0)]
    full = {k: np.hstack([X, beside]) for k, (_, X, _) in tried.items()}
    likely = CHANCE / max(len(rms) - 1, 1)
    bent = [k for k in rms if k > 1 and rms[k] < rms[1] and _chance(full[1], full[k], y) < likely]
    if not bent:
        return (
            1,
            f"A straight line per direction suffices: no curve predicts left-out runs significantly better than its "
            f"{rms[1]:.3g} {unit} rms.",
        )
    best = min(bent, key=lambda k: rms[k])
    return best, (
        f"{best} line sections per direction predict left-out runs to {rms[best]:.3g} {unit} rms, a straight line per "
        f"direction to {rms[1]:.3g} {unit}: the curve is bent."
    )


def _chance(simple: np.ndarray, full: np.ndarray, y: np.ndarray) -> float:
    """Return the probability that noise alone causes the decrease of the residual from a regressor to an extended one."""
    powers = [float(np.sum((y - X @ regression.solve(X.T @ X, X.T @ y)) ** 2)) for X in (simple, full)]
    added, freedom = full.shape[1] - simple.shape[1], y.size - full.shape[1]
    if freedom < 1 or not powers[0] > ROUNDING * float(y @ y):
        return 1.0
    gain = max(powers[0] - powers[1], 0.0) / added
    return float(fdtrc(added, freedom, gain * freedom / max(powers[1], 1e-300)))


def _quality(y: np.ndarray, error: np.ndarray) -> Quality:
    relative = 100.0 * float(np.linalg.norm(error) / max(np.linalg.norm(y), 1e-300))
    rms = float(np.sqrt(np.mean(error**2)))
    return Quality(residual=relative, residual_raw=relative, rms=rms, samples=y.size)


def _warnings(runs: list[Run], both: bool, directional: bool, apart: bool, joint: Joint) -> tuple[str, ...]:
    uneven = [abs(r.velocity) for r in runs if r.uneven]
    return sentences(
        (
            uneven,
            f"{len(uneven)} runs at up to {max(uneven, default=0.0):.3g} {joint.unit}/s did not keep their speed (stick-slip): "
            "their mean torque is not the friction at their mean velocity.",
        ),
        (not both, "All runs have one direction: friction and a constant torque cannot be separated."),
        (
            both and directional and apart,
            "Friction at rest was taken as equal in both directions, and the constant torque that is left (gravity, bias) as "
            "an offset: the data cannot tell the two apart.",
        ),
        (
            both and directional and not apart,
            "A constant bias torque (gravity, cable, current offset) cannot be told from friction that differs by "
            "direction; it is part of the identified friction.",
        ),
        (
            sum(r.torque * r.velocity for r in runs) < 0,
            "The torque feeds energy in instead of dissipating it: its sign is probably inverted.",
        ),
    )
