"""`Log`: recorded motion and torque of a robot's joints, in SI units, on one clock.

Positive torque, position and velocity all point along +q. Arrays are time first, joint second. A log may hold everything that
occurs in real files: NaN, gaps, unsorted time. `backdrive.logs.health` finds these faults, and the identification refuses those
that would spoil a result. Only shapes are checked here, and that no number is so large that its square overflows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from backdrive._upper import Display, upper
from backdrive.errors import InvalidInput
from backdrive.logs.joint import Drive, Joint, Source, as_joints, check_coupling
from backdrive.logs.quantiles import median
from backdrive.logs.values import check_period, read_only

#: Larger numbers are measurements in no unit, and products of a few overflow; an infinity counts as a missing sample.
LARGEST = 1e60
AS_SI = "was taken as SI"  # words of a note on a doubtful unit
#: Words of the same note where nobody said that the unit is right: without a factor, or with one that seems of another unit.
DOUBTED = "as --map gives no factor", "a large factor for the unit in its name"
WRENCH = 6  # numbers of a wrench

#: Per-sample, per-joint channels of a `Log`, each with the SI unit for a rotary and for a linear joint.
CHANNELS: dict[str, tuple[str, str]] = {
    "position": ("rad", "m"),
    "velocity": ("rad/s", "m/s"),
    "torque": ("N.m", "N"),
    "reference": ("rad", "m"),
    "drive_input": ("1", "1"),
    "second_encoder": ("rad", "m"),
    "external_torque": ("N.m", "N"),
    "model_torque": ("N.m", "N"),
    "load": ("N.m", "N"),
    "temperature": ("degC", "degC"),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Log(Display):
    """Measured motion and torque of one or more joints.

    Attributes:
        time: sampling instants [s], (n,).
        joints: one `Joint` per column, (J,); a name stands for a rotary joint.
        position: joint position [rad or m], (n, J). Position or velocity is required.
        velocity: joint velocity [rad/s or m/s], (n, J).
        torque: actuator torque on the joint side [N.m or N], (n, J).
        reference: commanded position [rad or m], (n, J).
        drive_input: input of the drive, in the unit of `drive`'s law, (n, J).
        second_encoder: link-side position [rad or m], (n, J).
        external_torque: torque of the environment on the robot [N.m or N], (n, J).
        model_torque: known torque of gravity and of the coupling to other axes [N.m or N], (n, J).
        load: transmitted load [N.m or N], (n, J).
        temperature: of the joint [degC], (n, J).
        wrench: of the environment on the robot, as measured by a sensor: force [N], then moment [N.m], (n, 6). It belongs to
            no joint.
        drive: the law behind `drive_input`.
        plan: the motion plan it was recorded with (an object of `backdrive.plans`), if known.
        sources: files it came from.
        notes: what a reader or a repair did to the data, in sentences.
        coupling: C of q_joint = C q_motor, with which the channels were converted from coupled motors to the joints, (J, J).
    """

    time: np.ndarray
    joints: tuple[Joint, ...]  # or names
    position: np.ndarray | None = None
    velocity: np.ndarray | None = None
    torque: np.ndarray | None = None
    reference: np.ndarray | None = None
    drive_input: np.ndarray | None = None
    second_encoder: np.ndarray | None = None
    external_torque: np.ndarray | None = None
    model_torque: np.ndarray | None = None
    load: np.ndarray | None = None
    temperature: np.ndarray | None = None
    wrench: np.ndarray | None = None
    drive: Drive | None = None
    plan: Any = None
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()
    coupling: tuple[tuple[float, ...], ...] | None = None

    def __post_init__(self):
        time = read_only(self.time, "time")
        if time.ndim != 1:
            raise InvalidInput(f"Log.time has shape {time.shape}.", remedy="Give one instant a sample, (n,).")
        object.__setattr__(self, "time", time)
        self._refuse_beyond("time", time)
        joints = () if self.joints is None else as_joints(self.joints)  # pyright: ignore[reportUnnecessaryComparison]
        if not joints:
            raise InvalidInput("A Log needs at least one joint.", remedy="Pass joints=(Joint(name=...),).")
        object.__setattr__(self, "joints", joints)
        names = [joint.name for joint in self.joints]
        if len(set(names)) != len(names):
            raise InvalidInput(f"Joint names repeat: {names}.", remedy="Name every joint differently.")
        for name in (*CHANNELS, "wrench"):
            width, of = (WRENCH, "numbers") if name == "wrench" else (len(names), "joints")
            value = getattr(self, name)
            if value is None:
                continue
            value = read_only(value, name)
            if value.ndim == 1:
                value = value[:, None]
            if value.shape != (time.size, width):
                raise InvalidInput(
                    f"Log.{name} has shape {value.shape}, but there are {time.size} instants and {width} {of}.",
                    remedy="Give every channel one row an instant and one column a joint, a wrench six.",
                )
            object.__setattr__(self, name, value)
            self._refuse_beyond(name, value)
        if self.coupling is not None:
            matrix = check_coupling(self.coupling, len(names))
            object.__setattr__(self, "coupling", tuple(tuple(row) for row in matrix.tolist()))
        if self.position is None and self.velocity is None:
            raise InvalidInput(
                "A Log needs position or velocity, and has neither.",
                remedy="Name the channel, for example --map q=COLUMN.",
            )

    def _refuse_beyond(self, channel: str, values: np.ndarray) -> None:
        if not values.size or (values.max() <= LARGEST and values.min() >= -LARGEST):
            return
        beyond = np.argwhere((np.abs(values) > LARGEST) & np.isfinite(values))
        if len(beyond):
            place: tuple[int, ...] = tuple(beyond[0].tolist())
            where = f"{self.sources[0].path}: " if self.sources else ""
            of = "" if channel in ("time", "wrench") else f" of joint '{self.joints[place[1]].name}'"
            raise InvalidInput(
                f"{where}the {channel}{of} is {values[place]:g} at sample {place[0]}, beyond the largest valid number "
                f"({LARGEST:g}).",
                remedy="Mark missing samples as NaN, drop them, or correct the factor of --map.",
            )

    @classmethod
    def from_arrays(
        cls,
        time: Any = None,
        *,
        rate: float | None = None,
        joints: str | Joint | Sequence[str | Joint] | None = None,
        unit: str | Sequence[str] = "rad",
        **channels: Any,
    ) -> Log:
        """Return a log of arrays: `Log.from_arrays(rate=1000, position=q, torque=tau)`.

        Args:
            time: sampling instants [s], (n,); None: by `rate`.
            rate: samples a second [Hz].
            joints: names; None: joint_1, joint_2, ...
            unit: `rad`, `m`, or `deg` (positions and velocities are then converted), for all joints or one each.
            channels: `position`, `torque` and the other channels of a log, (n,) or (n, J).

        Raises:
            UnknownName: there is no such channel; the message lists those that there are.
            InvalidInput: an array is no array of numbers, shapes do not fit, or the time is not given.
        """
        from backdrive.logs.tables import log_of_arrays

        return log_of_arrays(time, rate=rate, joints=joints, unit=unit, channels=channels)

    @classmethod
    def from_frame(cls, frame: Any, **options: Any) -> Log:
        """Return a log of a data frame; its columns are recognized by their names, as those of a file are.

        Args:
            frame: of pandas, polars or pyarrow, or a mapping from names to arrays; units may stand in the names (`q [deg]`).
            options: `map`, `names`, `units`, `gear`, `counts`, ..., as `read_log` takes them.

        Raises:
            MappingError: columns are not recognized by their names; the message lists them.
            InvalidInput: it is no table, or an option does not fit.
        """
        from backdrive.logs.tables import log_of_frame

        return log_of_frame(frame, **options)

    def __repr__(self) -> str:
        return f"<Log of {', '.join(self.names)}: {len(self)} samples, {self.duration:.4g} s; {', '.join(self.channels)}>"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values that describe the log: joints, clock, range of every channel, sources and notes; not the samples."""
        return upper("logs.description", "describe")(self)

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.time.size

    @property
    def names(self) -> tuple[str, ...]:
        """Joint names, in column order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def channels(self) -> dict[str, np.ndarray]:
        """The channels that are present, by name, each (n, J)."""
        return {name: getattr(self, name) for name in CHANNELS if getattr(self, name) is not None}

    @cached_property
    def period(self) -> float:
        """Median sampling interval [s]; NaN with fewer than two samples.

        Raises:
            InvalidInput: it is above zero and below a picosecond.
        """
        return check_period(median(np.diff(self.time))) if len(self) > 1 else float("nan")

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.time[-1] - self.time[0]) if len(self) else 0.0

    def column(self, joint: str | int) -> int:
        """Return the column of a joint given by name or index.

        Raises:
            UnknownName: no such joint; the message lists the names.
        """
        from backdrive._catalog import lookup

        if isinstance(joint, (int, np.integer)):
            joint = str(joint) if str(joint) in self.names else self._name_at(int(joint))
        return lookup(joint, {name: i for i, name in enumerate(self.names)}, "joint of this log")

    def _name_at(self, index: int) -> str:
        if not -len(self.names) <= index < len(self.names):
            raise InvalidInput(
                f"There is no joint {index}: the log has {len(self.names)}.", remedy=f"Names: {self.names}."
            )
        return self.names[index]

    def need(self, channel: str) -> np.ndarray:
        """Return a channel that must be there, (n, J).

        Raises:
            InvalidInput: it is absent; the message says how to name it.
        """
        value = getattr(self, channel)
        if value is None:
            short = {"position": "q", "velocity": "dq", "torque": "tau"}.get(channel, channel)
            where = f"{self.sources[0].path}: the log" if self.sources else "The log"
            said = [note for note in self.notes if note.startswith(f"No column was taken as {channel}")]
            raise InvalidInput(
                f"{where} holds no {channel}, and friction cannot be identified without it.",
                remedy=said[0] if said else f"Name the channel, for example --map {short}=COLUMN.",
            )
        return value

    @property
    def driving_torque(self) -> np.ndarray:
        """Driving torque of the joints: actuator torque plus external torque, if that is known [N.m or N], (n, J).

        Raises:
            InvalidInput: the log holds no torque.
        """
        torque = self.need("torque")
        return torque if self.external_torque is None else torque + self.external_torque

    def replace(self, **changes: Any) -> Log:
        """Return a copy with some fields changed."""
        return replace(self, **changes)

    def with_note(self, sentence: str) -> Log:
        """Return a copy with `sentence` added to its notes."""
        return replace(self, notes=(*self.notes, sentence))

    def select(self, joints: str | int | Sequence[str | int]) -> Log:
        """Return the log of some joints only, in the order given; a wrench on the whole robot is left out unless all are.

        Raises:
            UnknownName: a joint is not in the log.
        """
        wanted = [joints] if isinstance(joints, (str, int)) else list(joints)
        columns = [self.column(j) for j in wanted]
        if columns == list(range(len(self.joints))):
            return self
        arrays = {name: value[:, columns] for name, value in self.channels.items()}
        every = sorted(columns) == list(range(len(self.joints)))
        coupling = tuple(self.coupling[c] for c in columns) if every and self.coupling else None
        chosen, wrench = tuple(self.joints[c] for c in columns), self.wrench if every else None
        return replace(self, joints=chosen, coupling=coupling, wrench=wrench, **arrays)

    def rows(self, index: slice | np.ndarray) -> Log:
        """Return the samples at a slice, mask or index array."""
        if isinstance(index, slice) and range(len(self))[index] == range(len(self)):
            return self
        names = ["time", *self.channels, *([] if self.wrench is None else ["wrench"])]
        return replace(self, **{name: getattr(self, name)[index] for name in names})

    def between(self, start: float = -np.inf, stop: float = np.inf) -> Log:
        """Return the samples with start <= time < stop [s]."""
        return self.rows((self.time >= start) & (self.time < stop))

    def apply_coupling(
        self, coupling: Sequence[Sequence[float]], side: Literal["motor", "joint"] = "motor"
    ) -> Log:
        """Return the log of joints that coupled motors drive: motion by C, torque by its inverse transpose.

        Power is the same on both sides, so q_joint = C q_motor means tau_motor = C^T tau_joint.

        Args:
            coupling: C, a row a joint and a column a motor, (J, J).
            side: side that the channels refer to. Channels of the joint side are not converted; C is recorded, since friction
                acts at the motors.

        Raises:
            InvalidInput: it is no invertible matrix of the joints, or the log is coupled already.
        """
        matrix = check_coupling(coupling, len(self.joints))
        if self.coupling is not None:
            raise InvalidInput(
                "The log was brought from coupled motors to its joints already.", remedy="Do it once."
            )
        rows = tuple(tuple(row) for row in matrix.tolist())
        if side == "joint":
            return replace(self, coupling=rows)
        moves = {
            c: self.channels[c] @ matrix.T
            for c in ("position", "velocity", "reference")
            if c in self.channels
        }
        torque = {} if self.torque is None else {"torque": np.linalg.solve(matrix.T, self.torque.T).T}
        return replace(self, coupling=rows, **moves, **torque).with_note(
            f"Brought from coupled motors to the joints: {', '.join([*moves, *torque])}."
        )

    def on_joint_side(self) -> Log:
        """Return the log with motor-side torques multiplied by their gear ratios."""
        if self.torque is None or all(j.torque_side == "joint" for j in self.joints):
            return self
        ratio = np.array([j.gear_ratio if j.torque_side == "motor" else 1.0 for j in self.joints])
        joints = tuple(replace(j, torque_side="joint") for j in self.joints)
        return replace(self, joints=joints, torque=self.torque * ratio).with_note(
            "Motor-side torque was multiplied by the gear ratio."
        )


def channel_unit(channel: str, joint: Joint) -> str:
    """Return the SI unit of a channel for this joint."""
    rotary, linear = CHANNELS[channel]
    return rotary if joint.unit == "rad" else linear


assert set(CHANNELS) <= set(Log.__dataclass_fields__)
