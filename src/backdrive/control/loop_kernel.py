"""One tick of the fused loop in compiled code: readings, compensation and estimate, watch, limits."""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit, ladder, leaf
from backdrive.control import guard, readings
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.estimators import external as external_
from backdrive.control.estimators.level import learn
from backdrive.control.table import (
    ANCHOR,
    APPLIED,
    BEFORE,
    CALLS,
    COUNT,
    CREEP,
    DEAD,
    ELSEWHERE,
    ERROR,
    ESTIMATES,
    EXTERNAL,
    FLOOR,
    FRICTION,
    GROWS,
    HOLD,
    KNOWN,
    LEARNS,
    LEVEL,
    LIMIT,
    LOAD,
    LOWER,
    MOTOR,
    PENDING,
    SETTLE,
    SINCE,
    SLID,
    SLOPE,
    STILL,
    TEMPERATURE,
    TIME,
    UPPER,
)  # fmt: skip
from backdrive.elementary import exp
from backdrive.status import Status

OK, NOT_FINITE, NO_MOTION = int(Status.OK), int(Status.NOT_FINITE), int(Status.NO_MOTION)
SEVERITY = tuple(status.severity for status in Status)
STANDING = 0.1  # share of the hold time after which a joint stands still
MOVED = 2.5  # encoder steps from the position of rest beyond which a joint has moved; noise of one step does not count
NOTABLE = 0.01  # share of the limit above which a torque counts as nonzero


@jit
def restart(c, x, s, ce, xe, se, g, q):
    """Reset a joint's state to rest at q."""
    for k in range(x.size):
        x[k] = 0.0
    for k in range(xe.size):
        xe[k] = 0.0
    compensator_.restart(c, 0, s, 0, q)
    external_.restart(ce, 0, se, 0, q)
    g[BEFORE] = g[ELSEWHERE] = g[ANCHOR] = q
    g[SINCE], g[PENDING], g[STILL] = 0.0, 0.0, 0.0
    g[EXTERNAL], g[FRICTION] = 0.0, 0.0
    guard.forget_speed(g)


@jit
def standing(c, x, s, g, q, T):
    """Return the remaining share of the compensating torque while the encoder stands still; after the hold time the contact
    is relaxed.
    """
    hold = g[HOLD]
    if abs(q - g[ANCHOR]) > MOVED * g[COUNT]:
        g[ANCHOR], g[STILL] = q, 0.0
        return 1.0
    before = g[STILL]
    g[STILL] = before + T
    if before + T < hold:
        late = before + T - 0.5 * hold
        return 1.0 if late <= 0.0 else exp(-6.0 * late / hold)
    if before < hold:
        compensator_.relax(c, 0, x, s, 0)
    return 1.0


@ladder
def joint(c, i, p, x, s, ce, pe, xe, se, g, q, dt):  # noqa: PLR0913  (a kernel's row)
    """Advance one joint by one tick and return its status.

    `c[i:]`, `p`, `x`, `s`: compensator; `ce`, `pe`, `xe`, `se`: estimator; `g`: row of the table.
    """
    g[CALLS] += 1.0
    code = readings.judge(c, s, ce, se, g, q, dt)
    f, T = 0.0, g[SINCE]
    if readings.valid(code):
        dp, u, level = q - g[BEFORE], g[APPLIED], g[LEVEL]
        load, temp = (g[MOTOR], g[LOAD]), g[TEMPERATURE]
        if g[GROWS] > 0.0 and load[0] == 0.0 and load[1] == 0.0:  # no load was given
            load = (u, -g[KNOWN] if g[KNOWN] != 0.0 else np.nan)
        left = standing(c, x, s, g, q, T)
        push, dither = compensator_.tick(
            c, i, p, x, s, 0, q, dp, T, g[TIME], g[ERROR], g[SLOPE], u - g[KNOWN], load, temp,
            g[STILL] >= g[HOLD],
        )  # fmt: skip
        push *= left
        f = level * (push + dither)
        tau_e, tau_f = 0.0, 0.0
        if g[ESTIMATES] > 0.0:
            tau_e, tau_f = external_.tick(ce, 0, pe, xe, se, 0, q, dp, T, u, g[KNOWN], load, temp, level)
        if not np.isfinite(f + tau_e + tau_f):  # finite inputs, but the result overflows
            restart(c, x, s, ce, xe, se, g, q)
            code = NOT_FINITE
        else:
            if g[LEARNS] > 0.0:
                slid = g[SLID] + T if abs(dp) >= g[CREEP] * T else 0.0
                numbers = g[LEARNS], g[SETTLE], g[FLOOR], g[DEAD], g[LOWER], g[UPPER]
                g[LEVEL], g[SLID] = learn(level, tau_f / level, tau_e, slid, T, *numbers), slid
            g[EXTERNAL], g[FRICTION] = tau_e, tau_f
            g[BEFORE], g[SINCE], g[PENDING] = q, 0.0, 0.0
            if g[STILL] >= STANDING * g[HOLD] and abs(level * push) > NOTABLE * g[LIMIT]:
                code = NO_MOTION
    return guard.act(g, code, f, T, dt)


@leaf
def absent(c, i, p, x, s, ce, pe, xe, se, g, q, dt):  # noqa: PLR0913  (a kernel's row)
    """Advance nothing: `joint` where nothing runs."""
    return 0


@jit
def tick(A, o, g, codes, q, dt):
    """Advance every joint by one tick and return the worst status.

    `A[j]`: the arrays of `rows` for a joint, concatenated, `o`: begin of each (9,), `g`: table.
    """
    worst = OK
    for j in range(codes.size):
        a = A[j]
        c, p, x, s = a[: o[1]], a[o[1] : o[2]], a[o[2] : o[3]], a[o[3] : o[4]]
        ce, pe, xe, se = a[o[4] : o[5]], a[o[5] : o[6]], a[o[6] : o[7]], a[o[7] :]
        codes[j] = joint(c, 0, p, x, s, ce, pe, xe, se, g[j], q[j], dt)
        if SEVERITY[codes[j]] > SEVERITY[worst]:
            worst = codes[j]
    return worst
