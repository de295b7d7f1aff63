"""The drive of a log: from its law and gains, as recorded or as a person names them, to the drive of the engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Literal

from backdrive._catalog import lookup
from backdrive.engine import DriveModel
from backdrive.errors import InvalidInput
from backdrive.logs.log import Drive, Log

#: Law of a log's drive -> what its input is, and whether there is a motor between that and the torque.
LAWS: dict[str, tuple[Literal["open", "position", "velocity"], bool]] = {
    "torque": ("open", False),
    "position": ("position", False),
    "velocity": ("velocity", False),
    "voltage": ("open", True),
    "duty": ("open", True),
}
MOTOR = ("torque_constant", "resistance")
GAINS = {f.name: f for f in fields(DriveModel) if f.name not in ("controller", "actuator", "hold")}


def sought_of(bounds: Mapping[str, object] | None) -> tuple[str, ...]:
    """Return the numbers of the drive among what is bounded, and so sought."""
    return tuple(n[6:] for n in bounds or {} if n.startswith("drive."))


def model_of(drive: Drive, sought: tuple[str, ...] = ()) -> DriveModel:
    """Return the drive of the engine.

    A motor is between the controller and the torque where the input is a voltage or a duty, or where `torque_constant` is
    among the gains. A duty needs the `supply` voltage too.

    Args:
        drive: law and gains by the names of `DriveModel`.
        sought: names of its numbers that a fit seeks, which need not be given.

    Raises:
        InvalidInput: the motor's numbers are not known.
        UnknownName: a drive has no such gain.
    """
    lookup(drive.law, LAWS, "law of a drive")
    controller, motor = LAWS[drive.law]
    gains = dict(drive.gains)
    for name in gains:
        lookup(name, GAINS, "number of a drive")
    motor = motor or "torque_constant" in gains or "torque_constant" in sought
    if motor:
        needed = (*MOTOR, *(("supply",) if drive.law == "duty" else ()))
        if lacking := [n for n in needed if n not in gains and n not in sought]:
            raise InvalidInput(
                f"The drive takes a {drive.law}, and its {' and '.join(lacking)} are not known.",
                remedy="Give them, --drive "
                + drive.law
                + "".join(f",{n}=..." for n in lacking)
                + f", or have them sought: --bound drive.{lacking[0]}=LOW:HIGH.",
            )
    needed_gain = {"position": "proportional", "velocity": "proportional"}.get(controller)
    if needed_gain and needed_gain not in gains and needed_gain not in sought:
        raise InvalidInput(
            f"The drive takes a {drive.law}, and its gain '{needed_gain}' is not known.",
            remedy=f"Give it, --drive {drive.law},{needed_gain}=..., in SI units.",
        )
    return DriveModel(controller=controller, actuator="motor" if motor else "torque").replace(**gains)


def drive_of(log: Log, sought: tuple[str, ...] = ()) -> DriveModel:
    """Return the drive that a log was recorded with; of its gains those that the engine knows.

    Raises:
        InvalidInput: the log does not say.
    """
    if log.drive is None:
        raise InvalidInput(
            "The log does not say what its drive's input does.",
            remedy="Name the drive: --drive torque, or position,proportional=2000,derivative=60 (in Python: drive=Drive(...)).",
        )
    known = {n: v for n, v in log.drive.gains.items() if n in GAINS}
    return model_of(Drive(law=log.drive.law, gains=known), sought)


def with_gains(log: Log, template: DriveModel, sought: tuple[str, ...] = ()) -> DriveModel:
    """Return a log's own drive, which may differ from the first one's in its proportional gain alone.

    Raises:
        InvalidInput: it differs in something else.
    """
    own = drive_of(log, sought)
    if own.replace(proportional=template.proportional) != template:
        raise InvalidInput(
            f"The logs have different drives: {template} and {own}.",
            remedy="Fit them one by one; only the proportional gain may differ from log to log.",
        )
    return own
