"""The compiled run of a scene: joint, hand, controller and what runs in its loop, tick by tick."""

from __future__ import annotations

import numpy as np

from backdrive._jit import jit
from backdrive.control import admittance, loop_kernel, table
from backdrive.elementary import sin
from backdrive.engine import axis as axis_
from backdrive.engine import servo as servo_

TEMPERATURE = 20.0  # degC, of a simulated joint
PUSH = 9  # place of the constant torque in the row of an axis
COLUMNS = (
    "reading", "command", "compensation", "estimate", "friction", "force", "motor", "load",
    "motor_velocity", "load_velocity", "wanted", "status", "level",
)  # fmt: skip


@jit
def encoder(p, count):
    """What an encoder of this resolution reads at position p."""
    if count > 0.0:
        return count * np.floor(p / count + 0.5)
    return p


@jit
def run(  # noqa: PLR0913, PLR0915  (a kernel's row)
    j,
    law,
    p,
    x,
    s,
    loops,
    C,
    cp,
    cx,
    cs,
    E,
    ep,
    ex,
    es,
    g,
    kind,
    k_row,
    k_state,
    numbers,
    target,
    hand,
    noise,
    out,
):
    """Run one scene and fill `out` (n, 13), its columns as in `COLUMNS`.

    `law`: rate and element of the joint; C, ...: compensator; E, ...: estimator; `loops`: 1 where they run; `kind`: 0 no
    controller, 1 servo, 2 admittance, 3 the torque that `target` holds; `numbers`: period, substeps, late, count, limit, K_h,
    B_h, ripple, cycles a unit, gravity compensated, phase of the encoder; `target` (n, 2); `hand` (n, 4): position, velocity,
    grip, push; `noise` (n, 4): of the actuator, of the encoder, what a fault adds to the reading, and whether the tick is missed.
    """
    T, substeps, late, count, limit = numbers[0], int(numbers[1]), int(numbers[2]), numbers[3], numbers[4]
    K_h, B_h, ripple, cycles, weightless, phase = (
        numbers[5],
        numbers[6],
        numbers[7],
        numbers[8],
        numbers[9],
        numbers[10],
    )
    h = T / substeps
    offset = j[PUSH]
    before = axis_.gravity(j, s[2])
    reading_before = encoder(s[0] + phase, count)
    n = target.shape[0]
    last = before
    passed = 0.0
    for k in range(n):
        passed += T
        read = encoder(s[0] + phase, count) + noise[k, 1] + noise[k, 2]
        reading = read if np.isfinite(read) else reading_before  # the controller holds on to what it has seen
        v = (reading - reading_before) / passed
        held = 0.0
        if weightless > 0.0:
            j[PUSH] = offset
            held = axis_.gravity(j, reading)
        f, code = 0.0, 0
        if loops > 0:
            g[0, table.APPLIED] = last - held
            if kind == 1:
                g[0, table.ERROR], g[0, table.SLOPE] = target[k, 0] - reading, target[k, 1] - v
            if noise[k, 3] == 0.0:
                code = loop_kernel.joint(C, 0, cp, cx, cs, E, ep, ex, es, g[0], read, passed)
            f = g[0, table.TORQUE]
        command, wanted = last, target[k, 0]
        if noise[k, 3] == 0.0:
            u = 0.0
            if kind == 1:
                u = servo_.tick(k_row, 0, k_state, passed, target[k, 0], target[k, 1], reading, limit)
            elif kind == 2:
                u = admittance.tick(k_row, 0, k_state, 0, g[0, table.EXTERNAL], reading, passed)
                wanted = k_state[0]
            elif kind == 3:
                u = target[k, 0]
            command = min(max(u + f + held, -limit), limit)
            last, reading_before, passed = command, reading, 0.0
        elif kind == 2:
            wanted = k_state[0]
        force = hand[k, 2] * (K_h * (hand[k, 0] - s[2]) + B_h * (hand[k, 1] - s[3])) + hand[k, 3]
        out[k, 0], out[k, 1], out[k, 2] = read, command, f
        out[k, 3], out[k, 4], out[k, 5] = g[0, table.EXTERNAL], g[0, table.FRICTION], force
        out[k, 6], out[k, 7], out[k, 8], out[k, 9] = s[0], s[2], s[1], s[3]
        out[k, 10], out[k, 11], out[k, 12] = wanted, code, g[0, table.LEVEL]
        following = k + 1 if k + 1 < n else k
        touched = hand[k, 2] != 0.0 or hand[k, 3] != 0.0
        j[PUSH] = offset
        for i in range(substeps):
            behind = k - (late - i + substeps - 1) // substeps if late > i else k
            acting = (out[behind, 1] if behind >= 0 else before) + noise[k, 0]
            if ripple != 0.0:
                acting += ripple * sin(cycles * s[0])
            if touched:
                share = (i + 0.5) / substeps
                x_h = hand[k, 0] + share * (hand[following, 0] - hand[k, 0])
                v_h = hand[k, 1] + share * (hand[following, 1] - hand[k, 1])
                j[PUSH] = offset - (hand[k, 2] * (K_h * (x_h - s[2]) + B_h * (v_h - s[3])) + hand[k, 3])
            axis_.advance(j, s, law[0], law[1], p, x, acting, h, TEMPERATURE)
