"""Friction from runs at constant velocity: one point a run, a curve through the points, judged by leaving runs out.

A run's torque is a robust mean; its error comes from blocks of neighbouring samples. Curves with more and more line sections are
compared with a straight line per direction by leave-one-run-out, so that the result says whether a line suffices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identify import curves, regression
from backdrive.identify.evidence import curve, verdict
from backdrive.identify.result import JointEvidence, Samples
from backdrive.log import Joint, Log
from backdrive.model import Estimate, JointFriction, Quality, Validity

LEAST_RUNS = 4  # fewer runs do not make a curve
LEAST_TIME = 0.3  # a plateau inside a longer log lasts at least so long [s]
STEADY = 0.08  # and stays this close to its level [share of the level]
SECTIONS = (1, 2, 3, 4, 5, 6)  # line sections per direction that are tried
GAIN = 1.0  # a curve must beat the line by so many standard errors of the mean gain [-]


@dataclass(frozen=True, kw_only=True)
class Run:
    """One constant-velocity run.

    Attributes:
        velocity: mean velocity [rad/s or m/s].
        torque: robust mean torque [N.m or N].
        standard_error: of the torque, from blocks [N.m or N].
        spread: standard deviation of the torque within the run [N.m or N].
        uneven: the velocity's standard deviation exceeds a quarter of its mean (stick-slip).
        start: first instant [s].
    """

    velocity: float
    torque: float
    standard_error: float
    spread: float
    uneven: bool
    start: float


def _robust_mean(x: np.ndarray) -> float:
    weights = regression.robust_weights(np.ones((x.size, 1)), x, np.ones(x.size))
    return float(np.average(x, weights=weights))


def _run(time: np.ndarray, velocity: np.ndarray, torque: np.ndarray) -> Run:
    blocks = [b for b in np.array_split(torque, min(10, max(2, torque.size // 5))) if b.size]
    means = np.array([_robust_mean(b) for b in blocks])
    level = float(np.mean(velocity))
    return Run(
        velocity=level,
        torque=_robust_mean(torque),
        standard_error=float(means.std(ddof=1) / np.sqrt(means.size)),
        spread=float(np.std(torque)),
        uneven=bool(np.std(velocity) > 0.25 * abs(level)),
        start=float(time[0]),
    )


def find_runs(log: Log, joint: str | int) -> list[Run]:
    """Return the constant-velocity runs of one joint: the whole log where it is one, else its plateaus.

    Raises:
        InvalidInput: the log holds no torque.
    """
    if log.torque is None:
        raise InvalidInput(
            "The log holds no torque.", remedy="Name the channel, for example --map tau=COLUMN."
        )
    if len(log) < 20:
        return []
    log = log.select(joint).on_joint_side()
    torque, velocity = log.torque[:, 0], _velocity(log)  # type: ignore[index]
    good = np.isfinite(velocity) & np.isfinite(torque)
    time, velocity, torque = log.time[good], velocity[good], torque[good]
    if _keeps_level(velocity):
        return [_run(time, velocity, torque)]
    return _plateaus(time, velocity, torque, log.period)


def whole_run(log: Log, joint: str | int) -> bool:
    """Say whether a log keeps one velocity throughout."""
    if len(log) < 20:
        return False
    velocity = _velocity(log.select(joint))
    return _keeps_level(velocity[np.isfinite(velocity)])


def _velocity(log: Log) -> np.ndarray:
    from backdrive.filters import derivative

    velocity = log.velocity if log.velocity is not None else derivative(log.position, log.period)
    return velocity[:, 0]


def _keeps_level(velocity: np.ndarray) -> bool:
    """Say whether the means of the thirds agree and none is zero: single samples may jump (stick-slip)."""
    if velocity.size < 20:
        return False
    levels = [float(np.mean(part)) for part in np.array_split(velocity, 3)]
    return min(np.abs(levels)) > 0 and float(np.ptp(levels)) < 0.25 * float(np.max(np.abs(levels)))


def _plateaus(time: np.ndarray, velocity: np.ndarray, torque: np.ndarray, period: float) -> list[Run]:
    width = max(3, int(LEAST_TIME / period))
    if velocity.size < 2 * width:
        return []
    kernel = np.ones(width) / width
    level = np.convolve(velocity, kernel, "same")
    square = np.convolve(velocity**2, kernel, "same")
    spread = np.sqrt(np.maximum(square - level**2, 0.0))
    top = np.max(np.abs(level))
    steady = (np.abs(level) > 0.005 * top) & (spread < STEADY * np.abs(level) + 0.002 * top)
    edges = np.flatnonzero(np.diff(np.r_[False, steady, False].astype(np.int8))).reshape(-1, 2)
    return [
        _run(time[a:b], velocity[a:b], torque[a:b])
        for a, b in edges
        if b - a >= width and np.ptp(level[a:b]) < 2 * STEADY * abs(np.mean(level[a:b]))
    ]


def _knots(speed: np.ndarray, sections: int) -> np.ndarray:
    """Return knots at quantiles of the speeds; a straight line goes from zero."""
    if sections == 1:
        return np.array([0.0, speed.max()])
    return np.unique(np.quantile(speed, np.linspace(0.0, 1.0, sections + 1)))


def _try_sections(v: np.ndarray, y: np.ndarray, both: bool, directional: bool) -> dict:
    """Return sections per direction -> form, regressor and each run's error when it is left out."""
    tried = {}
    for sections in SECTIONS:
        knots = _knots(np.abs(v), sections)
        if knots.size != sections + 1 or sections + 1 > v.size // (4 if directional else 2):
            continue
        form = curves.forms(knots, {"": knots}, both)[-1 if directional else 0]
        X = curves.basis(v, knots) @ form.spread
        if both and not directional:
            X = np.hstack([X, np.ones((v.size, 1))])
        if np.linalg.matrix_rank(X) == X.shape[1]:
            tried[sections] = (form, X, _leave_one_out(X, y))
    return tried


def compare_sections(runs: Sequence[Run]) -> dict[int, float]:
    """Return the rms error of left-out runs [N.m or N] by the number of line sections per direction."""
    v, y = np.array([r.velocity for r in runs]), np.array([r.torque for r in runs])
    both = bool(np.any(v > 0) and np.any(v < 0))
    return {k: float(np.sqrt(np.mean(e**2))) for k, (_, _, e) in _try_sections(v, y, both, both).items()}


def _leave_one_out(X: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return each point's error by the fit to all the others, (n,)."""
    blocks = regression.accumulate(X, y, np.ones(y.size), np.arange(y.size), y.size)
    return y - np.einsum("ij,ij->i", X, regression.left_out_solutions(blocks))


def identify_constant_velocity(
    logs: Sequence[Log], joint: str, *, symmetric: bool | None = None
) -> tuple[JointFriction, JointEvidence]:
    """Identify one joint from constant-velocity runs.

    Args:
        logs: one run each, or holding several plateaus.
        joint: name.
        symmetric: True: one curve for both directions and an offset; otherwise one curve each.

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
    y = np.array([r.torque for r in runs])
    both = bool(np.any(v > 0) and np.any(v < 0))
    directional = both and not symmetric
    tried = _try_sections(v, y, both, directional)
    if not tried:
        raise NotIdentifiable(
            f"Joint '{joint}': the {v.size} runs do not determine a curve.", remedy="Record more speeds."
        )
    losses = {sections: loss for sections, (_, _, loss) in tried.items()}
    sections, said = _choose(losses)
    form, X, _ = tried[sections]
    blocks = regression.accumulate(X, y, np.ones(y.size), np.arange(y.size), y.size)
    theta = regression.solve(blocks.gram.sum(axis=0), blocks.moment.sum(axis=0))
    covariance = regression.sandwich(blocks, theta)
    r = form.spread.shape[1]
    law, errors = curves.to_law(form, theta[:r], covariance[:r, :r])
    dynamics = {}
    if theta.size > r:
        error = float(np.sqrt(covariance[r, r]))
        dynamics["offset"] = Estimate(value=float(theta[r]), unit=about.torque_unit, standard_error=error)
    friction = JointFriction(
        joint=about,
        law=law,
        standard_errors=errors,
        dynamics=dynamics,
        validity=Validity(velocity=(float(v.min()), float(v.max()))),
        fitted=_quality(y, y - X @ theta),
        held_out=_quality(y, losses[sections]),
        method="constant-velocity",
        warnings=_warnings(runs, both, directional, about),
    )
    samples = Samples(
        time=np.array([r.start for r in runs]),
        position=np.full(v.size, np.nan),
        velocity=v,
        torque=y,
        friction=y - dynamics["offset"].value if dynamics else y,
        predicted=X @ theta,
        fitted=np.ones(v.size, dtype=bool),
    )
    return friction, JointEvidence(
        joint=about.name,
        samples=samples,
        curve=curve(friction, curves.error_of_curve(form, covariance[:r, :r])),
        verdict=f"{verdict(friction)} {said}",
    )


def _choose(losses: dict[int, np.ndarray]) -> tuple[int, str]:
    """Return the number of sections and a sentence on the straight line."""
    rms = {k: float(np.sqrt(np.mean(e**2))) for k, e in losses.items()}
    best = min(rms, key=lambda k: rms[k])
    if 1 not in rms:
        return best, f"{best} line sections per direction were fitted."
    gain = losses[1] ** 2 - losses[best] ** 2
    error = float(np.std(gain) / np.sqrt(gain.size))
    if best == 1 or float(np.mean(gain)) <= GAIN * error:
        return (
            1,
            f"A straight line per direction suffices: no curve predicts left-out runs better ({rms[1]:.3g}).",
        )
    return best, (
        f"{best} line sections per direction predict left-out runs to {rms[best]:.3g} rms, a straight line per "
        f"direction to {rms[1]:.3g}: the curve is bent."
    )


def _quality(y: np.ndarray, error: np.ndarray) -> Quality:
    relative = 100.0 * float(np.linalg.norm(error) / max(np.linalg.norm(y), 1e-300))
    rms = float(np.sqrt(np.mean(error**2)))
    return Quality(residual=relative, residual_raw=relative, rms=rms, samples=y.size)


def _warnings(runs: list[Run], both: bool, directional: bool, joint: Joint) -> tuple[str, ...]:
    said = []
    uneven = [abs(r.velocity) for r in runs if r.uneven]
    if uneven:
        said.append(
            f"{len(uneven)} runs at up to {max(uneven):.3g} {joint.unit}/s did not keep their speed (stick-slip): "
            "their mean torque is not the friction at their mean velocity."
        )
    if not both:
        said.append("All runs go one way: friction and a constant torque cannot be told apart.")
    elif directional:
        said.append(
            "A constant bias torque (gravity, cable, current offset) cannot be told from friction that differs by "
            "direction; what there is of it is in the friction."
        )
    power = [r.torque * r.velocity for r in runs]
    if np.sum(power) < 0:
        said.append("The torque feeds energy in instead of dissipating it: its sign is probably inverted.")
    return tuple(said)
