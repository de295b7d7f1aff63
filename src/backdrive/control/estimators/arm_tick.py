"""`ArmForce` in a loop: one call per tick, without exceptions, and without allocation except by pinocchio itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from backdrive.control.estimators import arm_kernel as k
from backdrive.engine.series import stack_rows
from backdrive.errors import InvalidInput
from backdrive.laws import REFERENCE, kernels
from backdrive.robot import require_pinocchio
from backdrive.status import Status

if TYPE_CHECKING:
    from backdrive.control.estimators.arm import ArmForce

FULL = 6  # components of a wrench
SINGULAR = 0.25  # share of the damping in a wrench, above which the posture counts as singular [-]
PATIENCE = 20  # ticks with positions that no joint can have reached, after which the estimator starts again
OK = Status.OK


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmSeries:
    """External torque along a log, with friction, deviations and wrench.

    Attributes:
        force: external torque [N.m or N], (n, J).
        friction: torque that was subtracted as friction [N.m or N], (n, J).
        deviation: standard deviation of the torque, in motion or at rest [N.m or N], (n, J).
        wrench: at the frame, along the axes of the base [N, N.m], (n, 6); (0, 6) without a frame.
        covariance: of the wrench, (n, 6, 6).
        singular: True where damping affects the wrench, (n,).
    """

    force: np.ndarray
    friction: np.ndarray
    deviation: np.ndarray
    wrench: np.ndarray
    covariance: np.ndarray
    singular: np.ndarray


class ArmForceTick:
    """Runs an `ArmForce` in a loop, without exceptions, and without allocation except by pinocchio itself.

    Attributes:
        force: external torque [N.m or N], (J,).
        friction: torque that was subtracted as friction [N.m or N], (J,).
        deviation: standard deviation of the torque, in motion or at rest [N.m or N], (J,).
        wrench: at the frame, along the axes of the base [N, N.m], (6,).
        covariance: of the wrench, (6, 6).
    """

    def __init__(self, settings: ArmForce, period: float):
        """Allocate the work arrays, and compile the kernels.

        Args:
            settings: the estimator.
            period: of the loop [s].

        Raises:
            InvalidInput: a period that is not positive.
        """
        if not 0.0 < period < np.inf:
            raise InvalidInput(f"A period of {period:g} s.", remedy="Give a positive number, such as 1e-3.")
        self.settings, self.period = settings, float(period)
        J = len(settings.joints)
        self._c = settings.row(period)
        self._s = np.zeros(k.STATES * J)
        self._io = np.zeros(k.OUT * J + 2 * FULL + FULL**2 + 1)
        laws = [f.law for f in settings.friction]
        self._P = stack_rows([law.row() for law in laws])
        self._X0 = stack_rows([law.state() for law in laws])
        self._X = self._X0.copy()
        self._room, self._temperature = np.zeros((J, J)), np.full(J, REFERENCE)
        rows = [self._io[i * J : (i + 1) * J] for i in range(k.OUT)]
        self._position, self._torque, middle, velocity, acceleration = rows[:5]
        self.force, self.friction, self.deviation = rows[5:8]
        at = k.OUT * J
        self.wrench = self._io[at : at + FULL]
        self.covariance = self._io[at + FULL : at + FULL + FULL**2].reshape(FULL, FULL)
        self.wrench_row = self._io[at : at + FULL + FULL**2 + 1]
        self._coupling = None if settings.coupling is None else np.array(settings.coupling)
        moving = self._io[2 * J : 5 * J].reshape(3, J)
        joints = moving if self._coupling is None else np.zeros((3, J))
        if self._coupling is None:
            made = settings.bodies.calls(settings.method, middle, velocity, acceleration)
        else:
            made = settings.bodies.calls_at_motors(settings.method, moving, joints, self._coupling)
        self._bodies, self._M, self._bias, self._C = made
        self._jacobian = np.zeros((FULL, J), order="F")
        self._turned = np.zeros((FULL, J), order="F")
        self._frame, self._at, self._model, self._data = None, joints[0], None, None
        if settings.frame is not None:
            pin, robot = require_pinocchio(), settings.bodies.robot
            self._frame, self._model, self._data = (
                robot.frame(settings.frame),
                robot.model,
                settings.bodies.data,
            )
            self._axes, self._jacobian_of = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, pin.computeFrameJacobian
        kinds = [law.rate.KIND for law in laws], [law.element.KIND for law in laws]
        self._after = kernels.of_kinds(k.after, *kinds)
        self._fresh, self._jumps = True, 0
        self.tick(np.zeros(J), np.zeros(J))
        self.reset()

    @property
    def singular(self) -> bool:
        """Whether the posture is singular: the damping has a share in the wrench."""
        return bool(self.wrench_row[-1] > SINGULAR)

    def reset(self, position: np.ndarray | None = None, velocity: np.ndarray | None = None) -> None:
        """Reset the estimator.

        Args:
            position: positions of the joints [rad or m], (J,); None: those of the next tick.
            velocity: velocities of the joints [rad/s or m/s], (J,); None: they rest.
        """
        self._fresh, self._jumps = position is None, 0
        self._X[:] = self._X0
        self.force[:] = self.friction[:] = 0.0
        if position is None:
            return
        self._position[:] = position
        k.restart(self._c, self._s, self._io)
        if velocity is not None:
            own = self._s.reshape(-1, k.STATES)
            v = np.asarray(velocity, dtype=np.float64)
            own[:, 1] = own[:, 2] = own[:, k.V] = own[:, k.V_HAT] = own[:, k.SPEED] = v
            M = self.settings.inertia_at(np.asarray(position, dtype=np.float64))
            if self.settings.method == "momentum":
                own[:, k.Y] = M @ v

    def bodies_only(self) -> None:
        """Evaluate the rigid bodies at the last reading, as each tick does."""
        self._bodies()
        if self._frame is not None:
            self._jacobian = self._jacobian_of(self._model, self._data, self._at, self._frame, self._axes)
            if self._coupling is not None:
                self._jacobian = np.matmul(self._jacobian, self._coupling, out=self._turned)

    def tick(
        self,
        position: np.ndarray,
        torque: np.ndarray,
        interval: float | None = None,
        temperature: np.ndarray | float | None = None,
    ) -> Status:
        """Advance by one tick; the attributes hold the result.

        Args:
            position: encoder readings [rad or m], (J,).
            torque: that acted since the tick before: the command of that tick [N.m or N], (J,).
            interval: since the tick before [s]; None: the period.
            temperature: of the joints [degC], (J,); None: as before, 20 at first.

        Returns:
            OK; NOT_FINITE (also for another shape), JUMP or BAD_INTERVAL where an input was not used: the results stay as they
            were. After `PATIENCE` ticks of JUMP the estimator starts again from the new positions.
        """
        try:
            dt = self.period if interval is None else float(interval)
            if temperature is not None:
                self._temperature[:] = temperature
            self._position[:], self._torque[:] = position, torque
        except Exception:  # of another shape or type
            return Status.NOT_FINITE
        if self._fresh:
            if not np.isfinite(self._position).all():
                return Status.NOT_FINITE
            k.restart(self._c, self._s, self._io)
            self._fresh = False
        status = k.before(self._c, self._s, self._io, dt)
        if status:
            self._jumps = self._jumps + 1 if status == Status.JUMP else 0
            if self._jumps > PATIENCE:  # the encoders have another zero
                self.reset()
            return Status(status)
        self._jumps = 0
        self.bodies_only()
        self._after(
            self._c,
            self._s,
            self._io,
            self._P,
            self._X,
            self._M,
            self._bias,
            self._C,
            self._jacobian,
            self._room,
            dt,
            self._temperature,
        )
        return OK
