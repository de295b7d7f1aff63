"""Logs made from a closed form: motion as a sum of sines, torque by inverse dynamics. No simulator of ours takes part."""

from __future__ import annotations

import numpy as np

from backdrive import Joint, Log

TONES = ((0.13, 0.9, 0.3), (0.31, 0.35, 1.1), (0.77, 0.12, 2.0), (1.9, 0.02, 0.7))  # Hz, rad, rad


def motion(time: np.ndarray, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q, dq, ddq = np.zeros_like(time), np.zeros_like(time), np.zeros_like(time)
    for hertz, amplitude, phase in TONES:
        w = 2 * np.pi * hertz
        q += scale * amplitude * np.sin(w * time + phase)
        dq += scale * amplitude * w * np.cos(w * time + phase)
        ddq -= scale * amplitude * w * w * np.sin(w * time + phase)
    return q, dq, ddq


def any_motion(
    friction,
    *,
    inertia=0.5,
    offset=0.0,
    gravity=(0.0, 0.0),
    delay=0.0,
    noise=0.05,
    seconds=30.0,
    rate=500.0,
    seed=0,
    name="j1",
    unit="rad",
    phase=0.0,
) -> Log:
    """Return a log of one joint whose friction is `friction(dq)`; the torque comes `delay` seconds late."""
    time = np.arange(round(seconds * rate)) / rate
    q, *_ = motion(time + phase)
    q_then, dq_then, ddq_then = motion(time + phase - delay)
    tau = (
        inertia * ddq_then
        + friction(dq_then)
        + offset
        + gravity[0] * np.sin(q_then)
        + gravity[1] * np.cos(q_then)
    )
    tau = tau + noise * np.random.default_rng(seed).standard_normal(time.size)
    return Log(time=time, joints=(Joint(name=name, unit=unit),), position=q, torque=tau)


def constant_runs(friction, speeds, *, noise=0.05, samples=300, rate=100.0, seed=0, offset=0.0) -> list[Log]:
    """Return one velocity-only log a speed and direction."""
    generator = np.random.default_rng(seed)
    time = np.arange(samples) / rate
    logs = []
    for v in [*speeds, *(-s for s in speeds)]:
        velocity = v + 0.01 * abs(v) * generator.standard_normal(samples)
        torque = float(friction(v)) + offset + noise * generator.standard_normal(samples)
        logs.append(Log(time=time, joints=(Joint(name="j1"),), velocity=velocity, torque=torque))
    return logs
