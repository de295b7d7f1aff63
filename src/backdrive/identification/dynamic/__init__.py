"""Fits: any friction law from logs, with honest uncertainty and a choice between laws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from backdrive._blas import on_one_thread
from backdrive.errors import BackdriveError, InvalidInput, NotIdentifiable
from backdrive.identification.dynamic.choice import Candidate as Candidate
from backdrive.identification.dynamic.choice import Choice as Choice
from backdrive.identification.dynamic.intervals import Method
from backdrive.identification.dynamic.law_fit import LawFit as LawFit
from backdrive.identification.dynamic.law_fit import fit_law as fit_law
from backdrive.identification.dynamic.motion import MotionFit as MotionFit
from backdrive.identification.dynamic.motion import fit_motion as fit_motion
from backdrive.identification.dynamic.motion_log import MotionLog as MotionLog
from backdrive.identification.result import Identification
from backdrive.logs.log import Drive, Log

if TYPE_CHECKING:
    from backdrive.engine import DriveModel


@dataclass(frozen=True, kw_only=True, eq=False)
class FitResult(Identification):
    """The outcome of `fit`: an identification, and the laws that were tried.

    Attributes:
        choices: one a joint, in the model's order.
        intervals: 95 % intervals of every number that was sought, by joint and name [SI].
        stopped: a person interrupted it; this is what had been found.
    """

    choices: tuple[Choice, ...] = ()
    intervals: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    stopped: bool = False

    def choice(self, joint: str | int = 0) -> Choice:
        """Return the choice of one joint, by name or position."""
        name = self.model.joint(joint).joint.name
        return next(c for c in self.choices if c.joint == name)


@on_one_thread
def fit(
    logs: Log | Sequence[Log],
    law: str | Sequence[str] = "auto",
    *,
    joints: Sequence[str] | None = None,
    held_out: Sequence[Log] = (),
    gravity: bool | None = None,
    delay: bool = True,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    cutoff: float | None = None,
    step: float | None = None,
    loss: str = "huber",
    interval: Method = "covariance",
    drive: DriveModel | Drive | None = None,
    known: Mapping[str, float] | None = None,
    accept: Sequence[str] = (),
    repair: bool = False,
    seed: int = 0,
    reading: Mapping[str, object] | None = None,
    progress: Callable[[str], None] | None = None,
) -> FitResult:
    """Fit friction laws to every joint that moves: from torque given motion, or from motion given the drive's input.

    Every law is fitted twice: without every third window of time, on which it is judged (or on `held_out` logs), and the
    chosen one again on everything. Inertia, a constant torque and, where asked for, gravity are sought along.

    Logs without torque are fitted through forward dynamics with the drive in the loop: the law is judged by the position that
    it predicts from the drive's input.

    Args:
        logs: one log, or several of the same joints, with position or velocity, and torque; or with position and the input
            of the drive (`drive_input`).
        law: `auto` for a shortlist that the data can support; `rate`, `rate+element`, or several with commas between.
        joints: names of the joints wanted; None: every joint that moves.
        held_out: logs to judge on; windows of the fitted ones where there are none.
        gravity: seek gravity as sin q and cos q; None: where the joint turns.
        delay: seek the time by which torque was recorded later than motion, or by which the drive's input acts late.
        bounds: of parameters, `inertia`, `offset`, `gravity_sin`, `gravity_cos` and `delay`, by name [SI]; given the drive's
            input of any number of the axis and its drive, which is sought then: `drive.resistance`, ... (see
            `fitting.motion_terms`).
        cutoff: low pass of the motion before differentiation [Hz]; None: a tenth of the sampling rate, at most 100, and
            lower where an encoder's steps would drown the acceleration (`fitting.smoothing`).
        step: longest integration step of a fit given the drive's input [s]; None: a part of the fastest time constant of the
            drive with the inertia, at most 1 ms.
        loss: `linear`, `huber` or `absolute`.
        interval: `covariance`, `profile` or `bootstrap`; see `fitting.intervals`.
        drive: fit from motion given this drive's input; None: as the logs say, where they hold no torque.
        known: what is not sought, by name [SI]: `inertia`, `offset`, `gravity_sin`, `gravity_cos`; given the drive's input any
            number of `engine.Axis`.
        accept: names of health findings to accept.
        repair: mend the log where an honest repair exists; each is noted.
        seed: of the starts.
        reading: how the logs were read, for the record.
        progress: called with a sentence before every step that may take long.

    An interruption (Ctrl-C) ends the fit with the best that it had found, once it has something; the result says so.

    Returns:
        The model, the evidence for every joint, and the table of laws with the reason for the choice.

    Raises:
        UnhealthyLog: a finding would spoil the result.
        NotIdentifiable: no joint's friction can be fitted; where some can, the others are named in the warnings.
        InvalidInput: an argument or a log does not fit.
        UnknownName: no such law or joint.
    """
    from backdrive import __version__
    from backdrive.identification.auto import moving_joints
    from backdrive.identification.dynamic import asked as asked_
    from backdrive.identification.dynamic import given_drive, given_motion, stopping
    from backdrive.identification.dynamic.choice import shortlist
    from backdrive.identification.dynamic.drive_of_log import model_of, sought_of
    from backdrive.identification.dynamic.request import JointFit, Request
    from backdrive.identification.dynamic.unknowns import LawShape
    from backdrive.identification.request import apart, healthy, in_order, slow_clock
    from backdrive.model import FrictionModel

    say = progress or (lambda sentence: None)
    logs = [logs] if isinstance(logs, Log) else list(logs) if isinstance(logs, Sequence) else [logs]
    if not logs or not all(isinstance(log, Log) for log in [*logs, *held_out]):
        raise InvalidInput(
            "There is no log to fit.", remedy="Pass at least one `Log`, as `read_log` gives it."
        )
    if not (isinstance(law, str) and law == "auto"):
        for name in shortlist(law, presliding=True, load=True, warm=True):
            LawShape.named(name)
    asked_.refuse_nonsense(
        loss=loss,
        interval=interval,
        seed=seed,
        cutoff=cutoff,
        step=step,
        known=known or {},
        bounds=bounds or {},
        drive=drive,
    )
    logs = [in_order(log, logs[0]) for log in logs]
    held_out = [in_order(log, logs[0]) for log in held_out]
    apart(logs, held_out)
    say("Checking the logs")
    warnings: list[str] = []
    logs = [healthy(log, accept, repair, warnings) for log in logs]
    held_out = [healthy(log, accept, repair, warnings) for log in held_out]
    warnings += slow_clock(logs)
    driven = drive is not None or any(log.torque is None and log.drive_input is not None for log in logs)
    asked = Request(
        law=law,
        gravity=gravity,
        delay=delay,
        bounds=bounds,
        cutoff=cutoff,
        step=step,
        loss=loss,
        interval=interval,
        seed=seed,
        drive=model_of(drive, sought_of(bounds)) if isinstance(drive, Drive) else drive,
        known=known or {},
        say=say,
    )
    fit_joint = given_drive.fit_joint if driven else given_motion.fit_joint
    names, idle = moving_joints(logs, joints)
    warnings += [f"Joint '{name}' hardly moves and was left out." for name in idle]
    if driven:
        warnings += asked_.drive_off(logs)
    found: list[JointFit] = []
    stopped = False
    with stopping.gently():
        for name in names:
            try:
                stopping.check()
                found.append(fit_joint(logs, held_out, name, asked))
            except BackdriveError as error:
                if len(names) == 1:
                    raise
                warnings.append(f"Joint '{name}' was left out: {error.message} {error.remedy}")
            except KeyboardInterrupt:
                if not found:
                    raise
                stopped = True
            stopped = stopped or bool(found and found[-1].stopped)
            if stopped:
                break
        stopped = stopped or stopping.noted()
    left = [name for name in names if name not in [f.choice.joint for f in found]]
    if stopped:
        rest = f" Without a result: {', '.join(left)}." if left else ""
        warnings.append(f"The fit was interrupted.{rest}")
    if not found:
        raise NotIdentifiable(
            "No joint could be fitted. " + " ".join(warnings), remedy="Record a motion with reversals."
        )
    model = FrictionModel(
        joints=tuple(f.friction for f in found),
        sources=tuple(s for log in logs for s in log.sources),
        options=asked_.remembered(
            asked,
            joints={
                f.choice.joint: dict(f.settings)
                for f in found
                if any(v is not None for v in f.settings.values())
            },
            hold_out=[s.path for log in held_out for s in log.sources],
            accept=list(accept),
            repair=repair or None,
            reading=dict(reading or {}),
        ),
        version=__version__,
    )
    return FitResult(
        model=model,
        evidence=tuple(f.evidence for f in found),
        method="fit",
        reason="motion given the drive's input" if driven else "torque given motion",
        warnings=tuple(warnings),
        notes=(*(note for log in logs for note in log.notes), *(note for f in found for note in f.notes)),
        choices=tuple(f.choice for f in found),
        intervals={f.choice.joint: f.intervals for f in found},
        stopped=stopped,
    )
