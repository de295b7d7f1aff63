"""The torque of a friction compensator, tick by tick.

    f = R tau_f(dp) + dither + extra

tau_f: a `FrictionEstimator`, any law of `backdrive.laws`. R <= 1: compensated share of the friction, Iwatani 2017, (2.21). It
stays slightly below 1, since energy added beyond the real friction is not dissipated. With Hayward and Armstrong's contact
this is Mahvash and Okamura's compensator (IEEE Trans. Robotics 23(6), 2007), with the decaying contact the thesis' algFC,
(3.27), and with a switching decay rate algFC2, (3.28). The `extra` torque goes beyond a friction model (`extras`): pulses, an
observer of LuGre's bristle, a disturbance observer.

While its contact is stuck, a friction compensator is a spring with negative stiffness. Only the joint's real friction makes
the sum passive. This requires R < 1 and a contact no stiffer than the joint's own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from backdrive._jit import choice, jit, ladder, leaf
from backdrive.control.compensators import dither as dither_
from backdrive.control.compensators import extras
from backdrive.control.compensators.dither import NONE, Dither
from backdrive.control.compensators.extras import Extra
from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators.friction import NOTHING, FrictionEstimator
from backdrive.errors import InvalidInput
from backdrive.parameters import NOT_NEGATIVE, WithBounds

FRICTION, DITHER, EXTRA = 2, 2 + friction_.ROW, 2 + friction_.ROW + dither_.ROW
ROW = EXTRA + extras.ROW
SHARE = 0.8  # default of R: friction may easily be a fifth lower than identified
S_DITHER, S_EXTRA = 1, 1 + dither_.STATES
STATES = S_EXTRA + extras.STATES
NEARLY = 0.98  # share of its bound at which a bristle counts as sliding, since it approaches the bound without reaching it


@leaf
def nothing(c, i, share, p, x, s, j, q, dp, dt, error, slope, u, load, temp):  # noqa: PLR0913  (a kernel's row)
    """Nothing extra."""
    return 0.0


NAMES = {**vars(extras), **globals()}
#: Every extra by number. To add one, write its file and import it above.
EXTRAS: dict[int, type[Extra]] = {
    e.KIND: e for e in NAMES.values() if isinstance(e, type) and issubclass(e, Extra) and e is not Extra
}
INSTEAD = sum(e.INSTEAD << kind for kind, e in EXTRAS.items())
extra = choice({kind: e.KERNEL for kind, e in EXTRAS.items()}, nothing)
DITHERED, BEYOND = True, True  # there may be a dither, or something extra


@ladder
def tick(c, i, p, x, s, j, q, dp, dt, t, error, slope, u, load, temp, idle):  # noqa: PLR0913  (a kernel's row)
    """Return the torque of one tick in two parts: the compensation, and the dither. The arguments are those of `advance`."""
    push, wave, _ = advance(c, i, p, x, s, j, q, dp, dt, t, error, slope, u, load, temp, idle)
    return push, wave


@ladder
def advance(c, i, p, x, s, j, q, dp, dt, t, error, slope, u, load, temp, idle):  # noqa: PLR0913  (a kernel's row)
    """Return the torque of one tick in two parts, the compensation and the dither, and the estimated friction.

    `c[i:]`: row. `p`, `x`: law and its state. `s[j:]`: state. q: encoder. dp: its increment. t: time. error, slope: reference
    minus position, and its rate. u: torque that acted since the last tick, minus gravity. `idle`: the extra torque is off, and
    the amplitude of the dither stays.
    """
    kind = int(c[i + EXTRA])
    push, wave, model = 0.0, 0.0, 0.0
    if not INSTEAD >> kind & 1:
        model = friction_.tick(c, i + FRICTION, p, x, s, j + 0, dp, dt, load, temp)
        push = c[i] * model
        if DITHERED and c[i + DITHER] >= 0.0:
            lo, hi, viscous = friction_.bounds(int(c[i + FRICTION]), p, dp / dt, load, temp)
            slides = c[i + 1] > 0.0
            held = x[0] if slides else model - viscous
            near = 1.0 if slides else NEARLY
            stuck = near * lo < held < near * hi or held * dp <= 0.0
            wave = dither_.tick(c, i + DITHER, s, j + S_DITHER, stuck, lo, hi, q, dt, t, idle)
    if BEYOND and kind > 0 and not idle:
        push += extra(
            kind, (c, i + EXTRA, c[i], p, x, s, j + S_EXTRA, q, dp, dt, error, slope, u, load, temp)
        )
    return push, wave, model


@jit
def relax(c, i, x, s, j):
    """Relax the contact and reset the integrators, for a joint at rest. The dither continues."""
    friction_.relax(x)
    learned = s[j + S_EXTRA + 1]
    for k in range(extras.STATES):
        s[j + S_EXTRA + k] = 0.0
    if c[i + EXTRA] == 2.0:
        s[j + S_EXTRA + 1] = learned


@jit
def shift(c, i, s, j, by):
    """Shift all positions, after a change of the encoder's zero."""
    s[j + S_DITHER + 3] += by
    s[j + S_DITHER + 4] += by


@jit
def restart(c, i, s, j, q):
    """Reset all states to a joint at rest at q."""
    for k in range(STATES):
        s[j + k] = 0.0
    if c[i + EXTRA] == 2.0:
        s[j + S_EXTRA + 1] = 1.0
    shift(c, i, s, j, q)


@dataclass(frozen=True, kw_only=True)
class Compensator(WithBounds):
    """A friction compensator of one joint.

    Attributes:
        friction: friction estimator.
        share: R, share of the friction that is compensated [-].
        dither: at rest; None for none.
        extra: torque beyond a friction model; None: no such torque.
    """

    BOUNDS: ClassVar = {"share": NOT_NEGATIVE}

    friction: FrictionEstimator = field(default_factory=lambda: NOTHING)
    share: float = SHARE
    dither: Dither | None = None
    extra: Extra | None = None

    def __post_init__(self):
        super().__post_init__()
        if self.dither is not None and not self.friction.law.element.states():
            raise InvalidInput(
                f"'{self.friction.law.name}' has no presliding, so it is never stuck and a dither would never act.",
                remedy="Give the law an element, for example `Decaying`.",
            )
        if self.extra is not None:
            self.extra.check(self.friction.law)

    def row(self, dt: float) -> np.ndarray:
        """Return the row that `tick` reads, (ROW,); `InvalidInput` where the dither is too fast for a period dt [s]."""
        c = np.zeros(ROW)
        if self.dither is not None:
            self.dither.check(dt)
        c[0], c[1] = self.share, float(self.friction.law.element.SLIDER)
        c[FRICTION:DITHER] = self.friction.row()
        c[DITHER:EXTRA] = NONE if self.dither is None else self.dither.row()
        c[EXTRA:] = np.zeros(extras.ROW) if self.extra is None else self.extra.row(dt, self.friction)
        return c

    def start(self, position: float) -> np.ndarray:
        """Return the state of a joint at rest at a position, (STATES,)."""
        s = np.zeros(STATES)
        s[S_DITHER + 3], s[S_DITHER + 4] = position, position
        s[S_EXTRA:] = extras.start(self.extra)
        return s
