"""The wrench at a frame that explains the external torques of an arm's joints.

    (P + J S^-1 J') w = J S^-1 tau_e,        cov w = (P + J S^-1 J')^-1

S: variances of the joints' torques, from the bands of their states. So a joint at rest, where friction is not determined, has
less weight. P damps directions that no joint observes in this posture (`ArmForce.damping`). If it affects the wrench, the
posture counts as singular. Force before moment, along the axes of the base, the moment about the frame's origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.control.estimators import arm_kernel
from backdrive.control.estimators.arm import ArmForce
from backdrive.control.estimators.arm_tick import FULL, SINGULAR
from backdrive.control.estimators.of_model import WIDTH
from backdrive.external.directions import blind_directions, direction_words, usual_direction
from backdrive.external.result import JointForce

COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
UNITS = ("N", "N", "N", "N.m", "N.m", "N.m")
FORCE = 3  # components of the force
SQUARES = ("N^2", "N^2.m", "N^2.m^2")  # of covariances, by the number of moments in them
USUAL = 0.8  # share of the singular time's directions from which on one stands for all [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class WrenchEstimate:
    """The wrench of the environment on an arm, at a frame.

    Attributes:
        frame: name.
        time: [s], (n,).
        wrench: force [N] and moment about the frame's origin [N.m], along the axes of the base, (n, 6).
        covariance: of it, (n, 6, 6).
        singular: True where a direction is unobservable in the posture, and damped, (n,).
        known: the log's wrench (`measured_along`), or else the wrench that explains the log's external torques with the same
            weights, (n, 6); None without either.
        joints: of the arm.
        blind: where `singular`, the direction of the wrench that the joints feel least, with force [N] and moment [N.m] along the
            axes of the base (`blind_directions`), (n, 6); NaN elsewhere, and with fewer than six joints, which leave several.
        damping: P [1/N^2, 1/(N.m)^2], (6,).
    """

    frame: str
    time: np.ndarray
    wrench: np.ndarray
    covariance: np.ndarray
    singular: np.ndarray
    known: np.ndarray | None = None
    joints: int = FULL
    blind: np.ndarray | None = None
    damping: np.ndarray | None = None

    @property
    def blind_direction(self) -> np.ndarray | None:
        """Direction that the joints usually feel least where the posture is singular [N, N.m], (6,); None if none is known."""
        told = self._usual()
        return None if told is None else told[0]

    def _usual(self) -> tuple[np.ndarray, float] | None:
        if self.blind is None or self.damping is None:
            return None
        known = self.blind[np.isfinite(self.blind).all(axis=1)]
        return usual_direction(known, self.damping) if len(known) else None

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviations [N, N.m], (n, 6)."""
        return np.sqrt(np.einsum("nii->ni", self.covariance))

    @property
    def rms_error(self) -> np.ndarray | None:
        """Root mean square of the error against the known wrench [N, N.m], (6,); None without one."""
        return None if self.known is None else np.sqrt(np.nanmean((self.wrench - self.known) ** 2, axis=0))

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of a table, by name: wrench, standard deviations, upper triangle of the covariance, singular."""
        table, deviation = {}, self.deviation
        for i, (name, unit) in enumerate(zip(COMPONENTS, UNITS, strict=True)):
            table[f"{self.frame}_{name} [{unit}]"] = self.wrench[:, i]
            table[f"{self.frame}_{name}_sd [{unit}]"] = deviation[:, i]
        for i in range(FULL):
            for j in range(i, FULL):
                unit = SQUARES[(i >= FORCE) + (j >= FORCE)]
                table[f"{self.frame}_cov_{COMPONENTS[i]}_{COMPONENTS[j]} [{unit}]"] = self.covariance[:, i, j]
        return table | {f"{self.frame}_singular": self.singular.astype(np.int8)}

    def remarks(self) -> list[str]:
        """Return remarks on unobservable components of the wrench."""
        if not self.singular.any():
            return []
        if self.joints < FULL:
            return [
                f"Wrench at '{self.frame}': {self.joints} joints can observe at most {self.joints} of its {FULL} "
                f"components at a time. The others are set to zero, with a large standard deviation."
            ]
        first, share = float(self.time[np.argmax(self.singular)]), 100.0 * float(np.mean(self.singular))
        told = f"{share:.0f} %" if share >= 1.0 else "less than 1 %"
        return [
            f"Wrench at '{self.frame}': {told} of the time (first at {first:.4g} s) a direction is "
            f"not observable, because of the posture or of joints at rest{self._blind_words()}. Along it the estimate is damped, "
            f"and its standard deviation is large."
        ]

    def _blind_words(self) -> str:
        """Describe the direction that is not observable."""
        told = self._usual()
        if told is None or self.damping is None:
            return ""
        which = "" if told[1] >= USUAL else "most often "
        return f": {which}{direction_words(told[0], self.damping)}"


def wrench_of(
    estimator: ArmForce,
    time: np.ndarray,
    position: np.ndarray,
    joints: Sequence[JointForce],
    measured: np.ndarray | None = None,
) -> WrenchEstimate:
    """Return the wrench that explains the torques of the joints.

    Args:
        estimator: with a frame.
        time: of the positions [s], (m,).
        position: of the joints, or of coupled motors [rad or m], (m, J).
        joints: external torques on one clock, in the estimator's order.
        measured: wrench at the frame, along the axes of the base, at those instants [N, N.m], (n, 6); None: not measured.
    """
    frame, J, clock = estimator.frame, len(joints), joints[0].time
    assert frame is not None
    q = np.column_stack([np.interp(clock, time, position[:, j]) for j in range(J)])
    C = np.eye(J) if estimator.coupling is None else np.array(estimator.coupling)
    jacobians = estimator.bodies.robot.jacobian(q @ C.T, frame) @ C
    deviations = np.column_stack([0.5 * (one.upper - one.lower) / WIDTH for one in joints])
    fallback = np.array(estimator.sliding)
    deviations = np.where(np.isfinite(deviations) & (deviations > 0.0), deviations, fallback)
    forces = np.column_stack([one.force for one in joints])
    row = estimator.row(1e-3)
    rows = _solve_samples(row, jacobians, forces, deviations)
    known = measured
    if known is None and all(one.known is not None for one in joints):
        told = np.column_stack([one.known for one in joints])  # type: ignore[arg-type]
        known = _solve_samples(row, jacobians, told, deviations)[:, :FULL]
    covariance, singular = rows[:, FULL:-1].reshape(-1, FULL, FULL), rows[:, -1] > SINGULAR
    damping = row[arm_kernel.DAMPING : arm_kernel.DAMPING + FULL].copy()
    blind = np.full((clock.size, FULL), np.nan)
    if J >= FULL and singular.any():
        blind[singular] = blind_directions(covariance[singular], damping)
    return WrenchEstimate(
        frame=frame,
        time=clock,
        wrench=rows[:, :FULL],
        covariance=covariance,
        singular=singular,
        known=known,
        joints=J,
        blind=blind,
        damping=damping,
    )


def _solve_samples(
    row: np.ndarray, jacobians: np.ndarray, forces: np.ndarray, deviations: np.ndarray
) -> np.ndarray:
    """Return wrench, covariance and share of the damping of every sample, (n, 43)."""
    n, J = forces.shape
    io = np.zeros(arm_kernel.OUT * J + 2 * FULL + FULL**2 + 1)
    out = np.empty((n, FULL + FULL**2 + 1))
    arm_kernel.wrenches(row, io, jacobians, np.ascontiguousarray(forces), deviations, J, out)
    return out
