"""A joint's friction and its growth with the load in both directions of power, from sweeps with and without a known payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.curves import hats, knot_names
from backdrive.identification.evidence import describe_fit, evidence, parts_of
from backdrive.identification.load_fit import PayloadGrowth, payload_growth
from backdrive.identification.quality import assess_parts
from backdrive.identification.result import JointEvidence
from backdrive.identification.signals import Signals, prepare_each
from backdrive.identification.sweep import pairs
from backdrive.identification.sweep_delay import drive_delays
from backdrive.identification.sweep_knots import polyline_through
from backdrive.identification.sweep_verdict import error_of_curve
from backdrive.identification.terms import GRAVITY, column, estimates
from backdrive.identification.timing import Timing
from backdrive.laws import Growth, Law
from backdrive.logs.log import Log
from backdrive.model import Covariance, JointFriction, Validity
from backdrive.model.covariance import errors_by_parameter

REACH = 1.96  # standard errors of a 95 % interval


def identify_payload(
    logs: Sequence[Log],
    joint: str,
    payloads: Sequence[tuple[float, float]],
    *,
    timing: Timing | None = None,
    delay: float | None = None,
) -> tuple[JointFriction, JointEvidence]:
    """Identify one joint's friction, and its growth for a motor that lifts the load and for a load that drives the motor back.

    Inertia and quality come from the sweeps with the least payload.

    Args:
        logs: one sweep each, about several centers, each with and without the payload.
        joint: name.
        payloads: s and c of the payload's gravity s sin q + c cos q in each log; (0, 0) without one [N.m].
        timing: as in `identify_sweep`.
        delay: as in `identify_sweep` [s].

    Returns:
        The friction, with a law for zero load and its growth in both directions of power; and the evidence.

    Raises:
        InvalidInput: the joint is linear, the number of payloads and logs differs, or all payloads are equal.
        NotIdentifiable: the sweeps do not separate curve, gravity, growth and payload.
    """
    if len(payloads) != len(logs):
        raise InvalidInput(
            f"{len(payloads)} payloads for {len(logs)} logs.",
            remedy="Give one for each log in their order, 0 for none: --payload 0,0,0,0:20,0:20,0:20.",
        )
    about = logs[0].select(joint).on_joint_side().joints[0]
    if about.unit != "rad":
        raise InvalidInput(
            f"Joint '{joint}' is linear: its weight does not change along it.",
            remedy="A payload tells growth with the load on rotary joints.",
        )
    stretches = prepare_each(logs, joint)
    delays, errors, remarks = drive_delays(logs, joint, stretches, timing, False, delay)
    knots = [pairs(log, joint, s, delay=d) for log, s, d in zip(logs, stretches, delays, strict=True)]
    found = payload_growth(knots, payloads, name=joint)
    size = np.hypot(*np.array(payloads, dtype=float).T)
    light = np.flatnonzero(size <= size.min()).tolist()
    weight = np.array([knots[i].inertia[1] for i in light]) ** -2.0
    inertia = float(weight @ [knots[i].inertia[0] for i in light] / weight.sum())
    slip = -0.5 / stretches[light[0]][0].rate - delays[light[0]]
    values = {
        "inertia": (inertia, float(weight.sum() ** -0.5)),
        "time_slip": (slip, errors[light[0]]),
        "gravity_sin": (float(found.gravity[0]), float(found.gravity_error[0])),
        "gravity_cos": (float(found.gravity[1]), float(found.gravity_error[1])),
    }
    speeds = np.concatenate([s.velocity for log in stretches for s in log])
    law = polyline_through(found.velocity, found.positive, found.negative)
    shapes = np.kron(np.eye(2), hats(np.array(law.velocity), found.velocity))
    spread = np.zeros((len(shapes) + 4, len(found.covariance)))
    spread[:-4, :-4], spread[-4:, -4:] = shapes, np.eye(4)
    covariance = spread @ found.covariance @ spread.T
    names = (*knot_names(len(law.velocity)), *GRAVITY, "load_driving", "load_driven")
    errors_of = errors_by_parameter(names, covariance)
    friction = JointFriction(
        joint=about,
        law=Law(
            rate=law,
            growth=Growth(load_driving=found.driving[0], load_driven=found.driven[0]),
        ),
        standard_errors={name: e for name, e in errors_of.items() if name not in GRAVITY},
        covariance=Covariance.of(names, covariance),
        dynamics=estimates(values, about.unit),
        validity=Validity(
            velocity=(float(speeds.min()), float(speeds.max())), lowest_speed=float(found.velocity[0])
        ),
        method="sweep",
        warnings=tuple(dict.fromkeys([w for k in knots for w in k.warnings] + remarks)),
    )
    bare = [_without(s, *payloads[i]) for i in light for s in stretches[i]]
    parts = parts_of(friction, bare, True)
    friction = replace(friction, fitted=assess_parts(parts))
    support = evidence(friction, parts, error_of_curve(friction))
    return friction, replace(support, verdict=_verdict(friction, found))


def _without(s: Signals, sine: float, cosine: float) -> Signals:
    """Return signals without a payload's gravity."""
    return replace(s, torque=s.torque - sine * column(s, "gravity_sin") - cosine * column(s, "gravity_cos"))


def _verdict(friction: JointFriction, found: PayloadGrowth) -> str:
    unit = friction.joint.torque_unit
    (up, a), (down, b) = found.driving, found.driven
    return (
        f"Without load, friction is {found.positive[0]:.3g} {unit} along +q and {found.negative[0]:.3g} {unit} along -q at "
        f"{found.velocity[0]:.3g} rad/s. It grows by {up:.4f} +- {REACH * a:.4f} of the load while the motor lifts it, and by "
        f"{down:.4f} +- {REACH * b:.4f} while the load drives the motor (95 %, condition {found.condition:.0f}). "
        f"{describe_fit(friction)}"
    )
