"""The fields of an external-force estimator, from the model of a joint."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.control.estimators.friction import FrictionEstimator
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.laws import Decaying, Law, Polyline, Rigid, with_element
from backdrive.model import JointFriction

DECAY = 20.0  # of friction at rest, as in Iwatani 2017, Sec. 4.6 [1/s]
COUNT = 1e-6  # step of an encoder whose counts are not known [rad or m]
COUNTS = 8.0  # encoder steps that a contact of unknown stiffness deflects before it slides
ABRUPT = 10.0  # force, relative to friction, that the filter of `direct` follows if the accelerations are unknown [-]
CREEP = 0.05  # share of the top speed: sliding up to twice this speed determines friction at rest [-]
STEEPER = 2.0  # largest slope of a curve below a low speed, relative to that above it [-]
WIDTH = 1.96  # half-width of a 95 % band, in standard deviations
BEND = {
    "rad": 1e-3,
    "m": 1e-4,
}  # deflection before sliding, if neither stiffness nor encoder count is known [rad or m]


def fields(
    friction: JointFriction, method: str, bandwidth: float, acceleration: float | None = None
) -> dict[str, Any]:
    """Return the fields of an estimator with inertia, gravity, offset, friction, delay, noise and encoder step of a joint.

    Friction at rest is that of a decaying contact (algFE), which leaves no offset when a hand lets go. A known torque in the
    model (`tau_model`) has to be passed as `known`.

    Args:
        friction: of a model.
        method: of the estimator.
        bandwidth: L [1/s].
        acceleration: largest that the filter of `direct` is to follow [rad/s^2 or m/s^2]; None: that of ten times friction.

    Raises:
        NotIdentifiable: the model holds no inertia, or none that is positive.
        InvalidInput: a bandwidth that is not positive.
    """
    name, value = friction.joint.name, {term: e.value for term, e in friction.dynamics.items()}
    inertia = value.get("inertia", 0.0)
    if not inertia > 0.0:
        raise NotIdentifiable(
            f"Joint '{name}': the model contains no inertia, so no force can be estimated from motion.",
            remedy="Identify a log in which the joint accelerates (`backdrive plan multisine`).",
        )
    if not 0.0 < bandwidth < np.inf:
        raise InvalidInput(f"A bandwidth of {bandwidth:g} 1/s.", remedy="Give a positive number, such as 50.")
    law, counts = contact(friction), friction.joint.encoder_counts
    follow = ABRUPT * max(at_rest(law), 1e-9) / inertia if acceleration is None else acceleration
    return dict(
        inertia=inertia,
        friction=FrictionEstimator(law=law),
        method=method,
        filter=MotionFilter.of_bandwidth(bandwidth, follow),
        bandwidth=bandwidth,
        gravity_sin=value.get("gravity_sin", 0.0),
        gravity_cos=value.get("gravity_cos", 0.0),
        offset=value.get("offset", 0.0),
        encoder_count=COUNT if not counts else 1.0 / counts,
        delay=friction.delay,
        noise=None if friction.torque_channel is None else friction.torque_channel.noise,
    )


def contact(friction: JointFriction) -> Law:
    """Return a model's law with a decaying contact, which keeps the stiffness of the law's element if there is one."""
    law = friction.law
    own = law.element
    stiffness = getattr(own, "stiffness", None)
    if isinstance(own, Rigid) or not isinstance(stiffness, float):
        counts = friction.joint.encoder_counts
        bend = BEND[friction.joint.unit] if counts is None else COUNTS / counts
        stiffness = max(at_rest(law), 1e-9) / bend
    return with_element(law, Decaying(stiffness=stiffness, decay_rate=DECAY))


def with_break_away(friction: JointFriction) -> JointFriction:
    """Return a joint whose curve, if it is piecewise linear, starts at its break-away friction.

    The fit of a whole arm hardly determines the curve near zero speed, where the sign of the velocity is smoothed, and may
    give zero there. Friction at rest, which the estimate needs, is then that of slow sliding.

    Args:
        friction: of a model.
    """
    rate = friction.law.rate
    if not isinstance(rate, Polyline):
        return friction
    ends = zip(("positive", "negative"), break_away(friction), (rate.positive, rate.negative), strict=True)
    curves = {way: (float(end), *values[1:]) for way, end, values in ends if values[0] < end}
    if not curves:
        return friction
    law = replace(friction.law, rate=replace(rate, **curves))
    return replace(friction, law=law, covariance=None)


def with_slow_sliding(friction: JointFriction) -> JointFriction:
    """Return a joint whose curve, if it is piecewise linear, does not fall steeply towards zero speed.

    The fit of a whole arm hardly determines the curve near zero speed, and may let it vanish there. A compensator would then
    act as a negative viscosity, and the joint would tremble. Below a low speed, a curve may be at most `STEEPER` times as
    steep as between that speed and twice that speed. Where it falls further, it is raised to that line.

    Args:
        friction: of a model.
    """
    law, low = friction.law, CREEP * friction.validity.speeds[1]
    if not isinstance(law.rate, Polyline):
        return friction
    v, curves = np.array(law.rate.velocity), {}
    for name in ("positive", "negative"):
        values = np.array(getattr(law.rate, name))
        slow, twice = np.interp((low, 2.0 * low), v, values)
        line = slow - STEEPER * max(twice - slow, 0.0) * (1.0 - v / low)
        raised = np.where(v < low, np.maximum(values, np.minimum(line, twice)), values)
        if np.any(raised > values):
            curves[name] = tuple(raised.tolist())
    if not curves:
        return friction
    return replace(friction, law=replace(law, rate=replace(law.rate, **curves)), covariance=None)


def break_away(
    friction: JointFriction, temperature: np.ndarray | None = None
) -> tuple[np.ndarray | float, np.ndarray | float]:
    """Return the largest friction of a joint at rest along +q and along -q, without load [N.m or N].

    Friction cannot be measured at zero speed. A curve may fall towards zero speed by extrapolation, or because the instants
    of reversals are unknown. So the result is the largest of three values: the curve at zero speed, its knots of slow
    sliding, and the value at zero speed of the line through a low speed and twice that speed.

    Args:
        friction: of a model.
        temperature: for laws that depend on it [degC], (n,); None: 20, and numbers are returned.
    """
    law, low = friction.law, CREEP * friction.validity.speeds[1]
    if law.rate.SMOOTH:
        return bounds_at_rest(law)
    warmth = None if temperature is None or "temperature" not in law.rate.NEEDS else temperature
    knots = [v for v in law.rate.velocity if v <= 2.0 * low] if isinstance(law.rate, Polyline) else []
    speeds = np.array([1e-12, low, 2.0 * low, *knots])[:, None] * np.ones(
        1 if warmth is None else warmth.size
    )
    shared = None if warmth is None else np.broadcast_to(warmth, speeds.shape)
    ends = []
    for way in (1.0, -1.0):
        curve = way * law.torque(way * np.maximum(speeds, 1e-12), temperature=shared)
        end = np.maximum(np.max(curve[[0, *range(3, len(curve))]], axis=0), 2.0 * curve[1] - curve[2])
        ends.append(float(end[0]) if warmth is None else end)
    return ends[0], ends[1]


def bounds_at_rest(law: Law) -> tuple[float, float]:
    """Return the friction's bounds at rest along +q and along -q [N.m or N]; of a smooth law its largest friction for both."""
    if law.rate.SMOOTH:
        largest = float(np.max(np.abs(law.torque(np.array([-1.0, 1.0])))))
        return largest, largest
    return law.coulomb()


def at_rest(law: Law) -> float:
    """Return the larger of the friction's bounds at rest [N.m or N]."""
    return max(bounds_at_rest(law))
