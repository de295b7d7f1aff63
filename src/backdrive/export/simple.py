"""A joint's friction in a robot description: the nearest Coulomb and viscous friction, or MuJoCo's LuGre model.

    tau = F sgn(v) + B v

F and B >= 0 are fitted by least squares to the identified curve over the velocities that the data covered. MuJoCo 4 contains
LuGre as a passive `dcmotor`. It represents Coulomb, viscous or Gauss-Stribeck friction on a LuGre bristle exactly, if both
directions are equal and the bristle's damping does not fade.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from backdrive.laws import Law, LuGre

if TYPE_CHECKING:
    from backdrive.model.joint_friction import JointFriction

SPEEDS = 200  # velocities of a fit, in each direction


@dataclass(frozen=True, kw_only=True)
class Simple:
    """A joint's friction in a description, and the effects that it leaves out.

    Attributes:
        joint: name.
        friction: F [N.m or N].
        damping: B [N.m.s/rad or N.s/m].
        armature: inertia of the motor on the joint side [kg.m^2 or kg]; None if the model does not contain it.
        velocity: smallest and largest velocity of the fit [rad/s or m/s].
        largest_error: of the torque, against the identified curve [N.m or N].
        rms_error: of the same [N.m or N].
        lost: what the description cannot express, in words.
        lugre: stiffness, damping, Coulomb, break-away torque and Stribeck velocity of a `dcmotor` in SI units; None: there is none.
    """

    joint: str
    friction: float
    damping: float
    armature: float | None
    velocity: tuple[float, float]
    largest_error: float
    rms_error: float
    lost: tuple[str, ...]
    lugre: tuple[float, ...] | None = None


def simplify(friction: JointFriction) -> Simple:
    """Return the Coulomb and viscous friction nearest to what was identified, over the velocities that the data covered."""
    law = friction.law
    low, high = friction.validity.velocity
    top = max(abs(low), abs(high))
    slowest = min(friction.validity.lowest_speed or 1e-3 * top, top)
    speeds = np.linspace(slowest, top, SPEEDS)
    velocity = np.concatenate([speeds, -speeds])
    torque = law.torque(velocity)
    F, B = _line(np.abs(velocity), torque * np.sign(velocity))
    error = torque - (F * np.sign(velocity) + B * velocity)
    lost = []
    if law.element.states():
        lost.append(f"presliding ('{law.element.NAME}')")
    forwards, backwards = law.torque(speeds), -law.torque(-speeds)
    if np.abs(forwards - backwards).max() > 1e-6 * np.abs(torque).max():
        lost.append("different friction in the two directions")
    if law.growth is not None or "load" in law.rate.NEEDS:
        lost.append("growth with the load")
    if "temperature" in law.rate.NEEDS:
        lost.append("change with temperature")
    actuator = friction.actuator
    return Simple(
        joint=friction.joint.name,
        friction=float(F),
        damping=float(B),
        armature=None if actuator is None else actuator.motor_inertia,
        velocity=(-top, top),
        largest_error=float(np.abs(error).max()),
        rms_error=float(np.sqrt(np.mean(error**2))),
        lost=tuple(lost),
    )


def with_lugre(simple: Simple, law: Law) -> Simple:
    """Return the same with the law as a `dcmotor` of MuJoCo, where that fits."""
    element, numbers = law.element, law.rate.values()
    if type(element) is not LuGre or law.growth is not None:
        return simple
    if law.rate.NAME == "coulomb-viscous":
        if numbers["coulomb_positive"] != numbers["coulomb_negative"]:
            return simple
        if numbers["viscous_positive"] != numbers["viscous_negative"]:
            return simple
        numbers = {name.removesuffix("_positive"): value for name, value in numbers.items()}
    elif law.rate.NAME not in ("coulomb", "m1", "stribeck-gauss"):
        return simple
    coulomb = float(numbers["coulomb"])
    fades = element.fading > 0.0 and element.damping > 0.0
    return replace(
        simple,
        friction=0.0,
        damping=float(numbers.get("viscous", 0.0)),
        lugre=(
            element.stiffness,
            element.damping,
            coulomb,
            float(numbers.get("breakaway", coulomb)),
            float(numbers.get("stribeck_velocity", 1.0)),
        ),
        largest_error=0.0,
        rms_error=0.0,
        lost=("a damping of the bristle that fades",) if fades else (),
    )


def _line(speed: np.ndarray, torque: np.ndarray) -> tuple[float, float]:
    """Return F >= 0 and B >= 0 of the line F + B v nearest to a curve, by least squares."""
    slope, intercept = np.polyfit(speed, torque, 1)
    if slope < 0.0:
        return max(float(torque.mean()), 0.0), 0.0
    if intercept < 0.0:
        return 0.0, max(float(speed @ torque / (speed @ speed)), 0.0)
    return float(intercept), float(slope)
