"""`FrictionModel`: the identified joints of a robot. `model.file` writes and reads it."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from backdrive._catalog import lookup
from backdrive._upper import Display, upper
from backdrive.errors import ExtrapolationWarning, InvalidInput, NegativeFrictionWarning, check_path
from backdrive.logs.joint import Source, check_coupling
from backdrive.model.covariance import AGAIN, check_covariance
from backdrive.model.joint_friction import JointFriction
from backdrive.parameters import numbers, whole

ONE = np.float64(1.0)  # a product with it is a NumPy number, made in half the time of `np.float64(x)`


@dataclass(frozen=True, kw_only=True)
class ArmModel:
    """The rigid-body part of a whole arm.

    Attributes:
        urdf_sha256: digest of the robot description that the parameters belong to.
        parameters: standard inertial parameters of every link, ten each in the order of the description
            [kg, kg.m, kg.m^2], (10 J,). Only their base combinations are identified.
        condition: condition number of the fitted regressor [-].
        covariance: of the base parameters in the order of `Robot.base`, and of the joints' offsets after them, in the order of
            the description, (b + J, b + J); None where it is not known.
    """

    urdf_sha256: str
    parameters: tuple[float, ...]
    condition: float
    covariance: tuple[tuple[float, ...], ...] | None = None

    def __post_init__(self):
        if self.covariance is not None:
            size = len(self.covariance)
            if not 0 < size <= len(self.parameters) or any(len(row) != size for row in self.covariance):
                raise InvalidInput(
                    f"The covariance of the arm's bodies is not of {size} rows and columns.", remedy=AGAIN
                )
            check_covariance(np.array(self.covariance, dtype=np.float64))


@dataclass(frozen=True, kw_only=True)
class FrictionModel(Display):
    """The friction of every joint of a robot, ready to be used.

    Attributes:
        joints: one `JointFriction` a joint.
        arm: rigid-body parameters, when a whole arm was identified.
        sources: files it came from, with digests.
        options: options of the identification.
        version: backdrive that made it.
        coupling: C of q_joint = C q_motor, where motors drive several joints, rows in the order of the joints, (J, J).
        coupled: names of the joints in the rows of `coupling`, if the matrix contains more joints than the model.
    """

    joints: tuple[JointFriction, ...]
    arm: ArmModel | None = None
    sources: tuple[Source, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    version: str = ""
    coupling: tuple[tuple[float, ...], ...] | None = None
    coupled: tuple[str, ...] = ()

    def __post_init__(self):
        names = self.names
        if not names or len(set(names)) != len(names):
            raise InvalidInput(
                f"A FrictionModel needs distinct joints, got {names}.", remedy="Name each joint once."
            )
        if self.coupling is not None:
            rows = self.coupled or names
            check_coupling(self.coupling, len(rows))
            if len(set(rows)) != len(rows) or not set(names) <= set(rows):
                raise InvalidInput(
                    f"The rows of the coupling are of {', '.join(rows)}, and the joints {', '.join(names)}.",
                    remedy="Name each joint of the model, and each other one of the matrix, once.",
                )

    def __repr__(self) -> str:
        return f"<FrictionModel of {', '.join(self.names)}>"

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
        return lookup(str(joint), dict(zip(self.names, self.joints, strict=True)), "joint of this model")

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
            load: load of the joint, that is, its torque of gravity and inertia, positive along +q [N.m or N], one number or
                the shape of `dq`; or pairs of motor-side and external torque, that shape and (2,). None: the load under which
                the curve was identified, or no load if the model has no growth with it.
            temperature: for laws that depend on it [degC], one number or the shape of `dq`; None: 20.

        Returns:
            tau_f [N.m or N], positive for positive velocity, 0 at rest; the shape of `dq`.

        Raises:
            UnknownName: no such joint.
            InvalidInput: a velocity, load or temperature is not finite, or their shapes do not match.

        Warns:
            ExtrapolationWarning: a velocity is beyond the validity range, or below the lowest speed of the data and not zero.
            NegativeFrictionWarning: at a velocity friction drives the motion instead of resisting it.
        """
        if load is None and temperature is None and type(dq) is float:
            try:
                scalar = self._scalars[joint]
            except (KeyError, TypeError):  # not yet there; a list, for example
                scalar = None
            if scalar is not None:
                at, row, low, high, slowest = scalar
                if low <= dq <= high and (dq >= slowest or -dq >= slowest or dq == 0.0):
                    value = at(row, dq)
                    if value * dq >= 0.0:
                        return ONE * value  # type: ignore[return-value]
        velocity = numbers("dq", dq)
        for name, plural, value in (
            ("velocity", "velocities", velocity),
            ("load", "loads", load),
            ("temperature", "temperatures", temperature),
        ):
            if value is not None and not np.all(np.isfinite(numbers(name, value))):
                raise InvalidInput(f"A {name} is NaN or infinite.", remedy=f"Give finite {plural}.")
        friction = self.joint(joint)
        torque = friction.law.torque(velocity, load, temperature)
        if said := friction.extrapolation(velocity):
            warnings.warn(said, ExtrapolationWarning, stacklevel=2)
        if np.any(slow := friction.too_slow(velocity)):
            said = f"Joint '{friction.joint.name}' at {velocity[slow][0]:.4g} {friction.joint.unit}/s: "
            warnings.warn(said + friction.lowest_speed_remark(), ExtrapolationWarning, stacklevel=2)
        if np.any(wrong := torque * velocity < 0.0):
            said = f"friction is negative at {velocity[wrong][0]:.4g} {friction.joint.unit}/s; there the model drives the motion"
            warnings.warn(f"Joint '{friction.joint.name}': {said}.", NegativeFrictionWarning, stacklevel=2)
        if velocity.ndim == 0 and friction.law.growth is None and friction.law.rate.MARK == 0.0:
            from backdrive._jit import entry

            row = friction.law.row()
            self._scalars[joint] = (
                entry(friction.law.scalar, row, 0.0),
                row,
                *friction.validity.velocity,
                friction.validity.lowest_speed or 0.0,
            )
        return torque

    @cached_property
    def _scalars(
        self,
    ) -> dict[str | int, tuple[Callable[[np.ndarray, float], float], np.ndarray, float, float, float]]:
        """Cache of curve, row, validity range and lowest speed, of joints whose torque at a single velocity was computed."""
        return {}

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_scalars"}

    def sample(self, n: int, seed: int = 0, joint: str | int | None = None) -> np.ndarray:
        """Return random draws of a joint's friction law from the identified covariance, within the bounds of its parameters.

        Args:
            n: how many.
            seed: the same one gives the same draws.
            joint: name or number; None: the only joint.

        Returns:
            Rows of parameters as kernels and arrays read them (`Law.row`), (n, P).

        Raises:
            InvalidInput: the model has several joints and none is named, or it has no errors of the joint's law.
        """
        from backdrive.model.sample import draw_laws

        if joint is None and len(self.joints) != 1:
            raise InvalidInput(
                f"The model has {len(self.joints)} joints.", remedy=f"Name one of {', '.join(self.names)}."
            )
        return np.array([law.row() for law in draw_laws(self.joint(0 if joint is None else joint), n, seed)])

    def draw(self, n: int, seed: int = 0) -> list[FrictionModel]:
        """Return random models that are consistent with the data: the law of every joint is drawn as in `sample`.

        Args:
            n: how many.
            seed: the same one gives the same models.

        Raises:
            InvalidInput: the model has no errors of a joint's law.
        """
        from backdrive.model.sample import draw_laws

        drawn = [draw_laws(friction, n, [seed, j]) for j, friction in enumerate(self.joints)]
        return [
            replace(
                self,
                joints=tuple(replace(f, law=laws[k]) for f, laws in zip(self.joints, drawn, strict=True)),
            )
            for k in range(n)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the document of the model file as plain values."""
        return json.loads(upper("model.file", "encode")(self))

    def loop(self, tunings: Any, period: float | None = None, **more: Any) -> Any:
        """Return the torque loop of one or several tuned joints, with the limits that the tunings hold.

        Args:
            tunings: of `tune`, one or several.
            period: of the loop [s]; None: what they were tuned for.
            more: `top_speed`, `limit`, `encoder_count`, as `Tuning.loop` takes them; a number, or by joint.

        Raises:
            InvalidInput: a tuning is of no joint of this model, was made for another period, or has no limits.
        """
        return upper("tuning.loops", "loop_of")(self, tunings, period=period, **more)

    def table(self, speeds: int = 21) -> dict[str, dict[str, np.ndarray]]:
        """Return each joint's curve over its validity range.

        Args:
            speeds: number of velocities.

        Returns:
            joint name -> {"velocity": (speeds,) [rad/s or m/s], "torque": (speeds,) [N.m or N]}.
        """
        speeds = whole("speeds", speeds)
        result: dict[str, dict[str, np.ndarray]] = {}
        for j in self.joints:
            velocity = np.linspace(*j.validity.velocity, speeds)
            result[j.joint.name] = {"velocity": velocity, "torque": j.law.torque(velocity)}
        return result

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the model file (JSON), whole or not at all."""
        upper("model.file", "save")(self, path)


def load_model(path: str | os.PathLike[str]) -> FrictionModel:
    """Read a model file, or published parameters by name.

    Args:
        path: of the file; or `preset:NAME`, such as `preset:mx106/m6`.

    Raises:
        ModelFileError: the file is absent, not a regular file, damaged, of another kind or of a newer schema, or contains
            impossible numbers; the message names place and reason.
        InvalidInput: `path` is neither a string nor a path.
        UnknownName: there is no such preset; the message lists them.
    """
    check_path(path)
    preset = upper("model.presets", "preset_name")(path)
    return (
        upper("model.file", "load")(path) if preset is None else upper("model.presets", "load_preset")(preset)
    )
