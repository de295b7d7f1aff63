"""The result of `estimate_force`: the external torque on each joint over time, with its band, contacts, and a table."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive._files import write_whole
from backdrive._upper import Display, check_page, upper
from backdrive.errors import InvalidInput, UnknownName, require
from backdrive.logs.log import Joint

if TYPE_CHECKING:
    from backdrive.external.calibrate import Calibration
    from backdrive.external.wrench import WrenchEstimate

STATES = ("moving", "reversing", "rest")


@dataclass(frozen=True, kw_only=True, eq=False)
class JointForce:
    """The external torque on one joint.

    Attributes:
        joint: whose it is.
        time: [s], (n,).
        force: external torque, positive along +q [N.m or N], (n,).
        friction: that was subtracted [N.m or N], (n,).
        lower: lower end of the 95 % band [N.m or N], (n,); NaN if unknown.
        upper: upper end, (n,).
        state: 0 moving, 1 reversing, 2 at rest, (n,).
        method: of the estimator.
        bandwidth: L [1/s].
        lag: lag of the estimator on a ramp, which was removed from `force` [s]; NaN if it is unknown and was not removed.
        known: external torque that the log holds [N.m or N], (n,); None where it holds none.
        contact: True where the estimate is beyond its threshold, (n,); None where contacts were not sought.
        speed: of the joint [rad/s or m/s], (n,); None where it is not known.
        abrupt: part of half the band where the force changes faster than the estimator follows [N.m or N], (n,); None: none.
    """

    joint: Joint
    time: np.ndarray
    force: np.ndarray
    friction: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    state: np.ndarray
    method: str
    bandwidth: float
    lag: float
    known: np.ndarray | None = None
    contact: np.ndarray | None = None
    speed: np.ndarray | None = None
    abrupt: np.ndarray | None = None

    @property
    def rms_error(self) -> float | None:
        """Root mean square of the error against the known torque [N.m or N]; None without one."""
        return None if self.known is None else float(np.sqrt(np.nanmean((self.force - self.known) ** 2)))

    @property
    def outside(self) -> np.ndarray:
        """True where zero lies outside the band: something acts on the joint, (n,)."""
        return (self.lower > 0.0) | (self.upper < 0.0)

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of a table, by name."""
        name, unit = self.joint.name, self.joint.torque_unit
        series = {"force": self.force, "lower": self.lower, "upper": self.upper, "friction": self.friction}
        table = {f"{name}_{what} [{unit}]": x for what, x in series.items()}
        table |= {f"{name}_state": self.state}
        return table if self.contact is None else table | {f"{name}_contact": self.contact.astype(np.int8)}


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """The threshold of a contact, in bands, for one joint in one state of motion.

    Attributes:
        joint: name.
        state: `moving`, `reversing` or `rest`.
        bands: the threshold by half the band; at rest by the friction's interval [-]. It has the expected rate of false
            contacts, averaged over all tails that the peaks leave possible: with few peaks it lies above `interval`.
        interval: 90 % interval of the level that free motion exceeds at that rate [-].
        peaks: peaks of free motion in the fitted tail; 0 if the threshold is that of another state.
        highest: of them [bands].
        hours: of free motion in this state.
        extrapolation: expected time per false contact, divided by the length of the free motion [-]; 1 if the free motion is
            longer.
    """

    joint: str
    state: str
    bands: float
    interval: tuple[float, float]
    peaks: int
    highest: float
    hours: float
    extrapolation: float


@dataclass(frozen=True, kw_only=True)
class Contact:
    """A contact.

    Attributes:
        begin: first instant beyond a threshold [s].
        end: last one [s].
        forces: by joint, the largest external torque, with its sign [N.m or N].
    """

    begin: float
    end: float
    forces: Mapping[str, float]

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that are beyond their thresholds."""
        return tuple(self.forces)


@dataclass(frozen=True, kw_only=True)
class ForceEstimate(Display):
    """The external torque on the joints of a log.

    Attributes:
        joints: one a joint, on one clock.
        remarks: what a reader should know, in sentences.
        calibrations: calibration of the bands by free motion, by joint; empty without free motion.
        contacts: in order of time; None where they were not sought.
        thresholds: of contacts, by joint and state.
        false_alarms: rate of false contacts of the thresholds, over all joints [1/h].
        wrench: at a frame of a whole arm; None where none was asked for.
    """

    joints: tuple[JointForce, ...]
    remarks: tuple[str, ...] = ()
    calibrations: Mapping[str, Calibration] = field(default_factory=dict)
    contacts: tuple[Contact, ...] | None = None
    thresholds: tuple[Threshold, ...] = ()
    false_alarms: float | None = None
    wrench: WrenchEstimate | None = None

    def joint(self, name: str) -> JointForce:
        """Return a joint by its name.

        Raises:
            UnknownName: there is none of this name.
        """
        for one in self.joints:
            if one.joint.name == name:
                return one
        raise UnknownName(
            f"No joint '{name}'.", remedy=f"One of {', '.join(j.joint.name for j in self.joints)}."
        )

    def report(self, path: str | Path, *, command: str = "", title: str | None = None) -> Path:
        """Write the report: one HTML file with the forces, their bands, contacts and the wrench.

        Args:
            path: of the file.
            command: that made it, to be copied.
            title: of the report; None: it names the joint or the number of joints.

        Raises:
            InvalidInput: `path` names no file, or one that is no HTML page.
            MissingExtra: matplotlib is not installed.
            WriteError: the file cannot be written.
        """
        check_page(path)
        command = command or "estimate_force(...)  # in Python"
        return upper("report.force", "write_force_report")(self, path, command=command, title=title)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as `backdrive estimate --json` prints them; `save` writes the series."""
        return upper("external.figures", "figures")(self)

    def save(self, path: str | Path) -> None:
        """Write a table, whole or not at all.

        Args:
            path: ends in .csv or .parquet.

        Raises:
            InvalidInput: another ending.
            MissingExtra: Parquet without pyarrow.
            WriteError: the file cannot be written.
        """
        clock = self.joints[0].time
        table = {"time [s]": clock}
        for one in self.joints:  # a joint whose readings have gaps of their own takes the nearest instants
            at = (
                np.abs(np.subtract.outer(clock, one.time)).argmin(axis=1)
                if one.time.size != clock.size
                else slice(None)
            )
            table |= {name: column[at] for name, column in one.columns().items()}
        if self.wrench is not None:
            table |= self.wrench.columns()
        if str(path).endswith(".parquet"):
            arrow = require("pyarrow", "Writing Parquet needs", "table")
            parquet = require("pyarrow.parquet", "Writing Parquet needs", "table")
            buffer = io.BytesIO()
            parquet.write_table(arrow.table(table), buffer)
            write_whole(path, buffer.getvalue())
        elif str(path).endswith(".csv"):
            text = io.StringIO()
            text.write(",".join(table) + "\n")
            np.savetxt(text, np.column_stack(list(table.values())), fmt="%.9g", delimiter=",")
            write_whole(path, text.getvalue())
        else:
            raise InvalidInput(
                f"{path}: a table is CSV or Parquet.", remedy="Let its name end in .csv or .parquet."
            )
