"""The terms of a joint's inverse dynamics other than friction, and the total torque.

    tau = inertia ddq + offset + gravity_sin sin q + gravity_cos cos q + model_torque tau_model + tau_f(dq, l)

l = g(q) + inertia ddq is the load of the joint, with which friction grows if the law contains such a growth (`laws.growth`).
The delay of the measured torque behind the motion is `time_slip` in a regression and `delay` in a search. The motion in all
terms is delayed by it.
"""

from __future__ import annotations

import numpy as np

from backdrive.engine import rollout
from backdrive.errors import InvalidInput
from backdrive.identification.delay import delay_motion
from backdrive.identification.signals import Signals
from backdrive.identification.terms import GRAVITY, columns
from backdrive.laws import Rigid
from backdrive.laws.growth import pairs
from backdrive.model import JointFriction


def rest_of_dynamics(friction: JointFriction, signals: Signals) -> np.ndarray:
    """Return the torque that is not friction [N.m or N], (n,).

    Raises:
        InvalidInput: the model needs a channel that the log does not hold.
    """
    return _rest(friction, _then(friction, signals))


def _rest(friction: JointFriction, signals: Signals) -> np.ndarray:
    value = {k: e.value for k, e in friction.dynamics.items()}
    tau = np.full(signals.velocity.shape, value.get("offset", 0.0))
    if value.get("inertia"):
        tau += value["inertia"] * signals.acceleration
    tau += _pull(friction, signals)
    if "model_torque" in value:
        if signals.model_torque is None:
            raise _cannot(friction, "a torque known from elsewhere", "model_torque", "tau_model")
        tau += value["model_torque"] * signals.model_torque
    return tau


def _pull(friction: JointFriction, signals: Signals) -> np.ndarray | float:
    """Return the torque of gravity [N.m or N], (n,)."""
    terms = [term for term in GRAVITY if term in friction.dynamics]
    if terms and signals.position is None:
        raise _cannot(friction, "gravity", "position", "q")
    if not terms:
        return 0.0
    return np.einsum("p,pn->n", [friction.dynamics[term].value for term in terms], columns(signals, terms))


def load_torque(friction: JointFriction, signals: Signals) -> np.ndarray | None:
    """Return the load of the joint, gravity plus inertial torque [N.m or N], (n,); None if it is unknown or not needed.

    If the model contains neither gravity nor inertia, the load is the negative of the log's external torque.

    Raises:
        InvalidInput: the model needs a channel that the log does not hold.
    """
    if friction.law.growth is None:
        return None
    inertia = friction.dynamics.get("inertia")
    if inertia is None and not any(term in friction.dynamics for term in GRAVITY):
        return None if signals.load is None else -signals.load[:, 1]
    accelerating = 0.0 if inertia is None else inertia.value
    return _pull(friction, signals) + accelerating * signals.acceleration


def growth_with_load(friction: JointFriction) -> tuple[float, float] | None:
    """Return the growth of friction with the load, equal for lifting and lowering [-], and the load of its curve [N.m or N].

    None if the model does not contain it.
    """
    growth = friction.law.growth
    return None if growth is None else (growth.mean, growth.load_carried)


def _cannot(friction: JointFriction, term: str, channel: str, short: str) -> InvalidInput:
    return InvalidInput(
        f"Joint '{friction.joint.name}': the model has {term}, and the log holds no {channel}.",
        remedy=f"Name the channel, for example --map {short}=COLUMN.",
    )


def predict(friction: JointFriction, signals: Signals) -> np.ndarray:
    """Return the joint's total torque by the model, presliding included [N.m or N], (n,).

    Raises:
        InvalidInput: the model needs a channel that the log does not hold.
    """
    return rest_and_total(friction, signals)[1]


def rest_and_total(friction: JointFriction, signals: Signals) -> tuple[np.ndarray, np.ndarray]:
    """Return the results of `rest_of_dynamics` and `predict` [N.m or N], (n,) each, in hardly more time than one of them.

    Raises:
        InvalidInput: the model needs a channel that the log does not hold.
    """
    then = _then(friction, signals)
    rest, law, dt = _rest(friction, then), friction.law, 1.0 / then.rate
    load, temperature = pairs(load_torque(friction, then), then.velocity.shape), None
    if "load" in law.rate.NEEDS:
        if then.load is None:
            raise _cannot(friction, "friction that depends on the load", "load", "load")
        load = then.load
    if "temperature" in law.rate.NEEDS:
        if then.temperature is None:
            raise _cannot(friction, "friction that depends on the temperature", "temperature", "temp")
        temperature = then.temperature
    if isinstance(law.element, Rigid):
        return rest, rest + law.torque(then.velocity, load, temperature)
    moved = increments(then.position, then.velocity, dt) / dt
    return rest, rest + rollout(law, dq=moved, dt=dt, load=load, temperature=temperature)


def increments(position: np.ndarray | None, velocity: np.ndarray, dt: float) -> np.ndarray:
    """Return the displacement of a joint in the interval that ends at each sample [rad or m], (n,).

    Args:
        position: [rad or m], (n,); None for a velocity-only log.
        velocity: [rad/s or m/s], (n,).
        dt: sampling time [s].
    """
    if position is not None:
        return np.diff(position, prepend=position[:1])
    return 0.5 * dt * (velocity + np.concatenate([velocity[:1], velocity[:-1]]))


def _then(friction: JointFriction, signals: Signals) -> Signals:
    """Return the motion and the load that belong to the torque of each sample; the model torque is not shifted."""
    return delay_motion(signals, friction.delay)
