"""A joint under its drive: gap-free stretches of motion and the drive's input, and how they are cut for a fit and its judgement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from backdrive.engine import DriveModel, drives
from backdrive.identification.dynamic.choice import windows
from backdrive.identification.dynamic.drive_of_log import sought_of, with_gains
from backdrive.identification.dynamic.motion_log import MotionLog
from backdrive.identification.dynamic.torque import Stretch, stretch
from backdrive.identification.options import Options
from backdrive.logs.log import Joint, Log

if TYPE_CHECKING:
    from backdrive.identification.signals import Signals

LOOSE = 2.0  # length of a window where no controller holds the motion [s]
FEWEST = 9  # windows


@dataclass(frozen=True, kw_only=True, eq=False)
class Driven:
    """One gap-free stretch of a joint under its drive.

    Attributes:
        signals: the motion, with the drive's input in place of a torque.
        log: the same for a fit of motion, with the gain of its own log.
    """

    signals: Signals
    log: MotionLog

    def stretch(self, drive: DriveModel) -> Stretch:
        """Return the stretch with the torque that a drive with these numbers gives along the motion."""
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


def driven(log: Log, name: str, template: DriveModel, options: Options) -> list[Driven]:
    """Return the stretches of one joint with the drive's input.

    Args:
        log: with position and the drive's input.
        name: of the joint.
        template: drive of the first log, which others may differ from in the proportional gain.
        options: for the drive, if a person named it, and the low pass.
    """
    from backdrive.identification.signals import prepare

    own = log.select(name)
    joint = own.joints[0]
    bare = Log(
        time=own.time,
        joints=(Joint(name=joint.name, unit=joint.unit, encoder_counts=joint.encoder_counts),),
        position=own.need("position"),
        torque=own.need("drive_input"),
    )
    drive = template if options.drive is not None else with_gains(log, template, sought_of(options.bounds))
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
        found.append(Driven(signals=signals, log=one))
    return found


def whole(parts: Sequence[Driven], held: bool) -> list[MotionLog]:
    """Return everything as a fit runs it.

    Args:
        parts: stretches.
        held: a controller holds the motion, so that a stretch can run from its first sample to its last. Without one, errors
            of force add up, and every window starts anew from the measured motion.
    """
    if held:
        return [p.log for p in parts]
    return [w for p in parts for w in p.log.windows(_loose(parts))]


def split(parts: Sequence[Driven], held: bool) -> tuple[list[MotionLog], list[MotionLog]]:
    """Return what is fitted and what is judged on: two of three windows of time, and every third."""
    logs = whole(parts, held)
    if not held:
        return [w for i, w in enumerate(logs) if i % 3 != 1], logs[1::3]
    masks = windows([len(log.position) for log in logs])
    return (
        [replace(log, judged=~mask) for log, mask in zip(logs, masks)],
        [replace(log, judged=mask) for log, mask in zip(logs, masks)],
    )


def held_out_masks(parts: Sequence[Driven], held: bool) -> list[np.ndarray]:
    """Return for every stretch the samples that `split` holds out, (n,) each."""
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


def _loose(parts: Sequence[Driven]) -> float:
    return min(LOOSE, sum(len(p.log.position) * p.log.dt for p in parts) / FEWEST)
