"""Rigid-body terms at one posture per tick, by pinocchio: gravity, Coriolis torque and the inertia matrix."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.control.estimators.arm_bodies import ArmBodies
from backdrive.errors import InvalidInput
from backdrive.robot import PER_LINK, Robot, require_pinocchio


class Bodies:
    """A robot's rigid bodies in a loop: nothing is checked, and positions have to be finite.

    Attributes:
        weight: g(q) [N.m or N], (J,).
        bias: h(q, dq) + g(q) [N.m or N], (J,).
    """

    def __init__(self, robot: Robot, parameters: Sequence[float] | None = None):
        """Copy a robot's model.

        Args:
            robot: the description.
            parameters: standard inertial parameters as they were identified [kg, kg.m, kg.m^2]; None: the description's, (10 J,).

        Raises:
            InvalidInput: there are more or fewer parameters, or with them a posture has no finite torque.
        """
        pin, J = require_pinocchio(), len(robot.joints)
        self._model = robot.model
        if parameters is not None:
            theta = np.asarray(parameters, dtype=np.float64)
            if theta.shape != (PER_LINK * J,):
                raise InvalidInput(
                    f"{theta.size} rigid-body parameters for the {J} joints of {robot.name}.",
                    remedy=f"Give {PER_LINK} per joint, as `FrictionModel.arm` has them.",
                )
            self._model = ArmBodies.of_parameters(robot, theta).robot.model
        self._data = self._model.createData()
        self._gravity, self._bias = pin.computeGeneralizedGravity, pin.nonLinearEffects
        self.weight = self.bias = np.zeros(J)
        self.update(np.zeros(J), np.zeros(J))
        if not np.all(np.isfinite(self.bias + self.weight)):
            raise InvalidInput(
                f"With these parameters the torque of {robot.name} is not finite.",
                remedy="Identify it again.",
            )

    def update(self, q: np.ndarray, dq: np.ndarray | None) -> None:
        """Compute everything at a posture.

        Args:
            q: positions of the joints [rad or m], (J,).
            dq: velocities of the joints [rad/s or m/s], (J,); None: `bias` is that of an arm at rest.
        """
        self.weight = self.bias = self._gravity(self._model, self._data, q)
        if dq is not None:
            self.bias = self._bias(self._model, self._data, q, dq)

    def over(self, postures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return gravity [N.m or N] and each joint's own inertia [kg.m^2 or kg] over postures, (n, J) each.

        Args:
            postures: positions of the joints [rad or m], (n, J).
        """
        pin, rest = require_pinocchio(), np.zeros(postures.shape[1])
        weights, inertias = np.zeros(postures.shape), np.zeros(postures.shape)
        for k, q in enumerate(postures):
            self.update(q, rest)
            weights[k] = self.weight
            inertias[k] = np.diag(pin.crba(self._model, self._data, q))
        return weights, inertias
