"""The delay of the torque behind the motion: the shift that explains it best, alone or beside friction that lags by itself.

Friction that builds up over a distance after each reversal (presliding), or that follows the position, looks like late torque: it
lags too, though by a distance and not by a time. Bristles and a wave of the position beside the other terms tell the two apart:
they leave little of a shift that only imitated them, and nearly all of a real one.
"""

from __future__ import annotations

import numpy as np

from backdrive.identification.curves import basis
from backdrive.identification.projection import orthonormal
from backdrive.identification.residual import Residual
from backdrive.logs.filters import deflections

SECTIONS = 6  # number of sections of the curve that is fitted for a delay
FEWEST_MOVES = 6  # least number of moves for the estimate of a delay
LATEST = 0.15  # longest delay of the search [s]
DISTANCES = np.geomspace(0.001, 0.2, 14)  # distances by which friction may lag, relative to the range [-]


def delay(res: Residual, *others: np.ndarray) -> tuple[float, float] | None:
    """Return the delay of the torque behind the motion [s], and the residual relative to that without a delay [-].

    A friction curve and the other terms of a single axis are fitted to torque at every shift. The result is None if the log is
    too short, or the best shift is at a limit of the range.

    Args:
        res: means of motion and torque.
        others: further columns of the joint's model, (n,) each.
    """
    rows = _rows(res)
    return None if rows is None else _lowest(res, rows, _terms(res, rows, others))


def delay_beside_distance(res: Residual, *others: np.ndarray) -> tuple[float, float] | None:
    """Return the same as `delay`, beside friction that builds up over a distance and torque that follows the position.

    Args:
        res: means of motion and torque; where these hold no position, neither is separated.
        others: further columns of the joint's model, (n,) each.
    """
    rows = _rows(res)
    if rows is None:
        return None
    terms = _terms(res, rows, others)
    if not np.isfinite(res.position).all():
        return _lowest(res, rows, terms)
    widths = DISTANCES * float(np.ptp(res.position))
    parts = [deflections(res.position[res.part == part], widths) for part in np.unique(res.part)]
    factors = np.ones_like(res.velocity), np.sign(res.velocity)
    waves = [
        (factor * of_phase(best.wave * res.position))[rows, None]
        for factor, best in zip(factors, res.over_position, strict=True)
        if best is not None
        for of_phase in (np.sin, np.cos)
    ]
    return _lowest(res, rows, np.hstack([terms, np.concatenate(parts)[rows], *waves]))


def _lowest(res: Residual, rows: np.ndarray, terms: np.ndarray) -> tuple[float, float] | None:
    """Return the shift that terms (m, p) explain best [s], and the residual relative to that without a shift [-]."""
    reach, columns = _reach(res), orthonormal(terms)
    torque = np.lib.stride_tricks.sliding_window_view(res.torque, 2 * reach + 1)[rows - reach]
    explained = columns.T @ torque
    powers = np.einsum("nk,nk->k", torque, torque) - np.einsum("pk,pk->k", explained, explained)
    best = int(np.argmin(powers))
    if best in (0, 2 * reach):
        return None  # no minimum: the model lacks a slow effect, and any shift lowers the residual
    before, least, after = powers[best - 1 : best + 2].tolist()
    bend = before - 2.0 * least + after  # of the parabola through the three, whose lowest point lies between
    part = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return (best - reach + part) * res.period, float(np.sqrt(max(least, 0.0) / max(powers[reach], 1e-300)))


def _reach(res: Residual) -> int:
    return round(LATEST / res.period)


def _rows(res: Residual) -> np.ndarray | None:
    """Return the means that slide with room for every shift, (m,); None where they are too few."""
    reach = _reach(res)
    n = res.time.size
    if reach < 3 or n < 20 * reach:
        return None
    inside = np.arange(reach, n - reach)
    inside = inside[(res.part[inside - reach] == res.part[inside + reach]) & res.sliding[inside]]
    moves = 1 + int(np.count_nonzero(np.diff(np.sign(res.velocity[inside]))))
    return None if inside.size < 20 * reach // 2 or moves < FEWEST_MOVES else inside


def _terms(res: Residual, rows: np.ndarray, others: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return a curve of the velocity and the rest of a single axis, (m, p)."""
    speed = np.abs(res.velocity[rows])
    ranks = np.linspace(0.0, speed.size - 1.0, SECTIONS + 1).astype(int)
    knots = np.unique(np.sort(speed)[ranks])
    return np.hstack([res.columns[rows], basis(res.velocity[rows], knots), *(x[rows, None] for x in others)])
