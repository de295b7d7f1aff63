"""The output stage between a joint's compensation and its motor: speed watch, torque limit and rate limit.

The watch latches a joint that is faster than its top speed v_top over a window of 10 to 15 ms,

    |q_k - q_i| > v_top (t_k - t_i),

and a joint whose readings were rejected for longer than the patience. Four good ticks offset one bad tick. A latched joint
has no torque until it is acknowledged. The output f of every call satisfies

    |f| <= cap <= limit,     |f - f_before| <= rate T

The cap is the present limit of the torque. It grows from zero at the slow rate after the start and after a fault, and falls
at the slow rate after a stop. After a latch it falls at limit/0.15 s, for a runaway at limit/0.02 s. Only the normal rate
limits a torque that decreases by itself. The order of precedence is: latch, stop, fault, compensator; then cap and limit, and
finally the rate limit.
"""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit, leaf, to_bits
from backdrive.control.readings import OVERSPEED
from backdrive.control.table import (
    BAD,
    BEFORE,
    CAP,
    CAUSE,
    DUE,
    EXTERNAL,
    FADE,
    FAST,
    FAULTY,
    HALF_SPAN,
    LATCHING,
    LIMIT,
    NEWER,
    NEWER_AGE,
    OLDER,
    OLDER_BY,
    PATIENCE,
    RAMP,
    RATE,
    SPAN,
    STOP,
    TOP,
    TORQUE,
    is_set,
)  # fmt: skip
from backdrive.status import Status

OK, STOPPED, LATCHED = int(Status.OK), int(Status.STOPPED), int(Status.LATCHED)
LONGEST = 20.0  # largest fault time that one call adds [period]
WINDOW = 0.01  # shortest window of a speed measurement [s]
HASTE = 7.5  # factor on the latch rate for a runaway, since friction has to dissipate the energy added above the top speed [-]
FORGIVEN = 0.25  # fault time that a good tick removes, relative to its own length [-]
ROUNDING = 1e-9  # relative tolerance of distances in a window, for rounding [-]
EARLY = 1e-6  # share of a window that may lack: ages are sums of rounded times, in single precision too where C asks for it [-]


def window(period: float) -> float:
    """Return the time in which a speed is measured [s]."""
    return max(WINDOW, 2.0 * period)


def spans(period: float) -> tuple[float, float]:
    """Return the age from which the older point gives a speed, and the age from which the newer point replaces it [s]."""
    span = window(period)
    return span * (1.0 - EARLY), 0.5 * span * (1.0 - EARLY)


@jit
def watch(g, since):
    """Return whether a joint is faster than its top speed; `since`: time since the last accepted reading."""
    age = g[NEWER_AGE] + since
    g[NEWER_AGE] = age
    if age < g[DUE]:
        return False
    return measure(g, age)


@jit
def measure(g, age):
    """Return whether the speed since the older point is above the top speed, and move both points on; `age`: of the newer."""
    q, older = g[BEFORE], age + g[OLDER_BY]
    fast = False
    if older >= g[SPAN]:
        reach, way = g[TOP] * older, abs(q - g[OLDER])
        fast = way > reach and way > reach + ROUNDING * (reach + abs(q))
        if fast or is_set(g[FAST]):
            g[FAST] = fast
    if age >= g[HALF_SPAN]:
        g[OLDER], g[NEWER], g[NEWER_AGE] = g[NEWER], q, 0.0
        schedule(g, age)
    return fast


@leaf
def schedule(g, older):
    """Note the age of the newer point at which the other, older by so much, gives a speed, or at which it is replaced."""
    g[OLDER_BY] = older
    g[DUE] = min(g[SPAN] - older, g[HALF_SPAN])


@jit
def forget_speed(g):
    """Begin a new window of speeds at the present reading."""
    g[OLDER] = g[NEWER] = g[BEFORE]
    g[NEWER_AGE] = g[FAST] = 0.0
    schedule(g, 0.0)


def acknowledge(g: np.ndarray) -> bool:
    """Clear a joint's latch and stop, unless it still has torque or is still too fast; return whether they were cleared."""
    if g[CAUSE] != 0.0 and (g[TORQUE] != 0.0 or g[FAST] != 0.0):
        return False
    if g[CAUSE] != 0.0 or g[STOP] != 0.0:
        g[CAP] = min(g[CAP], abs(g[TORQUE]))
        g[FAULTY] = 0.0
    g[CAUSE] = g[STOP] = 0.0
    return True


#: A joint may have a finite limit of any kind; without one, what is wanted is given.
LIMITED = True


@jit
def act(g, code, good, wanted, passed, since, interval):
    """Write the joint's output and return its status.

    `code`: status of the reading or of its processing. `good`: the reading was accepted. `wanted`: torque of the compensator
    for an accepted reading. `passed`: time that this tick counts for. `since`: time since the last accepted reading.
    `interval`: the given interval.
    """
    trips = False
    if good:
        g[BAD] = 0.0
        if LIMITED:
            if is_set(g[FAULTY]):
                g[FAULTY] = max(g[FAULTY] - FORGIVEN * passed, 0.0)
                trips = code != OK and g[FAULTY] > g[PATIENCE]
            if watch(g, since):
                code, trips = OVERSPEED, True
    else:
        g[FAULTY] += min(max(passed, interval), LONGEST * passed)  # `passed` where the interval is NaN
        fading = 1.0 + g[FADE] * passed if g[BAD] > 0.0 else 1.0  # a single bad reading changes no output
        g[BAD] += 1.0
        wanted = g[TORQUE] / fading
        g[EXTERNAL] /= fading
        trips = code == OVERSPEED or g[FAULTY] > g[PATIENCE]
    if not LIMITED:
        g[TORQUE] = wanted
        return code
    out, limit, cap = g[TORQUE], g[LIMIT], g[CAP]
    if trips or to_bits(g[CAUSE]) | to_bits(g[STOP]) != 0:
        latched = g[CAUSE] > 0.0
        if trips and not latched:
            g[CAUSE] = code
        fall = g[RAMP]
        if g[CAUSE] > 0.0:
            fall = (HASTE if g[CAUSE] == OVERSPEED else 1.0) * g[LATCHING]
            wanted = out
            code = LATCHED if latched else code
        elif good:
            code = STOPPED
        cap = max(min(cap, abs(out)) - fall * passed, 0.0)
        g[CAP] = cap
    elif good:
        cap = min(cap + g[RAMP] * passed, limit)
        g[CAP] = cap  # at once, so that the next cap does not wait for this output
    step = g[RATE] * passed
    # neither the cap nor the last output exceeds the limit, so nothing between them does
    f = min(max(min(max(wanted, -cap), cap), out - step), out + step)
    g[TORQUE] = f
    if not good and g[BAD] >= 2.0:
        g[CAP] = min(cap, abs(f))
    return code
