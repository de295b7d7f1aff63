"""One fused tick of several joints: compensation, external force and friction from one row of encoder readings.

    q, u -> f (torque to add), tau_e (external force), tau_f (friction)

Nothing is raised, and no memory is kept from call to call. In every tick, joint by joint: readings (`control.readings`), then
compensation and estimate, then the watch, the limit of torque and that of its rate (`control.guard`). Every joint has a `Status`,
and none notices what is wrong with another. A late tick is run with the time that really passed.

Without counts there is no push: while the encoder stands still, what the compensator gives beside its dither fades below 5 %
within the hold time, and what integrates stops. A frozen encoder and a person who leans on the arm look the same.

The level of the friction that is compensated and taken off may be learned meanwhile (`Adaptation`): what is estimated as external
force in free motion is what the friction model misses.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from backdrive.control import assembly, guard
from backdrive.control.envelope import PERIOD
from backdrive.control.joint_loop import BareLoop, JointLoop, rows
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
    """A row of a loop's table as the attribute of a loop: what is assigned is written into it.

    Args:
        rows: of the table: one, which is (J,), or a slice of k, which is (J, k).
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

    A loop that nobody calls cannot change the torque that the drive was last given: have the drive time out, or an outer
    watchdog look at `count`. Copies (`copy`, `deepcopy`, `pickle`) are loops of their own in the same state.

    Attributes:
        torque: to add to what drives the joints [N.m or N], changed by `update`, read-only (J,).
        external: estimated external force [N.m or N], changed by `update`, read-only (J,).
        friction: estimated [N.m or N], changed by `update`, read-only (J,).
        level: of the friction, learned [-], changed by `update`, read-only (J,).
        error: how far the reference is ahead, to be written before `update` [rad or m], (J,).
        slope: rate of `error`, to be written before `update` [rad/s or m/s], (J,).
        known: gravity and the other joints' pull, to be written before `update` [N.m or N], (J,). Where it is not 0, it is the
            load of laws that grow with it and are given none.
        load: motor-side and external torque for laws that depend on load, to be written before `update` [N.m or N], (J, 2).
            Where both are 0, that of a law that grows with the load is what is `known`, or the one under which it was identified.
        temperature: for laws that depend on it, to be written before `update` [degC], (J,).
    """

    _arrays: tuple[Any, ...]

    def __init__(self, joints: JointLoop | Sequence[JointLoop], *, interval: float):
        """Set up the rows and compile the kernel, so that the first tick takes no longer than the next.

        Args:
            joints: what runs on each.
            interval: period [s].

        Raises:
            InvalidInput: there is no joint, one is without its guards, or the period lies outside what the promises hold for.
        """
        self.joints = (joints,) if isinstance(joints, JointLoop) else tuple(joints)
        if not self.joints:
            raise InvalidInput("A loop of no joint.", remedy="Give at least one `JointLoop`.")
        check("Loop", {"interval": PERIOD}, {"interval": interval})
        self.interval = float(interval)
        self._admit()
        J = len(self.joints)
        *parts, self._table = rows(self.joints, np.zeros(J), self.interval)
        self._codes = np.zeros(J, dtype=np.int64)
        # in one array, for an argument more costs as much as a friction law
        begins = np.cumsum([0] + [part.shape[1] for part in parts])
        self._rows = np.concatenate(parts, axis=1)
        self._arrays = (self._rows, begins, self._table, self._codes)
        self._position = np.zeros(J)
        self._views = {k: row.view(self._table) for k, row in vars(Loop).items() if isinstance(row, Row)}
        self._read_codes = self._codes[:]
        self._read_codes.flags.writeable = False
        self._applied = self._table[APPLIED]
        self._tick: Any = self._kernel_of(tick)
        self.update(np.zeros(J), np.zeros(J))
        self.reset(np.zeros(J))
        self._table[CALLS] = 0.0

    def _kernel_of(self, kernel: F) -> F:
        """Return a kernel that advances joints for what runs on those of this loop."""
        compensators, _, _, _, estimators, *_ = rows(self.joints, np.zeros(len(self.joints)), self.interval)
        estimates = any(joint.external is not None for joint in self.joints)
        return assembly.of_loop(kernel, compensators, estimators, estimates)

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
        """How often `update` was called: it stands still where nobody calls the loop any more."""
        return int(self._table[CALLS, 0])

    @property
    def causes(self) -> tuple[Status, ...]:
        """What latched each joint, OK where it is not latched."""
        return tuple(STATUSES[int(cause)] for cause in self._table[CAUSE])

    def reset(self, positions: np.ndarray) -> None:
        """Return to joints at rest, relaxed and without torque, at time 0; `count` goes on.

        Args:
            positions: where they rest [rad or m], (J,).

        Raises:
            InvalidInput: a position is not finite, or there are more or fewer than joints.
        """
        at = array("positions", positions, self._position.shape)
        *parts, table = rows(self.joints, at, self.interval)
        table[CALLS] = self._table[CALLS]
        self._rows[:], self._table[:] = np.concatenate(parts, axis=1), table
        self._codes[:] = int(Status.OK)

    def acknowledge(self) -> bool:
        """Take back latches and a stop: the torque comes back at the slow rate.

        A latch stays where torque is still left or the joint is still faster than its top speed.

        Returns:
            Whether no joint is latched any more.
        """
        return all([guard.acknowledge(self._table, j) for j in range(len(self.joints))])

    def stop(self) -> None:
        """Let the torque ramp down to zero at the slow rate, and stay there until `acknowledge`."""
        self._table[STOP] = True

    def update(self, position: np.ndarray, applied: np.ndarray, interval: float | None = None) -> Status:
        """Advance every joint by one tick; nothing is raised, and what a call allocates it has freed when it returns.

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
    """Copy what a tick was given into `read` and `acted`, (J,) each; `read` is NaN where that is no reading.

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
    except Exception:  # whatever was given, it is no reading
        read[:] = np.nan
    return dt


def _in_state(
    joints: Sequence[JointLoop], interval: float, own: np.ndarray, table: np.ndarray, codes: np.ndarray
) -> Loop:
    loop = Loop(joints, interval=interval)
    loop._rows[:], loop._table[:], loop._codes[:] = own, table, codes
    return loop
