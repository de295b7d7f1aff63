"""A joint for `loop_safety` that shares nothing with the package: an elastoplastic slider, a hand, a stop and an encoder.

    M v' = u + tau_h + tau_out - f - tau_stop
    f    = K_c a + D_c a'  while |f| < F(v),  otherwise  |f| = F(v) and a follows from it (the rest slips)
    F(v) = F_+- (1 + s exp(-(v/v_s)^2) + g |v|)

Integrated by backward Euler in friction, 50 substeps a tick of 1 ms. The encoder rounds down to whole counts. A command acts
`delay` ticks after the reading that it was computed from. All draws of a case run side by side, one a column.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba as nb
import numpy as np

T = 1e-3
SUBSTEPS = 50
TURN = 2.0 * np.pi
M, F_P, F_N, GROWTH, STRIBECK, V_S, K_C, D_C, OUT, K_H, B_H, WALL, K_W, B_W, TOP, SHOVE = range(16)
PARAMETERS = 16
Q, V, A, ABOVE, LOST = range(
    5
)  # position, speed, bent contact, time above 1.2 TOP, energy that friction took
STATES = 5


@nb.njit(cache=True, error_model="numpy")
def bound(p, j, v):
    """Return what the joint's friction can hold or resist at a speed."""
    F, slow = (p[F_P, j] if v >= 0.0 else p[F_N, j]), (v / p[V_S, j]) ** 2
    peak = p[STRIBECK, j] * np.exp(-slow) if slow < 36.0 else 0.0
    return F * (1.0 + peak + p[GROWTH, j] * abs(v))


@nb.njit(cache=True, error_model="numpy")
def advance(p, x, u, hand, push):
    """Advance every joint by one tick.

    Args:
        p: parameters, (PARAMETERS, J).
        x: state, written, (STATES, J).
        u: torque of the motor (J,).
        hand: grip, position and velocity of the hand at the begin of the tick (3, J).
        push: torque of a nudge, while the joint is slower than SHOVE along it (J,).
    """
    h = T / SUBSTEPS
    for j in range(u.size):
        m, K, D = p[M, j], p[K_C, j], p[D_C, j]
        q, v, a = x[Q, j], x[V, j], x[A, j]
        spring = K + D / h
        for i in range(SUBSTEPS):
            tau = u[j] + p[OUT, j]
            if push[j] * v < abs(push[j]) * p[SHOVE, j]:  # nobody pushes on what runs away from him
                tau += push[j]
            if hand[0, j] > 0.0:
                at = hand[1, j] + i * h * hand[2, j]
                tau += hand[0, j] * (p[K_H, j] * (at - q) + p[B_H, j] * (hand[2, j] - v))
            if q > p[WALL, j]:
                tau -= max(p[K_W, j] * (q - p[WALL, j]) + p[B_W, j] * v, 0.0)
            new = (v + h / m * (tau - K * a)) / (1.0 + h / m * (K * h + D))
            f = K * (a + h * new) + D * new
            most = bound(p, j, v if abs(v) > abs(new) else new)
            if abs(f) > most:
                f = most if f > 0.0 else -most
                new = v + h / m * (tau - f)
                a = (f + D / h * a) / spring
            else:
                a += h * new
            v = new
            q += h * v
            x[LOST, j] += f * v * h
            if abs(v) > 1.2 * p[TOP, j]:
                x[ABOVE, j] += h
        x[Q, j], x[V, j], x[A, j] = q, v, a


@nb.njit(cache=True, error_model="numpy")
def untouched(p, x, hand, push, begin, speeds):
    """Play all ticks at zero torque of the motor; `hand`: (n, 3, J), `push`: (n, J), `speeds`: |v| at the ticks, written (n, J)."""
    u = np.zeros(x.shape[1])
    for k in range(begin, hand.shape[0]):
        advance(p, x, u, hand[k], push[k])
        speeds[k] = np.abs(x[V])


@dataclass(frozen=True, eq=False)
class Joints:
    """Draws of a joint, a column each.

    Attributes:
        p: parameters (PARAMETERS, J).
        count: step of the encoder [rad], (J,).
        phase: of the encoder's first count [1], (J,).
        delay: of the torque, in ticks (J,).
    """

    p: np.ndarray
    count: np.ndarray
    phase: np.ndarray
    delay: np.ndarray

    def __len__(self) -> int:
        return self.count.size

    def take(self, at: np.ndarray) -> Joints:
        """Return some of them."""
        return Joints(self.p[:, at].copy(), self.count[at], self.phase[at], self.delay[at])

    def with_(self, **rows: np.ndarray | float) -> Joints:
        """Return them with rows of the parameters changed, by the names of this file."""
        p = self.p.copy()
        for name, values in rows.items():
            p[globals()[name]] = values
        return replace(self, p=p)

    def start(self) -> np.ndarray:
        """Return the state at rest (STATES, J)."""
        return np.zeros((STATES, len(self)))

    def read(self, x: np.ndarray) -> np.ndarray:
        """Return what the encoders say (J,)."""
        return np.floor(x[Q] / self.count + self.phase) * self.count

    def friction(self, v: np.ndarray | float) -> np.ndarray:
        """Return the least friction of both directions at a speed [N.m], (J,)."""
        p = self.p
        shape = 1.0 + p[STRIBECK] * np.exp(-((np.asarray(v) / p[V_S]) ** 2)) + p[GROWTH] * np.abs(v)
        return np.minimum(p[F_P], p[F_N]) * shape


def log(rng: np.random.Generator, low: float, high: float, n: int) -> np.ndarray:
    """Return n numbers, even in the logarithm."""
    return low * (high / low) ** rng.random(n)


def drawn(rng: np.random.Generator, n: int) -> Joints:
    """Return n joints.

    F 1 to 30 N.m (L: even in the logarithm), F/M 3 to 60 rad/s^2 L, counts 4096 to 2^17 a turn L, F/K_c 1e-4 to 2e-3 rad L and at
    least a count, directions apart by up to 15 %, Stribeck 0 to 0.3 with v_s 0.02 to 0.1 rad/s, growth 0 to 0.5 F a rad/s, damping
    ratio of the contact 0.05 to 0.3, top speed 1.6 to 6 rad/s L, delay 1 to 3 ticks.
    """
    F, top = log(rng, 1.0, 30.0, n), log(rng, 1.6, 6.0, n)
    count = TURN / np.round(log(rng, 4096.0, 2.0**17, n))
    p = np.zeros((PARAMETERS, n))
    side = rng.uniform(-0.15, 0.15, n)
    p[M] = F / log(rng, 3.0, 60.0, n)
    p[F_P], p[F_N] = F * (1.0 + side), F * (1.0 - side)
    p[GROWTH], p[STRIBECK] = rng.uniform(0.0, 0.5, n), rng.uniform(0.0, 0.3, n)
    p[V_S] = rng.uniform(0.02, 0.1, n)
    p[K_C] = F / np.maximum(log(rng, 1e-4, 2e-3, n), count)
    p[D_C] = 2.0 * rng.uniform(0.05, 0.3, n) * np.sqrt(p[K_C] * p[M])
    p[WALL], p[TOP], p[SHOVE] = np.inf, top, np.inf
    return Joints(p, count, rng.random(n), rng.integers(1, 4, n))


def pulled(rng: np.random.Generator, joints: Joints, some: int) -> Joints:
    """Return joints of which the last ones have an outer torque of 0.1 to 0.5 times their friction."""
    pull = rng.uniform(0.1, 0.5, len(joints)) * np.where(rng.random(len(joints)) < 0.5, -1.0, 1.0)
    last = np.arange(len(joints)) >= len(joints) - some
    return joints.with_(OUT=np.where(last, pull * np.minimum(joints.p[F_P], joints.p[F_N]), 0.0))


def closed_forms() -> dict[str, tuple[float, float]]:
    """Return what the joint does beside its closed form: name -> (simulated, exact)."""
    one = drawn(np.random.default_rng(0), 1).with_(
        M=0.5, F_P=8.0, F_N=6.0, GROWTH=0.0, STRIBECK=0.0, K_C=2e4, D_C=0.0, OUT=0.0
    )
    p, none, idle = one.p, np.zeros(1), np.zeros((3, 1))
    found: dict[str, tuple[float, float]] = {}

    x, k = one.start(), 0
    while x[Q, 0] < 1.01 * 8.0 / 2e4:  # a torque that grows by 1 N.m/s until the joint breaks away
        advance(p, x, np.array([k * T]), idle, none)
        k += 1
    found["break-away [N.m]"] = k * T, 8.0

    for name, v in (("coasting forwards [s]", 2.0), ("coasting backwards [s]", -2.0)):
        x, k = one.start(), 0
        x[V] = v
        x[A] = np.sign(v) * (8.0 if v > 0.0 else 6.0) / 2e4  # slides already
        while x[V, 0] * v > 0.0:
            advance(p, x, none, idle, none)
            k += 1
        found[name] = k * T, 0.5 * abs(v) / (8.0 if v > 0.0 else 6.0)

    thick = one.with_(GROWTH=0.4)  # M v' = -F (1 + g v): stops at M/(F g) ln(1 + g v_0)
    x, k = one.start(), 0
    x[V], x[A] = 2.0, 8.0 / 2e4
    while x[V, 0] > 0.0:
        advance(thick.p, x, none, idle, none)
        k += 1
    found["coasting, viscous [s]"] = k * T, 0.5 / (8.0 * 0.4) * np.log(1.8)

    x, up = (
        one.start(),
        [],
    )  # half the break-away torque at once: an oscillation about F/(2 K_c) at sqrt(K_c/M)
    for k in range(200):
        before = x[V, 0]
        advance(p, x, np.array([3.0]), idle, none)
        if before < 0.0 <= x[V, 0]:
            up.append(k + before / (before - x[V, 0]))
    found["presliding, period [s]"] = (up[-1] - up[0]) / (len(up) - 1) * T, TURN * np.sqrt(0.5 / 2e4)

    many = drawn(np.random.default_rng(1), 200)
    x, rng, stored = many.start(), np.random.default_rng(2), np.zeros(200)
    least = np.zeros(200)
    for k in range(2000):  # what friction took and its contact holds, never gives more than it got
        push = many.p[F_P] * 3.0 * np.sin(0.02 * k + np.arange(200)) * rng.random(200)
        advance(many.p, x, np.zeros(200), np.zeros((3, 200)), push)
        stored = 0.5 * many.p[K_C] * x[A] ** 2
        least = np.minimum(least, (x[LOST] - stored) / (many.p[F_P] ** 2 / many.p[K_C]))
    found["friction gives back beyond what it stored [F^2/K_c]"] = float(-least.min()), 0.0
    return found
