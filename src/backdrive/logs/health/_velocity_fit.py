"""Fit of measured velocity to the change of position: scale, delay, and residual.

The position's change over a window, D, is compared with the integral of velocity over it, S. Integrating spares the
quantised position from being differentiated. A velocity delayed by T falls short of the change by T times the change of
velocity, dV, so D = scale * S + scale * T * dV, by least squares over many windows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.logs.health._exam import Exam, once
from backdrive.logs.resolution import white_noise

#: Fewest samples a window, and how many steps of the encoder the joint should move in it.
_WINDOW, _MOVED = 5, 24.0
#: Windows are longer than any relevant delay [s].
_LONG = 0.1
_MOST_WINDOWS = 8192
_FOLDS = 24  # stretches of the log by which the error of the scale is estimated


@dataclass(frozen=True)
class VelocityFit:
    """Position against velocity of one joint.

    Attributes:
        scale: change of position per integral of velocity; 1 when all is well [1].
        delay: of velocity behind position [s].
        residual: RMS of the residual divided by the RMS of the change of position [1].
        plain: the same without the delay [1].
        window: length of the windows compared [s].
        error: standard error of `scale` [1]; infinite if unknown.
    """

    scale: float
    delay: float
    residual: float
    plain: float
    window: float
    error: float = float("inf")


@once
def velocity_fit(exam: Exam, j: int) -> VelocityFit | None:
    """Return the fit; None if a channel is missing or the joint moves too little."""
    if not (exam.usable("position", j) and exam.usable("velocity", j)) or not exam.period > 0:
        return None
    if exam.survey("velocity").low[j] == exam.survey("velocity").high[j]:
        return None  # the check `stuck` reports that
    q, v, t = exam.log.channels["position"], exam.log.channels["velocity"], exam.log.time
    pieces = [(q[b, j], v[b, j], t[b] - t[b.start]) for b in exam.blocks if b.stop - b.start > 2 * _WINDOW]
    if not pieces:
        return None
    noise = white_noise(np.concatenate([p[1] for p in pieces])) * exam.period
    rounding = exam.quantum("velocity", j) * exam.period
    least = _MOVED * max(exam.quantum("position", j), 1e-9)
    longest = max(len(p[0]) for p in pieces)
    window = max(_WINDOW, round(_LONG / exam.period))
    if window > longest / 4:
        return None
    while True:
        change, integral, ends = _windows(pieces, window)
        moved, expected = (float(np.sqrt(np.mean(x**2))) for x in (change, integral))
        # noise grows with the root of the window's length, the effect of rounding in proportion to it
        unsure = max(6 * noise * np.sqrt(window), 3 * rounding * window)
        enough = moved > least and max(moved, expected) > unsure
        if enough or 3 * window > longest / 4:
            break
        window *= 3
    if not enough and not (moved > 0.5 * least and max(moved, expected) > 0.5 * unsure):
        return None
    scale, delay, residual, plain, error = _solve(change, integral, ends)
    return VelocityFit(scale, delay, residual, plain, window * exam.period, error)


def _windows(pieces: Any, window: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    changes: list[np.ndarray] = []
    integrals: list[np.ndarray] = []
    ends: list[np.ndarray] = []
    total = sum(len(p[0]) for p in pieces)
    stride = max(1, window // 4, total // _MOST_WINDOWS)
    for q, v, t in pieces:
        area = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
        start = np.arange(0, len(q) - window, stride)
        changes.append(q[start + window] - q[start])
        integrals.append(area[start + window] - area[start])
        ends.append(v[start + window] - v[start])
    return np.concatenate(changes), np.concatenate(integrals), np.concatenate(ends)


def _solve(
    change: np.ndarray, integral: np.ndarray, ends: np.ndarray
) -> tuple[float, float, float, float, float]:
    keep = np.ones(change.size, bool)
    power = float(np.mean(change**2))
    scale, slope, left = 0.0, 0.0, change
    for _ in range(2):  # the second time without what fits worst, such as the windows across a jump
        a, d, e = integral[keep], change[keep], ends[keep]
        matrix = np.array([[a @ a, a @ e], [a @ e, e @ e]])
        if not matrix[0, 0] > 0:
            return 0.0, 0.0, 1.0, 1.0, float("inf")
        if matrix[1, 1] * matrix[0, 0] - matrix[0, 1] ** 2 <= 1e-9 * matrix[0, 0] * matrix[1, 1]:
            scale, slope = float(a @ d / matrix[0, 0]), 0.0
        else:
            solution: np.ndarray = np.linalg.solve(matrix, [a @ d, e @ d])
            scale, slope = solution
        left = change - scale * integral - slope * ends
        keep = np.abs(left) <= 4 * np.sqrt(np.mean(left[keep] ** 2))
    residual = np.sqrt(np.mean(left[keep] ** 2) / power)
    lone = integral @ change / (integral @ integral)
    plain = np.sqrt(np.mean((change - lone * integral) ** 2) / power)
    delay = slope / scale if scale else 0.0
    scores = [float(part.sum()) for part in np.array_split(np.where(keep, left * integral, 0.0), _FOLDS)]
    error = np.sqrt(np.sum(np.square(scores))) / (integral[keep] @ integral[keep])
    return float(scale), float(delay), float(residual), float(plain), float(error)
