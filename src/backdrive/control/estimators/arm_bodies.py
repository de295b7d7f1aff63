"""The bodies of an identified arm in a loop. The results of pinocchio are read in place, without copies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.control.estimators import arm_kernel as kernel
from backdrive.errors import NotIdentifiable
from backdrive.model import FrictionModel
from backdrive.robot import PER_LINK, Robot, require_pinocchio

STIFF = 1e-4  # weight of changes of a mass relative to those of other parameters [-]
LIGHTEST = 1e-3  # mass given to a link whose mass does not affect any joint, relative to the largest mass of a link [-]


@dataclass(frozen=True, eq=False)
class ArmBodies:
    """A robot with identified inertias.

    Attributes:
        robot: the description, its model with those inertias.
        data: pinocchio's object that holds the results.
    """

    robot: Robot
    data: Any

    @classmethod
    def of_model(cls, model: FrictionModel, robot: Robot) -> ArmBodies:
        """Return the bodies of a model of an arm.

        Args:
            model: with an `arm`.
            robot: the description, without tools that the model does not know.

        Raises:
            NotIdentifiable: the base parameters ask for a link of negative mass.
        """
        assert model.arm is not None
        return cls.of_parameters(robot, np.array(model.arm.parameters))

    @classmethod
    def of_parameters(cls, robot: Robot, parameters: np.ndarray) -> ArmBodies:
        """Return the bodies with given standard parameters, or with others that have the same dynamics, (10 J,)."""
        from dataclasses import replace

        pin = require_pinocchio()
        theta = with_masses(robot, parameters).reshape(-1, PER_LINK)
        copied = robot.model.copy()
        for i, row in enumerate(theta):
            copied.inertias[i + 1] = (
                pin.Inertia.FromDynamicParameters(row) if row[0] > 0.0 else pin.Inertia.Zero()
            )
        return cls(replace(robot, model=copied), copied.createData())

    def calls(
        self, method: str, q: np.ndarray, v: np.ndarray, a: np.ndarray
    ) -> tuple[Callable[[], object], np.ndarray, np.ndarray, np.ndarray]:
        """Return the function to call each tick, and the arrays of M, bias and Coriolis matrix that it fills.

        Args:
            method: of the estimator: `direct` asks for M a + h + g, `momentum` for g and C, the others for h + g.
            q: positions, read at each call [rad or m], (J,).
            v: velocities, read at each call [rad/s or m/s], (J,).
            a: accelerations, read at each call [rad/s^2 or m/s^2], (J,).
        """
        pin, model, data = require_pinocchio(), self.robot.model, self.data
        M, C = data.M, data.C
        if method == "direct":
            inverse = pin.rnea
            return lambda: inverse(model, data, q, v, a), M, data.tau, C
        inertia = pin.crba
        if method == "momentum":
            coriolis, gravity = pin.computeCoriolisMatrix, pin.computeGeneralizedGravity

            def three() -> None:
                inertia(model, data, q)
                coriolis(model, data, q, v)
                gravity(model, data, q)

            return three, M, data.g, C
        nonlinear = pin.nonLinearEffects

        def two() -> None:
            inertia(model, data, q)
            nonlinear(model, data, q, v)

        return two, M, data.nle, C

    def calls_at_motors(
        self, method: str, rows: np.ndarray, joints: np.ndarray, coupling: np.ndarray
    ) -> tuple[Callable[[], object], np.ndarray, np.ndarray, np.ndarray]:
        """Return the same for motors that drive several joints: pinocchio's results are transformed to the motors.

        Args:
            method: of the estimator.
            rows: positions, velocities, accelerations of the motors, read at each call, (3, J).
            joints: work array for those of the joints, (3, J).
            coupling: C of q_joint = C q_motor, (J, J).
        """
        J = len(coupling)
        asked, M, bias, coriolis = self.calls(method, *joints)
        own, level, turning, room = np.zeros((J, J)), np.zeros(J), np.zeros((J, J)), np.zeros((J, J))

        def call() -> None:
            kernel.to_joints(coupling, rows, joints)
            asked()
            kernel.to_motors(coupling, M, bias, coriolis, own, level, turning, room)

        return call, own, level, turning


def with_masses(robot: Robot, parameters: np.ndarray) -> np.ndarray:
    """Return standard parameters with the same dynamics, in which each link with a first moment or an inertia has a mass.

    Torques depend only on base parameters, so masses that do not affect any joint may be chosen.

    Args:
        robot: the description.
        parameters: standard parameters [kg, kg.m, kg.m^2], (10 J,).

    Raises:
        NotIdentifiable: no choice gives each link a positive mass.
    """
    rows = parameters.reshape(-1, PER_LINK)
    least = LIGHTEST * max(float(rows[:, 0].max()), 1e-3)
    if np.all((rows[:, 0] >= least) | ~rows.any(axis=1)):
        return parameters
    nominal, spread = parameters.copy(), np.ones(parameters.size)
    masses = np.arange(0, parameters.size, PER_LINK)
    nominal[masses] = np.maximum(parameters[masses], least)
    spread[masses] = STIFF
    moved = robot.base.standard(robot.base.relation @ parameters, nominal, spread)
    if np.any(moved[masses] < 0.5 * least):
        light = [robot.joints[i] for i in np.flatnonzero(moved[masses] < 0.5 * least)]
        raise NotIdentifiable(
            f"The model asks for a link of no or negative mass (moved by {', '.join(light)}).",
            remedy="Identify from a longer log with larger accelerations, or correct the masses of the description.",
        )
    return moved
