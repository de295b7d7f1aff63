"""Constant-velocity runs: parts of a log with constant velocity, and their friction and gravity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.identification import regression, robust
from backdrive.identification.noise import noise_of
from backdrive.identification.signals import spans
from backdrive.logs.log import Log
from backdrive.logs.resolution import white_noise

LEAST_RUNS = 4  # least number of runs for a curve
LEAST_TIME = 0.3  # least duration of a plateau inside a longer log [s]
STEADY = 0.08  # largest standard deviation of the velocity on a plateau, relative to its mean [-]
SMOOTH = 0.05  # length of the means that locate the start and the stop of a run [s]
STARTING = 0.5  # first or last speed that indicates a start or a stop, relative to the level [-]
SLOWER = 0.75  # the same where encoder noise requires longer means, which include a part of the run [-]
UP_TO_SPEED = 0.95  # speed at which a start has ended, relative to the level [-]
LEAST_SHARE = 0.5  # least share of constant velocity in a log of one run [-]
SEEN = 0.25  # least share of the torque's variance within runs that an accepted gravity explains [-]
SURE = 10.0  # least significance of an accepted gravity that explains less [standard error]
UNEVEN = 0.25  # largest standard deviation of a steady run's velocity, relative to its mean [-]
CERTAIN = 3.0  # least significance of a velocity variation above encoder noise [standard error]
CALM = 0.1  # largest encoder noise in a mean that locates starts and reversals, relative to the velocity [-]
LONGEST = 0.15  # largest length of such a mean, relative to the log [-]


@dataclass(frozen=True, kw_only=True)
class Run:
    """One constant-velocity run.

    Attributes:
        velocity: mean velocity [rad/s or m/s].
        torque: robust mean torque [N.m or N].
        uneven: the velocity's standard deviation exceeds a quarter of its mean, the encoder's noise aside (stick-slip).
        start: first instant [s].
        pull: means of sin q and cos q over the run; None for a linear joint or without position.
        within: scatter of (sin q, cos q, torque) about their means, (3, 3); None if `pull` is None.
        error: standard error of the mean torque by the torque's scatter within the run and its correlation [N.m or N].
    """

    velocity: float
    torque: float
    uneven: bool
    start: float
    pull: tuple[float, float] | None = None
    within: np.ndarray | None = None
    error: float = 0.0


def _robust_mean(x: np.ndarray) -> float:
    weights = robust.robust_weights(np.ones((x.size, 1)), x, np.ones(x.size))
    return float(np.average(x, weights=weights))


def _error_of_mean(x: np.ndarray) -> float:
    noise = noise_of([x], [np.ones_like(x)], degree=0)
    return float(np.sqrt(noise.covariance(np.full((1, x.size), 1.0 / x.size), 0)[0, 0]))


def _run(
    time: np.ndarray, velocity: np.ndarray, torque: np.ndarray, angle: np.ndarray | None, uneven: bool
) -> Run:
    level = float(np.mean(velocity))
    pull, within = None, None
    if angle is not None:
        columns = np.stack([np.sin(angle), np.cos(angle), torque])
        pull = (float(columns[0].mean()), float(columns[1].mean()))
        apart = columns - columns.mean(axis=1, keepdims=True)
        within = apart @ apart.T
    return Run(
        velocity=level,
        torque=_robust_mean(torque),
        uneven=uneven,
        start=float(time[0]),
        pull=pull,
        within=within,
        error=_error_of_mean(torque),
    )


def find_runs(log: Log, joint: str | int) -> list[Run]:
    """Return the constant-velocity runs of one joint: the whole log if it is one run, or else its plateaus.

    Raises:
        InvalidInput: the log holds no torque.
    """
    log.need("torque")
    if len(log) < 20:
        return []
    log = log.select(joint).on_joint_side()
    torque, velocity = log.driving_torque[:, 0], _velocity(log)
    good = np.isfinite(velocity) & np.isfinite(torque)
    time, velocity, torque = log.time[good], velocity[good], torque[good]
    turns = log.position is not None and log.joints[0].unit == "rad"
    angle = log.need("position")[good, 0] if turns else None
    encoder = _encoder_noise(log, good)
    level = _level(velocity, log.period, encoder)
    parts = [level] if level else [slice(a, b) for a, b in _plateaus(velocity, log.period)]
    return [
        _run(
            time[part],
            velocity[part],
            torque[part],
            None if angle is None else angle[part],
            _uneven(velocity[part], log.period, encoder),
        )
        for part in parts
    ]


def _uneven(velocity: np.ndarray, period: float, encoder: float) -> bool:
    """Return whether a velocity varies significantly by more than `UNEVEN` of its mean, beyond the encoder's noise.

    Args:
        velocity: of a run [rad/s or m/s], (n,).
        period: sampling interval [s].
        encoder: standard deviation of the noise of the differentiated positions [rad or m]; 0 for a measured velocity.
    """
    allowed = (UNEVEN * float(np.mean(velocity))) ** 2
    if not float(np.var(velocity)) > allowed:
        return False
    if not encoder > 0.0:
        return True
    for width in (1, max(1, round(SMOOTH / period))):
        means = velocity[: velocity.size // width * width].reshape(-1, width).mean(axis=1)
        # a mean of central differences depends only on two positions at each end
        noise = encoder**2 / (width * period) ** 2 * (0.5 if width == 1 else 1.0)
        chance = 1.0 + CERTAIN * np.sqrt(2.0 * 3.0 / max(means.size, 1))  # neighbours share positions
        if means.size > 2 and float(np.var(means)) > allowed + noise * chance:
            return True
    return False


def whole_run(log: Log, joint: str | int) -> bool:
    """Return whether a log has one constant velocity, except for a start and a stop."""
    if len(log) < 20:
        return False
    log = log.select(joint)
    velocity = _velocity(log)
    good = np.isfinite(velocity)
    return _level(velocity[good], log.period, _encoder_noise(log, good)) is not None


def _velocity(log: Log) -> np.ndarray:
    """Return the velocity of one joint, or that of its positions over two samples, the least noisy one [rad/s or m/s], (n,)."""
    if log.velocity is not None:
        return log.velocity[:, 0]
    return np.gradient(log.need("position")[:, 0], log.period)


def _encoder_noise(log: Log, good: np.ndarray) -> float:
    """Return the noise of the positions that the velocity of one joint is the derivative of [rad or m]; 0 where it is not."""
    return 0.0 if log.velocity is not None else white_noise(log.need("position")[good, 0])


def _level(velocity: np.ndarray, period: float, encoder: float = 0.0) -> slice | None:
    """Return the part of a log with one constant velocity, without start and stop; None if that part is too short.

    Args:
        velocity: as measured, noise of an encoder and stick-slip included [rad/s or m/s], (n,).
        period: sampling interval [s].
        encoder: standard deviation of the noise of the positions that the velocity is the derivative of [rad or m].
    """
    if velocity.size < 20:
        return None
    moment = _moment(velocity, period, encoder)
    smooth = _smooth(velocity, period, moment)
    level = float(np.median(smooth))
    way = smooth * np.sign(level)
    reached = np.flatnonzero(way > UP_TO_SPEED * abs(level))
    if not reached.size:
        return None
    begin, end = 0, velocity.size
    first, least = 0, STARTING
    if moment > SMOOTH:  # means at the very ends are shorter and too noisy
        first, least = min(round(0.5 * moment / period), velocity.size // 2), SLOWER
    if way[first] < least * abs(level):
        begin = int(reached[0]) + round(moment / period)
    if way[-1 - first] < least * abs(level):
        end = int(reached[-1]) + 1 - round(moment / period)
    if end - begin < max(LEAST_SHARE * velocity.size, 20):
        return None
    return slice(begin, end) if _keeps_level(velocity[begin:end], smooth[begin:end]) else None


def _moment(velocity: np.ndarray, period: float, encoder: float) -> float:
    """Return how long means of the velocity last in which an encoder's noise hides neither start nor reversal [s].

    A mean is the difference of two positions by its length. It lasts `SMOOTH`, and longer only where no more than noise is seen.
    """
    smooth = _smooth(velocity, period, SMOOTH)
    level = abs(float(np.median(smooth)))
    noise = encoder / SMOOTH
    off = float(np.quantile(np.abs(smooth - np.median(smooth)), 0.7))
    if noise <= CALM * level or off > CERTAIN * noise:
        return SMOOTH
    most = LONGEST * velocity.size * period
    return max(SMOOTH, min(encoder / (CALM * level), most) if level > 0.0 else most)


def _smooth(velocity: np.ndarray, period: float, moment: float) -> np.ndarray:
    """Return centered moving means over a time [s], shorter at the ends, (n,)."""
    half = min(round(0.5 * moment / period), velocity.size // 2)
    total = np.concatenate([[0.0], np.cumsum(velocity)])
    index = np.arange(velocity.size)
    first, last = np.maximum(index - half, 0), np.minimum(index + half + 1, velocity.size)
    return (total[last] - total[first]) / (last - first)


def _keeps_level(velocity: np.ndarray, smooth: np.ndarray) -> bool:
    """Return whether the means of the thirds agree, none is zero, and the motion hardly reverses.

    Single samples may jump because of stick-slip or encoder noise.
    """
    levels = [float(np.mean(part)) for part in np.array_split(velocity, 3)]
    if np.mean(smooth * np.sign(np.mean(velocity)) < 0.0) > 0.1:  # it moves to and fro
        return False
    return min(np.abs(levels)) > 0 and float(np.ptp(levels)) < 0.25 * float(np.max(np.abs(levels)))


def _plateaus(velocity: np.ndarray, period: float) -> list[tuple[int, int]]:
    """Return start and end of every stretch with constant velocity."""
    width = max(3, int(LEAST_TIME / period))
    if velocity.size < 2 * width:
        return []
    kernel = np.ones(width) / width
    level = np.convolve(velocity, kernel, "same")
    square = np.convolve(velocity**2, kernel, "same")
    spread = np.sqrt(np.maximum(square - level**2, 0.0))
    top = np.max(np.abs(level))
    steady = (np.abs(level) > 0.005 * top) & (spread < STEADY * np.abs(level) + 0.002 * top)
    return [
        (int(a), int(b))
        for a, b in spans(steady)
        if b - a >= width and np.ptp(level[a:b]) < 2 * STEADY * abs(np.mean(level[a:b]))
    ]


def gravity_of(runs: Sequence[Run]) -> tuple[np.ndarray, np.ndarray] | None:
    """Return gravity from the torque's variation within the runs, in which only gravity changes with position.

    Returns:
        The coefficients of sin q and cos q [N.m], (2,), and their covariance, (2, 2); None if the position is unknown, or if
        gravity neither explains the share `SEEN` of the torque's variance within runs nor has the significance `SURE`.
    """
    scatter = [run.within for run in runs if run.within is not None]
    if len(scatter) < len(runs) or len(runs) < LEAST_RUNS:
        return None
    total = np.sum(scatter, axis=0)
    gram, moment, power = total[:2, :2], total[:2, 2], total[2, 2]
    if np.linalg.cond(gram) > 1e8 or power <= 0.0:
        return None
    theta = np.linalg.solve(gram, moment)
    scores = np.stack([s[:2, 2] - s[:2, :2] @ theta for s in scatter])
    covariance = regression.cluster_covariance(regression.invert(gram), scores)
    seen = theta @ moment >= SEEN * power
    return (theta, covariance) if seen or theta @ np.linalg.pinv(covariance) @ theta > SURE**2 else None


def without_gravity(log: Log, joint: str | int, gravity: np.ndarray) -> Log:
    """Return the log of one joint, with torque on the joint side minus gravity.

    Args:
        log: with position and torque.
        joint: name or column.
        gravity: coefficients of sin q and cos q [N.m], (2,).
    """
    log = log.select(joint).on_joint_side()
    pull = gravity[0] * np.sin(log.need("position")) + gravity[1] * np.cos(log.need("position"))
    return log.replace(torque=log.need("torque") - pull)
