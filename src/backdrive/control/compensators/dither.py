"""Dither at rest: a small sine that keeps a stuck joint close to break-away, so that a small external torque moves it.

    f_d = R_d ((F_p + F_n)/2 sin(Omega t) + (F_p - F_n)/2)   while the friction model is stuck, else 0

Iwatani 2017, (3.26), (3.27). F_p, F_n: friction that holds the joint now [N.m or N]. R_d: share of it [-]. Omega: angular
frequency [rad/s]. In the thesis t never restarts, so the sine may begin at any phase, with a step of up to R_d F. With
`reset` it begins at phase zero whenever the model becomes stuck.

`adaptive` follows the idea of M. T. S. Aung, R. Kikuuwe, M. Yamamoto (ASME J. Dyn. Syst. Meas. Control 137(5), 2015): the
oscillation is limited to a few counts of the encoder. The amplitude, a share of R_d, grows while a window of time shows no
count and shrinks while it shows more than `counts`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from backdrive._jit import jit, leaf
from backdrive.elementary import sin
from backdrive.errors import InvalidInput
from backdrive.parameters import POSITIVE, Bound, WithBounds

MODES = ("fixed", "reset", "adaptive")
ROW = 7  # mode, R_d, Omega, count, counts, window, rate
STATES = 5  # time in the phase, share, time in the window, least and largest position in it
RESET, ADAPTIVE = 1.0, 2.0  # modes
ADAPTS = True  # a dither may be adaptive


@jit
def tick(c, i, s, j, stuck, lo, hi, q, dt, t, idle):  # noqa: PLR0913  (a kernel's row)
    """Return the dither of one tick; `c[i:]`: row, `s[j:]`: state, lo and hi: bounds of friction, t: time,
    `idle`: the amplitude stays.
    """
    mode = c[i]
    if ADAPTS and mode == ADAPTIVE and not idle:
        adapt(c, i, s, j, q, dt)
    if not stuck:
        s[j] = 0.0
        return 0.0
    phase = t
    if mode == RESET:
        phase = s[j]
        s[j] += dt
    share = s[j + 1] if mode == ADAPTIVE else 1.0
    return share * c[i + 1] * (0.5 * (hi - lo) * sin(c[i + 2] * phase) + 0.5 * (hi + lo))


@leaf
def absent(c, i, s, j, stuck, lo, hi, q, dt, t, idle):  # noqa: PLR0913  (a kernel's row)
    """Return no dither: `tick` where no joint has one."""
    return 0.0


@jit
def adapt(c, i, s, j, q, dt):
    """Increase the amplitude if nothing moves, and decrease it if the motion is too large."""
    s[j + 2] += dt
    s[j + 3], s[j + 4] = min(s[j + 3], q), max(s[j + 4], q)
    if s[j + 2] < c[i + 5]:
        return
    moved = (s[j + 4] - s[j + 3]) / c[i + 3]
    if moved < 0.5:
        s[j + 1] = min(s[j + 1] + c[i + 6], 1.0)
    elif moved > c[i + 4] + 0.5:
        s[j + 1] = max(s[j + 1] - 2.0 * c[i + 6], 0.0)
    s[j + 2], s[j + 3], s[j + 4] = 0.0, q, q


@dataclass(frozen=True, kw_only=True)
class Dither(WithBounds):
    """A sine while the joint is stuck.

    Attributes:
        share: R_d, of the friction that holds the joint [-].
        frequency: Omega/(2 pi) [Hz].
        mode: `fixed`: by the clock, as in the thesis; `reset`: from phase zero; `adaptive`: of a few counts.
        count: of the encoder, for `adaptive` [rad or m].
        counts: target of the oscillation, for `adaptive` [count].
        window: window in which the oscillation is measured [s]; at least a period.
        growth: of the amplitude's share in each window [-].
    """

    BOUNDS: ClassVar = {
        "share": Bound(0.0, 1.0),  # so that the dither alone does not move the joint
        "frequency": POSITIVE,
        "count": POSITIVE,
        "counts": POSITIVE,
        "window": POSITIVE,
        "growth": Bound(0.0, 1.0, open_low=True),
    }
    CHOICES: ClassVar = {"mode": MODES}

    share: float = 0.3
    frequency: float = 15.0
    mode: Literal["fixed", "reset", "adaptive"] = "fixed"
    count: float = 1e-6
    counts: float = 2.0
    window: float = 0.07
    growth: float = 0.1

    def check(self, dt: float) -> None:
        """Refuse a frequency that a loop cannot make.

        Args:
            dt: period of the loop [s].

        Raises:
            InvalidInput: the frequency is not below half the rate of the loop.
        """
        if not self.frequency < 0.5 / dt:
            raise InvalidInput(
                f"Dither: frequency = {self.frequency:g} Hz is not below half the rate of the loop, {0.5 / dt:g} Hz.",
                remedy="Lower the frequency, or run the loop at a higher rate.",
            )

    def row(self) -> np.ndarray:
        """Return the row that `tick` reads, (7,)."""
        omega = 2.0 * np.pi * self.frequency
        return np.array(
            [MODES.index(self.mode), self.share, omega, self.count, self.counts, self.window, self.growth]
        )


#: The row for no dither: a mode below all others.
NONE = np.full(ROW, -1.0)
