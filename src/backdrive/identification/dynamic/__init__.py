"""Fit of any friction law, presliding included, to torque given motion, or to motion given the drive's input."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from backdrive._catalog import lookup
from backdrive.engine import DriveModel
from backdrive.errors import BackdriveError, InvalidInput, NotIdentifiable
from backdrive.identification.auto import in_motion
from backdrive.identification.dynamic import stopping
from backdrive.identification.dynamic.choice import Candidate as Candidate
from backdrive.identification.dynamic.choice import Choice as Choice
from backdrive.identification.dynamic.choice import shortlist
from backdrive.identification.dynamic.directions import symmetric_shape
from backdrive.identification.dynamic.drive_stretch import drive_unknowns, model_of
from backdrive.identification.dynamic.fit import Fit as Fit
from backdrive.identification.dynamic.joint_fit import JointFit, fit_joint
from backdrive.identification.dynamic.law_fit import LawFit as LawFit
from backdrive.identification.dynamic.law_fit import fit_law as fit_law
from backdrive.identification.dynamic.motion import MotionFit as MotionFit
from backdrive.identification.dynamic.motion import fit_motion as fit_motion
from backdrive.identification.dynamic.motion_log import MotionLog as MotionLog
from backdrive.identification.dynamic.motion_task import MotionTask
from backdrive.identification.dynamic.progress import part_of
from backdrive.identification.dynamic.search import LOSSES
from backdrive.identification.dynamic.torque_task import TorqueTask
from backdrive.identification.dynamic.uncertainty import check_interval
from backdrive.identification.dynamic.unknowns import LawShape, user_range
from backdrive.identification.log_set import moments_without_drive
from backdrive.identification.options import Options
from backdrive.logs.log import Drive, Log

POSITIVE = ("inertia", "stiffness")
NOT_NEGATIVE = ("load_inertia", "damping", "load_dependence")


def is_driven(logs: Sequence[Log], options: Options) -> bool:
    """Return whether motion is fitted given the drive's input, rather than torque given motion."""
    return options.drive is not None or any(
        log.torque is None and log.drive_input is not None for log in logs
    )


def check(options: Options) -> None:
    """Refuse contradictory numbers and unknown laws, before any long computation.

    Raises:
        InvalidInput: a number is invalid, two contradict each other, or a rate law and an element cannot be combined.
        UnknownName: no such law, loss or kind of interval.
    """
    lookup(options.loss, LOSSES, "loss")
    check_interval(options.interval, options.loss)
    if options.drive is not None and not isinstance(options.drive, (Drive, DriveModel)):
        raise InvalidInput(
            f"drive = {options.drive!r}.",
            remedy="Give Drive(law=..., gains={...}) of backdrive, or a DriveModel of backdrive.engine.",
        )
    for name, given in options.bounds.items():
        plain = name.partition("[")[0]
        if plain in options.known:
            raise InvalidInput(
                f"'{name}' is both known ({options.known[plain]:g}) and bounded.",
                remedy="Leave one of the two out: a bounded number is fitted.",
            )
        low, high = user_range(name, given[:2] if isinstance(given, (list, tuple)) else given)
        if not low < high:
            raise InvalidInput(
                f"The bounds {low:g} to {high:g} of '{name}' are no range.",
                remedy="Give a lower and a higher bound, in SI units.",
            )
    for name, value in options.known.items():
        number = isinstance(value, (int, float)) and math.isfinite(value)
        if not number or (name in POSITIVE and value <= 0.0) or (name in NOT_NEGATIVE and value < 0.0):
            raise InvalidInput(
                f"{name} = {value!r} is taken as known.", remedy="Give a finite SI value in its range."
            )
    if options.law not in (None, "auto"):
        for name in shortlist(options.law, presliding=True, load=True, warm=True):
            shape = LawShape.from_name(name)
            if options.symmetric:
                symmetric_shape(shape)


def fit_joints(
    logs: Sequence[Log], held_out: Sequence[Log], names: Sequence[str], options: Options, warnings: list[str]
) -> tuple[list[JointFit], bool]:
    """Return the fit of every joint for which one exists, and whether a person interrupted the search.

    Args:
        logs: logs to fit.
        held_out: logs to judge on; without any, windows of the fitted logs are held out.
        names: of the joints.
        options: options of the user.
        warnings: list to which warnings on the whole result are added.

    Raises:
        NotIdentifiable: no joint's friction can be fitted.
    """
    if isinstance(options.drive, Drive):
        options = replace(options, drive=model_of(options.drive, drive_unknowns(options.bounds)))
    options = replace(options, law=options.law or "auto")
    task = TorqueTask
    if is_driven(logs, options):
        task = MotionTask
        warnings += moments_without_drive(logs)
    fits: list[JointFit] = []
    stopped = False
    with stopping.gently():
        for k, name in enumerate(names):
            try:
                stopping.check()
                own = replace(options, progress=part_of(options.say, k, len(names)))
                fits.append(fit_joint(task(in_motion(logs, name), in_motion(held_out, name), name, own)))
            except BackdriveError as error:
                if len(names) == 1:
                    raise
                warnings.append(f"Joint '{name}' was left out: {error.message} {error.remedy}")
            except KeyboardInterrupt:
                if not fits:
                    raise
                stopped = True
            stopped = stopped or bool(fits and fits[-1].stopped)
            if stopped:
                break
        stopped = stopped or stopping.is_interrupt_pending()
    if stopped:
        done = [fit.choice.joint for fit in fits]
        left = [name for name in names if name not in done]
        rest = f" Without a result: {', '.join(left)}." if left else ""
        warnings.append(f"The fit was interrupted.{rest}")
    if not fits:
        raise NotIdentifiable(
            "No joint could be fitted. " + " ".join(warnings), remedy="Record a motion with reversals."
        )
    return fits, stopped
