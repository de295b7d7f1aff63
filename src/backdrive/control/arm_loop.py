"""A whole arm, one call per tick: friction, gravity, walls before the joints' limits, external torque, and the wrench at a frame.

    q, u -> torque of the motors, tau_e (external), tau_f (friction), wrench

`Loop` compensates each motor's friction within its limits. Once per tick, pinocchio computes the rigid bodies of the robot's
description at the position of the accepted readings. Nothing is raised in a tick; every joint has a `Status`. Stops and
latches remove all torque except that against gravity (docs/decisions/0010-arm-loop.md).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from backdrive.control import arm_kernel as kernel
from backdrive.control import arm_rows, guard
from backdrive.control.admittance import ROW, STATES
from backdrive.control.arm_joint import ArmJoint
from backdrive.control.arm_of_model import joints_of
from backdrive.control.bodies import Bodies
from backdrive.control.estimators.arm import ArmForce
from backdrive.control.loop import Loop, Row, take
from backdrive.control.table import APPLIED, CALLS, CAUSE, TORQUE
from backdrive.errors import InvalidInput
from backdrive.logs.joint import check_coupling
from backdrive.model import FrictionModel
from backdrive.parameters import Bound, array, check
from backdrive.robot import Robot
from backdrive.status import STATUSES, Status

HOLDING = {"rise": Bound(0.15, 60.0, "s"), "brake": Bound(0.0, 10.0, "s")}


class ArmLoop:
    """Friction, gravity, walls and external force of an arm, tick by tick.

    A loop that is not called cannot change the last torque command of the drives: use drives with a timeout, or a watchdog
    that monitors `count`. Copies (`copy`, `deepcopy`, `pickle`) are loops of their own in the same state.

    Attributes:
        torque: total torque of the motors [N.m or N], (J,). `update` changes all attributes; they are read-only.
        gravity: part of `torque` that balances gravity [N.m or N], (J,).
        drive: part of `torque` from walls and admittance [N.m or N], (J,).
        external: estimated external torque on the joints [N.m or N], (J,).
        position: of the joints, by the accepted readings [rad or m], (J,).
        velocity: of the joints, low-passed [rad/s or m/s], (J,).
    """

    def __init__(
        self,
        robot: Robot,
        joints: Mapping[str, ArmJoint],
        *,
        interval: float,
        parameters: Sequence[float] | None = None,
        force: ArmForce | None = None,
        coupling: Sequence[Sequence[float]] | np.ndarray | None = None,
        rise: float = 0.5,
        brake: float = 0.5,
        together: bool = True,
    ):
        """Set up the rows and compile the kernel, so that the first tick takes no longer than the next.

        Args:
            robot: rigid bodies.
            joints: settings of each joint of the robot, by name.
            interval: period [s].
            parameters: of the rigid bodies, as identified [kg, kg.m, kg.m^2], (10 J,); None: the description's.
            force: estimator of the external torque of the whole arm, with the same coupling; None: each joint's own
                (`JointLoop.external`), without wrench.
            coupling: C of q_joint = C q_motor; None: each motor drives its own joint, (J, J).
            rise: time in which gravity's torque is ramped up and down [s].
            brake: time for which a latched motor holds gravity; the brakes have to engage within it [s].
            together: a motor that latches stops the others.

        Raises:
            InvalidInput: joints are missing or not the robot's, or a number lies outside the envelope (`control.envelope`).
        """
        self.robot, self.joints = robot, arm_rows.in_order(robot, joints)
        J = len(robot.joints)
        check("ArmLoop", HOLDING, {"rise": rise, "brake": brake})
        C = np.eye(J) if coupling is None else check_coupling(coupling, J)
        self.coupling = np.ascontiguousarray(C, dtype=np.float64)
        self._settings = {
            "interval": interval, "parameters": parameters, "force": force, "coupling": coupling,
            "rise": rise, "brake": brake, "together": together,
        }  # fmt: skip
        self._loop = Loop([joint.loop for joint in self.joints.values()], interval=interval)
        self.interval = self._loop.interval
        self._bodies = Bodies(robot, parameters)
        each = list(self.joints.values())
        settings = {kernel.RISE: rise, kernel.BRAKE: brake, kernel.TOGETHER: float(together)}
        self._rows = arm_rows.limits(each, self._bodies, self.coupling, self.interval, settings)
        self._begin = arm_rows.output_stage(each, self._rows, self.interval)
        self._table, self._stage = self._rows.copy(), self._begin.copy()
        followers = [joint.admittance for joint in self.joints.values()]
        rows = np.array([np.zeros(ROW) if a is None else a.row() for a in followers])
        self._virtual, wanted = np.zeros((J, STATES)), np.zeros(J)
        back = np.ascontiguousarray(np.linalg.inv(self.coupling))
        self._force = arm_rows.matching(force, robot, self.coupling, interval)
        whole = np.zeros(0) if self._force is None else self._force.force
        self._arrays = (
            *self._loop._arrays, self._stage, self._table, rows, self._virtual, wanted, self.coupling, back, whole,
        )  # fmt: skip
        g = self._loop._table
        self._tick: Any = self._loop._kernel_of(kernel.tick)
        self._believed = (g, self._table, self.coupling, whole)
        self._frame = force is not None and force.frame is not None
        self._acted, self._passed = self._table[kernel.ACTED], self._table[kernel.STEP]
        self._read, self._applied = np.zeros(J), g[:, APPLIED]
        self._q, self._dq = self._table[kernel.Q], self._table[kernel.V]
        self._p = self._table[kernel.P]
        self._views = {k: row.view(self._table) for k, row in vars(ArmLoop).items() if isinstance(row, Row)}
        self.update(np.zeros(J), np.zeros(J))
        self.reset(np.zeros(J))
        g[:, CALLS] = 0.0

    @classmethod
    def from_model(
        cls,
        model: FrictionModel,
        robot: str | Path | Robot,
        *,
        interval: float,
        changes: Mapping[str, Mapping[str, Any]] | None = None,
        rise: float = 0.5,
        brake: float = 0.5,
        together: bool = True,
        **options: Any,
    ) -> ArmLoop:
        """Return the loop of an identified arm, with its friction, offsets, motor inertias, rigid bodies and coupling.

        Args:
            model: of a whole arm.
            robot: path of its description, or the robot, with limits of range, speed and torque.
            interval: period [s].
            changes: fields of `ArmJoint` by joint, such as its `admittance`.
            rise: time in which gravity's torque is ramped up and down [s].
            brake: time for which a latched motor holds gravity [s].
            together: a motor that latches stops the others.
            **options: of `control.arm_of_model.joints_of`: `limits`, `share`, `dither`, `bend`, `contact`,
                `encoder_count`, `method`, `bandwidth`, `frame`.

        Raises:
            InvalidInput: the model is not of an arm or not of this one, or a speed, a torque or a count is not known.
        """
        joints, force = joints_of(model, robot, **options)
        known, settings = force.bodies.robot, {"rise": rise, "brake": brake, "together": together}
        for name, values in (changes or {}).items():
            if name not in joints:
                raise InvalidInput(
                    f"{known.name} has no joint {name}.", remedy=f"It has {', '.join(joints)}."
                )
            names = [field.name for field in fields(ArmJoint)]
            if unknown := [value for value in values if value not in names]:
                raise InvalidInput(
                    f"Joint '{name}': {', '.join(unknown)} is no field of an `ArmJoint`.",
                    remedy=f"It has {', '.join(names)}.",
                )
            joints[name] = replace(joints[name], **values)
        return cls(known, joints, interval=interval, force=force, coupling=force.coupling, **settings)

    torque = Row(kernel.TOTAL, writeable=False)
    gravity = Row(kernel.GRAVITY, writeable=False)
    drive = Row(kernel.DRIVE, writeable=False)
    external = Row(kernel.TAU_E, writeable=False)
    position = Row(kernel.Q, writeable=False)
    velocity = Row(kernel.V, writeable=False)

    @property
    def compensation(self) -> np.ndarray:
        """Torque that compensates friction, a part of `torque` [N.m or N], read-only (J,)."""
        return self._loop.torque

    @property
    def friction(self) -> np.ndarray:
        """Friction of the motors, estimated [N.m or N], read-only (J,)."""
        if self._force is None:
            return self._loop.friction
        return _read_only(self._force.friction)

    @property
    def wrench(self) -> np.ndarray | None:
        """Wrench of the environment at the frame of `force`, along the base axes [N, N.m], read-only (6,); None without one."""
        return None if self._force is None or not self._frame else _read_only(self._force.wrench)

    @property
    def covariance(self) -> np.ndarray | None:
        """Covariance of the wrench, read-only (6, 6); None without one."""
        return None if self._force is None or not self._frame else _read_only(self._force.covariance)

    @property
    def singular(self) -> bool:
        """Whether the posture is singular for the wrench, so that damping affects it."""
        return self._force is not None and self._frame and self._force.singular

    @property
    def codes(self) -> np.ndarray:
        """`Status` of every motor, changed by `update`, read-only (J,)."""
        return self._loop.codes

    @property
    def count(self) -> int:
        """Number of calls of `update`; a watchdog sees from it that the loop has stopped."""
        return self._loop.count

    @property
    def causes(self) -> tuple[Status, ...]:
        """Cause of each motor's latch; OK if it is not latched."""
        return self._loop.causes

    def reset(self, positions: np.ndarray, *, gravity: float = 0.0) -> None:
        """Return to motors at rest, relaxed and without torque, at time 0; `count` goes on.

        Args:
            positions: of the motors, where they rest [rad or m], (J,).
            gravity: share of gravity's torque that is applied at once; 1 if another controller held the arm before [-].

        Raises:
            InvalidInput: a position is not finite, there is not one for each motor, or the share lies outside 0 to 1.
        """
        at = array("positions", positions, self._read.shape)
        check("reset", {"gravity": Bound(0.0, 1.0, "-")}, {"gravity": gravity})
        self._loop.reset(at)
        self._table[:], self._stage[:] = self._rows, self._begin
        self._table[kernel.P], self._q[:] = at, self.coupling @ at
        if self._force is not None:
            self._force.reset()
        self._virtual[:] = np.stack([self._q, 0.0 * self._q, self._q], axis=1)
        self._bodies.update(self._q, self._dq)
        held = self._bodies.weight + self._rows[kernel.OFFSET]
        weight, most = held @ self.coupling, self._rows[kernel.WEIGHT]
        self._table[kernel.SHARE] = gravity
        self._table[kernel.GRAVITY] = gravity * np.clip(weight, -most, most)
        self._table[kernel.TOTAL] = self._table[kernel.GRAVITY]

    def acknowledge(self) -> bool:
        """Clear latches and a stop; the torque then returns at the slow rate.

        A motor stays latched while it still has torque beside gravity's, or while the joint is faster than its top speed.

        Returns:
            Whether no motor is latched now.
        """
        g, d, free = self._loop._table, self._stage, True
        for j in range(len(self.joints)):
            if g[j, CAUSE] != 0.0 and d[j, TORQUE] != 0.0:
                free = False
            elif guard.acknowledge(g[j]):
                guard.acknowledge(d[j])
            else:
                free = False
        return free

    def stop(self) -> None:
        """Ramp all torque except that against gravity down to zero at the slow rate, until `acknowledge`."""
        self._loop.stop()

    def update(self, position: np.ndarray, applied: np.ndarray, interval: float | None = None) -> Status:
        """Advance the arm by one tick; nothing is raised.

        Args:
            position: encoder readings of the motors [rad or m], (J,).
            applied: torque of the motors that acted since the tick before [N.m or N], (J,).
            interval: since the tick before [s]; None: the period.

        Returns:
            The worst status of the motors; those of each are in `codes`.
        """
        read, bodies = self._read, self._bodies
        dt = take(position, applied, interval, read, self._applied, self.interval)
        begins, force = kernel.locate(*self._believed, read, dt), self._force
        try:
            bodies.update(self._q, self._dq if force is None else None)
            if force is not None:
                if begins:
                    force.reset()
                force.tick(self._p, self._acted, float(self._passed[0]))
        except Exception:  # gravity stays as it was
            read[:] = np.nan
        return STATUSES[self._tick(*self._arrays, read, dt, bodies.weight, bodies.bias)]

    def __reduce__(self):
        mine = (self._table, self._stage, self._virtual)
        if self._force is not None:
            mine += (self._force._s, self._force._X, self._force._io)
        state = (copy.copy(self._loop), *(copy.copy(x) for x in mine))
        return _in_state, (self.robot, self.joints, self._settings, *state)


def _read_only(view: np.ndarray) -> np.ndarray:
    own = view[:]
    own.flags.writeable = False
    return own


def _in_state(
    robot: Robot, joints: Mapping[str, ArmJoint], settings: Mapping[str, Any], motors: Loop, *mine: np.ndarray
) -> ArmLoop:
    loop = ArmLoop(robot, joints, **settings)
    inner = loop._loop
    inner._rows[:], inner._table[:], inner._codes[:] = motors._rows, motors._table, motors._codes
    arrays = [loop._table, loop._stage, loop._virtual]
    if loop._force is not None:
        arrays += [loop._force._s, loop._force._X, loop._force._io]
        loop._force._fresh = False
    for own, given in zip(arrays, mine, strict=True):
        own[:] = given
    return loop
