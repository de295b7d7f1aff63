"""Logs of joints that share nothing with the package: motions that are known exactly, torques from the equation of motion.

    tau = M ddq + a sin q + b cos q + o + friction,      encoder and torque noise added last

Each log is written as NPZ, so that two versions of the package read the same bytes.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

NOISE = 0.03  # of the torque, by its Coulomb part [-]


class Case(NamedTuple):
    """A log to be identified.

    Attributes:
        name: of the case and its file.
        law: that is searched; empty: the method that the log suggests.
        options: of `identify`, the same on both sides; `fit` gets those that it has.
        reading: of `read_log`.
        path: of the log; None for one of ours.
    """

    name: str
    law: str = ""
    options: dict = {}
    reading: dict = {}
    path: str = ""


OURS = (
    Case("motion"),
    Case("motion with gravity", options={"gravity": True}),
    Case("by direction"),
    Case("two joints"),
    Case("linear axis", reading={"units": "m"}),
    Case("constant velocities"),
    Case("coulomb-viscous, searched", law="coulomb-viscous"),
    Case("stribeck-gauss, searched", law="stribeck-gauss"),
    Case("degressive, searched", law="degressive"),
    Case("stribeck-gauss+lugre, searched", law="stribeck-gauss+lugre"),
)

REAL = (
    Case("EMPS", reading={"map": "t=t,q=qm,tau=35.15065188*vir", "units": "m"}, path="emps/DATA_EMPS.mat"),
    Case(
        "EMPS, stribeck-tustin",
        law="stribeck-tustin",
        reading={"map": "t=t,q=qm,tau=35.15065188*vir", "units": "m"},
        path="emps/DATA_EMPS.mat",
    ),
)


def write(case: Case, folder: Path, twin: int = 0) -> Path:
    """Write one of OURS and return its path.

    Args:
        case: which.
        folder: an existing one.
        twin: another draw of motion and noise.
    """
    rng = np.random.default_rng([OURS.index(case), twin] if twin else OURS.index(case))
    rate = 500.0
    t = np.arange(int(24.0 * rate)) / rate
    columns = []
    for j in range(2 if case.name == "two joints" else 1):
        constant = case.name == "constant velocities"
        q, v, a = _trapezoids(t, rng) if constant else _multisine(t, rng, 0.1 * (1.0 + 0.3 * j))
        F = 4.0 + j
        tau = 0.6 * a + _friction(case, v, F, 1.0 / rate) + 0.2
        if case.name == "motion with gravity":
            tau += 3.0 * np.sin(q) + 1.0 * np.cos(q)
        noise = NOISE * F * rng.standard_normal(t.size)
        count = 2.0 * np.pi / 2**17
        columns.append((count * np.round(q / count), tau + noise))
    path = folder / f"{case.name.replace(' ', '_')}{twin or ''}.npz"
    np.savez(path, t=t, q=np.array([c[0] for c in columns]).T, tau=np.array([c[1] for c in columns]).T)
    return path


SPEEDS = np.linspace(0.1, 0.6, 11)  # in both directions, at which curves are compared with the truth [rad/s]


def truth(case: Case, joint: int) -> dict[str, float]:
    """Return what one of OURS was made of: terms of the dynamics by name.

    Args:
        case: which.
        joint: of its joints, from 0.
    """
    rest = {"inertia": 0.6} if case.name == "by direction" else {"inertia": 0.6, "offset": 0.2}
    return rest | ({"gravity_sin": 3.0, "gravity_cos": 1.0} if case.name == "motion with gravity" else {})


def true_curve(case: Case, joint: int) -> np.ndarray:
    """Return friction in steady motion at SPEEDS forwards, then backwards, (22,); the offset too where no fit tells it apart."""
    v = np.concatenate([SPEEDS, -SPEEDS])
    if "lugre" in case.law:
        return (4.0 + 1.5 * np.exp(-((v / 0.1) ** 2))) * np.sign(v) + 1.5 * v
    return _friction(case, v, 4.0 + joint, 1.0) + (0.2 if case.name == "by direction" else 0.0)


def _multisine(t: np.ndarray, rng: np.random.Generator, f_0: float) -> tuple[np.ndarray, ...]:
    """Return position, velocity and acceleration of a sum of sines."""
    q, v, a = (np.zeros_like(t) for _ in range(3))
    for k in (1.0, 2.3, 4.1, 7.7):
        w, phase = 2.0 * np.pi * f_0 * k, rng.uniform(0.0, 2.0 * np.pi)
        A = 0.5 / k
        q += A * np.sin(w * t + phase)
        v += A * w * np.cos(w * t + phase)
        a -= A * w * w * np.sin(w * t + phase)
    return q, v, a


def _trapezoids(t: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Return runs there and back at eight speeds, each with smooth ramps and a rest."""
    v = np.zeros_like(t)
    piece = t.size // 16
    for k in range(16):
        speed = 0.08 * (1 + k // 2) * (1.0 if k % 2 == 0 else -1.0)
        s = np.linspace(0.0, 1.0, piece)
        rise = np.clip(np.minimum(s / 0.15, (1.0 - s) / 0.15), 0.0, 1.0)
        v[k * piece : (k + 1) * piece] = speed * (3.0 * rise**2 - 2.0 * rise**3)
    dt = t[1] - t[0]
    return np.cumsum(v) * dt, v, np.gradient(v, dt)


def _friction(case: Case, v: np.ndarray, F: float, dt: float) -> np.ndarray:
    """Return the friction along a motion of known velocity."""
    sign = np.sign(v)
    if case.name == "by direction":
        return np.where(v > 0.0, F + 1.5 * v, np.where(v < 0.0, -0.7 * F + 0.8 * v, 0.0))
    if "lugre" in case.law:
        bound = F + 1.5 * np.exp(-((v / 0.1) ** 2))
        z = np.zeros_like(v)
        stiffness, part = 2e3, 20
        for k in range(1, v.size):
            for i in range(part):  # midpoint of short steps
                u = v[k - 1] + (v[k] - v[k - 1]) * (i + 0.5) / part
                z[k] = z[k - 1] if i == 0 else z[k]
                z[k] += dt / part * (u - stiffness * abs(u) / bound[k] * z[k])
        return stiffness * z + 1.5 * v
    if "stribeck" in case.law:
        return (F + 2.0 * np.exp(-((v / 0.15) ** 2))) * sign + 1.5 * v
    if "degressive" in case.law:
        return F * sign + 2.0 * np.sqrt(np.abs(v)) * sign
    return F * sign + 1.5 * v
