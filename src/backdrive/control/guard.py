"""What stands between a joint's compensation and its motor: the watch, the limit of torque and that of its rate.

The watch latches a joint that is faster than its top speed v_top over a window of 10 to 15 ms,

    |q_k - q_i| > v_top (t_k - t_i),

and one whose readings could not be believed for longer than the patience; good ticks make up for bad ones four to one. A latched
joint gives no torque until it is acknowledged. The output f of every call, whatever came before, is

    |f| <= cap <= limit,     |f - f_before| <= rate T

where the cap is the torque that the loop may give at present: it grows from zero at the slow rate when the loop starts and after a
fault, falls at the slow rate after a stop, and when latched at limit/0.15 s, for a runaway at limit/0.02 s. Towards zero only the
normal rate counts. Where rules meet, the order is: a latch before a stop, a stop before a fault, a fault before the compensator;
then cap and limit, and the rate has the last word.
"""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit
from backdrive.control.readings import OVERSPEED, valid
from backdrive.control.table import (
    BAD,
    BEFORE,
    CAP,
    CAUSE,
    EXTERNAL,
    FADE,
    FAST,
    FAULTY,
    LATCHING,
    LIMIT,
    NEWER,
    NEWER_AGE,
    NOMINAL,
    OLDER,
    OLDER_AGE,
    PASSED,
    PATIENCE,
    RAMP,
    RATE,
    STOP,
    TOP,
    TORQUE,
)  # fmt: skip
from backdrive.status import Status

SATURATED, NO_MOTION = int(Status.SATURATED), int(Status.NO_MOTION)
STOPPED, LATCHED = int(Status.STOPPED), int(Status.LATCHED)
LONGEST = 20.0  # periods that one call counts for at most as fault time
WINDOW = 0.01  # in which a speed is measured [s]
HASTE = 7.5  # of a latch for a runaway: what is given past the top speed has to be braked by friction
FORGIVEN = 0.25  # fault time that a good tick takes off, by its own
ROUNDING = 1e-9  # of the distance in a window, of numbers


@jit
def window(period):
    """Return the time in which a speed is measured [s]."""
    return max(WINDOW, 2.0 * period)


@jit
def watch(g, j, since):
    """Return whether a joint is faster than its top speed; `since`: time since the last reading that was believed."""
    span, q = window(g[NOMINAL, j]), g[BEFORE, j]
    g[OLDER_AGE, j] += since
    g[NEWER_AGE, j] += since
    fast = False
    if g[OLDER_AGE, j] >= span * (1.0 - ROUNDING):
        reach = g[TOP, j] * g[OLDER_AGE, j]
        fast = abs(q - g[OLDER, j]) > reach + ROUNDING * (reach + abs(q))
        g[FAST, j] = fast
    if g[NEWER_AGE, j] >= 0.5 * span * (1.0 - ROUNDING):
        g[OLDER, j], g[OLDER_AGE, j] = g[NEWER, j], g[NEWER_AGE, j]
        g[NEWER, j], g[NEWER_AGE, j] = q, 0.0
    return fast


@jit
def forget_speed(g, j):
    """Begin a new window of speeds at the present reading."""
    g[OLDER, j] = g[NEWER, j] = g[BEFORE, j]
    g[OLDER_AGE, j] = g[NEWER_AGE, j] = g[FAST, j] = 0.0


def acknowledge(g: np.ndarray, j: int) -> bool:
    """Take back a joint's latch and stop, unless torque is still left or the joint is still too fast; return whether it was."""
    if g[CAUSE, j] != 0.0 and (g[TORQUE, j] != 0.0 or g[FAST, j] != 0.0):
        return False
    if g[CAUSE, j] != 0.0 or g[STOP, j] != 0.0:
        g[CAP, j] = min(g[CAP, j], abs(g[TORQUE, j]))
        g[FAULTY, j] = 0.0
    g[CAUSE, j] = g[STOP, j] = 0.0
    return True


@jit
def act(g, j, code, wanted, since, interval):
    """Write the joint's output and return its status.

    `code`: of the reading or of what was made of it, `wanted`: torque of the compensator where the reading was believed, `since`:
    time that this reading stands for, `interval`: as it was given.
    """
    passed = g[PASSED, j]
    good = valid(code) or code == NO_MOTION
    if good:
        g[FAULTY, j] = max(g[FAULTY, j] - FORGIVEN * passed, 0.0)
        g[BAD, j] = 0.0
        if watch(g, j, since):
            code = OVERSPEED
    else:
        g[FAULTY, j] += min(max(passed, interval), LONGEST * passed)  # `passed` where the interval is NaN
        fading = 1.0 + g[FADE, j] * passed if g[BAD, j] > 0.0 else 1.0  # one bad reading is bridged
        g[BAD, j] += 1.0
        wanted = g[TORQUE, j] / fading
        g[EXTERNAL, j] /= fading
    out, limit, cap = g[TORQUE, j], g[LIMIT, j], g[CAP, j]
    latched = g[CAUSE, j] != 0.0
    if not latched and (code == OVERSPEED or g[FAULTY, j] > g[PATIENCE, j]):
        g[CAUSE, j] = code
    if g[CAUSE, j] != 0.0 or g[STOP, j] != 0.0:
        fall = g[RAMP, j]
        if g[CAUSE, j] != 0.0:
            fall = (HASTE if g[CAUSE, j] == OVERSPEED else 1.0) * g[LATCHING, j]
            wanted = out
            code = LATCHED if latched else code
        elif good:
            code = STOPPED
        cap = max(min(cap, abs(out)) - fall * passed, 0.0)
    elif good:
        cap = min(cap + g[RAMP, j] * passed, limit)
    if abs(wanted) > limit and valid(code):
        code = SATURATED
    step = g[RATE, j] * passed
    f = min(max(min(max(wanted, -cap), cap), out - step), out + step)
    f = min(max(f, -limit), limit)
    g[CAP, j] = cap if good or g[BAD, j] < 2.0 else min(cap, abs(f))
    g[TORQUE, j] = f
    return code
