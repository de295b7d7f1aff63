"""`FrictionModel`: what was identified, how sure it is, and where it holds. `model_file` writes and reads it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from backdrive._catalog import lookup
from backdrive._upper import upper
from backdrive.errors import ExtrapolationWarning, InvalidInput, NegativeFrictionWarning
from backdrive.laws import Law
from backdrive.logs.log import Joint, Source

EDGE = 1e-9  # share of its end by which a validity range is wider when a velocity is looked at: rounding [-]


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A number with its unit and standard error.

    Attributes:
        value: the estimate [unit].
        unit: SI.
        standard_error: one standard deviation [unit]; NaN when unknown.
    """

    value: float
    unit: str
    standard_error: float = float("nan")


@dataclass(frozen=True, kw_only=True)
class Validity:
    """The range that the data covered; outside it the model extrapolates.

    Attributes:
        velocity: smallest and largest velocity seen [rad/s or m/s].
        load: smallest and largest transmitted torque seen [N.m or N], if known.
        temperature: smallest and largest temperature seen [degC], if known.
    """

    velocity: tuple[float, float]
    load: tuple[float, float] | None = None
    temperature: tuple[float, float] | None = None

    def __post_init__(self):
        for name in ("velocity", "load", "temperature"):
            ends = getattr(self, name)
            if ends is not None and not (-math.inf < ends[0] <= ends[1] < math.inf):
                raise InvalidInput(
                    f"validity.{name} goes from {ends[0]:g} to {ends[1]:g}.",
                    remedy="Give two finite numbers, the smaller one first.",
                )


@dataclass(frozen=True, kw_only=True)
class Quality:
    """How well measured torque is explained.

    Attributes:
        residual: 100 |tau - tau_hat| / |tau|, both low-passed at 5 Hz where the sampling allows [%].
        residual_raw: the same without the low pass [%].
        rms: root mean square of tau - tau_hat, raw [N.m or N].
        samples: number of samples judged.
    """

    residual: float
    residual_raw: float
    rms: float
    samples: int


@dataclass(frozen=True, kw_only=True)
class JointFriction:
    """The friction of one joint.

    Attributes:
        joint: whose friction it is.
        law: rate law and presliding element with their values.
        standard_errors: by parameter of the law (rate law, element, growth), one number or one a knot [its unit].
        at_bound: names of parameters that ended at a bound of their range.
        dynamics: the rest of the inverse dynamics found beside the friction, by term (see
            `identification.dynamics`): inertia, offset, gravity_sin, gravity_cos, ...
        validity: the range that the data covered.
        fitted: quality on the data of the fit.
        held_out: quality on data that the fit did not see; None when nothing was held out.
        method: which identification found it.
        warnings: what makes the result suspect, in sentences.
    """

    joint: Joint
    law: Law
    validity: Validity
    standard_errors: Mapping[str, Any] = field(default_factory=dict)
    at_bound: tuple[str, ...] = ()
    dynamics: Mapping[str, Estimate] = field(default_factory=dict)
    fitted: Quality | None = None
    held_out: Quality | None = None
    method: str = ""
    warnings: tuple[str, ...] = ()

    def driving(self) -> tuple[float, float] | None:
        """Return where in the validity range friction drives the motion, as negative friction does.

        Friction resists where tau_f v >= 0. Looked at 201 velocities, and at the knots, between which line sections are
        straight.

        Returns:
            Lowest and highest such velocity [rad/s or m/s]; None where there is none.
        """
        low, high = self.validity.velocity
        knots = np.asarray(getattr(self.law.rate, "velocity", ()), dtype=np.float64)
        velocity = np.concatenate([np.linspace(low, high, 201), knots, -knots])
        velocity = velocity[(velocity >= low) & (velocity <= high)]
        wrong = velocity[self.law.torque(velocity) * velocity < 0.0]
        return (float(wrong.min()), float(wrong.max())) if wrong.size else None

    def outside(self, velocity: np.ndarray) -> np.ndarray:
        """Return which velocities [rad/s or m/s] are outside the validity range, of the shape of `velocity`."""
        low, high = self.validity.velocity
        return (velocity < low - EDGE * abs(low)) | (velocity > high + EDGE * abs(high))

    def extrapolated(self, velocity: np.ndarray) -> str:
        """Return in a sentence how far velocities [rad/s or m/s] leave the validity range; empty where they do not."""
        outside = self.outside(velocity)
        if not np.any(outside):
            return ""
        low, high, unit = *self.validity.velocity, f"{self.joint.unit}/s"
        beyond = velocity[outside]
        furthest = float(beyond[np.argmax(np.maximum(low - beyond, beyond - high))])
        share = f", with {100.0 * np.mean(outside):.2g} % of the velocities" if velocity.size > 1 else ""
        return (
            f"Joint '{self.joint.name}': {furthest:.4g} {unit} is outside the validity range, {low:.4g} to {high:.4g} {unit}"
            f"{share}; there the model extrapolates."
        )

    def remarks(self) -> tuple[str, ...]:
        """Return what the numbers alone say against the model, in sentences."""
        ends, unit = self.driving(), f"{self.joint.unit}/s"
        if ends is None:
            return ()
        where = f"at {ends[0]:.4g}" if ends[0] == ends[1] else f"between {ends[0]:.4g} and {ends[1]:.4g}"
        return (f"Friction is negative {where} {unit}: there the model drives the motion.",)


@dataclass(frozen=True, kw_only=True)
class ArmModel:
    """The rigid-body part of a whole arm.

    Attributes:
        urdf_sha256: digest of the robot description that the parameters belong to.
        parameters: standard inertial parameters of every link, ten each in the order of the description
            [kg, kg.m, kg.m^2], (10 J,). Only their base combinations are identified.
        condition: condition number of the fitted regressor [-].
    """

    urdf_sha256: str
    parameters: tuple[float, ...]
    condition: float


@dataclass(frozen=True, kw_only=True)
class FrictionModel:
    """The friction of every joint of a robot, ready to be used.

    Attributes:
        joints: one `JointFriction` a joint.
        arm: rigid-body parameters, when a whole arm was identified.
        sources: files it came from, with digests.
        options: how it was asked for.
        version: backdrive that made it.
    """

    joints: tuple[JointFriction, ...]
    arm: ArmModel | None = None
    sources: tuple[Source, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    version: str = ""

    def __post_init__(self):
        names = self.names
        if not names or len(set(names)) != len(names):
            raise InvalidInput(
                f"A FrictionModel needs distinct joints, got {names}.", remedy="Name each joint once."
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Joint names, in order."""
        return tuple(j.joint.name for j in self.joints)

    def joint(self, joint: str | int) -> JointFriction:
        """Return one joint's friction by name or position.

        Raises:
            UnknownName: no such joint; the message lists the names.
        """
        if isinstance(joint, (int, np.integer)) and str(joint) not in self.names:
            joint = dict(enumerate(self.names)).get(int(joint), str(joint))
        return lookup(str(joint), dict(zip(self.names, self.joints)), "joint of this model")

    def torque(
        self,
        joint: str | int,
        dq: np.ndarray | float,
        load: np.ndarray | float | None = None,
        temperature: np.ndarray | float | None = None,
    ) -> np.ndarray:
        """Return a joint's steady friction torque at a velocity, under a load and at a temperature.

        Args:
            joint: name or position.
            dq: joint velocity [rad/s or m/s], any shape.
            load: that the joint carries, gravity and what accelerates it, positive along +q [N.m or N], one number or the shape of
                `dq`; or pairs of motor-side and external torque, that shape and (2,). None: the load under which the curve was
                identified, or none where the model does not know how friction grows with it.
            temperature: for laws that depend on it [degC], one number or the shape of `dq`; None: 20.

        Returns:
            tau_f [N.m or N], positive for positive velocity, 0 at rest; the shape of `dq`.

        Raises:
            UnknownName: no such joint.
            InvalidInput: a velocity, load or temperature is not finite, or their shapes do not match.

        Warns:
            ExtrapolationWarning: a velocity is outside the validity range.
            NegativeFrictionWarning: at a velocity friction drives the motion instead of resisting it.
        """
        velocity = np.asarray(dq, dtype=np.float64)
        for name, plural, value in (
            ("velocity", "velocities", velocity),
            ("load", "loads", load),
            ("temperature", "temperatures", temperature),
        ):
            if value is not None and not np.all(np.isfinite(value)):
                raise InvalidInput(f"A {name} is NaN or infinite.", remedy=f"Give finite {plural}.")
        friction = self.joint(joint)
        torque = friction.law.torque(velocity, load, temperature)
        if said := friction.extrapolated(velocity):
            warnings.warn(said, ExtrapolationWarning, stacklevel=2)
        if np.any(wrong := torque * velocity < 0.0):
            said = f"friction is negative at {velocity[wrong][0]:.4g} {friction.joint.unit}/s; there the model drives the motion"
            warnings.warn(f"Joint '{friction.joint.name}': {said}.", NegativeFrictionWarning, stacklevel=2)
        return torque

    def table(self, speeds: int = 21) -> dict[str, dict[str, np.ndarray]]:
        """Return each joint's curve over its validity range.

        Args:
            speeds: number of velocities.

        Returns:
            joint name -> {"velocity": (speeds,) [rad/s or m/s], "torque": (speeds,) [N.m or N]}.
        """
        result = {}
        for j in self.joints:
            velocity = np.linspace(*j.validity.velocity, speeds)
            result[j.joint.name] = {"velocity": velocity, "torque": j.law.torque(velocity)}
        return result

    def save(self, path) -> None:
        """Write the model file (JSON), whole or not at all."""
        upper("model.file", "save")(self, path)


def load_model(path) -> FrictionModel:
    """Read a model file, or published parameters by name.

    Args:
        path: of the file; or `preset:NAME`, such as `preset:mx106/m6`.

    Raises:
        ModelFileError: the file is absent, no regular file, damaged, of another kind or of a newer schema, or holds numbers that
            no joint has; the message says where and why.
        UnknownName: there is no such preset; the message lists them.
    """
    preset = upper("model.presets", "preset_name")(path)
    return (
        upper("model.file", "load")(path) if preset is None else upper("model.presets", "load_preset")(preset)
    )
