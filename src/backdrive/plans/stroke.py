"""The smallest stroke of a sweep, limited by the torque and by the friction error due to inertia."""

from __future__ import annotations

import math

from backdrive.errors import InvalidInput
from backdrive.parameters import Bound, number

#: Share c of a cycle's top speed from which samples are taken in the thesis, (2.7c).
SHARE = 0.8


def smallest_stroke(
    top_speed: float, inertia: float, torque_limit: float, friction: float = 0.0, gravity: float = 0.0
) -> float:
    """Return the smallest stroke whose last cycle the actuator can follow.

    The peak acceleration is 2 V^2 / A whatever the number of cycles, so A = 2 I V^2 / (limit - friction - gravity). It is
    the inverse of `Sweep.peak_torque` and as cautious.

    Args:
        top_speed: V [rad/s or m/s].
        inertia: I, about the joint [kg.m^2 or kg].
        torque_limit: of the actuator, on the joint side [N.m or N].
        friction: friction torque at the top speed [N.m or N].
        gravity: largest gravity torque on the stroke [N.m or N].

    Returns:
        Full stroke, peak to peak [rad or m].

    Raises:
        InvalidInput: friction and gravity alone take up the torque.
    """
    _check(top_speed=top_speed, inertia=inertia, torque_limit=torque_limit)
    left = torque_limit - abs(friction) - abs(gravity)
    if left <= 0:
        raise InvalidInput(
            f"Friction {abs(friction):g} and gravity {abs(gravity):g} take up the whole torque limit {torque_limit:g}.",
            remedy="No stroke is sufficient: choose a posture with less gravity, or a lower top speed.",
        )
    return 2.0 * inertia * top_speed**2 / left


def inertia_bias(
    stroke: float, top_speed: float, inertia: float, time_slip: float, share: float = SHARE
) -> float:
    """Return the friction error at the top speed due to inertia when torque and velocity are not simultaneous.

    If each torque is paired with the velocity at an instant tau earlier (later for tau < 0), then around a velocity peak

        mean of I ddq(t + tau) over sin >= c  =  -k I (2 V^2 / A) sin(2 V tau / A),   k = sqrt(1 - c^2) / (pi/2 - asin c),

    which remains in the half difference of both directions, while without a time slip it vanishes by symmetry (Iwatani 2017,
    (2.14)). To first order -4 k I V^3 tau / A^2, with c = 0.8: -3.73 I V^3 tau / A^2. Backward differences beside commanded
    torques slip by one sampling interval.

    Args:
        stroke: A, full stroke [rad or m].
        top_speed: V [rad/s or m/s].
        inertia: I [kg.m^2 or kg].
        time_slip: tau, by how much the torque's instant is later than the velocity's [s].
        share: c, of the top speed, above which samples are taken [-].

    Returns:
        Error of the friction [N.m or N]; negative for a positive slip: the curve lies too low.

    Raises:
        InvalidInput: an argument is out of range.
    """
    _check(stroke=stroke, top_speed=top_speed, inertia=inertia)
    peak = 2.0 * inertia * top_speed**2 / stroke
    return -_mean_cosine(share) * peak * math.sin(2.0 * top_speed * time_slip / stroke)


def stroke_for_bias(
    top_speed: float, inertia: float, bias: float, time_slip: float, share: float = SHARE
) -> float:
    """Return the stroke above which the friction error due to inertia is below a given torque.

    A = sqrt(4 k I V^3 |tau| / bias), the first order of `inertia_bias`, which the exact one never exceeds. This is the error
    at the top speed; that of slower cycles is smaller by the factor (n / N)^3.

    Args:
        top_speed: V [rad/s or m/s].
        inertia: I [kg.m^2 or kg].
        bias: accepted error of the friction [N.m or N].
        time_slip: tau, between torque and velocity [s]; one sampling interval if nothing is aligned.
        share: c, of the top speed, above which samples are taken [-].

    Returns:
        Full stroke, peak to peak [rad or m].

    Raises:
        InvalidInput: an argument is out of range.
    """
    _check(top_speed=top_speed, inertia=inertia, bias=bias)
    return math.sqrt(4.0 * _mean_cosine(share) * inertia * top_speed**3 * abs(time_slip) / bias)


def _mean_cosine(share: float) -> float:
    """Mean of a sine over the part of its half-wave above `share` [-]."""
    number("The share c", share, Bound(0.0, 1.0, open_high=True))
    return math.sqrt(1.0 - share**2) / (0.5 * math.pi - math.asin(share))


def _check(**values: float) -> None:
    for name, value in values.items():
        number(name, value)
