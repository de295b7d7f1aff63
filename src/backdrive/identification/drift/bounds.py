"""Upper bound of an adapted friction level: the compensation never exceeds the joint's own friction.

A compensator with the torque R theta f along the motion adds the power R theta |f v|, and the joint's friction dissipates
|F v|. If R theta |f(v)| <= |F(v)| at every speed and in both directions, the sum never adds energy for any theta within its
bounds. The loop stays as passive as before. The largest level is therefore

    theta_up = min over v of F_least(v) / (R f(v))

where F_least is the least friction that the joint can have: the lower end of its interval, or its curve when it is warm.
"""

from __future__ import annotations

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.laws import Law
from backdrive.laws.base import Rate

SPEEDS = 400  # number of compared speeds in each direction


def passive_level(
    law: Law | Rate, least: Law | Rate, *, gain: float, top_speed: float, margin: float = 0.0
) -> float:
    """Return the largest level of a compensated law that leaves a joint passive [-].

    Args:
        law: the compensated law at level 1; a law or its rate.
        least: the least friction that the joint can have; a law or its rate.
        gain: R, compensated share of the law [-].
        top_speed: largest speed at which the joint stays passive [rad/s or m/s].
        margin: subtracted from the least friction, such as 1.96 standard errors of its curve [N.m or N], one number.

    Raises:
        InvalidInput: gain or speed is not positive, the margin is negative, the law is zero at a speed, or no level above 0
            leaves the joint passive.
    """
    law, least = (x if isinstance(x, Law) else Law(rate=x) for x in (law, least))
    if not margin >= 0.0:
        raise InvalidInput(f"margin = {margin}.", remedy="It is taken off the least friction: 0 or more.")
    if not (0.0 < gain < np.inf and 0.0 < top_speed < np.inf):
        raise InvalidInput(
            f"gain = {gain}, top_speed = {top_speed}.", remedy="Both must be positive and finite."
        )
    speeds = top_speed * np.concatenate([[1e-9], np.linspace(0.0, 1.0, SPEEDS)[1:] ** 2])
    both = np.concatenate([speeds, -speeds])
    f, F = np.abs(law.torque(both)), np.abs(least.torque(both)) - margin
    if not np.all(f > 0):
        raise InvalidInput(
            "The compensated law is zero at a speed.", remedy="Give a law with a Coulomb torque."
        )
    level = float(np.min(F / (gain * f)))
    if not level > 0:
        raise InvalidInput(
            "The least friction does not exceed its margin: no compensation is certain to keep the joint passive.",
            remedy="Identify the joint better, or where it is warm.",
        )
    return level
