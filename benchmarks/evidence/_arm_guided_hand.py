"""The independent six-axis arm with compensated friction, moved by a soft hand at the tool: no servo, weight carried by the motors.

u = g(q) + R f,   f <- clip((f + K dp)/(1 + T alpha), -F, F)        Iwatani 2017, (3.21a)
hand: F = K_h (x_h - x) - D_h x',  nothing where it lets go
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from _arm_bodies import invert, kinematics, push, terms, tool_point, workspace
from _arm_scene import BODIES, STEP, _friction
from _arm_truth import NOISE, POSTURE, STIFF, TICK, TOOL, Arm, J
from numba import njit

SHARE, BEND, DECAY = 0.8, 1.2e-3, 20.0  # R, displacement to the whole compensation [rad], alpha [1/s]
HAND = (1200.0, 60.0)  # stiffness [N/m] and damping [N.s/m] of the hand


@dataclass(frozen=True, kw_only=True, eq=False)
class Guided:
    """What happened; arrays (n, 6) but `time` (n,) and `held` (n,)."""

    time: np.ndarray
    position: np.ndarray
    torque: np.ndarray
    wrench: np.ndarray
    push: np.ndarray
    velocity: np.ndarray
    held: np.ndarray


@njit(error_model="numpy")
def _guide(joints, bodies, level, tool, target, held, hand, p, w, q, v, z, f, queue, out):
    """Integrate all ticks; `level`: friction that is compensated (6,), `target` (n, 3), `held` (n,): whether the hand holds on."""
    n, N = target.shape[0], p.size
    R, V = workspace(N)
    M, Minv, L = np.zeros((N, N)), np.zeros((N, N)), np.zeros((N, N))
    bias, rest, still = np.zeros(N), np.zeros(N), np.zeros(N)
    tau, u, a, point, last = np.zeros(N), np.zeros(N), np.zeros(N), np.zeros(3), np.zeros(3)
    wrench, before = np.zeros(6), np.zeros(N)
    slot = 0
    for i in range(N):
        before[i] = round(p[i] / joints[i, 13]) * joints[i, 13]
    kinematics(bodies, q, R, V)
    tool_point(R, V, N, tool, last)
    for k in range(n):
        for i in range(N):
            read = round(p[i] / joints[i, 13]) * joints[i, 13]
            bend = f[i] + level[i] / BEND * (read - before[i])
            f[i] = min(max(bend / (1.0 + TICK * DECAY), -level[i]), level[i])
            before[i] = read
        terms(bodies, before, still, R, V, M, rest)
        for i in range(N):
            u[i] = rest[i] + SHARE * f[i]
            out[k, 0, i], out[k, 1, i], out[k, 4, i] = before[i], u[i], w[i]
        for s in range(round(TICK / STEP)):
            if s % BODIES == 0:
                terms(bodies, q, v, R, V, M, bias)
                invert(M, L, Minv)
                tool_point(R, V, N, tool, point)
                for m in range(3):
                    speed = (point[m] - last[m]) / (BODIES * STEP)
                    last[m] = point[m]
                    wrench[m] = held[k] * (hand[0] * (target[k, m] - point[m]) - hand[1] * speed)
                push(R, V, N, tool, wrench, tau)
                if s == 0:
                    for i in range(N):
                        out[k, 2, i], out[k, 3, i] = wrench[i], tau[i]
            for i in range(N):
                c = joints[i, 1] * (p[i] - q[i]) + joints[i, 2] * (w[i] - v[i])
                force, z[i] = _friction(joints, i, w[i], z[i], abs(c), p[i], 1.0, STEP)
                w[i] += STEP / joints[i, 0] * (queue[slot, i] - c - force)
                queue[slot, i] = u[i]
                a[i] = c - bias[i] + tau[i]
            slot = (slot + 1) % queue.shape[0]
            for i in range(N):
                for j in range(N):
                    v[i] += STEP * Minv[i, j] * a[j]
            for i in range(N):
                p[i] += STEP * w[i]
                q[i] += STEP * v[i]


def guided(arm: Arm, rng: np.random.Generator, strokes: int = 4) -> Guided:
    """Return a hand's strokes: out and back along a random direction, at rest and held for a while, and let go.

    Args:
        arm: the truth.
        rng: of directions and noise.
        strokes: how many.
    """
    posture = POSTURE + rng.uniform(-0.2, 0.2, J)
    bodies, tool = arm.bodies(), np.array(TOOL)
    R, V = workspace(J)
    weight, point = np.zeros(J), np.zeros(3)
    terms(bodies, posture, np.zeros(J), R, V, np.zeros((J, J)), weight)
    tool_point(R, V, J, tool, point)
    paths, holds = [], []
    for _ in range(strokes):
        way = rng.normal(size=3)
        way *= rng.uniform(0.08, 0.14) / np.linalg.norm(way)
        t = np.arange(round(1.6 / TICK)) * TICK / 1.6
        rise = t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
        shape = np.concatenate([np.zeros(300), rise, np.ones(800), rise[::-1], np.zeros(800), np.zeros(900)])
        paths.append(point + shape[:, None] * way)
        holds.append(np.concatenate([np.ones(shape.size - 900), np.zeros(900)]))
    target, held = np.concatenate(paths), np.concatenate(holds)
    table = arm.joints
    level = 0.5 * (table[:, 3] + table[:, 4])
    queue = np.tile(weight, (max(1, round(arm.late / STEP)), 1))
    state = [posture + weight / table[:, STIFF], *np.zeros((1, J)), posture.copy(), *np.zeros((3, J)), queue]
    out = np.zeros((target.shape[0], 5, J))
    _guide(table, bodies, level, tool, target, held, HAND, *state, out)
    return Guided(
        time=np.arange(target.shape[0]) * TICK,
        position=out[:, 0],
        torque=out[:, 1] + table[:, NOISE] * rng.standard_normal((target.shape[0], J)),
        wrench=out[:, 2],
        push=out[:, 3],
        velocity=out[:, 4],
        held=held > 0.5,
    )
