"""Data of a joint beside law and dynamics, from the logs, the evidence and the robot's description."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from backdrive.errors import BackdriveError
from backdrive.identification.quality import grade
from backdrive.identification.result import JointEvidence
from backdrive.logs.log import Log
from backdrive.logs.resolution import channel_noise
from backdrive.model import Actuator, JointFriction, TorqueChannel, Verdict
from backdrive.parameters import BIG
from backdrive.plans.limits import JointLimits, read_limits


def supplement(
    friction: JointFriction, evidence: JointEvidence, logs: Sequence[Log], limits: Mapping[str, JointLimits]
) -> JointFriction:
    """Return the joint with delay and noise of its torque, limits, ranges, bands and verdict.

    Args:
        friction: result of the method, with torque on the joint side.
        evidence: of the same joint.
        logs: fitted logs.
        limits: by joint, from the robot's description; the largest speed is the loop's trip speed.
    """
    name, validity, actuator = friction.joint.name, friction.validity, friction.actuator
    singles = [log.select(name).on_joint_side() for log in logs]
    if friction.law.growth is not None:
        validity = replace(validity, nominal_load=abs(friction.law.growth.load_carried))
    warmth = [log.temperature[np.isfinite(log.temperature)] for log in singles if log.temperature is not None]
    if warmth and np.concatenate(warmth).size:
        both = np.concatenate(warmth)
        validity = replace(validity, temperature=(float(both.min()), float(both.max())))
    known = limits.get(name, JointLimits())
    stated = {"torque_limit": known.effort, "trip_speed": known.velocity}
    if stated := {key: value for key, value in stated.items() if math.isfinite(value)}:
        actuator = replace(actuator or Actuator(), **stated)
    return replace(
        friction,
        validity=validity,
        friction_side="joint",
        torque_channel=_channel(friction, evidence, singles),
        actuator=actuator,
        bands=evidence.bands,
        verdict=Verdict(grade=grade(friction).level, text=evidence.verdict),
    )


def limits_of(urdf: str | None) -> dict[str, JointLimits]:
    """Return the limits of each joint from the robot's description; empty without one."""
    if urdf is None:
        return {}
    try:
        return read_limits(urdf)
    except BackdriveError:  # limits are optional
        return {}


def _channel(
    friction: JointFriction, evidence: JointEvidence, singles: Sequence[Log]
) -> TorqueChannel | None:
    """Return delay and noise of the measured torque; None if no torque was measured."""
    measured = [log for log in singles if log.torque is not None]
    if not measured:
        return None
    delay = friction.dynamics.get("delay", friction.dynamics.get("time_slip"))
    size = np.array([len(log) for log in measured])
    noises = np.array([channel_noise(log, "torque", 0) for log in measured])
    noise = float(np.sqrt(size @ noises**2 / max(size.sum(), 1)))
    return TorqueChannel(
        delay=None if delay is None else delay.value,
        delay_error=None if delay is None else _number(delay.standard_error),
        noise=_number(noise) or None,  # in a channel with coarse steps, noise cannot be measured
        long_run=_number(evidence.long_run),
    )


def _number(value: float | None) -> float | None:
    """Return a number if a model file may hold it, or else None."""
    return value if value is not None and abs(value) <= BIG else None
