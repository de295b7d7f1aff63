"""How long after a reversal of the motion friction turns: that of a late torque turns late, and all at once.

Friction that builds up over a distance turns gradually, from the reversal on. So friction that is held for a while and then turns
tells a delay of the torque, whatever the motion: also where the inertia is too small to tell it, or tells a wrong one.
"""

from __future__ import annotations

import numpy as np

from backdrive.identification.residual import Residual
from backdrive.identification.robust import robust_spread
from backdrive.identification.signals import turns
from backdrive.logs.quantiles import median

REACH = 0.3  # longest time after a reversal that is looked at [s]
FEWEST = 6  # least number of reversals
SLOW = 0.01  # least speed two means beside a reversal, relative to the top speed: others are rests [-]
STEADY = 0.5  # least part of the friction that has not turned at first, and inverse of the largest [-]
HELD, TURNED = 0.6, 0.2  # least part that is held, relative to the first, and largest that has turned [-]
FALL = 0.1  # largest fall from mean to mean while it is held, likewise: what builds up over a distance falls faster [-]
SCATTER = 0.1  # largest standard error of a part [-]
LASTING, EDGE = 2, 1  # least number of means in which friction is held, and most in which it turns
AFTER = 3  # least number of means in which it has turned


def turning_lag(res: Residual) -> float:
    """Return by which time friction turns late after reversals [s], below zero if early; 0 where it does not, or gradually.

    Args:
        res: of a model whose friction turns at once.
    """
    for way in (1, -1):
        held, error = _shares(res, way)
        first = float(held[:1].max(initial=0.0))
        steady = (held >= HELD * first) & (-np.diff(held, prepend=first) <= FALL * first)
        count = int(np.argmin(np.append(steady, False)))
        edge = count + int(np.argmax(np.append(held[count:], 0.0) < TURNED))
        after = slice(edge, edge + AFTER)
        if count < LASTING or edge > count + EDGE or held[after].size < AFTER:
            continue
        level = float(held[:count].mean())
        sure = max(error[:count].max(), error[after].max()) < SCATTER and np.abs(held[after]).max() < TURNED
        if sure and STEADY < level < 1.0 / STEADY:
            means = 1.0 + float(held[:edge].sum()) / level  # one is before the first part
            return way * res.period * means
    return 0.0


def _shares(res: Residual, way: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the part of the friction that has not turned, by the number of means after a reversal, and its standard error, (m,).

    It is the median over the reversals, begins with the second mean, and ends where few of them reach.

    Args:
        res: of a model whose friction turns at once.
        way: 1 for the time after a reversal, -1 for that before it, backwards.
    """
    friction = (res.predicted - res.torque + res.friction)[::way]  # as predicted
    velocity, error, part = way * res.velocity[::way], res.torque_error[::way], res.part[::way]
    ends = np.append(turns(velocity), velocity.size - 1)
    inside = (ends[:-1] >= 3) & (np.diff(ends) > LASTING + EDGE + AFTER)
    at, last = ends[:-1][inside], np.minimum(ends[1:], ends[:-1] + round(REACH / res.period))[inside]
    jump = friction[at + 2] - friction[at - 1]
    beside, top = np.abs(velocity[[at - 2, at + 3]]), float(np.abs(velocity).max(initial=0.0))
    quick = beside.min(axis=0) > SLOW * top
    used = quick & (way * jump * velocity[at + 1] > 0.0) & (part[at - 3] == part[last])
    at, last, jump = at[used], last[used], jump[used]
    held: list[tuple[float, float]] = []
    while True:
        there = at + 2 + len(held) <= last
        if np.count_nonzero(there) < max(FEWEST, at.size // 3):
            break
        values = -error[at[there] + 2 + len(held)] / jump[there]
        middle = median(values)
        if not held and middle < STEADY * HELD:
            break  # as nearly always
        held.append((middle, robust_spread(values - middle) / values.size**0.5))
    one, other = np.array(held).reshape(-1, 2).T
    return one, other
