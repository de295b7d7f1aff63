"""Friction torque of a joint from its encoder alone: any law of `backdrive.laws`, or the thesis' law with switching decay rate.

CT, Iwatani 2017, (4.17): a dead zone of velocity. HA, (4.8): Hayward and Armstrong's contact. algFE, (4.16): the decaying
contact. All of these are laws, run along the increments of the encoder. algFE2, (4.20), is the decaying contact whose rate goes
from alpha_N at rest to alpha_H in motion and back:

    w <- min(w + r_W T, 1)  where the joint moved by more than V_W T,  else  max(w - r_W T, 0)
    alpha = (1 - w) alpha_N + w alpha_H

The thesis prints max and min exchanged, by which w would leave [0, 1]. It also prints a step R_W per sample; here r_W = R_W/T.
Measured velocities are whole encoder counts per tick. `between_counts` puts a threshold half a count above one of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from backdrive._jit import jit, leaf, to_bits
from backdrive.errors import InvalidInput
from backdrive.laws import Coulomb, DeadZone, Decaying, HaywardArmstrong, Law, kernels, with_element
from backdrive.laws.base import Rate
from backdrive.parameters import NOT_NEGATIVE, POSITIVE, WithBounds

LITERAL = True  # the viscous part may see the encoder's velocity
ROW = 8  # rate, element, place of alpha in the row or 0, alpha_N, alpha_H, r_W, V_W, literal


@jit
def bounds(rate, p, v, load, temp):
    """Return lower and upper bound and the viscous part of a rate law, compiled once for all callers."""
    return kernels.limits(rate, p, v, load, temp)


@jit
def tick(c, i, p, x, s, j, dp, dt, load, temp):
    """Return the friction torque of one tick; `c[i:]`: row, `p`, `x`: the law and its state, `s[j]`: w."""
    at = int(c[i + 2])
    if at > 0:
        w = s[j]
        if abs(dp) > c[i + 6] * dt:
            w = min(w + c[i + 5] * dt, 1.0)
        else:
            w = max(w - c[i + 5] * dt, 0.0)
        s[j] = w
        p[at] = (1.0 - w) * c[i + 3] + w * c[i + 4]
    f = kernels.step(int(c[i]), int(c[i + 1]), p, x, dp, dt, load, temp)
    if LITERAL and c[i + 7] > 0.0:
        f = x[0] + bounds(int(c[i]), p, dp / dt, load, temp)[2]
    return f


@leaf
def coincide(x, s, j, other_x, other_s, other_j):
    """Return whether two estimators whose law has a state of one number are in the same state, bit for bit."""
    return to_bits(x[0]) == to_bits(other_x[0]) and to_bits(s[j]) == to_bits(other_s[other_j])


@jit
def relax(x):
    """Reset the law to its state at rest, which is one number where no element of the kernel has more."""
    if kernels.ROWS != 0:
        for k in range(x.size):
            x[k] = 0.0
    else:
        x[0] = 0.0


@dataclass(frozen=True, kw_only=True)
class FrictionEstimator(WithBounds):
    """A law that is run along the encoder.

    Attributes:
        law: friction law.
        fast_decay: alpha_H, rate in motion of a decaying law whose own rate is alpha_N [1/s]; None: the rate stays.
        switch_rate: r_W, rate at which the weight w of alpha_H rises and falls [1/s].
        threshold: V_W, speed above which w rises [rad/s or m/s].
        literal: the viscous part uses the encoder's velocity even if the curve falls, as printed in Iwatani 2017, (2.22b). Only
            for `HaywardArmstrong`, whose viscous part otherwise uses the slider's velocity.
    """

    BOUNDS: ClassVar = {"fast_decay": NOT_NEGATIVE, "switch_rate": POSITIVE, "threshold": NOT_NEGATIVE}

    law: Law
    fast_decay: float | None = None
    switch_rate: float = 10.0
    threshold: float = 0.0
    literal: bool = False

    def __post_init__(self):
        super().__post_init__()
        if self.literal and not isinstance(self.law.element, HaywardArmstrong):
            raise InvalidInput(
                f"'{self.law.name}' is not the contact that (2.22) prints.",
                remedy="Use the element `HaywardArmstrong`, or leave `literal` out.",
            )
        if self.fast_decay is not None and not isinstance(self.law.element, Decaying):
            raise InvalidInput(
                f"'{self.law.name}' has no decay rate to switch.", remedy="Use the element `Decaying`."
            )

    def row(self) -> np.ndarray:
        """Return the row that `tick` reads, (8,)."""
        law = self.law
        slow = getattr(law.element, "decay_rate", 0.0)
        at = 0 if self.fast_decay is None else len(law.row()) - 1
        fast = slow if self.fast_decay is None else self.fast_decay
        numbers = (law.rate.KIND, law.element.KIND, at, slow, fast, self.switch_rate, self.threshold)
        return np.array([*numbers, self.literal], dtype=float)


def between_counts(threshold: float, count: float, dt: float) -> float:
    """Return a velocity threshold between two counts: half a count above the largest count that does not exceed the given one.

    Args:
        threshold: speed [rad/s or m/s].
        count: of the encoder [rad or m]; 0 leaves the threshold unchanged.
        dt: sampling time [s].
    """
    return threshold if count == 0.0 else (np.floor(threshold * dt / count + 1e-6) + 0.5) * count / dt


def ct(rate: Rate | Law, threshold: float) -> FrictionEstimator:
    """Return CT, the rate law with a dead zone of velocity: Iwatani 2017, (4.17)."""
    return FrictionEstimator(law=with_element(rate, DeadZone(threshold=threshold)))


def ha(rate: Rate | Law, stiffness: float) -> FrictionEstimator:
    """Return HA, Hayward and Armstrong's contact: Iwatani 2017, (4.8)."""
    return FrictionEstimator(law=with_element(rate, HaywardArmstrong(stiffness=stiffness)))


def alg_fe(rate: Rate | Law, stiffness: float, decay_rate: float = 20.0) -> FrictionEstimator:
    """Return algFE, the decaying contact: Iwatani 2017, (4.16)."""
    return FrictionEstimator(law=with_element(rate, Decaying(stiffness=stiffness, decay_rate=decay_rate)))


def alg_fe2(
    rate: Rate | Law,
    stiffness: float,
    threshold: float,
    decay_rate: float = 20.0,
    fast_decay: float = 500.0,
    switch_rate: float = 10.0,
) -> FrictionEstimator:
    """Return algFE2, the decaying contact that decays faster in motion: Iwatani 2017, (4.20), corrected."""
    law = with_element(rate, Decaying(stiffness=stiffness, decay_rate=decay_rate))
    return FrictionEstimator(law=law, fast_decay=fast_decay, switch_rate=switch_rate, threshold=threshold)


#: No friction at all.
NOTHING = FrictionEstimator(law=Law(rate=Coulomb(coulomb=0.0)))

__all__ = [
    "NOTHING",
    "FrictionEstimator",
    "alg_fe",
    "alg_fe2",
    "between_counts",
    "ct",
    "ha",
    "tick",
]
