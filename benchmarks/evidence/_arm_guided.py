"""The independent six-axis arm under a loop: bodies by MuJoCo, motors, transmissions and friction of `_arm_scene`, a soft hand.

    links:   M(q) q'' + h(q, q') + g(q) = c + J_t^T w,     c = K (C p - q) + D (C p' - q')
    motors:  M_m p'' = u - C^T c - f(p', z)

The hand holds the tool with a spring and a damper, in place and in orientation, between its own path and the tool. MuJoCo gives M,
h + g and J_t once a tick; motors, transmissions and friction are integrated in ten steps a tick. A command acts a tick after the
reading that it was computed from. Nothing here is of the package.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from _arm_scene import _friction
from _arm_truth import COUNT, POSTURE, STIFF, TICK, Arm, J
from numba import njit

INNER = 10
LATCHED, BRAKE = 9, 400  # the loop's word for a motor that is latched, and ticks until its brake holds
HOLD, DAMP, HOLD_TURN, DAMP_TURN = 800.0, 40.0, 25.0, 1.0  # of the hand [N/m, N.s/m, N.m/rad, N.m.s/rad]


@njit(error_model="numpy")
def _advance(joints, C, Minv, bias, u, braked, p, w, q, v, z, load):
    """Advance motors and links by a tick; `braked`: motors that are held, (J,), `load`: room, (2, J)."""
    n, h = p.size, TICK / INNER
    c, back = load
    for _ in range(INNER):
        for i in range(n):
            bent, rate = -q[i], -v[i]
            for j in range(n):
                bent += C[i, j] * p[j]
                rate += C[i, j] * w[j]
            c[i] = joints[i, 1] * bent + joints[i, 2] * rate
        for j in range(n):
            back[j] = 0.0
            for i in range(n):
                back[j] += C[i, j] * c[i]
            f, z[j] = _friction(joints, j, w[j], z[j], abs(back[j]), p[j], 1.0, h)
            w[j] = 0.0 if braked[j] else w[j] + h / joints[j, 0] * (u[j] - back[j] - f)
        for i in range(n):
            for j in range(n):
                v[i] += h * Minv[i, j] * (c[j] - bias[j])
        for i in range(n):
            p[i] += h * w[i]
            q[i] += h * v[i]


class Machine:
    """An arm, stepped tick by tick.

    Attributes:
        q: true positions of the links [rad], (J,).
        v: their velocities [rad/s], (J,).
        p: positions of the motors [rad], (J,).
        w: their velocities [rad/s], (J,).
    """

    def __init__(self, arm: Arm, posture: np.ndarray = POSTURE):
        """Let an arm rest at a posture, each transmission bearing its weight."""
        mujoco: Any = import_module("mujoco")
        self._mujoco, self.arm = mujoco, arm
        xml = arm.mjcf(payload=True).replace("<option", '<compiler angle="radian"/><option')
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data, self.site = mujoco.MjData(self.model), self.model.site("tool").id
        self.q, self.v, self.w, self.z = posture.copy(), np.zeros(J), np.zeros(J), np.zeros(J)
        self.look()
        self.weight = self.data.qfrc_bias.copy()
        self.p = np.linalg.solve(arm.coupling, posture + self.weight / arm.joints[:, STIFF])
        self.held = arm.coupling.T @ self.weight  # by the motors

    def look(self) -> None:
        """Have MuJoCo compute the rigid bodies where they are now."""
        self.data.qpos[:], self.data.qvel[:] = self.q, self.v
        self._mujoco.mj_forward(self.model, self.data)

    def read(self) -> np.ndarray:
        """Return what the encoders of the motors read [rad], (J,)."""
        counts = self.arm.joints[:, COUNT]
        return np.floor(self.p / counts + 0.5) * counts

    def tool(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return place, (3,), orientation, (3, 3), and Jacobian, (6, J), of the tool."""
        jacobian = np.zeros((6, J))
        self._mujoco.mj_jacSite(self.model, self.data, jacobian[:3], jacobian[3:], self.site)
        return (
            self.data.site_xpos[self.site].copy(),
            self.data.site_xmat[self.site].reshape(3, 3).copy(),
            jacobian,
        )

    def step(self, command: np.ndarray, pushed: np.ndarray, braked: np.ndarray | None = None) -> None:
        """Advance by a tick, after `look`; `pushed`: torque of the hand on the joints [N.m], `braked`: motors, (J,) each."""
        M, room = np.zeros((J, J)), np.zeros((2, J))
        self._mujoco.mj_fullM(self.model, self.data, M)
        bias = self.data.qfrc_bias - pushed
        state = (self.p, self.w, self.q, self.v, self.z)
        braked = np.zeros(J, dtype=bool) if braked is None else braked
        _advance(self.arm.joints, self.arm.coupling, np.linalg.inv(M), bias, command, braked, *state, room)


@dataclass(frozen=True, eq=False)
class Run:
    """What came of a run, a row a tick.

    Attributes:
        force: of the hand [N], (n, 3).
        moment: of the hand [N.m], (n, 3).
        link: true positions of the links [rad], (n, J).
        speed: true velocities of the motors [rad/s], (n, J).
        torque: of the loop, (4, n, J): all, gravity, compensation, drive [N.m].
        estimate: external torque, estimated and true [N.m], (2, n, J).
        codes: `Status`, (n, J).
        causes: of latches at the end.
    """

    force: np.ndarray
    moment: np.ndarray
    link: np.ndarray
    speed: np.ndarray
    torque: np.ndarray
    estimate: np.ndarray
    codes: np.ndarray
    causes: tuple
    machine: Machine


def minimum_jerk(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return place and speed of a stroke of length and duration 1."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 30.0 * s**2 * (1.0 - s) ** 2


def strokes(
    rng: np.random.Generator, seconds: float, size: float = 0.14, duration: float = 0.8
) -> tuple[np.ndarray, np.ndarray]:
    """Return a hand's path in strokes of random directions about where it begins [m] and its velocity [m/s], (n, 3) each."""
    n = round(seconds / TICK)
    x, v, at, k = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(3), round(0.7 / TICK)
    while k < n:
        way = rng.normal(size=3)
        goal = size * rng.uniform(0.5, 1.0) * way / np.linalg.norm(way)
        lasts = duration * rng.uniform(0.8, 1.3) * max(0.6, np.linalg.norm(goal - at) / size)
        place, rate = minimum_jerk(np.arange(n - k) * TICK / lasts)
        x[k:], v[k:] = at + place[:, None] * (goal - at), rate[:, None] * (goal - at) / lasts
        at, k = goal, k + round((lasts + rng.uniform(0.0, 0.4)) / TICK)
    return x, v


def play(
    machine: Machine,
    loop: Any,
    path: np.ndarray,
    velocity: np.ndarray,
    *,
    grip: np.ndarray | None = None,
    stiff: float = 1.0,
    nudge: np.ndarray | None = None,
    fault: Any = None,
    way: np.ndarray | float = 1.0,
) -> Run:
    """Play a hand's path with a loop.

    Args:
        machine: advanced in place.
        loop: of the arm.
        path: of the hand, from where the tool begins [m], (n, 3).
        velocity: of the hand [m/s], (n, 3).
        grip: where the hand holds the tool, (n,); None: always.
        stiff: factor on the hand.
        nudge: torque on the joints, each while it is slower than 1 rad/s along it [N.m], (n, J); None: none.
        fault: of a tick's number and a reading gives reading and interval of the call, or None where nobody calls.
        way: -1 of motors that are wired the wrong way round, (J,).

    A motor that has been latched for 0.4 s is held by its brake.
    """
    n = len(path)
    loop.reset(machine.read(), gravity=1.0)
    start, upright, _ = machine.tool()
    waiting = [machine.held.copy(), machine.held.copy()]
    since, force, moment = np.zeros(J), np.zeros((n, 3)), np.zeros((n, 3))
    link, speed, codes = np.zeros((n, J)), np.zeros((n, J)), np.zeros((n, J), dtype=np.int64)
    torque, estimate = np.zeros((4, n, J)), np.zeros((2, n, J))
    for k in range(n):
        machine.look()
        reading = machine.read()
        call = (reading, None) if fault is None else fault(k, reading)
        if call is not None:
            loop.update(call[0], waiting[0], call[1])
        waiting = [waiting[1], loop.torque.copy()]
        place, turned, jacobian = machine.tool()
        if grip is None or grip[k] > 0.0:
            rate = jacobian @ machine.v
            R = upright @ turned.T
            turn = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
            force[k] = stiff * (HOLD * (start + path[k] - place) + DAMP * (velocity[k] - rate[:3]))
            moment[k] = stiff * (HOLD_TURN * turn - DAMP_TURN * rate[3:])
        pushed = jacobian.T @ np.concatenate([force[k], moment[k]])
        link[k], speed[k], codes[k] = machine.q, machine.w, loop.codes
        torque[:, k] = loop.torque, loop.gravity, loop.compensation, loop.drive
        estimate[:, k] = loop.external, pushed
        if nudge is not None:
            pushed = pushed + np.where(nudge[k] * machine.v < np.abs(nudge[k]), nudge[k], 0.0)
        since = np.where(loop.codes == LATCHED, since + 1, 0)
        machine.step(way * waiting[0], pushed, since > BRAKE)
    return Run(force, moment, link, speed, torque, estimate, codes, loop.causes, machine)
