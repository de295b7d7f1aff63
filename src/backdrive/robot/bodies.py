"""Rigid bodies: inertia matrix, bias, gravity, Jacobians, and the regressor that is linear in the inertial parameters.

    tau = M(q) ddq + h(q, dq) + g(q) = Y(q, dq, ddq) theta

theta holds ten numbers a link, in pinocchio's order: mass m, first moment (mx, my, mz), and the inertia about the joint's frame
(Ixx, Ixy, Iyy, Ixz, Iyz, Izz). Joint torques depend only on some combinations of them, the base parameters (Gautier & Khalil
1990); see `BaseParameters`. Gravity is 9.81 m/s^2 along -z of the root link. For an arm on a wall or ceiling, rotate the root
by a fixed joint in the URDF, or set gravity in the MJCF.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from backdrive.errors import InvalidInput, UnknownName, require
from backdrive.logs.joint import coupling_between
from backdrive.robot.base import BaseParameters

PER_LINK = 10
#: Names of a link's ten parameters.
PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
POSTURES = 40  # number of random states per joint that determine the base parameters


@dataclass(frozen=True, kw_only=True)
class Range:
    """Limits of a joint in a description; infinite if not stated.

    Attributes:
        lower: lowest position [rad or m].
        upper: highest position [rad or m].
        velocity: greatest speed [rad/s or m/s].
        effort: greatest torque [N.m or N].
    """

    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """A tree of rigid bodies with one-degree-of-freedom joints.

    Attributes:
        name: of the robot.
        joints: names of the moving joints, in the order of all arrays here, (J,).
        units: `rad` or `m` by joint.
        sha256: digest of the description.
        model: pinocchio's model.
        ranges: of the joints, (J,); empty where nothing was read.
        remarks: remarks on missing data in the description.
    """

    name: str
    joints: tuple[str, ...]
    units: tuple[Literal["rad", "m"], ...]
    sha256: str
    model: Any
    ranges: tuple[Range, ...] = ()
    remarks: tuple[str, ...] = field(default=())

    @cached_property
    def parameters(self) -> np.ndarray:
        """Standard parameters theta of the description [kg, kg.m, kg.m^2], (10 J,)."""
        return np.concatenate([inertia.toDynamicParameters() for inertia in list(self.model.inertias)[1:]])

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """Name of every standard parameter, with the joint that moves its link, (10 J,)."""
        return tuple(f"{p} of {joint}" for joint in self.joints for p in PARAMETERS)

    @cached_property
    def base(self) -> BaseParameters:
        """The base parameters; computed once, at the first use."""
        random = np.random.default_rng(0)
        n, J = POSTURES * len(self.joints), len(self.joints)
        q, dq, ddq = random.uniform(-np.pi, np.pi, (n, J)), *random.uniform(-5.0, 5.0, (2, n, J))
        return BaseParameters.of(self.regressor(q, dq, ddq).reshape(n * J, -1))

    @cached_property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames for wrenches: links, including fixed tools, and sites."""
        return tuple(self._frames)

    @cached_property
    def _frames(self) -> dict[str, int]:
        kinds = require_pinocchio().FrameType
        wanted: dict[str, int] = {}
        for kind in (kinds.BODY, kinds.OP_FRAME):
            for i, frame in enumerate(self.model.frames):
                if frame.type == kind and frame.name != "universe":
                    wanted.setdefault(frame.name, i)
        return wanted

    def frame(self, name: str) -> int:
        """Return pinocchio's number of a frame.

        Raises:
            UnknownName: there is none of this name; all are listed.
        """
        if name not in self._frames:
            raise UnknownName(
                f"{self.name} has no frame '{name}'.", remedy=f"One of {', '.join(self.frames)}."
            )
        return self._frames[name]

    def order_in(self, names: Sequence[str]) -> np.ndarray:
        """Return the columns of a log that hold this robot's joints, in this robot's order, (J,).

        Args:
            names: of the log's joints; joints that the robot does not have are ignored.

        Raises:
            InvalidInput: a joint of the robot is not among them; both lists are named.
        """
        missing = [joint for joint in self.joints if joint not in names]
        if missing:
            raise InvalidInput(
                f"Not in the log: {', '.join(missing)}. The robot description has {len(self.joints)} joints "
                f"({', '.join(self.joints)}), the log has {len(names)} ({', '.join(names)}).",
                remedy="Name the log's columns as in the description, in the order of the log. If both have the same order: "
                f"--names {','.join(self.joints)}."
                if len(names) >= len(self.joints)
                else "Record all joints, or make the joints without motion `fixed` in the description.",
            )
        return np.array([list(names).index(joint) for joint in self.joints])

    def without_tools(self, names: Sequence[str]) -> Robot:
        """Return the robot with joints beyond the logged ones held, such as a gripper's fingers.

        Their links become part of the last logged link, whose parameters are identified. So the position of the held joints
        does not matter, as long as it is constant.

        Args:
            names: of the log's joints. Nothing is held if one of them is not the robot's, or if a missing joint carries one
                of them; `order_in` then raises an error.
        """
        pin = require_pinocchio()
        missing = [i for i, joint in enumerate(self.joints, start=1) if joint not in names]
        known = {i for i, joint in enumerate(self.joints, start=1) if joint in names}
        carries = any(known & set(self.model.subtrees[i]) for i in missing)
        if not missing or not known or carries or set(names) - set(self.joints):
            return self
        reduced = pin.buildReducedModel(self.model, missing, pin.neutral(self.model))
        keep = [i for i, joint in enumerate(self.joints) if joint in names]
        return replace(
            self,
            joints=tuple(self.joints[i] for i in keep),
            units=tuple(self.units[i] for i in keep),
            model=reduced,
            ranges=tuple(self.ranges[i] for i in keep) if self.ranges else (),
        )

    def for_model(self, names: Sequence[str], sha256: str, parameters: int) -> Robot:
        """Return the robot of an arm's model, with joints that are not in the model held.

        Args:
            names: of the model's joints.
            sha256: of the description that it was identified with.
            parameters: how many inertial parameters it holds.

        Raises:
            InvalidInput: the model belongs to another description, or to other joints.
        """
        robot = self.without_tools(names)
        if robot.sha256 != sha256:
            raise InvalidInput(
                f"The model belongs to another robot description (sha256 {sha256[:12]}...).",
                remedy="Pass the URDF or MJCF that it was identified with.",
            )
        robot.order_in(names)
        if parameters != robot.parameters.size:
            raise InvalidInput(
                f"The model has {parameters} rigid-body parameters, the description {robot.parameters.size}.",
                remedy="Identify again.",
            )
        return robot

    def coupling_of(
        self, coupling: Sequence[Sequence[float]] | None, names: Sequence[str]
    ) -> np.ndarray | None:
        """Return C of q_joint = C q_motor in the robot's order of joints, (J, J), or None; each joint has the motor that mainly
        moves it.

        Args:
            coupling: as a model has it, or None.
            names: of its rows.

        Raises:
            InvalidInput: it is not of all this robot's joints, or ties them to others.
        """
        if coupling is None:
            return None
        if missing := [joint for joint in self.joints if joint not in names]:
            raise InvalidInput(
                f"The coupling is of {', '.join(names)}, and {self.name} has {', '.join(missing)}, too.",
                remedy="Identify all of its joints together.",
            )
        return coupling_between(coupling, names, self.joints)

    def regressor(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Return Y with tau = Y theta.

        Args:
            q: positions [rad or m], (n, J).
            dq: velocities [rad/s or m/s], (n, J).
            ddq: accelerations [rad/s^2 or m/s^2], (n, J).

        Returns:
            Regressor, (n, J, 10 J): 560 bytes per joint and sample for seven joints, so process long motions in chunks.
        """
        shape = (len(self.joints), PER_LINK * len(self.joints))
        return self._evaluate("computeJointTorqueRegressor", shape, q, dq, ddq)

    def inverse_dynamics(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Return the torque of the description's own inertias without friction [N.m or N], (n, J)."""
        return self._evaluate("rnea", (len(self.joints),), q, dq, ddq)

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """Return M(q) [kg.m^2, kg.m or kg], (n, J, J)."""
        upper = np.triu(self._evaluate("crba", (len(self.joints),) * 2, q))
        return upper + np.swapaxes(np.triu(upper, 1), 1, 2)

    def bias(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Return h(q, dq), Coriolis and centrifugal torque without gravity [N.m or N], (n, J)."""
        return self._evaluate("nonLinearEffects", (len(self.joints),), q, dq) - self.gravity(q)

    def gravity(self, q: np.ndarray) -> np.ndarray:
        """Return g(q) [N.m or N], (n, J)."""
        return self._evaluate("computeGeneralizedGravity", (len(self.joints),), q)

    def placement(self, q: np.ndarray, frame: str) -> np.ndarray:
        """Return where a frame is in the base, as homogeneous matrices [m], (n, 4, 4).

        Args:
            q: positions [rad or m], (n, J).
            frame: one of `frames`.

        Raises:
            UnknownName: there is no such frame.
        """
        pin, at = require_pinocchio(), self.frame(frame)

        def place(model: Any, data: Any, row: np.ndarray) -> np.ndarray:
            pin.framesForwardKinematics(model, data, row)
            return data.oMf[at].homogeneous

        return self._each(place, (4, 4), q)

    def jacobian(self, q: np.ndarray, frame: str) -> np.ndarray:
        """Return the Jacobian of a frame: velocity of its origin, then angular velocity, along the axes of the base.

        Its transpose converts a wrench (force, then moment about the frame's origin) to joint torques.

        Args:
            q: positions [rad or m], (n, J).
            frame: one of `frames`.

        Returns:
            (n, 6, J).

        Raises:
            UnknownName: there is no such frame.
        """
        pin, at = require_pinocchio(), self.frame(frame)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return self._each(
            lambda model, data, row: pin.computeFrameJacobian(model, data, row, at, axes),
            (6, len(self.joints)),
            q,
        )

    def _evaluate(self, name: str, shape: tuple[int, ...], q: np.ndarray, *rates: np.ndarray) -> np.ndarray:
        return self._each(getattr(require_pinocchio(), name), shape, q, *rates)

    def _each(
        self, function: Callable[..., Any], shape: tuple[int, ...], q: np.ndarray, *rates: np.ndarray
    ) -> np.ndarray:
        """Return what a function of pinocchio gives for each sample, (n, *shape)."""
        data = self.model.createData()
        arrays = [np.ascontiguousarray(np.atleast_2d(a), dtype=np.float64) for a in (q, *rates)]
        n, J = arrays[0].shape[0], len(self.joints)
        for array in arrays:
            if array.shape != (n, J):
                raise InvalidInput(
                    f"A state has shape {array.shape}, but {self.name} has {J} joints.",
                    remedy=f"Give (n, {J}) in the order {', '.join(self.joints)}.",
                )
            if not np.all(np.isfinite(array)):
                raise InvalidInput("A state is NaN or infinite.", remedy="Give finite positions and rates.")
        out = np.empty((n, *shape))
        for i in range(n):
            out[i] = function(self.model, data, *(a[i] for a in arrays))
        return out


def require_pinocchio() -> Any:
    """Return pinocchio, or say how to install it.

    Raises:
        MissingExtra: names the extra.
    """
    return require("pinocchio", "Rigid bodies need", "arm")
