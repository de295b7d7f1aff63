"""A simulated arm guided by a hand at its grip: compensated joints move, and position controllers hold the others.

The hand is a spring and a damper in space, between its own path and the grip: F = K_h (x_h - x) + B_h (x_h' - x'). On the
joints it acts as J(q)' F. Every tick of every compensated joint is the kernel of `control.loop`, in one fused call.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from backdrive.control.arm_loop import ArmLoop
from backdrive.control.loop import JointLoop, Loop
from backdrive.engine.servo import STATES, Servo
from backdrive.engine.servo import tick as servo_tick
from backdrive.errors import InvalidInput
from backdrive.simulation.arm import Arm, ArmRecord
from backdrive.simulation.hand import Hand, minimum_jerk


class _Loop(Loop):
    """A loop for simulation only: its joints may have no guards, as in `closed_loop`."""

    def _admit(self) -> None:
        pass


def polygon(
    corners: Sequence[Sequence[float]],
    *,
    dt: float,
    duration: float,
    interval: float,
    rounds: int,
    start: float = 0.3,
    variation: float = 0.0,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return a hand's path along a polygon, a minimum-jerk stroke a side: positions [m] and velocities [m/s], (n, 3) each.

    With variation, a hand ends a stroke beside the corner, and start and duration vary from stroke to stroke, as in
    `hand.strokes`.

    Args:
        corners: relative to the grip's first position, which is the first corner [m].
        dt: sampling time [s].
        duration: of a stroke [s].
        interval: between the beginnings of strokes [s].
        rounds: how often the polygon is gone around.
        start: time before the first stroke [s].
        variation: standard deviation of length, duration and (in intervals) of the beginning, from stroke to stroke [-].
        seed: of the variation.
    """
    points = np.asarray(corners, dtype=np.float64)
    rng = np.random.default_rng(seed)
    count = rounds * len(points)
    t = dt * np.arange(round((start + count * interval) / dt))
    x, v = np.zeros((t.size, 3)), np.zeros((t.size, 3))
    x += points[0]
    at = points[0]
    for i in range(count):
        z = variation * np.clip(rng.standard_normal(3), -2.5, 2.5)
        goal = points[(i + 1) % len(points)]
        goal = goal + z[0] * (goal - points[i % len(points)])
        D = min(duration * (1.0 + z[1]), interval * (1.0 - abs(z[2])))
        share, rate = minimum_jerk((t - start - interval * (i + max(z[2], 0.0))) / D)
        x += share[:, None] * (goal - at)
        v += rate[:, None] * (goal - at) / D
        at = goal
    return x, v


def guide(
    arm: Arm,
    path: np.ndarray,
    velocity: np.ndarray,
    *,
    hand: Hand,
    loops: Mapping[int, JointLoop],
    servos: Mapping[int, Servo],
    period: float = 1e-3,
    delay: int = 0,
) -> ArmRecord:
    """Let a hand move the arm's grip along a path, and return the record.

    Args:
        arm: advanced in place.
        path: of the hand, relative to where the grip begins [m], (n, 3).
        velocity: of the hand [m/s], (n, 3).
        hand: stiffness [N/m] and damping [N.s/m].
        loops: what runs on the joints that are free to move; the arm's weight is held.
        servos: of the joints that are held where they are.
        period: of the loop [s].
        delay: ticks until a command acts.

    Raises:
        InvalidInput: a joint has neither a loop nor a servo, or has both, or the path has another shape.
    """
    J, n = len(arm.joints), len(path)
    if (
        sorted([*loops, *servos]) != list(range(J))
        or np.shape(path) != (n, 3)
        or np.shape(velocity) != (n, 3)
    ):
        raise InvalidInput(
            f"loops for {sorted(loops)}, servos for {sorted(servos)}, path {np.shape(path)}.",
            remedy=f"Give every joint of 0 to {J - 1} either a loop or a servo, and a path (n, 3).",
        )
    free, fixed = sorted(loops), sorted(servos)
    loop = _Loop([loops[j] for j in free], interval=period)
    reading = arm.reading()
    loop.reset(reading[free])
    states = {j: np.zeros(STATES) for j in fixed}
    rows = {j: servos[j].row() for j in fixed}
    goal = reading.copy()
    for j in fixed:
        states[j][1] = goal[j]
        if rows[j][2] > 0.0:
            states[j][0] = arm.weight[j] / rows[j][2]
    begin = arm.grip()[0]
    columns = {
        name: np.zeros((n, J)) for name in ("reading", "command", "compensation", "estimate", "hand", "load")
    }
    force, place = np.zeros((n, 3)), np.zeros((n, 3))
    waiting = [arm.weight.copy() for _ in range(delay + 1)]  # commands on their way, the oldest first
    for k in range(n):
        reading = arm.reading()
        weight = arm.data.qfrc_bias
        loop.known[:] = 0.0
        loop.update(reading[free], (waiting[0] - weight)[free])
        x, jacobian = arm.grip()
        place[k] = x
        force[k] = hand.stiffness * (begin + path[k] - x) + hand.damping * (
            velocity[k] - jacobian @ arm.load_velocity
        )
        pushed = jacobian.T @ force[k]
        command = np.zeros(J)
        command[free] = weight[free] + loop.torque
        for j in fixed:
            limit = arm.joints[j].torque_limit
            command[j] = servo_tick(rows[j], 0, states[j], period, goal[j], 0.0, reading[j], limit)
        columns["reading"][k], columns["command"][k], columns["load"][k] = reading, command, arm.load
        columns["compensation"][k, free], columns["estimate"][k, free] = loop.torque, loop.external
        columns["hand"][k] = pushed
        waiting = [*waiting[1:], command]
        arm.step(waiting[0], pushed, period)
    return ArmRecord(time=period * np.arange(n), force=force, grip=place, **columns)


def guide_whole(
    arm: Arm,
    path: np.ndarray,
    velocity: np.ndarray,
    *,
    hand: Hand,
    wrist: Hand | None = None,
    loop: ArmLoop,
    grip: np.ndarray | None = None,
    delay: int = 1,
    sensor: Callable[[int, np.ndarray], np.ndarray] | None = None,
) -> ArmRecord:
    """Let a hand move the grip of an arm under an `ArmLoop`, and return the record.

    Before, a controller has held the arm.

    Args:
        arm: advanced in place.
        path: of the hand, relative to where the grip begins [m], (n, 3).
        velocity: of the hand [m/s], (n, 3).
        hand: stiffness [N/m] and damping [N.s/m].
        wrist: stiffness [N.m/rad] and damping [N.m.s/rad] by which the hand holds the grip's orientation; None: it does not.
        loop: what runs on the arm.
        grip: 1 where the hand holds the grip, 0 where it has let go, (n,); None: it always does.
        delay: ticks until a command acts.
        sensor: function of the tick's number and the encoders' readings that returns the loop's readings; None: the encoders'
            readings.

    Raises:
        InvalidInput: the path has another shape, or the loop is of another number of joints.
    """
    J, n = len(arm.joints), len(path)
    if np.shape(path) != (n, 3) or np.shape(velocity) != (n, 3) or len(loop.joints) != J:
        raise InvalidInput(
            f"path {np.shape(path)}, velocity {np.shape(velocity)}, a loop of {len(loop.joints)} joints for an arm of {J}.",
            remedy="Give a path and its velocity (n, 3), and a loop of the arm's joints.",
        )
    loop.reset(arm.reading(), gravity=1.0)
    start, upright = arm.grip()[0], arm.turn()[0]
    holds = np.ones(n) if grip is None else np.asarray(grip, dtype=np.float64)
    columns = {
        name: np.zeros((n, J)) for name in ("reading", "command", "compensation", "estimate", "hand", "load")
    }
    force, moment, codes = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, J), dtype=np.int64)
    waiting = [arm.weight.copy() for _ in range(delay + 1)]  # commands on their way, the oldest first
    for k in range(n):
        reading = arm.reading()
        loop.update(reading if sensor is None else sensor(k, reading), waiting[0])
        waiting = [*waiting[1:], loop.torque.copy()]
        x, jacobian = arm.grip()
        force[k] = holds[k] * (
            hand.stiffness * (start + path[k] - x)
            + hand.damping * (velocity[k] - jacobian @ arm.load_velocity)
        )
        pushed = jacobian.T @ force[k]
        if wrist is not None:
            now, turning = arm.turn()
            moment[k] = holds[k] * (
                wrist.stiffness * _rotation(upright @ now.T) - wrist.damping * (turning @ arm.load_velocity)
            )
            pushed += turning.T @ moment[k]
        columns["reading"][k], columns["command"][k], columns["load"][k] = reading, waiting[0], arm.load
        columns["compensation"][k], columns["estimate"][k] = loop.compensation, loop.external
        columns["hand"][k], codes[k] = pushed, loop.codes
        arm.step(waiting[0], pushed, loop.interval)
    return ArmRecord(time=loop.interval * np.arange(n), force=force, moment=moment, codes=codes, **columns)


def _rotation(R: np.ndarray) -> np.ndarray:
    """Return the rotation vector of a small turn [rad], (3,)."""
    return 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
