"""The compiled part of the external-force estimate of a whole arm, before and after the call of pinocchio.

With n = u - h - g - tau_f - o, and M the inertia of bodies and motors, the methods compute in each tick T:

    direct        M a + h + g + tau_f + o - u, v and a of a `MotionFilter`; Iwatani 2017, (4.4)
    momentum      r <- L (M v - S - T m)/(1 + L T),   S <- S + T (m + r),   m = n + h + C' v;  De Luca, Mattone, IEEE ICRA 2005
    disturbance   y <- (y + L T (M a - n))/(1 + L T), a differenced twice
    extended, kalman   an observer of q, v, tau_e:  a = M^-1 (n + tau_e),  tau_e <- tau_e + g_3 M e/T^2

The rigid bodies are evaluated at the middle of the tick, because the differenced velocity belongs to this instant. Friction
that grows with the load uses the torque that the joint carries: that of the bodies minus the external torque. The wrench w at
a frame follows from tau_e = J' w by

    (P + J S^-1 J') w = J S^-1 tau_e,

S: variances of the joints' torques, in motion or at rest; P: inverse variance of a very large wrench (`damping`).

If motors drive several joints (q_joint = C q_motor), all equations hold for the motors, with C' M C, C' h, C' g and J C.
"""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit
from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators import sliding_mode
from backdrive.control.estimators.gains import threefold
from backdrive.status import Status

METHODS = ("direct", "momentum", "disturbance", "extended", "kalman")
DIRECT, MOMENTUM, DISTURBANCE = 0.0, 1.0, 2.0
# the row: numbers of the whole arm, the information P of the damping (6), then ROW numbers per joint
METHOD, BAND, GAINS, PERIOD, WRENCH, JOINTS, DAMPING, GLOBAL = 0, 1, 2, 5, 6, 7, 8, 14
FRICTION = sliding_mode.ROW  # the filter stands before it
INERTIA, OFFSET, SLIDING, RESTING, SLOW = range(FRICTION + friction_.ROW, FRICTION + friction_.ROW + 5)
ROW = SLOW + 1
# the state of a joint, behind the filter's
W, Q, V, Y, Q_HAT, V_HAT, A, R, TAU_F, SPEED = range(sliding_mode.STATES, sliding_mode.STATES + 10)
STATES = sliding_mode.STATES + 10
# what goes in and out, J numbers each, then the wrench (6), its covariance (36), and how much of it is damping
POSITION, TORQUE, MIDDLE, VELOCITY, ACCELERATION, FORCE, TAKEN, DEVIATION, OUT = range(9)
LONGEST = 20.0  # periods that a tick may last
FASTEST = 1e3  # speed that no joint has [rad/s or m/s]
OK, NOT_FINITE, BAD_INTERVAL = int(Status.OK), int(Status.NOT_FINITE), int(Status.BAD_INTERVAL)
JUMP = int(Status.JUMP)


@jit
def restart(c, s, io):
    """Reset all states to joints at rest at the positions in `io`."""
    J = int(c[JOINTS])
    for j in range(J):
        for k in range(STATES):
            s[STATES * j + k] = 0.0
        q = io[j]
        s[STATES * j] = s[STATES * j + Q] = s[STATES * j + Q_HAT] = q


@jit
def before(c, s, io, dt):
    """Compute the inputs of pinocchio from positions; return a status."""
    J = int(c[JOINTS])
    if not 0.0 < dt < LONGEST * c[PERIOD]:
        return BAD_INTERVAL
    for j in range(2 * J):
        if not np.isfinite(io[j]):
            return NOT_FINITE
    for j in range(J):
        if abs(io[j] - s[STATES * j + Q]) > FASTEST * dt:
            return JUMP
    for j in range(J):
        k, q = STATES * j, io[j]
        dp = q - s[k + Q]
        if c[METHOD] == DIRECT:
            v, a = sliding_mode.motion(c, GLOBAL + ROW * j, s, k, q, dp, dt)
            io[MIDDLE * J + j], io[VELOCITY * J + j], io[ACCELERATION * J + j] = q, v, a
        else:
            io[MIDDLE * J + j], io[VELOCITY * J + j] = q - 0.5 * dp, dp / dt
    return OK


@jit
def after(c, s, io, P, X, M, bias, coriolis, jacobian, room, dt, temps):  # noqa: PLR0913  (a kernel's row)
    """Fill `io` with external torque, friction and wrench.

    `M`: inertia of the bodies, upper triangle. `bias`: h + g; for `momentum` only g, with `coriolis` as the rest; for `direct`
    M a + h + g. `room`: work array, (J, J). `temps`: by joint.
    """
    J, L = int(c[JOINTS]), c[BAND]
    share = L * dt / (1.0 + L * dt)
    method = c[METHOD]
    for j in range(J):
        i, k = GLOBAL + ROW * j, STATES * j
        carried = bias[j]
        if method != DIRECT:
            for m in range(J):
                carried += (M[j, m] if j < m else M[m, j]) * s[STATES * m + A]
        if method == MOMENTUM:
            for m in range(J):
                carried += coriolis[j, m] * io[VELOCITY * J + m]
        load = (io[TORQUE * J + j], s[k + R] - carried)
        s[k + TAU_F] = friction_.tick(
            c, i + FRICTION, P[j], X[j], s, k + W, io[j] - s[k + Q], dt, load, temps[j]
        )
        # n, kept where the force will be
        io[FORCE * J + j] = io[TORQUE * J + j] - bias[j] - s[k + TAU_F] - c[i + OFFSET]
    if method == DIRECT:
        _direct(c, s, io, J)
    elif method == MOMENTUM:
        _momentum(c, s, io, M, coriolis, J, L, dt)
    elif method == DISTURBANCE:
        _disturbance(c, s, io, M, J, share, dt)
    else:
        _observe(c, s, io, M, room, J, L, dt)
    for j in range(J):
        i, k, v = GLOBAL + ROW * j, STATES * j, io[VELOCITY * J + j]
        s[k + R] = io[FORCE * J + j]
        if method == DIRECT:
            s[k + A] = io[ACCELERATION * J + j]
        else:
            s[k + A] += share * ((v - s[k + V]) / dt - s[k + A])
        s[k + SPEED] += share * (v - s[k + SPEED])
        s[k + Q], s[k + V] = io[j], v
        io[TAKEN * J + j] = s[k + TAU_F]
        io[DEVIATION * J + j] = c[i + SLIDING] if abs(s[k + SPEED]) > c[i + SLOW] else c[i + RESTING]
    if c[WRENCH] > 0.0:
        wrench(c, io, jacobian, J)


@jit
def to_joints(C, rows, joints):
    """Fill positions, velocities and accelerations of the joints by those of coupled motors, (3, J) each."""
    J = C.shape[0]
    for r in range(3):
        for i in range(J):
            joints[r, i] = 0.0
            for j in range(J):
                joints[r, i] += C[i, j] * rows[r, j]


@jit
def to_motors(C, M, bias, coriolis, own, level, turning, room):
    """Fill inertia, bias and Coriolis matrix at coupled motors: C' M C, C' bias, C' coriolis C; only M's upper triangle is read."""
    J = C.shape[0]
    for i in range(J):
        for j in range(J):
            room[i, j] = 0.0
            for m in range(J):
                room[i, j] += (M[i, m] if i < m else M[m, i]) * C[m, j]
    for i in range(J):
        level[i] = 0.0
        for m in range(J):
            level[i] += C[m, i] * bias[m]
        for j in range(J):
            own[i, j] = 0.0
            for m in range(J):
                own[i, j] += C[m, i] * room[m, j]
    for i in range(J):
        for j in range(J):
            room[i, j] = 0.0
            for m in range(J):
                room[i, j] += coriolis[i, m] * C[m, j]
    for i in range(J):
        for j in range(J):
            turning[i, j] = 0.0
            for m in range(J):
                turning[i, j] += C[m, i] * room[m, j]


@jit
def _times(c, M, j, J, s, at, stride):
    """Return row j of the whole inertia times a vector."""
    total = c[GLOBAL + ROW * j + INERTIA] * s[at + stride * j]
    for m in range(J):
        total += (M[j, m] if j < m else M[m, j]) * s[at + stride * m]
    return total


@jit
def _direct(c, s, io, J):
    for j in range(J):
        own = c[GLOBAL + ROW * j + INERTIA] * io[ACCELERATION * J + j]
        io[FORCE * J + j] = own - io[FORCE * J + j]


@jit
def _momentum(c, s, io, M, coriolis, J, L, dt):
    for j in range(J):
        k = STATES * j
        n = io[FORCE * J + j]
        for m in range(J):
            n += coriolis[m, j] * io[VELOCITY * J + m]
        p = _times(c, M, j, J, io, VELOCITY * J, 1)
        r = L * (p - s[k + Y] - dt * n) / (1.0 + L * dt)
        s[k + Y] += dt * (n + r)
        io[FORCE * J + j] = r


@jit
def _disturbance(c, s, io, M, J, share, dt):
    for j in range(J):
        io[ACCELERATION * J + j] = (io[VELOCITY * J + j] - s[STATES * j + V]) / dt
    for j in range(J):
        k = STATES * j
        s[k + Y] += share * (_times(c, M, j, J, io, ACCELERATION * J, 1) - io[FORCE * J + j] - s[k + Y])
        io[FORCE * J + j] = s[k + Y]


@jit
def _observe(c, s, io, M, room, J, L, dt):
    g_1, g_2, g_3 = c[GAINS], c[GAINS + 1], c[GAINS + 2]
    if abs(dt - c[PERIOD]) > 0.1 * c[PERIOD]:  # gains depend on the tick: new ones for another length
        g_1, g_2, g_3 = threefold(L, dt)
    for j in range(J):
        for m in range(j + 1):
            room[j, m] = M[m, j]
        room[j, j] += c[GLOBAL + ROW * j + INERTIA]
        io[ACCELERATION * J + j] = io[FORCE * J + j] + s[STATES * j + Y]
    factor(room, J)
    solve(room, J, io, ACCELERATION * J)
    for j in range(J):
        k, a = STATES * j, io[ACCELERATION * J + j]
        e = io[j] - (s[k + Q_HAT] + dt * s[k + V_HAT] + 0.5 * dt * dt * a)
        s[k + Q_HAT] = io[j] - (1.0 - g_1) * e
        s[k + V_HAT] += dt * a + g_2 * e / dt
        io[ACCELERATION * J + j] = g_3 * e / (dt * dt)
    for j in range(J):
        k = STATES * j
        s[k + Y] += _times(c, M, j, J, io, ACCELERATION * J, 1)
        io[FORCE * J + j] = s[k + Y]


@jit
def factor(room, n):
    """Replace the lower triangle of a positive definite matrix by its Cholesky factor."""
    for i in range(n):
        for j in range(i + 1):
            total = room[i, j]
            for k in range(j):
                total -= room[i, k] * room[j, k]
            room[i, j] = np.sqrt(total) if i == j else total / room[j, j]


@jit
def solve(room, n, x, at):
    """Solve a factored system in place for the right-hand side `x[at:]`."""
    for i in range(n):
        total = x[at + i]
        for k in range(i):
            total -= room[i, k] * x[at + k]
        x[at + i] = total / room[i, i]
    for i in range(n - 1, -1, -1):
        total = x[at + i]
        for k in range(i + 1, n):
            total -= room[k, i] * x[at + k]
        x[at + i] = total / room[i, i]


@jit
def wrench(c, io, jacobian, J):  # noqa: PLR0912  (a kernel calls little)
    """Fill the last numbers of `io` with the wrench, its covariance and the share of the damping in it."""
    at = OUT * J
    cov = at + 6
    for i in range(6):
        io[at + i] = 0.0
        for m in range(6):
            io[cov + 6 * i + m] = c[DAMPING + i] if i == m else 0.0
    for j in range(J):
        information = 1.0 / (io[DEVIATION * J + j] * io[DEVIATION * J + j])
        for i in range(6):
            weighted = jacobian[i, j] * information
            io[at + i] += weighted * io[FORCE * J + j]
            for m in range(i + 1):
                io[cov + 6 * i + m] += weighted * jacobian[m, j]
    # Cholesky's factor in the lower triangle, its inverse in its place, and from both the covariance
    for i in range(6):
        for j in range(i + 1):
            total = io[cov + 6 * i + j]
            for k in range(j):
                total -= io[cov + 6 * i + k] * io[cov + 6 * j + k]
            io[cov + 6 * i + j] = np.sqrt(total) if i == j else total / io[cov + 7 * j]
    for j in range(6):
        io[cov + 7 * j] = 1.0 / io[cov + 7 * j]
        for i in range(j + 1, 6):
            total = 0.0
            for k in range(j, i):
                total -= io[cov + 6 * i + k] * io[cov + 6 * k + j]
            io[cov + 6 * i + j] = total / io[cov + 7 * i]
    damped = 0.0
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, 6):
                total += io[cov + 6 * k + i] * io[cov + 6 * k + j]
            io[cov + 6 * j + i] = total
            if i == j:
                io[cov + 7 * i] = total
        damped += io[cov + 7 * i] * c[DAMPING + i]
    for i in range(6):
        for j in range(i):
            io[cov + 6 * i + j] = io[cov + 6 * j + i]
    io[cov + 36] = damped
    for i in range(6):
        io[cov + 37 + i] = io[at + i]
    for i in range(6):
        io[at + i] = 0.0
        for j in range(6):
            io[at + i] += io[cov + 6 * i + j] * io[cov + 37 + j]


@jit
def wrenches(c, io, jacobians, forces, deviations, J, out):
    """Fill `out` (n, 43) with wrench, covariance and share of the damping, given torques and deviations (n, J)."""
    for i in range(forces.shape[0]):
        for j in range(J):
            io[FORCE * J + j], io[DEVIATION * J + j] = forces[i, j], deviations[i, j]
        wrench(c, io, jacobians[i], J)
        for m in range(43):
            out[i, m] = io[OUT * J + m]
