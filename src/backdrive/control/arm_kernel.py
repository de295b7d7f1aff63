"""One tick of a whole arm in compiled time: what is believed of its posture, and the torque that its motors are given.

    torque = gravity + compensation + drive,      |torque| <= effort

Motors may drive several joints: q = C p, and a torque tau on the joints asks C' tau of the motors. Compensation is that of
`control.loop`, motor by motor. The drive holds what acts on the joints: soft walls before their limits, and the position
controller of an admittance. It passes the same output stage as the compensation (`control.guard`), with a table of its own. Gravity
is what the rigid bodies weigh where the arm was last believed to be; what a fault does to it is in `carry`.

A wall pushes inwards only, begins before its place where the joint comes fast, and never more than its limit:

    tau = -min(max(K (q - w + t q'), 0), limit)        above, and likewise below
"""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit
from backdrive.control import admittance, guard, readings
from backdrive.control.loop_kernel import SEVERITY
from backdrive.control.loop_kernel import tick as tick_motors
from backdrive.control.table import (
    APPLIED,
    BAD,
    BEFORE,
    BEGUN,
    CAUSE,
    EXTERNAL,
    KNOWN,
    NOMINAL,
    OLDER,
    OLDER_AGE,
    PASSED,
    PENDING,
    SINCE,
    STOP,
    TORQUE,
    ZERO,
)  # fmt: skip
from backdrive.status import Status

OK, NOT_FINITE = int(Status.OK), int(Status.NOT_FINITE)
SATURATED, OVERSPEED = int(Status.SATURATED), int(Status.OVERSPEED)
VELOCITY = 3e-3  # time constant of the velocity that walls and Coriolis torque see [s]
COASTING = 0.02  # time constant in which a motor whose readings are not believed is taken to stop [s]
HASTE = 0.02  # in which gravity that drives a runaway is let go [s]

(
    # settings
    EFFORT, WEIGHT, OFFSET, RISE, BRAKE, LOW, HIGH, STIFFNESS, LEAD, WALL, FOLLOWS, DEAD, FASTEST, TOGETHER,
    # of a motor: position since the first reading's zero, velocity
    P, W,
    # of a joint
    Q, V,
    # output, and the share of gravity that is given; how long latched
    TOTAL, GRAVITY, DRIVE, TAU_E, SHARE, AGE,
    # what the estimate is given: torque of the motors that acted, and the time that has passed
    ACTED, STEP,
) = range(26)  # fmt: skip
ROWS = 26


@jit
def locate(g, h, C, whole, read, dt):
    """Write where motors and joints are believed to be, how fast, and what torque acted; return whether the estimate begins anew.

    A reading that is not possible changes nothing: the motor is taken to go on, and to stop within some 20 ms. `whole`: the
    estimate of the tick before.
    """
    J, begins = read.size, False
    for j in range(J):
        q, nominal = read[j], g[NOMINAL, j]
        timely = readings.FASTEST * nominal <= dt <= readings.SLOWEST * nominal
        passed = dt if timely else nominal
        h[STEP, j] = passed
        if timely and np.isfinite(q) and g[BEGUN, j] == 0.0:
            h[P, j], begins = q, True
        elif (
            timely
            and g[PENDING, j] == 0.0
            and readings.possible(g, j, q - g[BEFORE, j], g[SINCE, j] + passed)
        ):
            p = q - g[ZERO, j]
            h[W, j] += ((p - h[P, j]) / passed - h[W, j]) * passed / (passed + VELOCITY)
            h[P, j] = p
        else:
            h[P, j] += passed * h[W, j]
            h[W, j] *= COASTING / (COASTING + passed)
    for i in range(J):
        h[ACTED, i] = g[APPLIED, i] if np.isfinite(g[APPLIED, i]) else h[TOTAL, i]
        h[Q, i] = h[V, i] = 0.0
        for j in range(J):
            h[Q, i] += C[i, j] * h[P, j]
            h[V, i] += C[i, j] * h[W, j]
    for i in range(whole.size):
        begins = begins or not np.isfinite(whole[i])
    return begins


@jit
def wall(h, i):
    """Return the torque of a joint's walls."""
    limit, ahead = h[WALL, i], h[Q, i] + h[LEAD, i] * h[V, i]
    if not limit > 0.0:
        return 0.0
    above = min(max(h[STIFFNESS, i] * (ahead - h[HIGH, i]), 0.0), limit)
    below = min(max(h[STIFFNESS, i] * (h[LOW, i] - ahead), 0.0), limit)
    return below - above


@jit
def follow(h, c, s, i, T, rests):
    """Return the torque of a joint's admittance; `c`: its row, `s`: its state, `rests`: it begins anew where the joint is."""
    if rests:
        s[0], s[1], s[2] = h[Q, i], 0.0, h[Q, i]
        return 0.0
    tau_e, dead, before = h[TAU_E, i], h[DEAD, i], s[0]
    tau_e = tau_e - dead if tau_e > dead else (tau_e + dead if tau_e < -dead else 0.0)
    u = admittance.tick(c, 0, s, 0, tau_e, h[Q, i], T)
    s[1] = min(max(s[1], -h[FASTEST, i]), h[FASTEST, i])
    reach = c[4] / c[2] if c[2] > 0.0 else np.inf
    s[0] = min(max(before + T * s[1], h[Q, i] - reach), h[Q, i] + reach)
    if (s[0] > h[HIGH, i] and s[1] > 0.0) or (
        s[0] < h[LOW, i] and s[1] < 0.0
    ):  # the wall stops the virtual mass too
        s[0], s[1] = before, 0.0
    return u


@jit
def carry(g, h, j, weight):
    """Write what a motor gives against gravity: whole within the rise time of the start, and held through faults and stops.

    A latched motor holds it for the brakes' time, then lets go within the rise time; where gravity's torque drives a runaway,
    within 20 ms.
    """
    passed, share, before = g[PASSED, j], h[SHARE, j], h[GRAVITY, j]
    if g[CAUSE, j] != 0.0:
        h[AGE, j] += passed
        moved = g[BEFORE, j] - g[OLDER, j] if g[OLDER_AGE, j] > 0.0 else h[W, j]
        if g[CAUSE, j] == OVERSPEED and before * moved > 0.0:
            share -= passed / HASTE
        elif h[AGE, j] > h[BRAKE, j]:
            share -= passed / h[RISE, j]
    else:
        h[AGE, j] = 0.0
        share += passed / h[RISE, j]
    h[SHARE, j] = share = min(max(share, 0.0), 1.0)
    if not np.isfinite(weight):  # the arm is nowhere that numbers hold: what was given stays
        weight, share = before, 1.0
    step = h[WEIGHT, j] / HASTE * passed
    wanted = share * min(max(weight, -h[WEIGHT, j]), h[WEIGHT, j])
    h[GRAVITY, j] = min(max(wanted, before - step), before + step)


@jit
def tick(A, o, g, codes, d, h, a, s, wanted, C, back, whole, read, dt, weight, bias):  # noqa: PLR0913, PLR0912  (a kernel's row)
    """Advance every motor and joint by one tick and return the worst status.

    `A`, `o`, `g`, `codes`: of `loop_kernel.tick`; `d`: table of the drive's output stage, `h`: of the arm, `a`, `s`: rows and
    states of the admittances, `wanted`: torque of walls and admittance on the joints, `C`: q = C p, `back`: its inverse,
    `whole`: external torque on the motors by an estimator of the whole arm, (J,), or (0,), `weight`: g(q), `bias`: h + g of the
    joints.
    """
    J = codes.size
    for j in range(J):
        g[KNOWN, j] = 0.0
        for i in range(J):
            g[KNOWN, j] += C[i, j] * bias[i]
    tick_motors(A, o, g, codes, read, dt)
    latched = False
    for j in range(J):
        latched = latched or g[CAUSE, j] != 0.0
    for i in range(J):
        rests, h[TAU_E, i] = False, 0.0
        for j in range(J):
            outside = g[EXTERNAL, j] if whole.size == 0 else whole[j]
            if back[j, i] != 0.0 and np.isfinite(outside):
                h[TAU_E, i] += back[j, i] * outside
            if C[i, j] != 0.0:
                rests = rests or g[BAD, j] > 1.0 or g[CAUSE, j] != 0.0 or g[STOP, j] != 0.0
        wanted[i] = wall(h, i)
        if h[FOLLOWS, i] > 0.0:
            wanted[i] += follow(h, a[i], s[i], i, g[PASSED, i], rests)
    worst = OK
    for j in range(J):
        if latched and h[TOGETHER, j] > 0.0 and g[CAUSE, j] == 0.0:
            g[STOP, j] = 1.0
        push, load = 0.0, 0.0
        for i in range(J):
            push += C[i, j] * wanted[i]
            load += C[i, j] * (weight[i] + h[OFFSET, i])
        carry(g, h, j, load)
        good = g[BAD, j] == 0.0 and np.isfinite(push)
        d[PASSED, j], d[BEFORE, j], d[STOP, j] = g[PASSED, j], g[BEFORE, j], g[STOP, j]
        d[SINCE, j] += g[PASSED, j]
        if g[CAUSE, j] != 0.0:
            d[CAUSE, j] = g[CAUSE, j]
        code = guard.act(d, j, OK if good else NOT_FINITE, push, d[SINCE, j], dt)
        if good:
            d[SINCE, j] = 0.0
        h[DRIVE, j] = d[TORQUE, j]
        total, effort = h[GRAVITY, j] + g[TORQUE, j] + d[TORQUE, j], h[EFFORT, j]
        h[TOTAL, j] = min(max(total, -effort), effort)
        if codes[j] == OK and (code == SATURATED or abs(total) > effort):
            codes[j] = SATURATED
        if SEVERITY[codes[j]] > SEVERITY[worst]:
            worst = codes[j]
    return worst
