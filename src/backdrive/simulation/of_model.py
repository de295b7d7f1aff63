"""A simulated joint as a model describes it, and its log: `simulate(model, plan)`."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from backdrive._arguments import NUMBER, SEED, check_arguments, check_keywords, optional
from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput, NotIdentifiable, check_type
from backdrive.logs.log import Log
from backdrive.model import FrictionModel, JointFriction
from backdrive.parameters import number
from backdrive.plans import Plan
from backdrive.simulation import open_loop
from backdrive.simulation.joint import JointSimulation

BANDWIDTH = 100.0  # of the servo that follows a motion [rad/s]
#: Arguments of `simulate`; fields of a simulated joint replace those of the model.
ARGUMENTS = (
    *("model", "plan", "joint", "inertia", "seed", "rate"),
    *(field.name for field in fields(JointSimulation)),
)


def joint_of(friction: JointFriction, *, inertia: float | None = None, **more: Any) -> JointSimulation:
    """Return a simulated joint with the parameters of a model.

    Args:
        friction: of the joint, with the inertia, gravity and encoder that were identified beside it.
        inertia: of the joint [kg.m^2 or kg]; None: the model's.
        more: fields of `JointSimulation` that replace those of the model: `torque_noise`, `encoder_count`, `stiffness`, ...

    Raises:
        NotIdentifiable: the inertia is unknown.
        InvalidInput: a number makes no sense.
    """
    known = {name: estimate.value for name, estimate in friction.dynamics.items()}
    motor = friction.actuator.motor_inertia if friction.actuator else None
    inertia = known.get("inertia", motor) if inertia is None else inertia
    if inertia is None:
        raise NotIdentifiable(
            f"Joint '{friction.joint.name}': the model contains no inertia (a sweep removes it by symmetry).",
            remedy="Give inertia=... [kg.m^2 or kg], or identify by `motion`.",
        )
    inertia = number("inertia [kg.m^2 or kg]", inertia)
    counts = friction.joint.encoder_counts
    limit = friction.actuator.torque_limit if friction.actuator else None
    fields: dict[str, Any] = {
        "name": friction.joint.name,
        "unit": friction.joint.unit,
        "law": friction.law,
        "motor_inertia": inertia,
        "servo": Servo.from_bandwidth(inertia, BANDWIDTH),
        "gravity_sin": known.get("gravity_sin", 0.0),
        "gravity_cos": known.get("gravity_cos", 0.0),
        "encoder_count": 1.0 / counts if counts else 0.0,
    }
    if limit is not None:
        fields["torque_limit"] = limit
    return JointSimulation(**{**fields, **more})


def simulate(
    model: FrictionModel | JointSimulation,
    plan: Any,
    *,
    joint: str | int | None = None,
    inertia: float | None = None,
    seed: int = 0,
    rate: float = 1000.0,
    **more: Any,
) -> Log:
    """Drive a joint along a plan and record it, as a real one would be.

    Args:
        model: of friction, or a simulated joint.
        plan: the motion or torque, an object of `backdrive.plans`.
        joint: name or number; None: the only one.
        inertia: of the joint [kg.m^2 or kg]; None: the model's.
        seed: of the actuator's noise.
        rate: of controller and log [Hz].
        more: fields of `JointSimulation` that replace those of the model: `torque_noise`, `encoder_count`, `stiffness`, ...

    Returns:
        A log of one joint: time, encoder position, torque and, for a motion, the reference.

    Raises:
        NotIdentifiable: the inertia is unknown.
        InvalidInput: several joints and none is named, or plan and joint do not fit.
    """
    check_type(
        plan,
        Plan,
        "plan of one joint",
        "Give one of `backdrive.plans`, such as Sweep(stroke=0.3, top_speed=2.0, cycles=4).",
    )
    check_keywords("simulate", more, ARGUMENTS)
    kinds = {"inertia": optional(NUMBER), "seed": SEED, "rate": NUMBER}
    check_arguments(kinds, {"inertia": inertia, "seed": seed, "rate": rate})
    if isinstance(model, JointSimulation):
        return open_loop.simulate(model.replace(**more), plan, seed=seed, rate=rate)
    check_type(
        model, FrictionModel, "friction model", "Give one, such as identify(log).model, or a JointSimulation."
    )
    if joint is None and len(model.joints) != 1:
        raise InvalidInput(
            f"The model has {len(model.joints)} joints.", remedy=f"Name one: joint={model.names[0]!r}."
        )
    plant = joint_of(model.joint(0 if joint is None else joint), inertia=inertia, **more)
    return open_loop.simulate(plant, plan, seed=seed, rate=rate)
