"""Clean logs by seed: joints under closed-loop control, with what real and healthy logs also have.

Each joint has inertia, gravity, LuGre friction with a Stribeck curve, a quantised encoder, a cascaded controller whose
velocity comes from that encoder, a noisy and perhaps quantised torque signal, and in part of the logs jitter of the clock, a
filtered velocity, coupling to its neighbour, or only velocity (a drive's export) or only position. Nothing in them is a fault.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from backdrive.logs.log import Joint, Log

#: Kinds of motion, with how often each is drawn.
MOTIONS = {
    "sweep": 0.2,
    "multisine": 0.22,
    "chirp": 0.15,
    "trapezoid": 0.15,
    "in turn": 0.08,
    "constant velocity": 0.1,
    "torque ramp": 0.05,
    "torque triangle": 0.05,
}
RATES = (100.0, 125.0, 200.0, 250.0, 500.0, 1000.0)


@dataclass(frozen=True, kw_only=True)
class Clean:
    """A log without fault and what was put into it.

    Attributes:
        seed: it came from.
        motion: a key of `MOTIONS`.
        log: the log.
        torque_noise: standard deviation of the torque noise by joint [N.m], (J,).
        slip: by how much torque comes after motion of itself [sample].
        friction_share: mean friction torque while moving over the standard deviation of torque, by joint [1], (J,).
        speed: true velocity [rad/s], (n, J).
    """

    seed: int
    motion: str
    log: Log
    torque_noise: np.ndarray
    slip: float
    friction_share: np.ndarray
    speed: np.ndarray


def clean_log(seed: int) -> Clean:
    """Return the clean log of a seed."""
    rng = np.random.default_rng([20260, seed])
    motion = str(rng.choice(list(MOTIONS), p=list(MOTIONS.values())))
    if motion == "constant velocity":
        return _constant_velocity(seed, rng)
    rate = float(rng.choice(RATES))
    duration = float(rng.uniform(8.0, 14.0))
    joints = int(rng.choice([1, 1, 2, 3])) if motion != "in turn" else int(rng.integers(2, 4))
    n = int(duration * rate)
    control = max(rate, 1000.0)
    every = round(control / rate)
    t = np.arange(n * every) / control
    until = rng.random() < 0.3
    names = tuple(f"joint{k + 1}" for k in range(joints))
    q, v, tau = np.empty((n, joints)), np.empty((n, joints)), np.empty((n, joints))
    velocity, noise, share = np.empty((n, joints)), np.empty(joints), np.empty(joints)
    pull = np.zeros(t.size)  # acceleration of the neighbour, which this joint feels through its own inertia
    for k in range(joints):
        top_speed = rng.uniform(0.3, 4.0)
        reference = _reference(motion, t, top_speed, rng, turn=(k, joints))
        acceleration = np.quantile(np.abs(reference[:, 2]), 0.99)
        inertia = 10 ** rng.uniform(-2.5, 0.5)
        scale = max(inertia * acceleration, 1e-6)
        coulomb = scale * 10 ** rng.uniform(-0.5, 0.7)
        gravity = coulomb * rng.uniform(0.2, 4.0) if rng.random() < 0.5 and "torque" not in motion else 0.0
        viscous = coulomb / top_speed * rng.uniform(0.1, 1.5)
        presliding = 10 ** rng.uniform(-5, -3.7)
        encoder = 2 * np.pi / 2 ** int(rng.integers(14, 21))
        stroke = np.ptp(reference[:, 0])
        band = max(
            2 * np.pi * rng.uniform(4, 15),
            min(np.sqrt(40 * coulomb / (inertia * max(stroke, 0.05))), 2 * np.pi * 30),
        )
        p = np.array(
            [
                inertia,
                gravity,
                rng.uniform(-np.pi, np.pi),
                coulomb,
                coulomb * rng.uniform(1.0, 1.5),
                top_speed * rng.uniform(0.01, 0.1),
                viscous,
                coulomb / presliding,
                encoder,
                inertia * band**2,
                2 * rng.uniform(0.7, 1.0) * inertia * band,
                inertia * band**3 * rng.uniform(0, 0.15),
                2 * np.pi * rng.uniform(40, 150),
                2 * np.pi * rng.uniform(30, 200),
                0.0 if "torque" not in motion else 1.0,
            ]
        )
        if "torque" in motion:
            reference = _torque(motion, t, p[4] * 1.6, rng)
        substeps = max(1, int(np.ceil(1 / control / min(2e-4, 0.25 * np.sqrt(inertia / p[7])))))
        state, u, filtered = _run(p, reference, inertia * pull, 1 / control, substeps)
        q[:, k] = np.round(state[::every, 0] / encoder) * encoder
        v[:, k] = state[::every, 1]
        # the torque that acts from the sample on, or the one that acted until then
        tau[:, k] = np.roll(u, 1)[::every] if until else u[::every]
        velocity[:, k] = filtered[::every]
        moving = np.abs(v[:, k]) > 0.02 * top_speed
        share[k] = (
            np.mean(coulomb + viscous * np.abs(v[moving, k])) / max(np.std(tau[:, k]), 1e-12)
            if moving.any()
            else 0
        )
        noise[k] = np.std(tau[:, k]) * 10 ** rng.uniform(-3, -1.5)
        tau[:, k] += noise[k] * rng.standard_normal(n)
        if rng.random() < 0.4:
            step = noise[k] * rng.uniform(0.3, 2.0)
            tau[:, k] = np.round(tau[:, k] / step) * step
        if rng.random() < 0.4:  # an own velocity sensor
            velocity[:, k] = v[:, k] + top_speed * 10 ** rng.uniform(-3.5, -2) * rng.standard_normal(n)
        if rng.random() < 0.3:
            step = top_speed * 10 ** rng.uniform(-4, -2)
            velocity[:, k] = np.round(velocity[:, k] / step) * step
        pull = rng.uniform(-0.15, 0.15) * np.gradient(state[:, 1], 1 / control)
    time = np.arange(n) / rate
    if rng.random() < 0.4:
        time = time + rng.uniform(0.0, 0.04) / rate * rng.standard_normal(n).clip(-3, 3)
    channels = {"position": q, "velocity": velocity, "torque": tau}
    draw = rng.random()
    if draw < 0.15:
        del channels["velocity"]
    elif draw < 0.2 and motion != "torque ramp":
        del channels["position"]
    log = Log(
        time=time + rng.choice([0.0, 3.6, 1.7e9]),
        joints=tuple(Joint(name=name) for name in names),
        **channels,
    )
    slip = (0.5 if until else -0.5) / every
    return Clean(
        seed=seed, motion=motion, log=log, torque_noise=noise, slip=slip, friction_share=share, speed=v
    )


def _constant_velocity(seed: int, rng: np.random.Generator) -> Clean:
    """Return a drive's export: whole rpm and tenths of percent, 500 samples, one direction."""
    n, period = 500, float(rng.choice([6.4e-3, 12.8e-3, 25.6e-3, 51.2e-3]))
    rpm = float(rng.choice([5, 10, 20, 50, 100, 200])) * rng.choice([-1, 1])
    t = np.arange(n) * period
    turn = 2 * np.pi * abs(rpm) / 60 * t + rng.uniform(0, 6)
    ripple = rng.uniform(0.02, 0.15)
    wander = np.convolve(rng.standard_normal(n + 40), np.ones(20) / 20, "same")[20:-20]
    percent = (
        np.sign(rpm) * rng.uniform(10, 50) * (1 + ripple * np.sin(turn) + 0.1 * wander)
        + rng.standard_normal(n) * 0.8
    )
    speed = rpm + rng.uniform(0.3, 3.0) * (np.sin(turn + 1) * 0.5 + 0.7 * rng.standard_normal(n))
    tau = np.round(percent, 1)[:, None] * 9.84e-5
    v = np.round(speed)[:, None] * (2 * np.pi / 60)
    log = Log(time=t, joints=(Joint(name="motor"),), velocity=v, torque=tau)
    return Clean(
        seed=seed,
        motion="constant velocity",
        log=log,
        torque_noise=np.array([0.8 * 9.84e-5]),
        slip=0.0,
        friction_share=np.zeros(1),
        speed=v,
    )


def _reference(
    motion: str, t: np.ndarray, top_speed: float, rng: np.random.Generator, turn: tuple[int, int]
) -> np.ndarray:
    """Return reference position, velocity and acceleration, (m, 3)."""
    end = t[-1]
    if motion in ("sweep", "torque ramp", "torque triangle"):
        cycles = int(rng.integers(3, 12))
        return _sines(t, top_speed, np.array([cycles / end]), np.ones(1), np.array([-np.pi / 2]))
    if motion == "multisine":
        base, count = rng.uniform(0.1, 0.2), int(rng.integers(4, 8))
        harmonics = base * np.arange(1, count + 1)
        return _sines(t, top_speed, harmonics, rng.uniform(0.3, 1, count), rng.uniform(0, 2 * np.pi, count))
    if motion == "chirp":
        low, high = rng.uniform(0.1, 0.3), rng.uniform(1.0, 2.5)
        phase = 2 * np.pi * (low * t + (high - low) * t**2 / (2 * end))
        envelope = _ease(t)
        w = 2 * np.pi * (low + (high - low) * t / end)
        q = envelope * np.sin(phase) / w
    elif motion == "trapezoid":
        q = _trapezoid(t, rng)
    else:
        k, joints = turn
        slot = slice(t.size * k // joints, t.size * (k + 1) // joints)
        q = np.zeros(t.size)
        q[slot] = _trapezoid(t[slot], rng)
        q[slot.stop :] = q[slot.stop - 1]
    dq = np.gradient(q, t)
    q, dq = q * top_speed / np.abs(dq).max(), dq * top_speed / np.abs(dq).max()
    return np.stack([q, dq, np.gradient(dq, t)], axis=1)


def _sines(
    t: np.ndarray, top_speed: float, f: np.ndarray, weight: np.ndarray, phase: np.ndarray
) -> np.ndarray:
    w = 2 * np.pi * f
    q = _ease(t) * np.sum(weight * np.sin(np.outer(t, w) + phase) / w, axis=1)
    dq = np.gradient(q, t)
    factor = top_speed / np.abs(dq).max()
    return factor * np.stack([q, dq, np.gradient(dq, t)], axis=1)


def _ease(t: np.ndarray) -> np.ndarray:
    """Return a rise from 0 to 1 within the first second, without a jump in acceleration."""
    x = np.minimum(1, t - t[0])
    return x**3 * (10 - 15 * x + 6 * x**2)


def _trapezoid(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a position of constant speeds both ways, corners rounded over 0.3 s."""
    speeds = np.concatenate([[v, -v] for v in rng.uniform(0.2, 1.0, int(rng.integers(2, 5)))])
    width = int(0.3 / (t[1] - t[0]))
    window = np.hanning(width) / np.hanning(width).sum()
    level = np.repeat(speeds, (t.size - 2 * width) // speeds.size)
    level = np.concatenate([np.zeros(width), level, np.zeros(t.size - width - level.size)])
    smooth = np.convolve(level, window, "same")
    return np.cumsum(smooth) * (t[1] - t[0])


def _torque(motion: str, t: np.ndarray, top: float, rng: np.random.Generator) -> np.ndarray:
    """Return an open-loop torque in the first column: one slow ramp to 0.9 of break-away, or triangles beyond it."""
    if motion == "torque ramp":
        u = top / 1.6 * 0.9 * np.interp(t / t[-1], [0, 0.25, 0.75, 1], [0, 1, -1, 0])
    else:
        count = int(rng.integers(3, 7))
        u = top * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * count * t / t[-1]))
    return np.stack([u, np.zeros_like(u), np.zeros_like(u)], axis=1)


@njit
def _run(p, reference, disturbance, period, substeps):
    inertia, gravity, angle, coulomb, static, stribeck, viscous, stiffness = (
        p[0],
        p[1],
        p[2],
        p[3],
        p[4],
        p[5],
        p[6],
        p[7],
    )
    encoder, kp, kd, ki, control_pole, sensor_pole, open_loop = p[8], p[9], p[10], p[11], p[12], p[13], p[14]
    n = reference.shape[0]
    state, torque, measured = np.empty((n, 2)), np.empty(n), np.empty(n)
    q, v, z, integral = reference[0, 0] * (1 - open_loop), reference[0, 1] * (1 - open_loop), 0.0, 0.0
    before = np.round(q / encoder) * encoder
    loop_speed = v
    sensor_speed = v
    h = period / substeps
    damping = 0.3 * np.sqrt(stiffness * inertia)
    for k in range(n):
        seen = np.round(q / encoder) * encoder
        raw = (seen - before) / period if k else v
        before = seen
        loop_speed += (raw - loop_speed) * (1 - np.exp(-control_pole * period))
        sensor_speed += (raw - sensor_speed) * (1 - np.exp(-sensor_pole * period))
        if open_loop > 0:
            u = reference[k, 0]
        else:
            error = reference[k, 0] - seen
            integral += error * period
            u = kp * error + kd * (reference[k, 1] - loop_speed) + ki * integral + inertia * reference[k, 2]
            u += gravity * np.sin(seen + angle)
        state[k, 0], state[k, 1], torque[k], measured[k] = q, v, u, sensor_speed
        for _ in range(substeps):
            limit = coulomb + (static - coulomb) * np.exp(-((v / stribeck) ** 2))
            slip = (z + h * v) / (1 + h * abs(v) * stiffness / limit)
            rate = (slip - z) / h
            z = slip
            friction = stiffness * z + damping * np.exp(-((v / stribeck) ** 2)) * rate + viscous * v
            v += h / inertia * (u - friction - gravity * np.sin(q + angle) - disturbance[k])
            q += h * v
    return state, torque, measured
