"""The rest of a joint's inverse dynamics, by term, and the torque that it all adds up to.

    tau = inertia (ddq - time_slip dddq) + offset + gravity_sin sin q + gravity_cos cos q
          + model_torque tau_model + tau_f(dq)

`time_slip` is the delay of the measured torque behind the motion: to first order it shows as jerk times inertia, which is
where an unnoticed slip spoils a friction curve.
"""

from __future__ import annotations

import numpy as np

from backdrive.identification.signals import Signals
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
    """Return the torque that is not friction [N.m or N], (n,)."""
    value = {k: e.value for k, e in friction.dynamics.items()}
    tau = np.full(signals.velocity.shape, value.get("offset", 0.0))
    if value.get("inertia"):
        tau += value["inertia"] * (signals.acceleration - value.get("time_slip", 0.0) * signals.jerk)
    if "gravity_sin" in value and signals.position is not None:
        tau += value["gravity_sin"] * np.sin(signals.position) + value["gravity_cos"] * np.cos(
            signals.position
        )
    if "model_torque" in value and signals.model_torque is not None:
        tau += value["model_torque"] * signals.model_torque
    return tau


def predict(friction: JointFriction, signals: Signals) -> np.ndarray:
    """Return the joint's total torque by the model [N.m or N], (n,)."""
    return rest_of_dynamics(friction, signals) + friction.law.torque(signals.velocity)
