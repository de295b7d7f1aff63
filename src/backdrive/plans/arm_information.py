"""The information of an arm's motion on the wanted parameters: the logarithm of a determinant, and its gradient.

    tau = Y(q, dq, ddq) theta + F sign(dq) + B dq + I ddq + o + (load on the last link or the tool)
    information = sum over samples of  Z' W Z,      Z: columns of all coefficients,  W = 1 / noise^2

The criterion is log det(information) - log det(its part for the other parameters), per wanted coefficient. So it accounts for
the other parameters, which must be estimated too (D_s-optimality). A payload, or a constant force at the tool, is identified by
comparing logs of the same motion with and without it. Each of them adds the rows of such a log.

The gradient by the columns is 2 W Z (information^-1 - inverse of the part for the other parameters). Its product with finite
differences of the regressors gives the gradients by position, velocity and acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.robot import PER_LINK, Robot

#: Possible purposes: friction of every joint; inertias of bodies and motors; masses and first moments that gravity shows; mass
#: and center of a payload; a constant force and moment at the tool.
PURPOSES = {name: name for name in ("friction", "inertia", "gravity", "payload", "force")}
OWN = ("coulomb", "viscous", "inertia", "offset")  # columns of every joint
LOAD = 4  # numbers of a payload: mass and first moments
WRENCH = 6
PRIOR = 3.0  # prior standard deviation of a coefficient from the description's, relative to the size of a link [-]
STEP = 1e-6  # of a difference quotient [rad, rad/s or rad/s^2]


@dataclass(frozen=True, kw_only=True, eq=False)
class Information:
    """The criterion for the motion of an arm.

    Attributes:
        robot: the description.
        noise: of the torque [N.m or N], (J,).
        transition: velocity within which friction changes sign [rad/s or m/s], (J,).
        purpose: names of `PURPOSES`, at least one.
        frame: frame at which a force is identified; None: the last of the description.
    """

    robot: Robot
    noise: np.ndarray
    transition: np.ndarray
    purpose: tuple[str, ...]
    frame: str | None = None

    def __post_init__(self):
        if not self.purpose:
            raise InvalidInput("No purpose is given.", remedy=f"Name some of {', '.join(PURPOSES)}.")
        for name in self.purpose:
            lookup(name, PURPOSES, "purpose of a motion")
        if self.frame is not None:
            self.robot.frame(self.frame)  # refuses an unknown frame

    @cached_property
    def loads(self) -> tuple[int, ...]:
        """Number of coefficients of every log with something at the tool."""
        return (
            *([LOAD] if "payload" in self.purpose else []),
            *([WRENCH] if "force" in self.purpose else []),
        )

    @cached_property
    def size(self) -> int:
        """Number of coefficients."""
        return self.robot.base.columns.size + len(OWN) * len(self.robot.joints) + sum(self.loads)

    @cached_property
    def _gravity_parameters(self) -> np.ndarray:
        """Base parameters that matter at rest, (b,)."""
        q = np.random.default_rng(0).uniform(-np.pi, np.pi, (20, len(self.robot.joints)))
        still = self.robot.regressor(q, 0.0 * q, 0.0 * q)[:, :, self.robot.base.columns]
        return np.abs(still).max(axis=(0, 1)) > 1e-9

    @cached_property
    def targets(self) -> np.ndarray:
        """Wanted coefficients, (P,)."""
        J, b = len(self.robot.joints), self.robot.base.columns.size
        of_gravity = self._gravity_parameters
        bodies = np.where(of_gravity, "gravity" in self.purpose, "inertia" in self.purpose)
        own = np.tile(["friction" in self.purpose] * 2 + ["inertia" in self.purpose, False], J)
        loads = np.ones(self.size - b - own.size, dtype=bool)
        return np.concatenate([bodies, own, loads])

    @cached_property
    def _prior(self) -> np.ndarray:
        """Prior precision that keeps the determinant finite if a coefficient is not identifiable, (P, P)."""
        robot, J = self.robot, len(self.robot.joints)
        sizes = np.abs(robot.parameters).reshape(J, PER_LINK).max(axis=0)
        sizes[1:4], sizes[4:] = max(sizes[1:4].max(), 1e-3 * sizes[0]), max(sizes[4:].max(), 1e-4 * sizes[0])
        spread = PRIOR * np.maximum(sizes, 1e-6)
        bodies = (robot.base.relation * np.tile(spread, J) ** 2) @ robot.base.relation.T
        precision = np.zeros((self.size, self.size))
        b = bodies.shape[0]
        precision[:b, :b] = np.linalg.inv(bodies)
        fast = 1e3 * self.noise
        own = np.stack([fast, fast, np.full(J, spread[4]), fast], axis=1)
        rest = [own.ravel()]
        if "payload" in self.purpose:
            rest.append(spread[:LOAD])
        if "force" in self.purpose:
            rest.append(np.full(WRENCH, 1e3 * float(self.noise.max())))
        precision[b:, b:] = np.diag(1.0 / np.concatenate(rest) ** 2)
        return precision

    def value(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, weight: float) -> float:
        """Return the criterion per wanted coefficient, which is the logarithm of a variance; less is better.

        Args:
            q: positions [rad or m], (n, J).
            dq: velocities [rad/s or m/s], (n, J).
            ddq: accelerations [rad/s^2 or m/s^2], (n, J).
            weight: how many independent samples each stands for.
        """
        regressor = self.robot.regressor(q, dq, ddq)
        return self._criterion(self._gram(self._columns(regressor, q, dq, ddq), weight))[0]

    def gradient(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, weight: float
    ) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Return the criterion and its gradient, and the rigid bodies' torque and its gradient; see `value`.

        Returns:
            The criterion; by q, dq and ddq, (3, n, J); torque [N.m or N], (n, J); by q, dq and ddq, (3, n, J, J): the last axis
            is what is moved.
        """
        n, J = q.shape
        near = np.repeat(np.stack([q, dq, ddq])[None], 3 * J + 1, axis=0)
        for k in range(3 * J):
            near[k + 1, k // J, :, k % J] += STEP
        states = near.transpose(1, 0, 2, 3).reshape(3, -1, J)
        regressor = self.robot.regressor(*states).reshape(3 * J + 1, n, J, -1)
        columns = self._columns(regressor[0], q, dq, ddq)
        value, slope = self._criterion(self._gram(columns, weight))
        whole = 2.0 * weight * self._contract(columns, slope) / self.noise[None, :, None] ** 2
        by_regressor, by_own, by_wrench = self._parts(whole)
        flat = regressor.reshape(3 * J + 1, n, -1)
        told = np.einsum("knc,nc->kn", flat, by_regressor.reshape(n, -1))
        slopes = ((told[1:] - told[0]) / STEP).reshape(3, J, n).transpose(0, 2, 1)
        sign = np.tanh(dq / self.transition)
        slopes[1] += by_own[..., 0] * (1.0 - sign**2) / self.transition + by_own[..., 1]
        slopes[2] += by_own[..., 2]
        if by_wrench is not None:
            slopes[0] += self._wrench_slope(q, by_wrench)
        torque = regressor @ self.robot.parameters
        by_state = ((torque[1:] - torque[0]) / STEP).reshape(3, J, n, J).transpose(0, 2, 3, 1)
        return value, slopes, torque[0], by_state

    def _columns(self, regressor: np.ndarray, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Return the columns of all coefficients, the loads' last, (n, J, P)."""
        n, J = q.shape
        b = self.robot.base.columns.size
        columns = np.zeros((n, J, self.size))
        columns[:, :, :b] = regressor[:, :, self.robot.base.columns]
        each = np.arange(J)
        own = np.stack([np.tanh(dq / self.transition), dq, ddq, np.ones_like(q)], axis=2)
        for i in range(len(OWN)):
            columns[:, each, b + len(OWN) * each + i] = own[:, :, i]
        at = b + len(OWN) * J
        if "payload" in self.purpose:
            columns[:, :, at : at + LOAD] = regressor[:, :, self._last]
            at += LOAD
        if "force" in self.purpose:
            columns[:, :, at:] = self._wrench(q)
        return columns

    @property
    def _last(self) -> slice:
        first = PER_LINK * (len(self.robot.joints) - 1)
        return slice(first, first + LOAD)

    def _wrench(self, q: np.ndarray) -> np.ndarray:
        """Return the torque of unit forces and moments at the tool along the base's axes, (n, J, 6)."""
        return self.robot.jacobian(q, self.frame or self.robot.frames[-1]).transpose(0, 2, 1)

    def _wrench_slope(self, q: np.ndarray, by_wrench: np.ndarray) -> np.ndarray:
        """Return the gradient by position through the tool's columns, (n, J)."""
        here, slope = self._wrench(q), np.empty_like(q)
        for k in range(q.shape[1]):
            moved = q.copy()
            moved[:, k] += STEP
            slope[:, k] = np.sum((self._wrench(moved) - here) * by_wrench, axis=(1, 2)) / STEP
        return slope

    def _gram(self, columns: np.ndarray, weight: float) -> np.ndarray:
        """Return the information of a log without anything at the tool, and of one with each load, (P, P)."""
        rows = (columns / self.noise[None, :, None]).reshape(-1, self.size)
        gram = weight * (rows.T @ rows)
        common = self.size - sum(self.loads)
        gram[:common, :common] *= 1 + len(self.loads)
        for i, first in enumerate(self._starts):  # two loads are never in one log
            for j, other in enumerate(self._starts):
                if i != j:
                    gram[first : first + self.loads[i], other : other + self.loads[j]] = 0.0
        return gram + self._prior

    @property
    def _starts(self) -> list[int]:
        common = self.size - sum(self.loads)
        return [common + sum(self.loads[:i]) for i in range(len(self.loads))]

    def _criterion(self, gram: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the criterion and its slope by the information, (P, P)."""
        count = int(self.targets.sum())
        scale = 1.0 / np.sqrt(np.diag(gram))
        unit = gram * np.outer(scale, scale)
        value = float(np.linalg.slogdet(unit)[1] - 2.0 * np.log(scale).sum())
        slope = np.linalg.inv(unit) * np.outer(scale, scale)
        rest = ~self.targets
        if rest.any():
            pick = np.ix_(rest, rest)
            value -= float(np.linalg.slogdet(unit[pick])[1] - 2.0 * np.log(scale[rest]).sum())
            slope[pick] -= np.linalg.inv(unit[pick]) * np.outer(scale[rest], scale[rest])
        return -value / count, -slope / count

    def _contract(self, columns: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """Return Z times the slope, over all logs, (n, J, P)."""
        common = self.size - sum(self.loads)
        whole = np.zeros_like(columns)
        whole[..., :common] = (1 + len(self.loads)) * columns[..., :common] @ slope[:common, :common]
        for first, count in zip(self._starts, self.loads, strict=True):
            own = slice(first, first + count)
            whole[..., :common] += columns[..., own] @ slope[own, :common]
            whole[..., own] = (
                columns[..., :common] @ slope[:common, own] + columns[..., own] @ slope[own, own]
            )
        return whole

    def _parts(self, whole: np.ndarray) -> tuple[np.ndarray, np.ndarray, Any]:
        """Return the gradient by the regressor, by the joints' own columns and by the tool's."""
        n, J, _ = whole.shape
        b = self.robot.base.columns.size
        by_regressor = np.zeros((n, J, PER_LINK * J))
        by_regressor[:, :, self.robot.base.columns] = whole[:, :, :b]
        each = np.arange(J)
        by_own = np.stack([whole[:, each, b + len(OWN) * each + i] for i in range(len(OWN))], axis=2)
        at = b + len(OWN) * J
        if "payload" in self.purpose:
            by_regressor[:, :, self._last] += whole[:, :, at : at + LOAD]
            at += LOAD
        return by_regressor, by_own, whole[:, :, at:] if "force" in self.purpose else None
