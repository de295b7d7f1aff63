"""One fused tick of several joints: compensation, external force and friction from one row of encoder readings.

    q, u -> f (torque to add), tau_e (external force), tau_f (friction)

`update` raises no exception and keeps no allocated memory. In every tick each joint passes: readings (`control.readings`),
compensation and estimate, then the speed watch and the limits of torque and rate (`control.guard`). Every joint has its own
`Status`; a fault of one does not affect the others. A late tick uses the time that really elapsed.

If the encoder stands still, the compensation without its dither falls below 5 % within the hold time, and integrators stop.
The reason: a frozen encoder cannot be distinguished from an arm on which a person leans.

`Adaptation` can adapt the level of the friction in the loop: in free motion, the estimated external force is the error of the
friction model.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from backdrive.control import assembly, guard
from backdrive.control.envelope import PERIOD
from backdrive.control.joint_loop import BareLoop, JointLoop, concatenate, rows
from backdrive.control.loop_kernel import tick
from backdrive.control.table import (
    APPLIED,
    CALLS,
    CAUSE,
    ERROR,
    EXTERNAL,
    FRICTION,
    KNOWN,
    LEVEL,
    LOAD,
    MOTOR,
    SLOPE,
    STOP,
    TEMPERATURE,
    TORQUE,
)  # fmt: skip
from backdrive.errors import InvalidInput
from backdrive.parameters import array, check
from backdrive.status import STATUSES, Status

F = TypeVar("F", bound=Callable)


class Row:
    """A row of a loop's table as an attribute of the loop: an assignment writes into the row.

    Args:
        rows: number of a row, for an attribute (J,), or a slice of k rows, for (J, k).
        writeable: callers may write.
    """

    def __init__(self, rows: int | slice, *, writeable: bool = True):
        self.rows, self.writeable = rows, writeable

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, loop: Any, owner: type | None = None) -> np.ndarray:
        return loop._views[self.name]

    def __set__(self, loop: Any, value: Any) -> None:
        if not self.writeable:
            raise AttributeError(f"`{self.name}` of a loop is read-only.")
        loop._views[self.name][:] = value

    def view(self, table: np.ndarray) -> np.ndarray:
        """Return its part of a table."""
        view = table[self.rows].T
        view.flags.writeable = self.writeable
        return view


class Loop:
    """Compensation and estimation of several joints, tick by tick.

    A loop that is not called cannot change the last torque command of the drive: use a drive with a timeout, or a watchdog
    that monitors `count`. Copies (`copy`, `deepcopy`, `pickle`) are loops of their own in the same state.

    Attributes:
        torque: to add to what drives the joints [N.m or N], changed by `update`, read-only (J,).
        external: estimated external force [N.m or N], changed by `update`, read-only (J,).
        friction: estimated friction [N.m or N], changed by `update`, read-only (J,).
        level: learned level of the friction [-], changed by `update`, read-only (J,).
        error: reference minus position, to be written before `update` [rad or m], (J,).
        slope: rate of `error`, to be written before `update` [rad/s or m/s], (J,).
        known: gravity and the coupling torque of other joints, to be written before `update` [N.m or N], (J,). If it is not
            0, it is also the load of laws that grow with the load and have no `load`.
        load: motor-side and external torque for laws that depend on load, to be written before `update` [N.m or N], (J, 2).
            If both are 0, a law that grows with the load uses `known`, or the load under which it was identified.
        temperature: for laws that depend on it, to be written before `update` [degC], (J,).
    """

    _arrays: tuple[Any, ...]

    def __init__(self, joints: JointLoop | Sequence[JointLoop], *, interval: float):
        """Set up the rows and compile the kernel, so that the first tick takes no longer than the next.

        Args:
            joints: settings of each joint.
            interval: period [s].

        Raises:
            InvalidInput: there is no joint, a joint has no guards, or the period lies outside the envelope
                (`control.envelope`).
        """
        self.joints = (joints,) if isinstance(joints, JointLoop) else tuple(joints)
        if not self.joints:
            raise InvalidInput("The loop has no joint.", remedy="Give at least one `JointLoop`.")
        check("Loop", {"interval": PERIOD}, {"interval": interval})
        self.interval = float(interval)
        self._admit()
        J = len(self.joints)
        *parts, self._table = rows(self.joints, np.zeros(J), self.interval)
        self._codes = np.zeros(J, dtype=np.int64)
        self._rows, begins = concatenate(parts)
        self._arrays = (self._rows, begins, self._table, self._codes)
        self._position = np.zeros(J)
        self._views = {k: row.view(self._table.T) for k, row in vars(Loop).items() if isinstance(row, Row)}
        self._read_codes = self._codes[:]
        self._read_codes.flags.writeable = False
        self._applied = self._table[:, APPLIED]
        self._tick: Any = self._kernel_of(tick)
        self.update(np.zeros(J), np.zeros(J))
        self.reset(np.zeros(J))
        self._table[:, CALLS] = 0.0

    def __repr__(self) -> str:
        limits = ", ".join(f"{joint.limit:.4g}" for joint in self.joints)
        count = f"{len(self.joints)} joint{'s' if len(self.joints) > 1 else ''}"
        return f"<Loop of {count}, {1.0 / self.interval:g} Hz; at most {limits} N.m or N>"

    def _kernel_of(self, kernel: F) -> F:
        """Return a kernel that is compiled only for the laws and estimators of this loop's joints."""
        return assembly.of_loop(kernel, rows(self.joints, np.zeros(len(self.joints)), self.interval))

    def _admit(self) -> None:
        """Refuse joints without limits."""
        for i, each in enumerate(self.joints):
            if isinstance(each, BareLoop):
                raise InvalidInput(
                    f"Joint {i} has no limits.", remedy="`BareLoop` is for simulation; give a `JointLoop`."
                )

    torque = Row(TORQUE, writeable=False)
    external = Row(EXTERNAL, writeable=False)
    friction = Row(FRICTION, writeable=False)
    level = Row(LEVEL, writeable=False)
    error = Row(ERROR)
    slope = Row(SLOPE)
    known = Row(KNOWN)
    load = Row(slice(MOTOR, LOAD + 1))
    temperature = Row(TEMPERATURE)

    @property
    def codes(self) -> np.ndarray:
        """`Status` of every joint, changed by `update`, read-only (J,)."""
        return self._read_codes

    @property
    def count(self) -> int:
        """Number of calls of `update`; a watchdog sees from it that the loop has stopped."""
        return int(self._table[0, CALLS])

    @property
    def causes(self) -> tuple[Status, ...]:
        """Cause of each joint's latch; OK if it is not latched."""
        return tuple(STATUSES[int(cause)] for cause in self._table[:, CAUSE])

    def reset(self, positions: np.ndarray) -> None:
        """Return to joints at rest, relaxed and without torque, at time 0; `count` goes on.

        Args:
            positions: where they rest [rad or m], (J,).

        Raises:
            InvalidInput: a position is not finite, or there is not one for each joint.
        """
        at = array("positions", positions, self._position.shape)
        *parts, table = rows(self.joints, at, self.interval)
        table[:, CALLS] = self._table[:, CALLS]
        self._rows[:], self._table[:] = concatenate(parts)[0], table
        self._codes[:] = int(Status.OK)

    def acknowledge(self) -> bool:
        """Clear latches and a stop; the torque then returns at the slow rate.

        A joint stays latched while it still has torque, or while it is faster than its top speed.

        Returns:
            Whether no joint is latched now.
        """
        return all([guard.acknowledge(row) for row in self._table])

    def stop(self) -> None:
        """Ramp the torque down to zero at the slow rate, until `acknowledge`."""
        self._table[:, STOP] = True

    def update(self, position: np.ndarray, applied: np.ndarray, interval: float | None = None) -> Status:
        """Advance every joint by one tick, without exceptions; memory allocated in a call is freed when it returns.

        Args:
            position: encoder readings [rad or m], (J,).
            applied: torque that acted since the tick before [N.m or N], (J,).
            interval: since the tick before [s]; None: the period.

        Returns:
            The worst status of the joints; those of each are in `codes`.
        """
        read = self._position
        dt = take(position, applied, interval, read, self._applied, self.interval)
        return STATUSES[self._tick(*self._arrays, read, dt)]

    def __reduce__(self):
        state = (self._rows, self._table, self._codes)
        return _in_state, (self.joints, self.interval, *(copy.copy(array) for array in state))


def take(
    position: np.ndarray,
    applied: np.ndarray,
    interval: float | None,
    read: np.ndarray,
    acted: np.ndarray,
    period: float,
) -> float:
    """Copy the inputs of a tick into `read` and `acted`, (J,) each; `read` is NaN where the input is not a valid reading.

    Returns:
        The interval, or the period where none was given [s].
    """
    dt = period
    try:
        if interval is not None:
            dt = float(interval)
        if len(position) != len(read) or len(applied) != len(read):
            read[:] = np.nan
        else:
            read[:], acted[:] = position, applied
    except Exception:  # the input is not a valid reading
        read[:] = np.nan
    return dt


def _in_state(
    joints: Sequence[JointLoop], interval: float, own: np.ndarray, table: np.ndarray, codes: np.ndarray
) -> Loop:
    loop = Loop(joints, interval=interval)
    loop._rows[:], loop._table[:], loop._codes[:] = own, table, codes
    return loop
