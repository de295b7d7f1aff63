"""External force from encoder and motor torque alone: what accelerates the joint beyond motor, gravity and friction.

    tau_e = M a + g(q) + tau_f - u,        g(q) = A sin q + B cos q + what else is known

u: torque that acted on the interval that ends at this encoder reading, that is, the command of the tick before: with any
later one the estimate would feed on itself. tau_f: of a `FrictionEstimator`. With n = u - g - tau_f the methods are

    direct        M a - n, a of a `MotionFilter`; Iwatani 2017, (4.4), (4.5)
    momentum      r <- L (M v - S - T n)/(1 + L T),   S <- S + T (n + r);  A. De Luca, R. Mattone, IEEE ICRA 2005
    disturbance   y <- (y + L T (M a - n))/(1 + L T), a differenced twice; the same numbers for a constant inertia
    extended      a Luenberger observer of q, v, d = tau_e/M with all poles at exp(-L T)
    kalman        the same observer, its gains from the encoder's count and the rate at which forces vary

v is differenced. The last two take the position as measured and difference nothing: one encoder count moves `disturbance` by
L M count/T and a raw second difference by M count/T^2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from backdrive._jit import choice, jit, ladder, leaf
from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators import sliding_mode
from backdrive.control.estimators.friction import NOTHING, FrictionEstimator
from backdrive.control.estimators.method import Method
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.errors import InvalidInput
from backdrive.parameters import FINITE, POSITIVE, Bounded

FILTER, FRICTION = 9, 14  # places of the rows of filter and friction in the row
ROW = FRICTION + friction_.ROW
STATES = sliding_mode.STATES + 1 + 4  # filter, w, and four of the observer
W, OBSERVER = sliding_mode.STATES, sliding_mode.STATES + 1


@jit
def threefold(L, T):
    """Return the gains, in ticks, of an observer of q, v, d with all poles at exp(-L T)."""
    b = np.exp(-L * T)
    return 1.0 - b * b * b, 1.5 * (1.0 - b) * (1.0 - b) * (1.0 + b), (1.0 - b) * (1.0 - b) * (1.0 - b)


@leaf
def direct(c, i, s, j, q, dp, T, n):
    """M a - n with the acceleration of the filter."""
    return c[i + 1] * sliding_mode.motion(c, i + FILTER, s, j + 0, q, dp, T)[1] - n


@leaf
def momentum(c, i, s, j, q, dp, T, n):
    """The generalised momentum's residual."""
    M, L = c[i + 1], c[i + 4]
    r = L * (M * (dp / T) - s[j + 6] - T * n) / (1.0 + L * T)
    s[j + 6] += T * (n + r)
    return r


@leaf
def disturbance(c, i, s, j, q, dp, T, n):
    """M a - n through a first-order low pass, a differenced twice."""
    M, L, v = c[i + 1], c[i + 4], dp / T
    s[j + 7] = (s[j + 7] + L * T * (M * (v - s[j + 6]) / T - n)) / (1.0 + L * T)
    s[j + 6] = v
    return s[j + 7]


@leaf
def observed(c, i, s, j, q, dp, T, n):
    """An observer: predict with what acted, correct with what was measured."""
    M, L = c[i + 1], c[i + 4]
    g_1, g_2, g_3 = c[i + 5], c[i + 6], c[i + 7]
    if abs(T - c[i + 8]) > 0.1 * c[i + 8]:  # gains are in ticks, those of a tick of another length from L
        g_1, g_2, g_3 = threefold(L, T)
    d = s[j + 8]
    acceleration = n / M + d
    e = q - (s[j + 6] + T * s[j + 7] + 0.5 * T * T * acceleration)
    s[j + 6] = q - (1.0 - g_1) * e
    s[j + 7] += T * acceleration + g_2 * e / T
    s[j + 8] = d + g_3 * e / (T * T)
    return M * s[j + 8]


def by_poles(estimator: ExternalForce, dt: float) -> tuple[float, float, float, float]:
    """Return the gains of an observer with all poles at exp(-L T)."""
    return (*threefold(estimator.bandwidth, dt), estimator.bandwidth)


def stationary(estimator: ExternalForce, dt: float) -> tuple[float, float, float, float]:
    """Return the gains of the stationary Kalman filter for d = tau_e/M that walks at random."""
    from scipy.linalg import solve_discrete_are

    # lengths in counts and times in ticks, so that the equation is well scaled
    A = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    C = np.array([[1.0, 0.0, 0.0]])
    walk = estimator.force_rate / estimator.inertia * np.sqrt(dt) * dt**2 / estimator.encoder_count
    Q, R = np.diag([0.0, 0.0, walk**2]), np.array([[1.0 / 12.0]])
    P = solve_discrete_are(A.T, C.T, Q, R)
    K = (P @ C.T / (C @ P @ C.T + R)).ravel()
    # of a threefold pole that corrects q by as much
    return float(K[0]), float(K[1]), float(K[2]), float(-np.log(1.0 - K[0]) / (3.0 * dt))


DIRECT = Method("direct", direct)
MOMENTUM = Method("momentum", momentum)
DISTURBANCE = Method("disturbance", disturbance)
EXTENDED = Method("extended", observed, gains=by_poles, places=True)
KALMAN = Method("kalman", observed, gains=stationary, places=True)
#: Every method by name. A method is one file and one import of its `Method` above.
KNOWN: dict[str, Method] = {m.name: m for m in globals().values() if isinstance(m, Method)}
METHODS = tuple(KNOWN)

estimate = choice({kind: m.kernel for kind, m in enumerate(KNOWN.values())}, direct)
PLACES = sum(m.places << kind for kind, m in enumerate(KNOWN.values()))


@ladder
def tick(c, i, p, x, s, j, q, dp, dt, u, known, load, temp, level):
    """Return external force and friction of one tick.

    `c[i:]`: row, `p`, `x`: friction law and its state, `s[j:]`: state. q: encoder, dp: its increment, u: torque that acted
    meanwhile, known: torque of gravity and of other joints beyond that of the row, level: factor on the friction.
    """
    tau_f = level * friction_.tick(c, i + FRICTION, p, x, s, j + W, dp, dt, load, temp)
    n = u - known - tau_f
    if c[i + 2] != 0.0 or c[i + 3] != 0.0:
        n -= c[i + 2] * np.sin(q) + c[i + 3] * np.cos(q)
    return estimate(int(c[i]), (c, i, s, j, q, dp, dt, n)), tau_f


@jit
def shift(c, i, s, j, by):
    """Move everything that is a position: the encoder counts from another zero."""
    s[j] += by
    if PLACES >> int(c[i]) & 1:
        s[j + OBSERVER] += by


@jit
def restart(c, i, s, j, q):
    """Forget everything: the joint rests at q."""
    for k in range(STATES):
        s[j + k] = 0.0
    shift(c, i, s, j, q)


@dataclass(frozen=True, kw_only=True)
class ExternalForce(Bounded):
    """An estimator of the external force on one joint.

    Attributes:
        inertia: M, of motor and load together [kg.m^2 or kg].
        friction: what is taken as friction.
        method: `direct`, `momentum`, `disturbance`, `extended` or `kalman`.
        filter: of the encoder, for `direct`.
        bandwidth: L of the observers [1/s].
        gravity_sin: A [N.m or N].
        gravity_cos: B [N.m or N].
        force_rate: for `kalman`, standard deviation of the force's change in one second [N.m or N].
        encoder_count: for `kalman`, step of the encoder [rad or m].
    """

    BOUNDS: ClassVar = dict.fromkeys(("inertia", "bandwidth", "force_rate", "encoder_count"), POSITIVE) | {
        "gravity_sin": FINITE,
        "gravity_cos": FINITE,
    }
    CHOICES: ClassVar = {"method": METHODS}

    inertia: float
    friction: FrictionEstimator = field(default_factory=lambda: NOTHING)
    method: str = "direct"
    filter: MotionFilter = field(default_factory=MotionFilter)
    bandwidth: float = 100.0
    gravity_sin: float = 0.0
    gravity_cos: float = 0.0
    force_rate: float = 50.0
    encoder_count: float = 1e-6

    def row(self, dt: float) -> np.ndarray:
        """Return the row that `tick` reads, (21,)."""
        c = np.zeros(ROW)
        c[:5] = (
            METHODS.index(self.method),
            self.inertia,
            self.gravity_sin,
            self.gravity_cos,
            self.bandwidth,
        )
        c[8] = dt
        gains = KNOWN[self.method].gains
        if gains is not None:
            *c[5:8], c[4] = gains(self, dt)
        c[FILTER:FRICTION], c[FRICTION:] = self.filter.row(), self.friction.row()
        return c

    def start(self, position: float) -> np.ndarray:
        """Return the state of a joint at rest at a position, (10,)."""
        s = np.zeros(STATES)
        s[0] = position
        if KNOWN[self.method].places:
            s[OBSERVER] = position
        return s

    def run(
        self,
        position: np.ndarray,
        torque: np.ndarray,
        dt: float,
        known: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return external force and friction along a log.

        Args:
            position: encoder readings [rad or m], (n,).
            torque: commands of the ticks; command k acts after reading k [N.m or N], (n,).
            dt: sampling time [s].
            known: torque of gravity and other joints [N.m or N], (n,); None: that of `gravity_sin`, `gravity_cos` alone. All of
                it is the load of a law that grows.

        Returns:
            External force and friction [N.m or N], (n,) each.

        Raises:
            InvalidInput: the series have different lengths.
        """
        series = (position, torque, np.zeros(np.size(position)) if known is None else known)
        q, u, g = (np.ascontiguousarray(x, dtype=np.float64) for x in series)
        if q.ndim != 1 or q.shape != u.shape or q.shape != g.shape or q.size == 0:
            raise InvalidInput(
                f"position {q.shape}, torque {u.shape}, known {g.shape}.", remedy="Give series of one length."
            )
        out = np.empty((q.size, 2))
        law = self.friction.law
        outside = np.zeros(1)
        if law.growth is not None:
            carried = g + self.gravity_sin * np.sin(q) + self.gravity_cos * np.cos(q)
            told = known is not None or self.gravity_sin != 0.0 or self.gravity_cos != 0.0
            outside = -carried if told else np.full(1, np.nan)
        along(self.row(dt), law.row(), law.state(), self.start(float(q[0])), q, u, g, outside, dt, out)
        force, friction = out.T
        return force, friction


@jit
def along(c, p, x, s, q, u, known, outside, dt, out):
    """Fill `out` with external force and friction along a log; `outside`: external torque that laws see, (n,) or (1,)."""
    for k in range(q.size):
        before = k - 1 if k > 0 else 0
        out[k, 0], out[k, 1] = tick(
            c,
            0,
            p,
            x,
            s,
            0,
            q[k],
            q[k] - q[before],
            dt,
            u[before] if k > 0 else known[0],
            known[k],
            (u[before], outside[k if outside.size > 1 else 0]),
            20.0,
            1.0,
        )
