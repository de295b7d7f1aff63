"""What happens to the joints of `loop_safety`: hands, nudges, faults of the readings; and a `Loop` played against them."""

from __future__ import annotations

from dataclasses import dataclass, field

import _loop_joint as plant
import numpy as np
from _loop_joint import TOP, Joints, M, Q, T, V

from backdrive.control import JointLoop, Loop
from backdrive.status import Status

LASTS = 6.0  # a scene [s]
LATCHED = int(Status.LATCHED)


@dataclass(frozen=True, eq=False)
class Scene:
    """What people do: `hand` grip, position, velocity (n, 3, J), `push` torque (n, J)."""

    hand: np.ndarray
    push: np.ndarray

    def take(self, at: np.ndarray) -> Scene:
        """Return it for some of the joints."""
        return Scene(self.hand[:, :, at], self.push[:, at])


@dataclass(frozen=True, eq=False)
class Fault:
    """What is wrong with the readings.

    Attributes:
        offset: added to the reading, may be NaN (n, J); None: nothing.
        frozen: first and last tick of a reading that stands still (2, J); None: none.
        missed: ticks in which nobody calls (n,); None: none.
        told: whether the caller says how long the interval was.
        turned: whether the drive is wired the wrong way round.
    """

    offset: np.ndarray | None = None
    frozen: np.ndarray | None = None
    missed: np.ndarray | None = None
    told: bool = True
    turned: bool = False


@dataclass(eq=False)
class Record:
    """What a scene came to, (n, J) where nothing else is said.

    Attributes:
        torque: output of the loop.
        codes: `Status`.
        causes: of the latches, at the end (J,).
        speed: |v| at the ticks.
        called: ticks with a call (n,).
        believed: interval that the loop had to believe (n,) [s].
        state: at the end (STATES, J).
        worst: largest torque by its limit, and step by rate and interval (2,).
    """

    torque: np.ndarray
    codes: np.ndarray
    causes: np.ndarray
    speed: np.ndarray
    called: np.ndarray
    believed: np.ndarray
    state: np.ndarray
    worst: np.ndarray
    joints: Joints
    loops: list[JointLoop] = field(repr=False)


def ticks(seconds: float) -> int:
    """Return a time in ticks."""
    return round(seconds / T)


def minimum_jerk(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return place and speed of a stroke of length and duration 1."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 30.0 * s**2 * (1.0 - s) ** 2


def nudge(rng: np.random.Generator, joints: Joints, at: float, push: np.ndarray) -> None:
    """Add a push of 2 to 5 F for 0.1 s, which ends where the joint has 0.3 to 0.8 of its top speed (SHOVE)."""
    J = len(joints)
    force = rng.uniform(2.0, 5.0, J) * joints.friction(0.0) * np.where(rng.random(J) < 0.5, -1.0, 1.0)
    begin, t = at + rng.uniform(0.0, 0.1, J), T * np.arange(len(push))[:, None]
    push += force * ((t >= begin) & (t < begin + 0.1))


def nudged(rng: np.random.Generator, joints: Joints) -> tuple[Joints, Scene]:
    """Return a joint that nobody holds, nudged twice."""
    n, J = ticks(LASTS), len(joints)
    push = np.zeros((n, J))
    nudge(rng, joints, 0.7, push)
    nudge(rng, joints, 3.0, push)
    return joints.with_(SHOVE=rng.uniform(0.3, 0.8, J) * joints.p[TOP]), Scene(np.zeros((n, 3, J)), push)


def guided(
    rng: np.random.Generator, joints: Joints, most: float = 0.9, lasts: float = LASTS, stays: bool = False
) -> tuple[Joints, Scene]:
    """Return a hand that guides in strokes with pauses, and lets go after about 3.2 s, which may be in the middle of a stroke.

    Args:
        rng: of the draws.
        joints: in a hand.
        most: peak speed of the strokes by the top speed.
        lasts: the scene [s].
        stays: it never lets go.
    """
    n, J = ticks(lasts), len(joints)
    fast, duration = rng.uniform(0.3, most, J) * joints.p[TOP], rng.uniform(0.35, 0.9, J)
    length = fast * duration / 1.875
    hand, push, t = np.zeros((n, 3, J)), np.zeros((n, J)), T * np.arange(n)[:, None]
    begin, place, way = np.full(J, 0.2), np.zeros(J), np.where(rng.random(J) < 0.5, -1.0, 1.0)
    hand[:, 0] = 1.0
    while np.any(begin < lasts):
        own = rng.uniform(0.6, 1.0, J) * length
        x, v = minimum_jerk((t - begin) / duration)
        hand[:, 1] += way * own * x
        hand[:, 2] += way * own / duration * v
        place += way * own
        way = -np.sign(place + 1e-12 * way)
        begin = (
            begin
            + duration
            + np.where(rng.random(J) < 0.3, rng.uniform(0.5, 1.2, J), rng.uniform(0.0, 0.2, J))
        )
    omega = rng.uniform(20.0, 40.0, J)
    stiffness = joints.p[M] * omega**2 + 10.0 * joints.friction(0.0) / length
    damping = 1.4 * np.sqrt(stiffness * joints.p[M])
    if not stays:
        hand[:, 0] *= t < rng.uniform(3.0, 3.4, J)
        nudge(rng, joints, 4.0, push)
    shove = rng.uniform(0.3, 0.8, J) * joints.p[TOP]
    return joints.with_(K_H=stiffness, B_H=damping, SHOVE=shove), Scene(hand, push)


def play(joints: Joints, loops: list[JointLoop], scene: Scene, fault: Fault) -> Record:
    """Play a scene with a loop on every joint; the hand's reference is followed within a tick."""
    n, J = scene.push.shape
    loop = Loop(loops, interval=T)
    limit = np.array([one.limit for one in loops])
    rate = np.array([one.normal_rate for one in loops])
    x, way = joints.start(), -1.0 if fault.turned else 1.0
    record = Record(
        np.zeros((n, J)), np.zeros((n, J), dtype=np.int8), np.zeros(J, dtype=int), np.zeros((n, J)),
        np.ones(n, dtype=bool), np.full(n, T), x, np.zeros(2), joints, loops,
    )  # fmt: skip
    queue, column = np.zeros((4, J)), np.arange(J)  # commands on their way, the latest in row k % 4
    held, before, acting, since = np.zeros(J), np.zeros(J), np.zeros(J), 0
    for k in range(n):
        q = joints.read(x)
        if fault.frozen is not None:
            held = np.where(k == fault.frozen[0], q, held)
            q = np.where((fault.frozen[0] <= k) & (k <= fault.frozen[1]), held, q)
        if fault.offset is not None:
            q = q + fault.offset[k]
        since += 1
        torque = before
        if fault.missed is not None and fault.missed[k]:
            record.called[k] = False
        else:
            given = since * T if fault.told and since > 1 else None
            record.believed[k] = T if given is None else given
            loop.update(q, acting, given)
            torque, since = np.array(loop.torque), 0
        record.torque[k], record.codes[k] = torque, loop.codes
        step = np.abs(torque - before) / (rate * record.believed[k])
        with np.errstate(invalid="ignore", divide="ignore"):
            size = np.where(limit > 0.0, np.abs(torque) / limit, np.where(torque == 0.0, 0.0, np.inf))
        record.worst = np.maximum(record.worst, (size.max(), step.max()))  # a NaN stays
        before = torque
        queue[k % 4] = torque
        acting = queue[(k - joints.delay) % 4, column]
        plant.advance(joints.p, x, way * acting, scene.hand[k], scene.push[k])
        record.speed[k] = np.abs(x[V])
    record.causes = np.array(loop.causes)
    return record


def coasted(record: Record, seconds: float = 20.0) -> np.ndarray:
    """Return how far each joint moves in half a second, long after the scene, at no torque and with nobody near [rad]."""
    n, J = ticks(seconds), len(record.joints)
    x, push = record.state.copy(), np.zeros((ticks(0.5), J))
    hand, speeds = np.zeros((len(push), 3, J)), np.zeros((len(push), J))
    before = x[Q]
    for _ in range(n // len(push)):
        before = x[Q].copy()
        plant.untouched(record.joints.p, x, hand, push, 0, speeds)
        if np.all(np.abs(x[Q] - before) < 1e-6):
            break
    return np.abs(x[Q] - before)


def bursts(rng: np.random.Generator, n: int, J: int, begin: float, long: np.ndarray) -> np.ndarray:
    """Return NaN bursts of 1 to 60 ms, a fifth of the time at most, and at 4.2 s one of 0.3 s where `long`, (n, J)."""
    offset = np.zeros((n, J))
    for j in range(J):
        k = ticks(begin + 0.3 * rng.random())
        while k < ticks(4.0):
            lasts = rng.integers(1, 61)
            offset[k : min(k + lasts, ticks(4.0)), j] = np.nan
            k += lasts + 4 * lasts + rng.integers(0, 200)
    offset[ticks(4.2) : ticks(4.5), long] = np.nan
    return offset


def wraps(rng: np.random.Generator, n: int, J: int, begin: float) -> np.ndarray:
    """Return readings that wrap by a turn, one way and 0.5 to 1.5 s later the other way, again and again (n, J)."""
    offset = np.zeros((n, J))
    for j in range(J):
        k, way = ticks(begin + 0.3 * rng.random()), 1.0 if rng.random() < 0.5 else -1.0
        while k < n:
            offset[k:, j] += way * plant.TURN
            k, way = k + ticks(rng.uniform(0.5, 1.5)), -way
    return offset
