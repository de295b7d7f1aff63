"""The distance that a joint travels after a reversal before its friction is that of sliding.

Elastic parts deflect first. Meanwhile, friction is smaller than at the same speed in sliding. If the torque just after reversals
is significantly smaller than the fit predicts, samples within that distance are left out, before the delay is estimated: friction
that lags by a distance looks like late torque.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification import noise, regression
from backdrive.identification.delay import earlier
from backdrive.identification.motion_bins import BLOCKS, Bins, bin_size
from backdrive.identification.residual import MEAN, Part, residual_of
from backdrive.identification.robust import robust_spread
from backdrive.identification.signals import Signals, since_reversal, way_since_reversal
from backdrive.identification.slip import fit
from backdrive.identification.whitening import WHITE, Colour
from backdrive.logs import filters
from backdrive.logs.quantiles import median

# tested distances, relative to the median distance between two reversals [-]
SHARES = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.24, 0.32, 0.45)
FAR = 0.16  # share beyond which a distance is tested only if friction still builds up just before it
SURE = 2.5  # least significance of a smaller torque after reversals [standard error]
FEWEST = 8  # least number of bins for the test
CLEAR = 3.0  # least significance from move to move, without whitening [standard error]
NEARLY_WHITE = (
    0.1  # largest correlation of neighbouring bins with which a fit's own residual tells nearly the same [-]
)
UNLIKELY = 1.5  # least significance by that residual that is worth a test with whitening [standard error]
DOUBT = 0.5  # the same that is worth a test with whitening [standard error]
FEWEST_MOVES = 4  # least number of moves for a test from move to move


def build_up(
    raw: Bins,
    stretches: Sequence[Signals],
    delay: float,
    spread: np.ndarray,
    colour: Colour,
    seconds: float,
    start: np.ndarray | None = None,
) -> float:
    """Return the distance after a reversal within which friction still builds up [rad or m]; 0 if it does not show.

    Args:
        raw: bins, not whitened.
        stretches: of one joint, from which the bins were computed.
        delay: of the torque behind the motion, with which the bins were computed [s].
        spread: matrix of the fitted candidate, (p, r).
        colour: of the noise of neighbouring bins.
        seconds: of the bins [s].
        start: coefficients of a similar fit, which save repetitions, (r,).
    """
    way, sense, moves, middle = _ways(stretches, delay, seconds)
    fitted, used, before, more = raw.map_columns(spread), raw.used, 0.0, None
    within, error, white = 0.0, None, abs(colour.correlation) < NEARLY_WHITE
    for share in SHARES:
        if share > FAR and within < before:  # a torque of the position is not to pass for build-up
            break
        band, before = (way >= before) & (way < share * middle), share * middle
        if error is None:
            if start is None or within > 0.0 or not white:  # else it is near enough
                start = fit(replace(fitted, used=used), start)
            error = sense * (fitted.y - fitted.X @ start)
            more = np.append(start, 0.0) if more is None else more
        surely = _from_move_to_move(error, used & band, moves)
        lags = surely < -CLEAR
        if not (lags or surely > -DOUBT) and np.count_nonzero(used & band) >= FEWEST:
            column, now = sense * band, replace(fitted, used=used)
            if white and _by_residual(now, sense * error, column) > -UNLIKELY:
                continue
            lags, more = _lags(now, column, colour, more)
        if lags:
            used, within, error = raw.used & (way >= before), before, None
    return within


def after_build_up(stretches: Sequence[Signals], distance: float) -> list[Signals]:
    """Return stretches in which samples within a distance after a reversal [rad or m] do not count as sliding."""
    if not distance > 0.0:
        return list(stretches)
    masks = [s.sliding & (way_since_reversal(s)[0] >= distance) for s in stretches]
    return [replace(s, sliding=mask).with_pull_of(s) for s, mask in zip(stretches, masks, strict=True)]


def past_build_up(parts: Sequence[Part]) -> list[np.ndarray]:
    """Return where friction no longer builds up, a mask for each part, (n,) each, by the residual of a model.

    It is for methods that fit samples far from reversals alone, so that they need not know where friction builds up.

    Args:
        parts: signals in step, measured friction, predicted torque [N.m or N] and whether they were fitted.
    """
    stretches, res = [s for s, *_ in parts], residual_of(parts, means_alone=True)
    if res is None or not res.sliding.any():
        return [s.sliding for s in stretches]
    raw = Bins(
        X=res.columns, y=res.torque_error, used=res.sliding, speed=np.abs(res.velocity), blocks=BLOCKS[0]
    )
    distance = build_up(raw, stretches, 0.0, np.eye(res.columns.shape[1]), WHITE, MEAN)
    return [s.sliding for s in after_build_up(stretches, distance)]


def _from_move_to_move(error: np.ndarray, band: np.ndarray, moves: np.ndarray) -> float:
    """Return the mean error in a band, from move to move, by its standard error [-]; NaN with too few moves.

    If friction builds up over several bins, their errors are correlated. Whitening would reverse the sign of all but the first.

    Args:
        error: of the torque along the motion, (n,).
        band: mask of the tested bins, (n,).
        moves: number of the move of each bin, (n,).
    """
    at = np.flatnonzero(band)
    count = np.bincount(moves[at])
    if np.count_nonzero(count) < FEWEST_MOVES:
        return np.nan
    means = np.bincount(moves[at], error[at])[count > 0] / count[count > 0]
    return float(means.mean() / max(means.std(ddof=1) / np.sqrt(means.size), 1e-300))


def _by_residual(fitted: Bins, error: np.ndarray, column: np.ndarray) -> float:
    """Return what `_lags` fits, by its standard error for white noise, from the residual of the fit without it [-].

    Args:
        fitted: bins with the candidate's columns.
        error: residual of its fit, (n,).
        column: the additional one, (n,).
    """
    used = fitted.used
    X, z, left = fitted.X[used], column[used], error[used]
    explained = X.T @ z
    own = float(z @ z - explained @ regression.invert(X.T @ X) @ explained)
    return float(z @ left) / max(robust_spread(left) * math.sqrt(max(own, 0.0)), 1e-300)


def _lags(
    fitted: Bins, column: np.ndarray, colour: Colour, start: np.ndarray | None
) -> tuple[bool, np.ndarray]:
    """Return whether the torque along an additional column is significantly smaller than the fitted candidate predicts.

    Args:
        fitted: bins with the candidate's columns.
        column: the additional one, (n,).
        colour: of the noise of neighbouring bins.
        start: coefficients of the fit before, (p + 1,).

    Returns:
        The answer, and the coefficients of this fit, (p + 1,).
    """
    more = replace(fitted, X=np.column_stack([fitted.X, column])).whiten(colour)
    theta = fit(more, start)
    if not theta[-1] < 0.0:
        return False, theta
    covariance = noise.covariance_of_fit(more.X, more.y - more.X @ theta, more.used, colour.independent)
    return bool(theta[-1] < -SURE * np.sqrt(covariance[-1, -1])), theta


def _ways(
    stretches: Sequence[Signals], delay: float, seconds: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return the distance since the last reversal, the direction and the number of the move of each bin, (n,) each, and the
    median distance between reversals.
    """
    ways, senses, moves, middles = [], [], [], []
    count = 0
    for s in stretches:
        width, size = bin_size(s, seconds)
        velocity = earlier(s.velocity, float(round(delay * s.rate)))  # near enough
        way, middle = since_reversal(velocity, s.rate)
        ways.append(way[: size * width].reshape(size, width).min(axis=1))
        senses.append(filters.means(np.sign(velocity), width))
        moves.append(count + np.cumsum(np.diff(ways[-1], prepend=0.0) < 0.0))
        count = 1 + int(moves[-1].max(initial=count))
        middles.append(middle)
    return np.concatenate(ways), np.concatenate(senses), np.concatenate(moves), median(np.array(middles))
