"""A joint with its drive: the drive of a log, gap-free stretches of motion and input, and their division for a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np

from backdrive._catalog import lookup
from backdrive.engine import DriveModel, drives
from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.choice import windows
from backdrive.identification.dynamic.motion_log import MotionLog
from backdrive.identification.dynamic.stretch import Stretch, stretch
from backdrive.identification.options import Options
from backdrive.identification.signals import Signals, prepare
from backdrive.logs.log import Drive, Joint, Log

LOOSE = 2.0  # longest window if no controller tracks the motion [s]
FEWEST = 9  # least number of windows if no controller tracks the motion

#: Law of a log's drive -> its controller, and whether a motor lies between input and torque.
LAWS: dict[str, tuple[Literal["open", "position", "velocity"], bool]] = {
    "torque": ("open", False),
    "position": ("position", False),
    "velocity": ("velocity", False),
    "voltage": ("open", True),
    "duty": ("open", True),
}
MOTOR = ("torque_constant", "resistance")
GAINS = {f.name: f for f in fields(DriveModel) if f.name not in ("controller", "actuator", "hold")}


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveStretch:
    """One gap-free stretch of a joint under its drive.

    Attributes:
        signals: the motion, with the drive's input in place of a torque.
        log: the same stretch for a fit of motion, with the proportional gain of its own log.
    """

    signals: Signals
    log: MotionLog

    def stretch(self, drive: DriveModel) -> Stretch:
        """Return the stretch with the torque that a given drive would produce along the motion."""
        own = drive.replace(
            proportional=drive.proportional if self.log.proportional is None else self.log.proportional
        )
        tau = np.empty(len(self.signals.velocity))
        drives.along(
            own.row(),
            np.zeros(drives.STATES),
            self.log.drive_input,
            np.array([np.nan]),
            self.log.position,
            self.signals.velocity,
            self.log.dt,
            tau,
        )
        return stretch(replace(self.signals, torque=tau), temperature=self.log.temperature)


def drive_stretches(log: Log, name: str, template: DriveModel, options: Options) -> list[DriveStretch]:
    """Return the stretches of one joint with the drive's input.

    Args:
        log: with position and the drive's input, or the reference of a position controller.
        name: of the joint.
        template: drive of the first log; other logs may have another proportional gain.
        options: options of the user, here the drive and the low pass.
    """
    own = log.select(name)
    joint = own.joints[0]
    bare = Log(
        time=own.time,
        joints=(Joint(name=joint.name, unit=joint.unit, encoder_counts=joint.encoder_counts),),
        position=own.need("position"),
        torque=input_of(own, template),
    )
    drive = (
        template if options.drive is not None else with_gains(log, template, drive_unknowns(options.bounds))
    )
    found = []
    for signals in prepare(bare, 0, cutoff=options.cutoff):
        temperature = None
        if own.temperature is not None:
            temperature = np.interp(signals.time, own.time, own.temperature[:, 0])
        assert signals.position is not None
        one = MotionLog(
            position=signals.position,
            velocity=signals.velocity,
            drive_input=signals.torque,
            dt=1.0 / signals.rate,
            proportional=drive.proportional if drive.controller != "open" and options.drive is None else None,
            temperature=temperature,
            name=log.sources[0].path if log.sources else "log",
        )
        found.append(DriveStretch(signals=signals, log=one))
    return found


def input_of(log: Log, drive: DriveModel) -> np.ndarray:
    """Return the input of a log's drive, (n, J). For a position controller without a logged input, it is the reference.

    Raises:
        InvalidInput: the log holds no input.
    """
    if log.drive_input is None and log.reference is not None and drive.controller == "position":
        return log.reference
    return log.need("drive_input")


def whole(parts: Sequence[DriveStretch], held: bool) -> list[MotionLog]:
    """Return all stretches as motion logs, each of which a fit simulates from its first to its last sample.

    Args:
        parts: stretches.
        held: a controller tracks the motion, so that a whole stretch can be simulated. Without a controller, force errors
            accumulate, so stretches are cut into windows that start from the measured motion.
    """
    if held:
        return [p.log for p in parts]
    return [w for p in parts for w in p.log.windows(_loose(parts))]


def split(parts: Sequence[DriveStretch], held: bool) -> tuple[list[MotionLog], list[MotionLog]]:
    """Return the fitted logs and the held-out ones: every third window of time is held out."""
    logs = whole(parts, held)
    if not held:
        return [w for i, w in enumerate(logs) if i % 3 != 1], logs[1::3]
    masks = windows([len(log.position) for log in logs])
    return (
        [replace(log, judged=~mask) for log, mask in zip(logs, masks, strict=True)],
        [replace(log, judged=mask) for log, mask in zip(logs, masks, strict=True)],
    )


def held_out_masks(parts: Sequence[DriveStretch], held: bool) -> list[np.ndarray]:
    """Return a mask of the samples that `split` holds out, for each stretch, (n,)."""
    if held:
        return windows([len(p.log.position) for p in parts])
    masks, index = [], 0
    length = _loose(parts)
    for p in parts:
        mask, place = np.zeros(len(p.log.position), dtype=bool), 0
        for w in p.log.windows(length):
            mask[place : place + len(w.position)] = index % 3 == 1
            place, index = place + len(w.position), index + 1
        masks.append(mask)
    return masks


def _loose(parts: Sequence[DriveStretch]) -> float:
    return min(LOOSE, sum(len(p.log.position) * p.log.dt for p in parts) / FEWEST)


def drive_unknowns(bounds: Mapping[str, object] | None) -> tuple[str, ...]:
    """Return the parameters of the drive that have bounds and are therefore estimated."""
    return tuple(n[6:] for n in bounds or {} if n.startswith("drive."))


def model_of(drive: Drive, sought: tuple[str, ...] = ()) -> DriveModel:
    """Return the engine's model of a log's drive.

    A motor lies between controller and torque if the input is a voltage or a duty cycle, or if `torque_constant` is among the
    gains. A duty cycle also needs the `supply` voltage.

    Args:
        drive: law and gains by the names of `DriveModel`.
        sought: names of parameters that a fit estimates, so that no value is needed.

    Raises:
        InvalidInput: a parameter of the motor or the proportional gain is missing.
        UnknownName: a drive has no such gain, or the law is unknown.
    """
    lookup(drive.law, LAWS, "law of a drive")
    controller, motor = LAWS[drive.law]
    gains = dict(drive.gains)
    for name in gains:
        lookup(name, GAINS, "number of a drive")
    motor = motor or "torque_constant" in gains or "torque_constant" in sought
    if motor:
        needed = (*MOTOR, "supply") if drive.law == "duty" else MOTOR
        if lacking := [n for n in needed if n not in gains and n not in sought]:
            raise InvalidInput(
                f"The drive takes a {drive.law}, and these of its numbers are not known: {', '.join(lacking)}.",
                remedy="Give them, --drive "
                + drive.law
                + "".join(f",{n}=..." for n in lacking)
                + f", or a range in which to search: --bound drive.{lacking[0]}=LOW:HIGH.",
            )
    if controller != "open" and "proportional" not in gains and "proportional" not in sought:
        raise InvalidInput(
            f"The drive takes a {drive.law}, and its gain 'proportional' is not known.",
            remedy=f"Give it, --drive {drive.law},proportional=..., in SI units.",
        )
    return DriveModel(controller=controller, actuator="motor" if motor else "torque").replace(**gains)


def drive_of(log: Log, sought: tuple[str, ...] = ()) -> DriveModel:
    """Return the drive of a log, with those of its gains that the engine knows.

    Raises:
        InvalidInput: the log does not name its drive, or lacks a gain.
    """
    if log.drive is None:
        raise InvalidInput(
            "The log does not name the law of its drive.",
            remedy="Name the drive: --drive torque, or position,proportional=2000,derivative=60 (in Python: drive=Drive(...)).",
        )
    known = {n: v for n, v in log.drive.gains.items() if n in GAINS}
    return model_of(Drive(law=log.drive.law, gains=known), sought)


def with_gains(log: Log, template: DriveModel, sought: tuple[str, ...] = ()) -> DriveModel:
    """Return a log's own drive, which may differ from that of the first log only in its proportional gain.

    Raises:
        InvalidInput: it differs in another parameter.
    """
    own = drive_of(log, sought)
    if own.replace(proportional=template.proportional) != template:
        raise InvalidInput(
            f"The logs have different drives: {template} and {own}.",
            remedy="Fit them one by one; only the proportional gain may differ from log to log.",
        )
    return own
