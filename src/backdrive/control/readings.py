"""Whether a reading can be believed: finite, timely, possible. The first of a loop's defences.

A reading is possible when the joint can have come there from the last one that was believed,

    |q - q_before| <= v_top (t + T) + 2 delta

t: time since then, T: period, delta: encoder step, v_top: top speed. Otherwise it is a jump, and what follows decides: a reading
near the old place was preceded by a wild one; readings that follow one another at the new place for half the patience mean that the
encoder counts from another zero, by which everything that is a position is moved, so that neither torque nor estimate sees it;
a second jump of the same direction and a similar speed is no fault of the encoder but a joint that runs away.
"""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.estimators import external as external_
from backdrive.control.table import (
    ANCHOR,
    APPLIED,
    BEFORE,
    BEGUN,
    COUNT,
    ELSEWHERE,
    ERROR,
    KNOWN,
    LEAP,
    LOAD,
    MOTOR,
    NEWER,
    NOMINAL,
    OLDER,
    PASSED,
    PATIENCE,
    PENDING,
    SETTLED,
    SINCE,
    SLOPE,
    TEMPERATURE,
    TIME,
    TOP,
    ZERO,
)  # fmt: skip
from backdrive.status import Status

OK, NOT_FINITE, BAD_INTERVAL = int(Status.OK), int(Status.NOT_FINITE), int(Status.BAD_INTERVAL)
JUMP, LATE, OVERSPEED = int(Status.JUMP), int(Status.LATE), int(Status.OVERSPEED)
SLOWEST, FASTEST = 20.0, 0.05  # intervals by the nominal one that are believed
LONGEST = 1.0  # time that an interval which is not believed counts for at most [s]
BEHIND = 1.5  # the same, above which a tick is late
ALIKE = 2.0  # ratio of speeds up to which two jumps are one motion


@jit
def shift(c, s, ce, se, g, j, by):
    """Move everything of a joint that is a position: the encoder counts from another zero."""
    compensator_.shift(c, 0, s, 0, by)
    external_.shift(ce, 0, se, 0, by)
    g[BEFORE, j] += by
    g[ELSEWHERE, j] = g[BEFORE, j]
    g[ANCHOR, j] += by
    g[OLDER, j] += by
    g[NEWER, j] += by
    g[ZERO, j] += by
    g[PENDING, j], g[SINCE, j] = 0.0, 0.0


@jit
def possible(g, j, distance, time):
    """Return whether a joint can have moved that far in a time."""
    return abs(distance) <= g[TOP, j] * (time + g[NOMINAL, j]) + 2.0 * g[COUNT, j]


@jit
def follows(c, s, ce, se, g, j, q, passed):
    """Return whether a reading is near that of a jump; where many have been, the encoder counts from another zero."""
    if g[PENDING, j] == 0.0 or not possible(g, j, q - g[ELSEWHERE, j], passed):
        return False
    g[ELSEWHERE, j] = q
    g[SETTLED, j] += passed
    if g[SETTLED, j] > 0.5 * g[PATIENCE, j]:
        shift(c, s, ce, se, g, j, q - g[BEFORE, j])
    return True


@jit
def jump_status(g, j, q, way, passed):
    """Return the status of a reading that is out of reach: a second jump that is like the first is a joint that runs away."""
    code = JUMP
    if g[PENDING, j] > 0.0:
        speed = (q - g[ELSEWHERE, j]) / passed
        ratio = speed / g[LEAP, j]
        code = OVERSPEED if 1.0 / ALIKE <= ratio <= ALIKE else JUMP
    else:
        speed = way / g[SINCE, j]
    g[PENDING, j], g[ELSEWHERE, j], g[LEAP, j], g[SETTLED, j] = True, q, speed, 0.0
    return code


@jit
def judge(c, s, ce, se, g, j, q, dt):
    """Return the status of a joint's input: OK or LATE where it can be believed."""
    nominal = g[NOMINAL, j]
    long = dt > SLOWEST * nominal
    timely = FASTEST * nominal <= dt and not long
    passed = dt if timely else nominal
    g[PASSED, j] = passed
    g[TIME, j] += passed
    # a long one is not believed, but the joint had that time to move
    g[SINCE, j] += min(dt, LONGEST) if long and dt < np.inf else passed
    if g[BEGUN, j] == 0.0 and np.isfinite(q):
        shift(c, s, ce, se, g, j, q - g[BEFORE, j])
        g[BEGUN, j], g[SINCE, j], g[ZERO, j] = True, passed, 0.0
    if not timely:
        return BAD_INTERVAL
    others = g[APPLIED, j] + g[KNOWN, j] + g[ERROR, j] + g[SLOPE, j] + g[MOTOR, j] + g[LOAD, j]
    if not (np.isfinite(q) and np.isfinite(others + g[TEMPERATURE, j])):
        return NOT_FINITE
    if follows(c, s, ce, se, g, j, q, passed):  # first, for the old place is within reach again after a while
        return JUMP
    way = q - g[BEFORE, j]
    if not possible(g, j, way, g[SINCE, j]):
        return jump_status(g, j, q, way, passed)
    return LATE if dt > BEHIND * nominal else OK


@jit
def valid(code):
    """Return whether a status is that of a reading that was believed."""
    return code in (OK, LATE)
