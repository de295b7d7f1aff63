"""What a friction compensator adds to the motor's torque, tick by tick.

    f = R tau_f(dp) + dither + extra

tau_f: a `FrictionEstimator`, any law of `backdrive.laws`. R <= 1: share that is compensated, Iwatani 2017, (2.21); a little less
than what is there, for what is put in beyond it is never taken out again. With Hayward and Armstrong's contact this is
Mahvash and Okamura's compensator (IEEE Trans. Robotics 23(6), 2007), with the decaying contact the thesis' algFC, (3.27), and with
a switching decay rate algFC2, (3.28). What is extra goes beyond a friction model (`extras`): pulses, an observer of LuGre's
bristle, a disturbance observer.

A compensator of friction is a spring with negative stiffness as long as its contact is stuck. What keeps it passive is the
real friction, which is why R < 1 and a contact no stiffer than the joint's own.
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
SHARE = 0.8  # R where nothing else is said: friction may well be a fifth less than what is believed
S_DITHER, S_EXTRA = 1, 1 + dither_.STATES
STATES = S_EXTRA + extras.STATES
NEARLY = (
    0.98  # share of its bound at which a bristle, which comes near it but never reaches it, counts as sliding
)


@leaf
def nothing(c, i, share, p, x, s, j, q, dp, dt, error, slope, u, load, temp):  # noqa: PLR0913  (a kernel's row)
    """Nothing extra."""
    return 0.0


NAMES = {**vars(extras), **globals()}
#: Everything extra by number. One is one file and one import above.
EXTRAS: dict[int, type[Extra]] = {
    e.KIND: e for e in NAMES.values() if isinstance(e, type) and issubclass(e, Extra) and e is not Extra
}
INSTEAD = sum(e.INSTEAD << kind for kind, e in EXTRAS.items())
extra = choice({kind: e.KERNEL for kind, e in EXTRAS.items()}, nothing)


@ladder
def tick(c, i, p, x, s, j, q, dp, dt, t, error, slope, u, load, temp, idle):  # noqa: PLR0913  (a kernel's row)
    """Return the torque of one tick in two parts: what pushes, and the dither.

    `c[i:]`: row, `p`, `x`: the law and its state, `s[j:]`: state. q: encoder, dp: its increment, t: time, error and slope: how
    far the reference is ahead and its rate, u: torque that acted meanwhile, less gravity. `idle`: what is extra rests.
    """
    kind = int(c[i + EXTRA])
    push, wave = 0.0, 0.0
    if not INSTEAD >> kind & 1:
        model = friction_.tick(c, i + FRICTION, p, x, s, j + 0, dp, dt, load, temp)
        push = c[i] * model
        if c[i + DITHER] >= 0.0:
            lo, hi, viscous = friction_.bounds(int(c[i + FRICTION]), p, dp / dt, load, temp)
            slides = c[i + 1] > 0.0
            held = x[0] if slides else model - viscous
            near = 1.0 if slides else NEARLY
            stuck = near * lo < held < near * hi or held * dp <= 0.0
            wave = dither_.tick(c, i + DITHER, s, j + S_DITHER, stuck, lo, hi, q, dt, t, idle)
    if kind > 0 and not idle:
        push += extra(
            kind, (c, i + EXTRA, c[i], p, x, s, j + S_EXTRA, q, dp, dt, error, slope, u, load, temp)
        )
    return push, wave


@jit
def relax(c, i, x, s, j):
    """Let go of what the contact holds and of what is integrated beside it: the joint rests. The dither goes on."""
    for k in range(x.size):
        x[k] = 0.0
    learned = s[j + S_EXTRA + 1]
    for k in range(extras.STATES):
        s[j + S_EXTRA + k] = 0.0
    if c[i + EXTRA] == 2.0:
        s[j + S_EXTRA + 1] = learned


@jit
def shift(c, i, s, j, by):
    """Move everything that is a position: the encoder counts from another zero."""
    s[j + S_DITHER + 3] += by
    s[j + S_DITHER + 4] += by


@jit
def restart(c, i, s, j, q):
    """Forget everything: the joint rests at q."""
    for k in range(STATES):
        s[j + k] = 0.0
    if c[i + EXTRA] == 2.0:
        s[j + S_EXTRA + 1] = 1.0
    shift(c, i, s, j, q)


@dataclass(frozen=True, kw_only=True)
class Compensator(WithBounds):
    """A friction compensator of one joint.

    Attributes:
        friction: what is taken as friction.
        share: R, of it that is given [-].
        dither: at rest; None for none.
        extra: beyond a friction model; None for nothing.
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
                f"'{self.friction.law.name}' has no presliding, so that it never is stuck and never dithers.",
                remedy="Give the law an element, for example `Decaying`.",
            )
        if self.extra is not None:
            self.extra.check(self.friction.law)

    def row(self, dt: float) -> np.ndarray:
        """Return the row that `tick` reads, (ROW,)."""
        c = np.zeros(ROW)
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
