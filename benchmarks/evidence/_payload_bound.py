"""How well any unbiased estimate can know a payload's mass: Cramer and Rao's bound, by MuJoCo and numpy alone.

Told are the shape of the friction and the spectrum of the noise. To be learnt, from a loaded and an unloaded log together, are
the payload's mass, center and inertia, all bodies of the arm, the motors' inertias, an offset, the growth of friction with the
load, and for each log the levels of Coulomb and viscous friction.
"""

from __future__ import annotations

import mujoco
import numpy as np
from _payload_arm import (
    AXES,
    CENTERS,
    JOINTS,
    MASSES,
    NAMES,
    NOISE,
    PLACES,
    RADII,
    RATE,
    TOOL,
    motion,
    rotation,
)

PER_BODY, PER_JOINT = 10, 7  # unknown quantities
STEP = 8  # samples to one row; motions end below 1 Hz
RADIUS = (0.04, 0.04, 0.03)  # of gyration of a payload [m]
OPEN = 1e-9  # directions with less than this share of the information are not shown by any log


def _model(theta: np.ndarray, load: bool) -> mujoco.MjModel:
    """Return the arm of mass, center and inertia about it (xx, yy, zz, xy, xz, yz) by body, (7, 10)."""

    def inertial(row: np.ndarray) -> str:
        words = [" ".join(repr(float(x)) for x in part) for part in (row[1:4], row[:1], row[4:])]
        return f'<inertial pos="{words[0]}" mass="{words[1]}" fullinertia="{words[2]}"/>'

    def place(xyz) -> str:
        return " ".join(map(str, xyz))

    opening = ""
    for i, name in enumerate(NAMES):
        opening += (
            f'<body pos="{place(PLACES[i])}"><joint name="{name}" type="hinge" axis="{place(AXES[i])}"/>'
        )
        opening += inertial(theta[i])
    held = ""
    if load:
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, rotation(TOOL[1]).ravel())
        held = f'<body pos="{place(TOOL[0])}" quat="{place(quat)}">{inertial(theta[-1])}</body>'
    return mujoco.MjModel.from_xml_string(
        '<mujoco><compiler angle="radian" inertiafromgeom="false"/><option gravity="0 0 -9.81"/><worldbody>'
        f"{opening}{held}{'</body>' * JOINTS}</worldbody></mujoco>"
    )


def _torque(theta: np.ndarray, load: bool, q, dq, ddq) -> np.ndarray:
    model = _model(theta, load)
    data, out = mujoco.MjData(model), np.empty_like(q)
    for i in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[i], dq[i], ddq[i]
        mujoco.mj_inverse(model, data)
        out[i] = data.qfrc_inverse
    return out


def _columns(theta: np.ndarray, load: bool, q, dq, ddq) -> tuple[np.ndarray, np.ndarray]:
    """Return the torque, (n, J), and its derivatives by all that bodies are made of, (n, J, 70)."""
    torque = _torque(theta, load, q, dq, ddq)
    columns = np.zeros((*torque.shape, theta.size))
    for k in range(theta.size if load else theta.size - PER_BODY):
        other, (i, which) = theta.copy(), divmod(k, PER_BODY)
        step = 1e-4 * (other[i, 0] if which == 0 else 0.01 if which < 4 else other[i, 4])
        other[i, which] += step
        columns[..., k] = (_torque(other, load, q, dq, ddq) - torque) / step
    return torque, columns


def least_error(seed: int, mass: float, center: np.ndarray, lengths: tuple[float, float]) -> float:
    """Return the least standard error of a payload's mass [kg] that a draw's loaded and unloaded log of some lengths [s] allow."""
    theta = np.zeros((JOINTS + 1, PER_BODY))
    held = (mass, *center, *mass * np.square(RADIUS))
    for i, row in enumerate(theta[:-1]):
        row[:7] = (MASSES[i], *CENTERS[i], *MASSES[i] * np.square(RADII[i]))
    theta[-1, :7] = held
    bodies = theta.size
    told = np.zeros((bodies + PER_JOINT * JOINTS,) * 2)
    for day, (seconds, way, load) in enumerate(
        ((lengths[0], 2 * seed + 1, True), (lengths[1], 2 * seed, False))
    ):
        q, dq, ddq = (x[::STEP] for x in motion(seconds, way)[1:])
        torque, columns = _columns(theta, load, q, dq, ddq)
        n = len(q)
        keep = np.exp(-2.0 * STEP / RATE)  # of the slow noise, from row to row
        turn = np.exp(-2j * np.pi * np.fft.rfftfreq(n))
        slow = (1.0 - keep**2) / np.abs(1.0 - keep * turn) ** 2
        for j in range(JOINTS):
            X = np.zeros((n, len(told)))
            X[:, :bodies] = columns[:, j]
            at = bodies + PER_JOINT * j
            X[:, at], X[:, at + 1], X[:, at + 2] = 1.0, ddq[:, j], np.abs(torque[:, j]) * np.sign(dq[:, j])
            X[:, at + 3 + day], X[:, at + 5 + day] = np.sign(dq[:, j]), dq[:, j]
            white = np.fft.rfft(X, axis=0) / (NOISE[j] * np.sqrt(1.0 / STEP + 0.25 * slow))[:, None]
            Z = np.fft.irfft(white, n, axis=0)
            told += Z.T @ Z
    size = np.sqrt(np.diag(told))
    size[size == 0.0] = 1.0
    values, vectors = np.linalg.eigh(told / np.outer(size, size))
    at, shown = bodies - PER_BODY, values > OPEN
    return float(np.sqrt(np.sum(vectors[at, shown] ** 2 / values[shown])) / size[at])
