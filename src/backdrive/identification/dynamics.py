"""The rest of a joint's inverse dynamics, by term, and the torque that it all adds up to.

    tau = inertia (ddq - time_slip dddq) + offset + gravity_sin sin q + gravity_cos cos q
          + model_torque tau_model + tau_f(dq)

`time_slip` is the delay of the measured torque behind the motion: to first order it shows as jerk times inertia, which is
where an unnoticed slip spoils a friction curve.
"""

from __future__ import annotations

import numpy as np

from backdrive.engine import rollout
from backdrive.errors import InvalidInput
from backdrive.identification.signals import Signals
from backdrive.laws import Rigid
from backdrive.log import Joint
from backdrive.model import JointFriction

#: Term -> unit for a rotary and for a linear joint.
TERMS: dict[str, tuple[str, str]] = {
    "inertia": ("kg.m^2", "kg"),
    "time_slip": ("s", "s"),
    "offset": ("N.m", "N"),
    "gravity_sin": ("N.m", "N"),
    "gravity_cos": ("N.m", "N"),
    "model_torque": ("1", "1"),
}


def unit_of(term: str, joint: Joint) -> str:
    """Return the SI unit of a term for this joint."""
    rotary, linear = TERMS[term]
    return rotary if joint.unit == "rad" else linear


def rest_of_dynamics(friction: JointFriction, signals: Signals) -> np.ndarray:
    """Return the torque that is not friction [N.m or N], (n,).

    Raises:
        InvalidInput: the model needs a channel that the log does not hold.
    """
    value = {k: e.value for k, e in friction.dynamics.items()}
    tau = np.full(signals.velocity.shape, value.get("offset", 0.0))
    if value.get("inertia"):
        tau += value["inertia"] * (signals.acceleration - value.get("time_slip", 0.0) * signals.jerk)
    if "gravity_sin" in value or "gravity_cos" in value:
        if signals.position is None:
            raise _cannot(friction, "gravity", "position", "q")
        tau += value.get("gravity_sin", 0.0) * np.sin(signals.position)
        tau += value.get("gravity_cos", 0.0) * np.cos(signals.position)
    if "model_torque" in value:
        if signals.model_torque is None:
            raise _cannot(friction, "a torque known from elsewhere", "model_torque", "tau_model")
        tau += value["model_torque"] * signals.model_torque
    return tau


def _cannot(friction: JointFriction, term: str, channel: str, short: str) -> InvalidInput:
    return InvalidInput(
        f"Joint '{friction.joint.name}': the model has {term}, and the log holds no {channel}.",
        remedy=f"Name the channel, for example --map {short}=COLUMN.",
    )


def predict(friction: JointFriction, signals: Signals) -> np.ndarray:
    """Return the joint's total torque by the model, presliding included [N.m or N], (n,)."""
    rest = rest_of_dynamics(friction, signals)
    if isinstance(friction.law.element, Rigid):
        return rest + friction.law.torque(signals.velocity)
    return rest + rollout(friction.law, dq=signals.velocity, dt=1.0 / signals.rate)
