"""Acceptance of encoder readings: a reading must be finite, timely and physically possible. This is a loop's first check.

A reading is possible if the joint can have moved there from the last accepted one,

    |q - q_before| <= v_top (t + T) + 2 delta

t: time since then, T: period, delta: encoder step, v_top: top speed. Otherwise it is a jump, and the next readings decide. If
they return to the old position, the jump was an outlier. If they stay near the new position for half the patience, the
encoder's zero has changed: all positions are shifted, so that torque and estimate are not affected. A second jump in the same
direction with a similar speed means a runaway, not an encoder fault.
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
    SLACK,
    SLOPE,
    TEMPERATURE,
    TIME,
    TOP,
    ZERO,
    is_set,
)  # fmt: skip
from backdrive.status import Status

OK, NOT_FINITE, BAD_INTERVAL = int(Status.OK), int(Status.NOT_FINITE), int(Status.BAD_INTERVAL)
JUMP, LATE, OVERSPEED = int(Status.JUMP), int(Status.LATE), int(Status.OVERSPEED)
SLOWEST, FASTEST = 20.0, 0.05  # accepted intervals relative to the nominal one
LONGEST = 1.0  # largest time that a rejected interval counts for [s]
BEHIND = 1.5  # interval relative to the nominal one above which a tick is late
ALIKE = 2.0  # largest ratio of speeds at which two jumps count as one motion
#: A joint may have a top speed; without one, every finite reading is possible.
LIMITED = True


@jit
def shift(c, s, ce, se, g, by):
    """Shift all positions of a joint, after a change of the encoder's zero."""
    compensator_.shift(c, 0, s, 0, by)
    external_.shift(ce, 0, se, 0, by)
    g[BEFORE] += by
    g[ELSEWHERE] = g[BEFORE]
    g[ANCHOR] += by
    g[OLDER] += by
    g[NEWER] += by
    g[ZERO] += by
    g[PENDING], g[SINCE] = 0.0, 0.0


def slack(top_speed: float, count: float, period: float) -> float:
    """Return how much farther than v_top t a joint can seem to have moved: v_top T + 2 delta [rad or m]."""
    return top_speed * period + 2.0 * count


@jit
def possible(g, distance, time):
    """Return whether a joint can have moved a distance in a given time; False for a NaN or an infinite distance."""
    return abs(distance) < g[TOP] * time + g[SLACK]


@jit
def follows(c, s, ce, se, g, q, passed):
    """Return whether a reading is near the one before it, after a jump. If this lasts, the encoder's zero is shifted."""
    if not is_set(g[PENDING]) or not possible(g, q - g[ELSEWHERE], passed):
        return False
    g[ELSEWHERE] = q
    g[SETTLED] += passed
    if g[SETTLED] > 0.5 * g[PATIENCE]:
        shift(c, s, ce, se, g, q - g[BEFORE])
    return True


@jit
def jump_status(g, q, way, passed):
    """Return the status of a reading that is out of reach. Two jumps with similar velocities mean a runaway."""
    if not np.isfinite(q):
        return NOT_FINITE
    code = JUMP
    if is_set(g[PENDING]):
        speed = (q - g[ELSEWHERE]) / passed
        ratio = speed / g[LEAP]
        code = OVERSPEED if 1.0 / ALIKE <= ratio <= ALIKE else JUMP
    else:
        speed = way / g[SINCE]
    g[PENDING], g[ELSEWHERE], g[LEAP], g[SETTLED] = True, q, speed, 0.0
    return code


@jit
def judge(c, s, ce, se, g, q, dt):
    """Return the status of a joint's input, OK or LATE if it is accepted, and the time that the tick counts for."""
    nominal = g[NOMINAL]
    code, passed, missed = OK, nominal, nominal
    if dt != nominal:  # seldom
        code = BAD_INTERVAL
        if FASTEST * nominal <= dt:
            if dt <= SLOWEST * nominal:
                passed, missed = dt, dt
                code = LATE if dt > BEHIND * nominal else OK
            elif dt < np.inf:  # it is rejected, but the joint may have moved during that time
                missed = min(dt, LONGEST)
    g[PASSED] = passed
    g[TIME] += passed
    g[SINCE] += missed
    if not is_set(g[BEGUN]) and np.isfinite(q):
        shift(c, s, ce, se, g, q - g[BEFORE])
        g[BEGUN], g[SINCE], g[ZERO] = True, passed, 0.0
    if code == BAD_INTERVAL:
        return code, passed
    others = (g[APPLIED] + g[KNOWN]) + (g[ERROR] + g[SLOPE]) + (g[MOTOR] + g[LOAD])
    if not np.isfinite(others + g[TEMPERATURE]):
        return NOT_FINITE, passed
    if not LIMITED:
        return (code if np.isfinite(q - g[BEFORE]) else NOT_FINITE), passed
    if follows(c, s, ce, se, g, q, passed):  # first, since the old position comes within reach after a while
        return JUMP, passed
    way = q - g[BEFORE]
    if not possible(g, way, g[SINCE]):
        return jump_status(g, q, way, passed), passed
    return code, passed


@jit
def valid(code):
    """Return whether a status belongs to an accepted reading."""
    return code in (OK, LATE)
