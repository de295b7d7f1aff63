"""Parts of a compensator beyond a friction model: pulses, an observer of LuGre's bristle, a disturbance observer.

Pulses (impulsive control) move a joint that is stuck away from its reference. A pulse starts if the encoder has not changed
for `wait` and the position error exceeds `tolerance`. For w = `width`, a torque f above break-away then acts on the inertia M,
and moves the joint by about (f - F_c) f w^2/(2 M F_c).

The LuGre observer corrects the bristle by the filtered tracking error e_f = e' + lambda e with e = r - q,

    z' = v - sigma_0 |v| z/s(v) + k e_f,   f = theta b + viscous(v),   b = sigma_0 z + sigma_1 z',   theta' = gamma e_f b

(C. Canudas de Wit, P. Lischinsky, Int. J. Adapt. Control Signal Process. 11, 1997). theta stays within its bounds, and |z| below
s/sigma_0. With gamma = 0, theta stays 1. The disturbance observer treats every deviation of the motion from the model as
unmodelled friction, and cancels it up to a limit. It cancels the force of a hand as well: use it for tracking, not for hand
guiding.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from backdrive._jit import jit
from backdrive.control.estimators import external
from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import NOTHING, FrictionEstimator
from backdrive.errors import InvalidInput
from backdrive.laws import Law, LuGre
from backdrive.laws.elements import lugre
from backdrive.parameters import BIG, FINITE, NOT_NEGATIVE, POSITIVE, Bound, WithBounds

ROW = (
    2 + external.ROW
)  # kind, a number, and either the numbers of pulse and observer or an external-force estimator
STATES = external.STATES


@jit
def pulse(c, i, share, p, x, s, j, q, dp, dt, error, slope, u, load, temp):  # noqa: PLR0913  (a kernel's row)
    """Return the pulse of one tick; `c[i:]`: kind, height, width, wait, tolerance; `s[j:]`: time stuck, time left, sign."""
    if s[j + 1] > 0.5 * dt:
        s[j + 1] -= dt
        s[j] = 0.0
        return s[j + 2] * c[i + 1]
    s[j] = s[j] + dt if dp == 0.0 else 0.0
    if s[j] >= c[i + 3] and abs(error) > c[i + 4]:
        s[j + 1], s[j + 2] = c[i + 2] - dt, 1.0 if error > 0.0 else -1.0
        s[j] = 0.0
        return s[j + 2] * c[i + 1]
    return 0.0


@jit
def missing(c, i, share, p, x, s, j, q, dp, dt, error, slope, u, load, temp):  # noqa: PLR0913  (a kernel's row)
    """Return the torque of the disturbance observer; `c[i:]`: kind, limit, estimator."""
    missed, friction = external.tick(c, i + 2, p, x, s, j, q, dp, dt, u, 0.0, load, temp, 1.0)
    limit = c[i + 1]
    return share * friction - min(max(missed, -limit), limit)


@jit
def bristle(c, i, share, p, x, s, j, q, dp, dt, error, slope, u, load, temp):  # noqa: PLR0913  (a kernel's row)
    """Return the torque of the LuGre observer; `s[j]`: sigma_0 z, `s[j + 1]`: theta."""
    v = dp / dt
    lo, hi, viscous = friction_.bounds(int(c[i + 6]), p, v, load, temp)
    e = 1 + int(p[0])
    sigma_0 = p[e]
    wrong = slope + c[i + 2] * error
    s_v = hi if dp > 0.0 else -lo
    before = s[j]
    after = before + sigma_0 * (dp + dt * c[i + 1] * wrong)
    if s_v > 0.0:
        after /= 1.0 + sigma_0 * abs(dp) / s_v
    after = min(
        max(after, min(lo, before)), max(hi, before)
    )  # if the bound has decreased, the state approaches it with LuGre's dynamics
    s[j] = after
    bent = after + lugre.damping(p[e + 1], p[e + 2], v) * (after - before) / (sigma_0 * dt)
    s[j + 1] = min(max(s[j + 1] + dt * c[i + 3] * wrong * bent, c[i + 4]), c[i + 5])
    return share * (s[j + 1] * bent + viscous)


@dataclass(frozen=True, kw_only=True)
class Extra(WithBounds, ABC):
    """Base class of the parts beyond a friction model. Each is defined beside its kernel and imported in `compensator`.

    Attributes:
        KIND: number of its kernel, 1 to 62.
        KERNEL: function with the arguments of `pulse` that returns the torque of one tick; its `share` is R.
        INSTEAD: it replaces the friction model, since it evaluates the law itself.
    """

    KIND: ClassVar[int]
    KERNEL: ClassVar[Callable]
    INSTEAD: ClassVar[bool] = False

    def check(self, law: Law) -> None:
        """Check that it can be used with a law."""

    @abstractmethod
    def row(self, dt: float, friction: FrictionEstimator) -> np.ndarray:
        """Return the row that the kernels read, (ROW,)."""

    def _row(self, *numbers: float) -> np.ndarray:
        c = np.zeros(ROW)
        c[0] = self.KIND
        c[1 : 1 + len(numbers)] = numbers
        return c


@dataclass(frozen=True, kw_only=True)
class Pulses(Extra):
    """Impulsive control of a joint that is stuck off its reference.

    Attributes:
        height: beyond break-away [N.m or N].
        width: of a pulse [s].
        wait: time without an encoder count before a pulse [s].
        tolerance: position error up to which there is no pulse [rad or m].
    """

    KIND: ClassVar[int] = 1
    KERNEL: ClassVar[Callable] = staticmethod(pulse)

    BOUNDS: ClassVar = {"height": POSITIVE, "width": POSITIVE, "wait": POSITIVE, "tolerance": NOT_NEGATIVE}

    height: float
    width: float = 0.003
    wait: float = 0.03
    tolerance: float = 0.0

    def row(self, dt: float, friction: FrictionEstimator) -> np.ndarray:
        """Return the row that `pulse` reads."""
        return self._row(self.height, self.width, self.wait, self.tolerance)


@dataclass(frozen=True, kw_only=True)
class BristleObserver(Extra):
    """The observer of LuGre's bristle, whose friction is scaled on-line where `adaptation` is not 0.

    Attributes:
        gain: k, by which the tracking error bends the bristle [-].
        corner: lambda of the error's filter [1/s].
        adaptation: gamma [1/(N.m.rad) or 1/(N.m)].
        lowest: smallest theta [-].
        highest: largest theta [-].
    """

    KIND: ClassVar[int] = 2
    KERNEL: ClassVar[Callable] = staticmethod(bristle)
    INSTEAD: ClassVar[bool] = True

    BOUNDS: ClassVar = {
        "gain": FINITE,
        "corner": NOT_NEGATIVE,
        "adaptation": NOT_NEGATIVE,
        "lowest": Bound(0.0, 1.0),
        "highest": Bound(1.0, BIG),
    }

    gain: float = 0.0
    corner: float = 20.0
    adaptation: float = 0.0
    lowest: float = 0.5
    highest: float = 1.5

    def check(self, law: Law) -> None:
        """Refuse a law whose bristle is not LuGre's.

        Raises:
            InvalidInput: it has another element.
        """
        if not isinstance(law.element, LuGre):
            raise InvalidInput(f"'{law.name}' has no LuGre bristle.", remedy="Use the element `LuGre`.")

    def row(self, dt: float, friction: FrictionEstimator) -> np.ndarray:
        """Return the row that `bristle` reads."""
        kind = friction.law.rate.KIND
        return self._row(self.gain, self.corner, self.adaptation, self.lowest, self.highest, kind)


@dataclass(frozen=True, kw_only=True)
class DisturbanceObserver(Extra):
    """A model, and an observer of its error.

    Attributes:
        inertia: of motor and load together [kg.m^2 or kg].
        bandwidth: of the observer [1/s].
        limit: largest torque that it adds [N.m or N].
        gravity_sin: A of gravity A sin q + B cos q [N.m or N].
        gravity_cos: B of the same [N.m or N].
    """

    KIND: ClassVar[int] = 3
    KERNEL: ClassVar[Callable] = staticmethod(missing)
    INSTEAD: ClassVar[bool] = True

    BOUNDS: ClassVar = {"limit": POSITIVE}

    inertia: float
    bandwidth: float = 30.0
    limit: float
    gravity_sin: float = 0.0
    gravity_cos: float = 0.0

    def __post_init__(self):
        super().__post_init__()
        self.estimator()  # checks the other numbers

    def row(self, dt: float, friction: FrictionEstimator) -> np.ndarray:
        """Return the limit and the row of the observer."""
        return self._row(self.limit, *self.estimator(friction).row(dt))

    def estimator(self, friction: FrictionEstimator = NOTHING) -> ExternalForce:
        """Return the estimator of what the model misses."""
        return ExternalForce(
            inertia=self.inertia,
            friction=friction,
            method="disturbance",
            bandwidth=self.bandwidth,
            gravity_sin=self.gravity_sin,
            gravity_cos=self.gravity_cos,
        )


def start(extra: Extra | None) -> np.ndarray:
    """Return the state at rest, (STATES,): it contains no positions."""
    s = np.zeros(STATES)
    if isinstance(extra, BristleObserver):
        s[1] = 1.0
    return s
