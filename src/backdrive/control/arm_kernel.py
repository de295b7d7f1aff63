"""One tick of a whole arm in compiled code: the accepted posture, and the torque of the motors.

    torque = gravity + compensation + drive,      |torque| <= effort

Motors may drive several joints: q = C p. Motor torques of C' tau then produce the torque tau on the joints. Compensation is
that of `control.loop`, motor by motor. The drive torque acts on the joints: soft walls before their limits, and the position
controller of an admittance. It passes through the same output stage as the compensation (`control.guard`), with its own
table. Gravity is the torque of the rigid bodies at the last accepted posture; `carry` describes it during faults.

A wall with the stiffness K begins at w. It pushes inwards only, acts earlier for a fast joint (by the lead time t), and never
exceeds its limit:

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
    LIMIT,
    NEWER_AGE,
    NOMINAL,
    OLDER,
    OLDER_BY,
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
VELOCITY = 3e-3  # time constant of the velocity filter for walls and Coriolis torque [s]
COASTING = 0.02  # time constant with which a motor is assumed to stop while its readings are rejected [s]
HASTE = 0.02  # time in which gravity torque that drives a runaway is ramped down [s]

(
    # settings
    EFFORT, WEIGHT, OFFSET, RISE, BRAKE, LOW, HIGH, STIFFNESS, LEAD, WALL, FOLLOWS, DEAD, FASTEST, TOGETHER,
    # of a motor: position relative to the encoder zero at the start, velocity
    P, W,
    # of a joint
    Q, V,
    # output, share of gravity that is applied, time since the latch
    TOTAL, GRAVITY, DRIVE, TAU_E, SHARE, AGE,
    # input of the estimate: torque of the motors that acted, and elapsed time
    ACTED, STEP,
) = range(26)  # fmt: skip
ROWS = 26


@jit
def locate(g, h, C, whole, read, dt):
    """Write the accepted positions and velocities of motors and joints, and the torque that acted; return whether the
    estimate restarts.

    A rejected reading is ignored: the motor is assumed to move on and to stop within about 20 ms. `whole`: estimate of the
    previous tick.
    """
    J, begins = read.size, False
    for j in range(J):
        q, nominal = read[j], g[j, NOMINAL]
        timely = readings.FASTEST * nominal <= dt <= readings.SLOWEST * nominal
        passed = dt if timely else nominal
        h[STEP, j] = passed
        if timely and np.isfinite(q) and g[j, BEGUN] == 0.0:
            h[P, j], begins = q, True
        elif (
            timely
            and g[j, PENDING] == 0.0
            and readings.possible(g[j], q - g[j, BEFORE], g[j, SINCE] + passed)
        ):
            p = q - g[j, ZERO]
            h[W, j] += ((p - h[P, j]) / passed - h[W, j]) * passed / (passed + VELOCITY)
            h[P, j] = p
        else:
            h[P, j] += passed * h[W, j]
            h[W, j] *= COASTING / (COASTING + passed)
    for i in range(J):
        h[ACTED, i] = g[i, APPLIED] if np.isfinite(g[i, APPLIED]) else h[TOTAL, i]
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
    """Return the torque of a joint's admittance; `c`: its row, `s`: its state, `rests`: restart it at the joint's position."""
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
    """Write a motor's torque against gravity. It reaches its full value within the rise time after the start, and is held
    through faults and stops.

    A latched motor holds this torque for the time of the brakes and then ramps it down within the rise time. If gravity's
    torque drives a runaway, it is ramped down within 20 ms.
    """
    passed, share, before = g[j, PASSED], h[SHARE, j], h[GRAVITY, j]
    if g[j, CAUSE] != 0.0:
        h[AGE, j] += passed
        moved = g[j, BEFORE] - g[j, OLDER] if g[j, NEWER_AGE] + g[j, OLDER_BY] > 0.0 else h[W, j]
        if g[j, CAUSE] == OVERSPEED and before * moved > 0.0:
            share -= passed / HASTE
        elif h[AGE, j] > h[BRAKE, j]:
            share -= passed / h[RISE, j]
    else:
        h[AGE, j] = 0.0
        share += passed / h[RISE, j]
    h[SHARE, j] = share = min(max(share, 0.0), 1.0)
    if not np.isfinite(weight):  # the posture is not finite: the torque stays as it was
        weight, share = before, 1.0
    step = h[WEIGHT, j] / HASTE * passed
    wanted = share * min(max(weight, -h[WEIGHT, j]), h[WEIGHT, j])
    h[GRAVITY, j] = min(max(wanted, before - step), before + step)


@jit
def tick(A, o, g, codes, d, h, a, s, wanted, C, back, whole, read, dt, weight, bias):  # noqa: PLR0913, PLR0912  (a kernel's row)
    """Advance every motor and joint by one tick and return the worst status.

    `A`, `o`, `g`, `codes`: as in `loop_kernel.tick`. `d`: table of the output stage of the drive torque. `h`: table of the arm.
    `a`, `s`: rows and states of the admittances. `wanted`: torque of walls and admittance on the joints. `C`, `back`: matrix of
    q = C p, and its inverse. `whole`: external torque on the motors if one estimator serves the whole arm, (J,), else (0,).
    `weight`: g(q). `bias`: h + g of the joints.
    """
    J = codes.size
    for j in range(J):
        g[j, KNOWN] = 0.0
        for i in range(J):
            g[j, KNOWN] += C[i, j] * bias[i]
    tick_motors(A, o, g, codes, read, dt)
    latched = False
    for j in range(J):
        latched = latched or g[j, CAUSE] != 0.0
    for i in range(J):
        rests, h[TAU_E, i] = False, 0.0
        for j in range(J):
            outside = g[j, EXTERNAL] if whole.size == 0 else whole[j]
            if back[j, i] != 0.0 and np.isfinite(outside):
                h[TAU_E, i] += back[j, i] * outside
            if C[i, j] != 0.0:
                rests = rests or g[j, BAD] > 1.0 or g[j, CAUSE] != 0.0 or g[j, STOP] != 0.0
        wanted[i] = wall(h, i)
        if h[FOLLOWS, i] > 0.0:
            wanted[i] += follow(h, a[i], s[i], i, g[i, PASSED], rests)
    worst = OK
    for j in range(J):
        if latched and h[TOGETHER, j] > 0.0 and g[j, CAUSE] == 0.0:
            g[j, STOP] = 1.0
        push, load = 0.0, 0.0
        for i in range(J):
            push += C[i, j] * wanted[i]
            load += C[i, j] * (weight[i] + h[OFFSET, i])
        carry(g, h, j, load)
        good = g[j, BAD] == 0.0 and np.isfinite(push)
        passed = g[j, PASSED]
        d[j, BEFORE], d[j, STOP] = g[j, BEFORE], g[j, STOP]
        d[j, SINCE] += passed
        if g[j, CAUSE] != 0.0:
            d[j, CAUSE] = g[j, CAUSE]
        code = (SATURATED if abs(push) > d[j, LIMIT] else OK) if good else NOT_FINITE
        code = guard.act(d[j], code, good, push, passed, d[j, SINCE], dt)
        if good:
            d[j, SINCE] = 0.0
        h[DRIVE, j] = d[j, TORQUE]
        total, effort = h[GRAVITY, j] + g[j, TORQUE] + d[j, TORQUE], h[EFFORT, j]
        h[TOTAL, j] = min(max(total, -effort), effort)
        if codes[j] == OK and (code == SATURATED or abs(total) > effort):
            codes[j] = SATURATED
        if SEVERITY[codes[j]] > SEVERITY[worst]:
            worst = codes[j]
    return worst
