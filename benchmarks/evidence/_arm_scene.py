"""A six-axis arm that shares nothing with the package: bodies, motors, transmissions, friction, counts, delay, and a hand.

    links:   M(q) q'' + h(q, q') + g(q) = c + J^T w,       c = K (C p - q) + D (C p' - q')
    motors:  M_m p'' = u - C^T c - f(p', z)

p: motors (reflected to the joints, which the encoders read), q: links, C: coupling of a wrist, w: wrench of a hand at the tool,
along the axes of the world. f is an elastoplastic bristle (Dupont, Hayward, Armstrong & Altpeter 2002; with `stuck` 0 it is LuGre)
with a Stribeck peak, two directions, a degressive viscous part, ripple over position, and growth with the torque that the
transmission carries. A servo with feed-forward of nominal bodies drives the motors; its torque acts `late` and is logged with
noise. Everything within a tick is compiled: about 9 ms a simulated second, 6 with the bodies looked at twice a tick; run as a
program, this measures it, compares the bodies with MuJoCo, and shows what rounding and fewer looks change.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from _arm_bodies import against_mujoco, factor, kinematics, push, solve, terms, workspace
from _arm_motions import free_motion, pushes
from _arm_truth import JOINTS, NAMES, NOISE, STIFF, TICK, TOOL, Arm, J, drawn
from numba import njit

STEP, BODIES = 1e-4, 2  # of the integration [s]; steps between two looks at the bodies
GONE = 6.5  # speeds of the Stribeck peak, at which it is below 1e-18 of itself [-]
FAST = 1.5  # speed at which the viscous part has lost half of its slope [rad/s]
SERVO = 2.0 * np.pi * 9.0  # bandwidth of the position loop [rad/s]

__all__ = [
    "JOINTS",
    "NAMES",
    "TICK",
    "TOOL",
    "Arm",
    "J",
    "Record",
    "drawn",
    "free_motion",
    "pushes",
    "record",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """A log, and what was true at its instants; arrays (n, 6).

    Attributes:
        time: [s], (n,).
        position: of the encoders [rad].
        torque: as commanded and logged [N.m].
        link: true positions of the links [rad].
        velocity: true velocities of the motors [rad/s].
        friction: true, of the motors [N.m].
        push: true torque of the hand on the joints [N.m].
        wrench: true, at the tool, along the axes of the world [N, N.m].
        end: state behind the last instant, to go on from.
    """

    time: np.ndarray
    position: np.ndarray
    torque: np.ndarray
    link: np.ndarray
    velocity: np.ndarray
    friction: np.ndarray
    push: np.ndarray
    wrench: np.ndarray
    end: tuple[np.ndarray, ...]


@njit(error_model="numpy")
def _friction(rows, j, w, z, load, p, level, step):
    """Return friction and the bristle's bend after a step."""
    speed = abs(w)
    fast = w / rows[j, 7]
    peak = rows[j, 6] * np.exp(-fast * fast) if abs(fast) < GONE else 0.0
    sliding = (rows[j, 3] if w >= 0.0 else rows[j, 4]) + peak
    sliding = level * (sliding * (1.0 + rows[j, 11] * np.sin(rows[j, 12] * p)) + rows[j, 10] * load)
    s = z / rows[j, 8]
    slide = 0.0
    if s * w > 0.0:
        size = abs(s)
        if rows[j, 9] <= 0.0 or size >= 1.0:
            slide = 1.0
        elif size > rows[j, 9]:
            slide = 0.5 + 0.5 * np.sin(np.pi * ((size - rows[j, 9]) / (1.0 - rows[j, 9]) - 0.5))
    z += step * w * (1.0 - slide * abs(s))
    z = min(max(z, -rows[j, 8]), rows[j, 8])
    return sliding * z / rows[j, 8] + level * rows[j, 5] * w / (1.0 + speed / FAST), z


@njit(error_model="numpy")
def _run(joints, bodies, nominal, tool, C, wanted, wrench, level, every, looks, p, w, q, v, z, queue, out):
    """Integrate all ticks; `queue`: torques on their way, (steps of delay, 6); `looks`: steps between two looks at the bodies."""
    n, N = wanted.shape[0], p.size
    R, V = workspace(N)
    M, L = np.zeros((N, N)), np.zeros((N, N))
    M_n, bias, bias_n = np.zeros((N, N)), np.zeros(N), np.zeros(N)
    tau, c, back, u, a, f = np.zeros(N), np.zeros(N), np.zeros(N), np.zeros(N), np.zeros(N), np.zeros(N)
    before, speed = np.zeros(N), np.zeros(N)
    inner, slot = round(TICK / STEP), 0
    for i in range(N):
        before[i] = round(p[i] / joints[i, 13]) * joints[i, 13]
        speed[i] = w[i]
    for k in range(n):
        # the controller: feed-forward of nominal bodies along the wanted motion, and a servo on counted positions
        terms(nominal, wanted[k, 0], wanted[k, 1], R, V, M_n, bias_n)
        for i in range(N):
            read = round(p[i] / joints[i, 13]) * joints[i, 13]
            speed[i] += 0.5 * ((read - before[i]) / TICK - speed[i])
            before[i] = read
            inertia = M_n[i, i] + joints[i, 0]
            u[i] = bias_n[i] + joints[i, 0] * wanted[k, 2, i]
            for j in range(N):
                u[i] += M_n[i, j] * wanted[k, 2, j]
            u[i] += inertia * SERVO * (SERVO * (wanted[k, 0, i] - read) + 2.0 * (wanted[k, 1, i] - speed[i]))
        if k % every == 0:
            r = k // every
            kinematics(bodies, q, R, V)
            push(R, V, N, tool, wrench[k], tau)
            for i in range(N):
                out[r, 0, i], out[r, 1, i], out[r, 2, i], out[r, 3, i] = before[i], u[i], q[i], w[i]
                out[r, 4, i], out[r, 5, i] = f[i], tau[i]
        for s in range(inner):
            if s % looks == 0:
                terms(bodies, q, v, R, V, M, bias)
                factor(M, L)
                push(R, V, N, tool, wrench[k], tau)
            for i in range(N):
                bent = -q[i]
                rate = -v[i]
                for j in range(N):
                    bent += C[i, j] * p[j]
                    rate += C[i, j] * w[j]
                c[i] = joints[i, 1] * bent + joints[i, 2] * rate
            for j in range(N):
                back[j] = 0.0
                for i in range(N):
                    back[j] += C[i, j] * c[i]
            for j in range(N):
                acting = queue[slot, j]
                f[j], z[j] = _friction(joints, j, w[j], z[j], abs(back[j]), p[j], level[k], STEP)
                w[j] += STEP / joints[j, 0] * (acting - back[j] - f[j])
                queue[slot, j] = u[j]
            slot = (slot + 1) % queue.shape[0]
            for i in range(N):
                a[i] = c[i] - bias[i] + tau[i]
            solve(L, a)
            for i in range(N):
                v[i] += STEP * a[i]
                p[i] += STEP * w[i]
                q[i] += STEP * v[i]
    return slot


def record(
    arm: Arm,
    reference: np.ndarray,
    rng: np.random.Generator,
    *,
    wrench: np.ndarray | None = None,
    level: np.ndarray | None = None,
    every: int = 1,
    start: tuple[np.ndarray, ...] | None = None,
    begin: float = 0.0,
    looks: int = BODIES,
) -> Record:
    """Return the log of an arm along a reference.

    Args:
        arm: the truth.
        reference: wanted positions every `TICK` [rad], (n, 6).
        rng: of the noise.
        wrench: of a hand at the tool every tick, along the axes of the world [N, N.m], (n, 6); None: nobody.
        level: factor on all friction, such as that of its temperature, (n,); None: 1.
        every: ticks from one logged instant to the next.
        start: `end` of the record before; None: at rest at the first position.
        begin: time of the first instant [s].
        looks: steps of the integration between two looks at the bodies.
    """
    n = reference.shape[0]
    velocity = np.gradient(reference, TICK, axis=0)
    wanted = np.ascontiguousarray(
        np.stack([reference, velocity, np.gradient(velocity, TICK, axis=0)], axis=1)
    )
    bodies, nominal = arm.bodies(), arm.bodies(payload=False)
    queue = max(1, round(arm.late / STEP))
    if start is None:
        weight = np.zeros(J)
        R, V = workspace(J)
        terms(bodies, reference[0], np.zeros(J), R, V, np.zeros((J, J)), weight)
        motors = np.linalg.solve(arm.coupling, reference[0] + weight / arm.joints[:, STIFF])
        held = arm.coupling.T @ weight
        start = (
            motors,
            np.zeros(J),
            reference[0].copy(),
            np.zeros(J),
            np.zeros(J),
            np.tile(held, (queue, 1)),
        )
    state = tuple(np.array(x, dtype=float) for x in start)
    hands = np.zeros((n, 6)) if wrench is None else np.ascontiguousarray(wrench, dtype=float)
    levels = np.ones(n) if level is None else np.ascontiguousarray(level, dtype=float)
    rows = -(-n // every)
    out = np.zeros((rows, 6, J))
    tool = np.array(TOOL)
    slot = _run(
        arm.joints, bodies, nominal, tool, arm.coupling, wanted, hands, levels, every, looks, *state, out
    )
    end = (*state[:5], np.roll(state[5], -slot, axis=0))
    return Record(
        time=begin + np.arange(rows) * TICK * every,
        position=out[:, 0],
        torque=out[:, 1] + arm.joints[:, NOISE] * rng.standard_normal((rows, J)),
        link=out[:, 2],
        velocity=out[:, 3],
        friction=out[:, 4],
        push=out[:, 5],
        wrench=hands[::every],
        end=end,
    )


def _rms(x: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(x**2, axis=0))


def main() -> None:
    """Compare the bodies with MuJoCo, and measure what a simulated second costs."""
    import time

    arm = replace(Arm(), payload=(2.0, (0.05, 0.01, 0.02)))
    print(f"from MuJoCo: {against_mujoco(arm.bodies(), np.array(TOOL), arm.mjcf(payload=True)):.1e}")
    rng = np.random.default_rng(1)
    record(arm, free_motion(1.0, rng), rng)
    reference = free_motion(60.0, rng)
    begun = time.perf_counter()
    r = record(arm, reference, rng, wrench=pushes(60.0, rng))
    cost = (time.perf_counter() - begun) / 60.0
    error = np.abs(r.position - reference).max(axis=0)
    print(f"{1e3 * cost:.1f} ms a simulated second; an hour in {3600 * cost:.0f} s")
    exact = record(arm, reference, np.random.default_rng(2))
    nudged = replace(arm, joints=arm.joints * (1.0 + 1e-15))
    for words, other in (
        ("parameters off by 1e-15", record(nudged, reference, np.random.default_rng(2))),
        ("bodies looked at twice a tick", record(arm, reference, np.random.default_rng(2), looks=5)),
    ):
        print(f"{words}, RMS of the torque's change [N.m]: {np.round(_rms(other.torque - exact.torque), 3)}")
    print(f"largest error of the servo [mrad]: {np.round(1e3 * error, 1)}")
    print(f"top speeds [rad/s]: {np.round(np.abs(r.velocity).max(axis=0), 2)}")
    print(
        f"torques, RMS [N.m]: {np.round(r.torque.std(axis=0), 2)}, friction {np.round(r.friction.std(axis=0), 2)}"
    )


if __name__ == "__main__":
    main()
