"""Rigid bodies from a URDF: inertia matrix, bias, gravity, and the regressor that is linear in the inertial parameters.

    tau = M(q) ddq + h(q, dq) + g(q) = Y(q, dq, ddq) theta

theta holds ten numbers a link, in pinocchio's order: mass m, first moment (mx, my, mz), and the inertia about the joint's
frame (Ixx, Ixy, Iyy, Ixz, Iyz, Izz). Joint torques see only some combinations of them, the base parameters
(Gautier & Khalil 1990); see `BaseParameters`. Gravity is 9.81 m/s^2 along -z of the root link: an arm on a wall or ceiling
has its root turned by a fixed joint in the URDF.

A URDF may come from anywhere: it is parsed without document type or entities, and only links, joints and their inertias
are handed on. Meshes are never looked for.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from backdrive._files import read_whole
from backdrive._urdf import skeleton
from backdrive.errors import InvalidInput, ReadError, require

PER_LINK = 10
#: Names of a link's ten parameters.
PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
MAX_BYTES = 20_000_000
POSTURES = 40  # random states that show which parameters a robot can feel, times the joints
INDEPENDENT = 1e-9  # a column whose remainder is smaller than this share of the largest is a combination [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseParameters:
    """The combinations of standard parameters that joint torques can tell: beta = relation @ theta.

    Found by a QR factorisation with column pivoting of the regressor at random states. With its columns parted into
    independent ones Y_1 and dependent ones Y_2 = Y_1 X, Y theta = Y_1 (theta_1 + X theta_2): so `relation` is the
    identity on `columns` and X on the others (Gautier 1991).

    Attributes:
        columns: the independent columns of the regressor, (b,).
        relation: from standard to base parameters, (b, 10 J).
    """

    columns: np.ndarray
    relation: np.ndarray

    def standard(self, beta: np.ndarray, nominal: np.ndarray, spread: np.ndarray) -> np.ndarray:
        """Return the standard parameters with these base parameters that are nearest to nominal ones.

        Args:
            beta: base parameters, (b,).
            nominal: standard parameters to stay near, (10 J,).
            spread: how far each may be expected to be off, in its unit, (10 J,).

        Returns:
            theta with relation @ theta = beta and the least sum of ((theta - nominal) / spread)^2, (10 J,).
        """
        scaled = self.relation * spread
        step = np.linalg.lstsq(scaled, beta - self.relation @ nominal, rcond=None)[0]
        return nominal + spread * step


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """A tree of rigid bodies with one-degree-of-freedom joints.

    Attributes:
        name: of the robot.
        joints: names of the moving joints, in the order of all arrays here, (J,).
        units: `rad` or `m` by joint.
        sha256: digest of the description.
        model: pinocchio's model.
    """

    name: str
    joints: tuple[str, ...]
    units: tuple[Literal["rad", "m"], ...]
    sha256: str
    model: Any

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
        from scipy.linalg import qr, solve_triangular

        random = np.random.default_rng(0)
        n, J = POSTURES * len(self.joints), len(self.joints)
        q, dq, ddq = random.uniform(-np.pi, np.pi, (n, J)), *random.uniform(-5.0, 5.0, (2, n, J))
        stacked = self.regressor(q, dq, ddq).reshape(n * J, -1)
        _, r, order = qr(stacked, mode="economic", pivoting=True)  # type: ignore[misc]
        size = np.abs(np.diag(r))
        rank = int(np.sum(size > INDEPENDENT * size[0])) if size[0] > 0 else 0
        relation = np.zeros((rank, stacked.shape[1]))
        relation[:, order[:rank]] = np.eye(rank)
        relation[:, order[rank:]] = solve_triangular(r[:rank, :rank], r[:rank, rank:])
        relation[np.abs(relation) < INDEPENDENT] = 0.0
        ascending = np.argsort(order[:rank])
        return BaseParameters(columns=order[:rank][ascending], relation=relation[ascending])

    def order_in(self, names: Sequence[str]) -> np.ndarray:
        """Return the columns of a log that hold this robot's joints, in this robot's order, (J,).

        Args:
            names: of the log's joints; joints that the robot does not have are passed over.

        Raises:
            InvalidInput: a joint of the robot is not among them; both lists are named.
        """
        missing = [joint for joint in self.joints if joint not in names]
        if missing:
            raise InvalidInput(
                f"Not in the log: {', '.join(missing)}. The URDF has {len(self.joints)} joints "
                f"({', '.join(self.joints)}), the log has {len(names)} ({', '.join(names)}).",
                remedy="Name the log's columns as in the URDF, in the log's order: "
                f"--names {','.join(self.joints)} where that is the order."
                if len(names) >= len(self.joints)
                else "Record all joints, or make those that stand still `fixed` in the URDF.",
            )
        return np.array([list(names).index(joint) for joint in self.joints])

    def without_tools(self, names: Sequence[str]) -> Robot:
        """Return the robot with joints beyond the logged ones held, such as a gripper's fingers.

        What they carry becomes part of the last logged link, whose parameters are identified anyway: so it does not
        matter at which position they are held, as long as they keep it.

        Args:
            names: of the log's joints. Unless all of them are the robot's, or where a missing joint carries one of
                them, nothing is held (and `order_in` will complain).
        """
        pin = require_pinocchio()
        missing = [i for i, joint in enumerate(self.joints, start=1) if joint not in names]
        known = {i for i, joint in enumerate(self.joints, start=1) if joint in names}
        carries = any(known & set(self.model.subtrees[i]) for i in missing)
        if not missing or not known or carries or set(names) - set(self.joints):
            return self
        reduced = pin.buildReducedModel(self.model, missing, pin.neutral(self.model))
        keep = [i for i, joint in enumerate(self.joints) if joint in names]
        return Robot(
            name=self.name,
            joints=tuple(self.joints[i] for i in keep),
            units=tuple(self.units[i] for i in keep),
            sha256=self.sha256,
            model=reduced,
        )

    def regressor(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Return Y with tau = Y theta.

        Args:
            q: positions [rad or m], (n, J).
            dq: velocities [rad/s or m/s], (n, J).
            ddq: accelerations [rad/s^2 or m/s^2], (n, J).

        Returns:
            Regressor, (n, J, 10 J): 560 bytes a joint and sample for seven joints, so mind the chunk.
        """
        shape = (len(self.joints), PER_LINK * len(self.joints))
        return self._each("computeJointTorqueRegressor", shape, q, dq, ddq)

    def inverse_dynamics(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Return the torque of the description's own inertias without friction [N.m or N], (n, J)."""
        return self._each("rnea", (len(self.joints),), q, dq, ddq)

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """Return M(q) [kg.m^2, kg.m or kg], (n, J, J)."""
        upper = np.triu(self._each("crba", (len(self.joints),) * 2, q))
        return upper + np.swapaxes(np.triu(upper, 1), 1, 2)

    def bias(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Return h(q, dq), Coriolis and centrifugal torque without gravity [N.m or N], (n, J)."""
        return self._each("nonLinearEffects", (len(self.joints),), q, dq) - self.gravity(q)

    def gravity(self, q: np.ndarray) -> np.ndarray:
        """Return g(q) [N.m or N], (n, J)."""
        return self._each("computeGeneralizedGravity", (len(self.joints),), q)

    def _each(self, name: str, shape: tuple[int, ...], q: np.ndarray, *rates: np.ndarray) -> np.ndarray:
        """Return what a function of pinocchio says of each sample, (n, *shape)."""
        function, data = getattr(require_pinocchio(), name), self.model.createData()
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
        arrays[0] = self._configuration(arrays[0])
        out = np.empty((n, *shape))
        for i in range(n):
            out[i] = function(self.model, data, *(a[i] for a in arrays))
        return out

    def _configuration(self, q: np.ndarray) -> np.ndarray:
        """Turn angles into pinocchio's configuration, where a joint without limits is (cos q, sin q)."""
        if self.model.nq == self.model.nv:
            return q
        configuration = np.empty((q.shape[0], self.model.nq))
        for i, joint in enumerate(list(self.model.joints)[1:]):
            if joint.nq == 2:
                configuration[:, joint.idx_q] = np.cos(q[:, i])
                configuration[:, joint.idx_q + 1] = np.sin(q[:, i])
            else:
                configuration[:, joint.idx_q] = q[:, i]
        return configuration


def load_robot(urdf: str | Path) -> Robot:
    """Read a robot description.

    Args:
        urdf: path of the URDF file; xacro must have been expanded.

    Raises:
        MissingExtra: pinocchio or defusedxml are not installed.
        ReadError: the file is missing, is not a URDF, or has a joint of more than one degree of freedom.
        ForbiddenContent: the file has a document type or entities.
        FileTooLarge: no arm needs that many bytes or joints.
    """
    content = read_whole(urdf, MAX_BYTES, remedy="Name the URDF of an arm.")
    return parse_robot(content, str(urdf))


def parse_robot(content: bytes | str, where: str = "the URDF") -> Robot:
    """Build a robot from the text of a URDF; see `load_robot`.

    Args:
        content: the text.
        where: what to call it in messages.
    """
    pin = require_pinocchio()
    data = content.encode() if isinstance(content, str) else content
    text = skeleton(data, where)
    try:
        model = pin.buildModelFromXML(text)
    except (ValueError, RuntimeError, IndexError) as error:
        raise ReadError(
            f"{where} is no valid URDF: {error}.", remedy="Check it with `check_urdf`."
        ) from error
    joints = list(model.joints)[1:]
    wide = [name for name, j in zip(list(model.names)[1:], joints) if j.nv != 1]
    if wide or not joints:
        raise ReadError(
            f"{where}: {'joints ' + ', '.join(wide) + ' have' if wide else 'no joint has'} one degree of freedom"
            + (" too few or too many." if wide else "."),
            remedy="Use revolute, continuous, prismatic and fixed joints only.",
        )
    robot = Robot(
        name=str(model.name),
        joints=tuple(list(model.names)[1:]),
        units=tuple("m" if j.shortname().startswith("JointModelP") else "rad" for j in joints),
        sha256=hashlib.sha256(data).hexdigest(),
        model=model,
    )
    placements = np.array([m.homogeneous for m in model.jointPlacements])
    if not (np.all(np.isfinite(robot.parameters)) and np.all(np.isfinite(placements))):
        raise ReadError(
            f"{where} holds numbers that are not finite.", remedy="Correct its origins and inertias."
        )
    return robot


def require_pinocchio() -> Any:
    """Return pinocchio, or say how to install it.

    Raises:
        MissingExtra: names the extra.
    """
    return require("pinocchio", "Rigid bodies need", "arm")
