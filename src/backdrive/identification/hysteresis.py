"""The hysteresis loop of a joint under a torque that goes up and down without making it slip (Iwatani 2017, Fig. 3.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.identification.sweep_windows import turning_points
from backdrive.logs import filters
from backdrive.logs.log import Log

CUTOFF = 20.0  # corner of the low pass on torque and position of a ramp [Hz]
BRANCH = 0.2  # a branch of a ramp covers at least this share of the whole torque range [-]


def loop(logs: Sequence[Log], slips: Sequence[float]) -> tuple[float, float]:
    """Return width [rad or m] and area [J] of the last closed hysteresis loop without slip; NaN where there is none.

    Args:
        logs: of one joint, torque ramps.
        slips: speed from which on the joint slips, a log [rad/s or m/s].
    """
    width, area = float("nan"), float("nan")
    for log, limit in zip(logs, slips):
        torque, position = log.torque[:, 0], log.position[:, 0]  # type: ignore[index]
        rate = 1.0 / log.period
        cutoff = min(CUTOFF, 0.1 * rate)
        u, x = filters.low_pass(torque, cutoff, rate), filters.low_pass(position, cutoff, rate)
        speed = np.abs(filters.derivative(x, log.period))
        turns = turning_points(u, BRANCH * float(np.ptp(u)))
        for a, b, c in zip(turns[1:], turns[2:], turns[3:]):
            if np.any(speed[a:c] >= limit) or abs(abs(u[b] - u[a]) / abs(u[c] - u[b]) - 1.0) > 0.1:
                continue
            middle = 0.5 * (u[a] + u[b])
            there = [np.interp(middle, *_rising(u[p:q], x[p:q])) for p, q in ((a, b), (b, c))]
            width = float(abs(there[1] - there[0]))
            loop_u, loop_x = np.append(u[a:c], u[a]), np.append(x[a:c], x[a])
            area = float(abs(np.sum(0.5 * (loop_u[1:] + loop_u[:-1]) * np.diff(loop_x))))
    return width, area


def _rising(u: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(u, kind="stable")
    return u[order], x[order]
