"""External force from encoder and motor torque alone: the part of the joint's acceleration that motor, gravity and friction
do not explain.

    tau_e = M a + g(q) + tau_f - u,        g(q) = A sin q + B cos q + what else is known

u: torque that acted in the interval that ends at this encoder reading, that is, the command of the previous tick. With a
later command the estimate would contain its own effect. tau_f: of a `FrictionEstimator`. With n = u - g - tau_f the methods
are

    direct        M a - n, a of a `MotionFilter`; Iwatani 2017, (4.4), (4.5)
    momentum      r <- L (M v - S - T n)/(1 + L T),   S <- S + T (n + r);  A. De Luca, R. Mattone, IEEE ICRA 2005
    disturbance   y <- (y + L T (M a - n))/(1 + L T), a differenced twice; the same numbers for a constant inertia
    extended      a Luenberger observer of q, v, d = tau_e/M with all poles at one place, exp(-p T)
    kalman        the same observer, its gains those of a stationary Kalman filter

L has the same meaning for all methods: the estimate of a force that grows at a constant rate lags by 1/L + T, and a constant
force is estimated without error. `lag` returns this lag. It determines p, about 3 L, and the default force rate of the Kalman
filter. For `direct` the filter determines the lag (`MotionFilter.of_bandwidth`). For `momentum` and `disturbance`, v is the
differenced position. `extended` and `kalman` use the measured position and difference nothing. For comparison, one encoder
count changes `disturbance` by L M count/T, and a raw second difference by M count/T^2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, overload

import numpy as np

from backdrive._assembly import assemble
from backdrive._jit import choice, jit, ladder, leaf
from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators import sliding_mode
from backdrive.control.estimators.friction import NOTHING, FrictionEstimator
from backdrive.control.estimators.gains import by_poles, stationary, threefold
from backdrive.control.estimators.gains import lag as lag_of
from backdrive.control.estimators.method import Method
from backdrive.control.estimators.of_model import COUNT, fields
from backdrive.control.estimators.series import check_series, on_time
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.elementary import cos, sin
from backdrive.errors import InvalidInput
from backdrive.laws import kernels
from backdrive.parameters import FINITE, NOT_NEGATIVE, POSITIVE, WithBounds

if TYPE_CHECKING:
    from backdrive.control.estimators.arm import ArmForce
    from backdrive.model import FrictionModel
    from backdrive.robot import Robot

OFFSET, FILTER, FRICTION = 9, 10, 15  # places of the offset and of the rows of filter and friction in the row
ROW = FRICTION + friction_.ROW
STATES = sliding_mode.STATES + 1 + 4  # filter, w, and four of the observer
W, OBSERVER = sliding_mode.STATES, sliding_mode.STATES + 1


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
def observe(c, i, s, j, q, dp, T, n):
    """An observer: predict with the applied torque, correct with the measured position."""
    M, L = c[i + 1], c[i + 4]
    g_1, g_2, g_3 = c[i + 5], c[i + 6], c[i + 7]
    if abs(T - c[i + 8]) > 0.1 * c[i + 8]:  # gains depend on the tick: new ones for another length
        g_1, g_2, g_3 = threefold(L, T)
    d = s[j + 8]
    acceleration = n / M + d
    e = q - (s[j + 6] + T * s[j + 7] + 0.5 * T * T * acceleration)
    s[j + 6] = q - (1.0 - g_1) * e
    s[j + 7] += T * acceleration + g_2 * e / T
    s[j + 8] = d + g_3 * e / (T * T)
    return M * s[j + 8]


DIRECT = Method("direct", direct)
MOMENTUM = Method("momentum", momentum, speed=6, of_mass=True)
DISTURBANCE = Method("disturbance", disturbance, speed=6)
EXTENDED = Method("extended", observe, gains=by_poles, places=True, speed=7)
KALMAN = Method("kalman", observe, gains=stationary, places=True, speed=7)
#: Every method by name. To add one, write its file and import its `Method` above.
KNOWN: dict[str, Method] = {m.name: m for m in globals().values() if isinstance(m, Method)}
METHODS = tuple(KNOWN)

estimate = choice({kind: m.kernel for kind, m in enumerate(KNOWN.values())}, direct)
HEAVY = True  # a row may hold a torque of gravity
PLACES = sum(m.places << kind for kind, m in enumerate(KNOWN.values()))


@ladder
def tick(c, i, p, x, s, j, q, dp, dt, u, known, load, temp, level):  # noqa: PLR0913  (a kernel's row)
    """Return external force and friction of one tick.

    `c[i:]`: row. `p`, `x`: friction law and its state. `s[j:]`: state. q: encoder. dp: its increment. u: torque that acted since
    the last tick. known: torque of gravity and of other joints that the row does not contain. level: factor on the friction.
    """
    tau_f = level * friction_of(c, i, p, x, s, j, dp, dt, load, temp)
    return force(c, i, s, j, q, dp, dt, u, known, tau_f), tau_f


@ladder
def friction_of(c, i, p, x, s, j, dp, dt, load, temp):
    """Return the friction of one tick at level 1; the arguments are those of `tick`."""
    return friction_.tick(c, i + FRICTION, p, x, s, j + W, dp, dt, load, temp)


@ladder
def force(c, i, s, j, q, dp, dt, u, known, tau_f):
    """Return the external force of one tick from the friction tau_f; the other arguments are those of `tick`."""
    n = u - known - tau_f - c[i + OFFSET]
    if HEAVY and (c[i + 2] != 0.0 or c[i + 3] != 0.0):
        n -= c[i + 2] * sin(q) + c[i + 3] * cos(q)
    return estimate(int(c[i]), (c, i, s, j, q, dp, dt, n))


@jit
def shift(c, i, s, j, by):
    """Shift all positions, after a change of the encoder's zero."""
    s[j] += by
    if PLACES >> int(c[i]) & 1:
        s[j + OBSERVER] += by


@jit
def restart(c, i, s, j, q):
    """Reset all states to a joint at rest at q."""
    for k in range(STATES):
        s[j + k] = 0.0
    shift(c, i, s, j, q)


@dataclass(frozen=True, kw_only=True)
class ExternalForce(WithBounds):
    """An estimator of the external force on one joint.

    Attributes:
        inertia: M, of motor and load together [kg.m^2 or kg].
        friction: what is taken as friction.
        method: `direct`, `momentum`, `disturbance`, `extended` or `kalman`.
        filter: of the encoder, for `direct`.
        bandwidth: L of the observers [1/s].
        gravity_sin: A [N.m or N].
        gravity_cos: B [N.m or N].
        offset: constant torque of a model beside friction [N.m or N].
        force_rate: for `kalman`, standard deviation of the force's change in one second [N.m or N]; None: that of `bandwidth`.
        encoder_count: for a `kalman` with a force rate, step of the encoder [rad or m].
        delay: by which the torque of a log is recorded later than motion; `run` takes it out [s]. A loop passes the torque as it
            acts, so `tick` does not.
        noise: standard deviation of the torque's noise from sample to sample [N.m or N]; None: not known.
    """

    BOUNDS: ClassVar = dict.fromkeys(("inertia", "bandwidth", "force_rate", "encoder_count"), POSITIVE) | {
        "gravity_sin": FINITE,
        "gravity_cos": FINITE,
        "offset": FINITE,
        "delay": FINITE,
        "noise": NOT_NEGATIVE,
    }
    CHOICES: ClassVar = {"method": METHODS}

    inertia: float
    friction: FrictionEstimator = field(default_factory=lambda: NOTHING)
    method: str = "direct"
    filter: MotionFilter = field(default_factory=MotionFilter)
    bandwidth: float = 100.0
    gravity_sin: float = 0.0
    gravity_cos: float = 0.0
    offset: float = 0.0
    force_rate: float | None = None
    encoder_count: float = COUNT
    delay: float = 0.0
    noise: float | None = None

    @overload
    @classmethod
    def from_model(
        cls, model: FrictionModel, joint: str | int, method: str = "momentum", bandwidth: float = 50.0
    ) -> ExternalForce: ...

    @overload
    @classmethod
    def from_model(
        cls, model: FrictionModel, joint: Path | Robot, method: str = "momentum", bandwidth: float = 50.0
    ) -> ArmForce: ...

    @classmethod
    def from_model(
        cls, model: FrictionModel, joint: Any, method: str = "momentum", bandwidth: float = 50.0
    ) -> Any:
        """Return an estimator from a model of a joint: inertia, gravity, offset, friction and its growth with load, delay and
        noise of the torque, step of the encoder.

        Where the model holds no delay it is 0, where it holds no noise None, and without counts the step is 1e-6 (`COUNT`).

        Args:
            model: of friction.
            joint: name or number. For a whole arm, the path of its description or the `Robot`: this calls
                `ArmForce.from_model`, which also takes a frame.
            method: as above.
            bandwidth: L [1/s].

        Raises:
            NotIdentifiable: the model holds no inertia of the joint.
            InvalidInput: the model is of a whole arm, whose joints have no inertia and gravity of their own.
        """
        described = isinstance(joint, str) and joint not in model.names and Path(joint).is_file()
        if described or not isinstance(joint, str | int):
            from backdrive.control.estimators.arm import ArmForce

            return ArmForce.from_model(model, joint, method=method, bandwidth=bandwidth)
        own = model.joint(joint)
        if model.arm is not None:
            raise InvalidInput(
                f"The model is of a whole arm: inertia and gravity of the links that '{own.joint.name}' moves are in its bodies.",
                remedy="Take ArmForce.from_model(model, ROBOT), with the description that it was identified with.",
            )
        return cls(**fields(own, method, bandwidth))

    def lag(self, dt: float) -> float:
        """Return the lag of the estimate for a force that grows at a constant rate [s]; NaN for `direct`, whose filter is
        nonlinear.

        Args:
            dt: sampling time [s].
        """
        if self.method == "direct":
            return float("nan")
        if KNOWN[self.method].gains is None:
            return 1.0 / self.bandwidth + dt
        return lag_of(self.row(dt)[5:8]) * dt

    def row(self, dt: float) -> np.ndarray:
        """Return the row that `tick` reads, (23,)."""
        c = np.zeros(ROW)
        c[:5] = (
            METHODS.index(self.method),
            self.inertia,
            self.gravity_sin,
            self.gravity_cos,
            self.bandwidth,
        )
        c[8], c[OFFSET] = dt, self.offset
        gains = KNOWN[self.method].gains
        if gains is not None:
            *c[5:8], c[4] = gains(self, dt)
        c[FILTER:FRICTION], c[FRICTION:] = self.filter.row(), self.friction.row()
        return c

    def start(self, position: float, velocity: float = 0.0) -> np.ndarray:
        """Return the state of a joint that moves freely through a position, (10,)."""
        s, method = np.zeros(STATES), KNOWN[self.method]
        s[0], s[1], s[2] = position, velocity, velocity
        if method.places:
            s[OBSERVER] = position
        if method.speed:
            s[method.speed] = velocity * (self.inertia if method.of_mass else 1.0)
        return s

    def run(
        self,
        position: np.ndarray,
        torque: np.ndarray,
        dt: float,
        known: np.ndarray | None = None,
        velocity: float = 0.0,
        temperature: np.ndarray | float | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return external force and friction along a log.

        Args:
            position: encoder readings [rad or m], (n,).
            torque: commands of the ticks; command k acts after reading k, `delay` before it is recorded [N.m or N], (n,).
            dt: sampling time [s].
            known: torque of gravity and other joints [N.m or N], (n,); None: that of `gravity_sin`, `gravity_cos` alone. All of
                it is the load of a law that grows.
            velocity: at the first reading [rad/s or m/s]; 0: the joint rests, and its motor carries what is known.
            temperature: for laws that depend on it [degC], one number or (n,); None: 20.

        Returns:
            External force and friction [N.m or N], (n,) each.

        Raises:
            InvalidInput: the series have different lengths, or a temperature is not finite.
        """
        q, u, g, warmth = check_series(position, torque, known, temperature)
        u = on_time(u, self.delay, dt)
        out = np.empty((q.size, 2))
        law = self.friction.law
        outside = np.zeros(1)
        if law.growth is not None:
            carried = g + self.gravity_sin * np.sin(q) + self.gravity_cos * np.cos(q)
            told = known is not None or self.gravity_sin != 0.0 or self.gravity_cos != 0.0
            outside = -carried if told else np.full(1, np.nan)
        begin = (velocity * dt, float(u[0] if velocity else g[0]))
        state = self.start(float(q[0]) - velocity * dt, velocity)
        row = self.row(dt)
        parts = kernels.parts([law.rate.KIND], [law.element.KIND]) | {estimate: int(row[0])}
        assemble(along, parts)(row, law.row(), law.state(), state, q, u, g, outside, warmth, begin, dt, out)
        force, friction = out.T
        return force, friction


@jit
def along(c, p, x, s, q, u, known, outside, warmth, begin, dt, out):  # noqa: PLR0913  (a kernel's row)
    """Fill `out` with external force and friction along a log.

    `outside`: external torque that laws see, (n,) or (1,); `warmth`: temperature, (n,) or (1,); `begin`: increment of the first
    tick, and torque that acted in it.
    """
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
            q[k] - q[before] if k > 0 else begin[0],
            dt,
            u[before] if k > 0 else begin[1],
            known[k],
            (u[before], outside[k if outside.size > 1 else 0]),
            warmth[k if warmth.size > 1 else 0],
            1.0,
        )
