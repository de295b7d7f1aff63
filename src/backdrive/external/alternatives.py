"""Other orders and signs of a log's joints, and whether the model of an arm fits one of them better than the log as it is.

Torques are compared with those of the model, tau = C' (M(q) ddq + h(q, dq) + g(q)) + I ddq + tau_f + offset, at some instants
of the motion. A force of the environment seldom follows the direction of motion as friction does: so the friction of a log
tells a robot that is pushed from another one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from backdrive.control.estimators.arm import ArmForce
from backdrive.identification.signals import Signals
from backdrive.model import JointFriction

INSTANTS = 500  # at most
BETTER = 0.25  # unexplained torque relative to that of the log as it is, below which another order or sign fits better [-]
FITS = 0.5  # least share of each joint's torque that it then explains [-]


class Instants:
    """Motion and torque of an arm's motors at some instants, and what the model predicts."""

    def __init__(
        self,
        estimator: ArmForce,
        frictions: Sequence[JointFriction],
        stretches: Sequence[Sequence[Signals]],
    ):
        """Take up to `INSTANTS` instants at equal distances.

        Args:
            estimator: of the arm, with the model's bodies.
            frictions: of its joints.
            stretches: by stretch, the signals of every joint.
        """
        self.estimator, self.frictions = estimator, frictions
        series = [
            np.array(
                [
                    np.concatenate([np.asarray(getattr(s[j], name)) for s in stretches])
                    for j in range(len(frictions))
                ]
            ).T
            for name in ("position", "velocity", "acceleration", "torque")
        ]
        step = max(len(series[0]) // INSTANTS, 1)
        self.q, self.dq, self.ddq, self.tau = (x[::step] for x in series)
        J = len(frictions)
        self._C = np.eye(J) if estimator.coupling is None else np.array(estimator.coupling)

    def misfit(self, order: np.ndarray, turned: np.ndarray, mirrored: np.ndarray) -> np.ndarray:
        """Return the share of each joint's torque that stays unexplained with another order or sign [-], (J,), by medians.

        Args:
            order: column that each joint takes, (J,).
            turned: factor on its torque, 1 or -1, (J,).
            mirrored: factor on its motion and torque, likewise, (J,).
        """
        q, dq, ddq = (x[:, order] * mirrored for x in (self.q, self.dq, self.ddq))
        tau = self.tau[:, order] * mirrored * turned
        error = tau - self._without_friction(q, dq, ddq) - self._friction(dq)
        return (np.median(np.abs(error), axis=0) / np.maximum(np.median(np.abs(tau), axis=0), 1e-9)) ** 2

    def friction_errors(self) -> np.ndarray:
        """Return the friction in the log relative to that of the model, less one, and its standard errors [-], (J, 2)."""
        friction = self._friction(self.dq)
        error = self.tau - self._without_friction(self.q, self.dq, self.ddq) - friction
        results = []
        for j in range(friction.shape[1]):
            X = np.column_stack(
                [np.ones(len(error)), np.sin(self.q), np.cos(self.q), self.ddq, friction[:, j]]
            )
            X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-12)
            inverse = np.linalg.pinv(X, rcond=1e-8)
            value = inverse @ error[:, j]
            spread = float(np.std(error[:, j] - X @ value)) * np.linalg.norm(inverse[-1])
            results.append(np.array([value[-1], spread]) / max(np.linalg.norm(friction[:, j]), 1e-12))
        return np.array(results)

    def _without_friction(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        bodies = (
            self.estimator.bodies.robot.inverse_dynamics(*(x @ self._C.T for x in (q, dq, ddq))) @ self._C
        )
        return bodies + np.array(self.estimator.inertia) * ddq + np.array(self.estimator.offset)

    def _friction(self, dq: np.ndarray) -> np.ndarray:
        return np.column_stack([f.law.torque(dq[:, j]) for j, f in enumerate(self.frictions)])

    def candidates(self) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
        """Yield what is changed in words, order, and factors on torque and motion."""
        names, J = self.estimator.joints, len(self.frictions)
        units = self.estimator.bodies.robot.units
        plain, one = np.arange(J), np.ones(J)
        yield "the torque's sign turned round (--map tau=-COLUMN)", plain, -one, one
        yield "position and torque of all joints turned round", plain, one, -one
        for j in range(J):
            sign = np.where(plain == j, -1.0, 1.0)
            yield f"the torque's sign of {names[j]} turned round", plain, sign, one
            yield f"position and torque of {names[j]} turned round", plain, one, sign
        for a, b in combinations(range(J), 2):
            if units[a] == units[b]:
                order = plain.copy()
                order[[a, b]] = b, a
                yield f"{names[a]} and {names[b]} in each other's place (--names)", order, one, one


def better_fit(instants: Instants) -> str | None:
    """Return in words the order or sign that fits far better than the log as it is; None if there is none."""
    J = len(instants.frictions)
    plain, one = np.arange(J), np.ones(J)
    own = float(np.sum(instants.misfit(plain, one, one)))
    tried = [(instants.misfit(*how), what) for what, *how in instants.candidates()]
    left, what = min(tried, key=lambda pair: float(np.sum(pair[0])))
    if float(np.sum(left)) < BETTER * own and 1.0 - float(left.max()) > FITS:
        return (
            f"with {what} it explains at least {100 * (1.0 - float(left.max())):.0f} % of each joint's torque"
        )
    return None
