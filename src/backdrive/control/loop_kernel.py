"""One tick of the fused loop in compiled code: readings, compensation and estimate, watch, limits."""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit, ladder, leaf, part
from backdrive.control import guard, readings
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.estimators import external as external_
from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators.level import learn
from backdrive.control.table import (
    ANCHOR,
    APPLIED,
    AWAY,
    BEFORE,
    CALLS,
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
    TABLE,
    TEMPERATURE,
    TIME,
    UPPER,
)  # fmt: skip
from backdrive.elementary import exp
from backdrive.status import Status

OK, NOT_FINITE = int(Status.OK), int(Status.NOT_FINITE)
SATURATED, NO_MOTION = int(Status.SATURATED), int(Status.NO_MOTION)
SEVERITY = np.array([status.severity for status in Status])
STANDING = 0.1  # share of the hold time after which a joint stands still
NOTABLE = 0.01  # share of the limit above which a torque counts as nonzero


#: Ends of the arrays of fixed length in a joint's row: compensator, its state, estimator, its state.
C = compensator_.ROW
S = C + compensator_.STATES
E = S + external_.ROW
FIXED = E + external_.STATES
#: A joint may have a law that grows, an estimator, a level that is learned, a hold time.
GROWING, ESTIMATING, LEARNING, HOLDING = True, True, True, True
#: Every estimator has the friction of its compensator: one of the two is computed while both are in the same state.
SHARING = False


@jit
def restart(c, x, s, ce, xe, se, g, q):
    """Reset a joint's state to rest at q."""
    friction_.relax(x)
    friction_.relax(xe)
    compensator_.restart(c, 0, s, 0, q)
    external_.restart(ce, 0, se, 0, q)
    g[BEFORE] = g[ELSEWHERE] = g[ANCHOR] = q
    g[SINCE], g[PENDING], g[STILL] = 0.0, 0.0, 0.0
    g[EXTERNAL], g[FRICTION] = 0.0, 0.0
    guard.forget_speed(g)


@jit
def stand(c, x, s, g, q, T):
    """Return whether the joint stands still, and count for how long; after the hold time the contact is relaxed."""
    if abs(q - g[ANCHOR]) > g[AWAY]:
        g[ANCHOR], g[STILL] = q, 0.0
        return False
    before, hold = g[STILL], g[HOLD]
    still = before + T
    g[STILL] = still
    if before < hold <= still:
        compensator_.relax(c, 0, x, s, 0)
    return still >= STANDING * hold


@jit
def share_at_rest(g):
    """Return the remaining share of the compensating torque of a joint that stands still."""
    hold = g[HOLD]
    late = g[STILL] - 0.5 * hold
    return exp(-6.0 * late / hold) if 0.0 < late < 0.5 * hold else 1.0


@ladder
def joint(c, i, p, x, s, ce, pe, xe, se, g, q, dt):  # noqa: PLR0913  (a kernel's row)
    """Advance one joint by one tick and return its status.

    `c[i:]`, `p`, `x`, `s`: compensator; `ce`, `pe`, `xe`, `se`: estimator; `g`: row of the table.
    """
    g[CALLS] += 1.0
    code, passed = readings.judge(c, s, ce, se, g, q, dt)
    f, T, good = 0.0, g[SINCE], readings.valid(code)
    if good:
        dp, u, level = q - g[BEFORE], g[APPLIED], g[LEVEL] if LEARNING else 1.0
        load, temp = (g[MOTOR], g[LOAD]), g[TEMPERATURE]
        if GROWING and g[GROWS] > 0.0 and load[0] == 0.0 and load[1] == 0.0:  # no load was given
            load = (u, -g[KNOWN] if g[KNOWN] != 0.0 else np.nan)
        stands = False
        if HOLDING:
            stands = stand(c, x, s, g, q, T)
        shares = SHARING and friction_.coincide(x, s, 0, xe, se, external_.W)
        push, dither, model = compensator_.advance(
            c, i, p, x, s, 0, q, dp, T, g[TIME], g[ERROR], g[SLOPE], u - g[KNOWN], load, temp,
            g[STILL] >= g[HOLD],
        )  # fmt: skip
        if HOLDING and stands:
            push *= share_at_rest(g)
        f = level * (push if dither == 0.0 else push + dither)
        tau_e, tau_f, total = 0.0, 0.0, f
        if ESTIMATING and g[ESTIMATES] > 0.0:
            if shares:
                se[external_.W], xe[0] = s[0], x[0]
            else:
                model = external_.friction_of(ce, 0, pe, xe, se, 0, dp, T, load, temp)
            tau_f = level * model
            tau_e = external_.force(ce, 0, se, 0, q, dp, T, u, g[KNOWN], tau_f)
            total = f + tau_e + tau_f
        if not np.isfinite(total):  # finite inputs, but the result overflows
            restart(c, x, s, ce, xe, se, g, q)
            code, good = NOT_FINITE, False
        else:
            if LEARNING and g[LEARNS] > 0.0:
                slid = g[SLID] + T if abs(dp) >= g[CREEP] * T else 0.0
                numbers = g[LEARNS], g[SETTLE], g[FLOOR], g[DEAD], g[LOWER], g[UPPER]
                g[LEVEL], g[SLID] = learn(level, tau_f / level, tau_e, slid, T, *numbers), slid
            if ESTIMATING:
                g[EXTERNAL], g[FRICTION] = tau_e, tau_f
            g[BEFORE], g[SINCE], g[PENDING] = q, 0.0, 0.0
            if stands and abs(level * push) > NOTABLE * g[LIMIT]:
                code = NO_MOTION
            elif abs(f) > g[LIMIT]:
                code = SATURATED
    return guard.act(g, code, good, f, passed, T, dt)


@leaf
def absent(c, i, p, x, s, ce, pe, xe, se, g, q, dt):  # noqa: PLR0913  (a kernel's row)
    """Advance nothing: `joint` where nothing runs."""
    return 0


@leaf
def tick(A, o, g, codes, q, dt):
    """Advance every joint by one tick and return the worst status.

    `A[j]`: the joined arrays of `rows` for a joint, those of fixed length first. `o`: starts of the others, and the end, (5,).
    `g`: table.
    """
    worst = OK
    for j in range(codes.size):
        c, s, ce, se = part(A, j, 0, C), part(A, j, C, S), part(A, j, S, E), part(A, j, E, FIXED)
        p, x = part(A, j, FIXED, o[1]), part(A, j, o[1], o[2])
        pe, xe = part(A, j, o[2], o[3]), part(A, j, o[3], o[4])
        code = joint(c, 0, p, x, s, ce, pe, xe, se, part(g, j, 0, TABLE), q[j], dt)
        codes[j] = code
        if code != OK and SEVERITY[code] > SEVERITY[worst]:
            worst = code
    return worst
