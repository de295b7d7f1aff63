"""`identify`: from logs to a friction model with its evidence. The method follows from the logs, or from the requested law."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

from backdrive._arguments import as_table, guard_keywords
from backdrive._blas import on_one_thread
from backdrive._catalog import lookup
from backdrive._memory import with_free_memory
from backdrive.engine import DriveModel
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.alignment import Start
from backdrive.identification.auto import METHODS, choose_method, in_motion, moving_joints, own_turn, standing
from backdrive.identification.evidence import describe_fit
from backdrive.identification.log_set import (
    TOGETHER,
    apart,
    attach_plan,
    coupling_of,
    external_torque_notes,
    in_order,
    move_together,
    slow_clock,
)
from backdrive.identification.options import Interval, Options
from backdrive.identification.plausibility import with_verdicts
from backdrive.identification.prior import as_priors, with_priors
from backdrive.identification.repairs import healthy
from backdrive.identification.result import Identification, JointEvidence
from backdrive.identification.supplement import limits_of, supplement
from backdrive.identification.timing import Timing
from backdrive.identification.validate import validate
from backdrive.logs.log import AS_SI, DOUBTED, Drive, Log
from backdrive.logs.tables import as_logs
from backdrive.model import ArmModel, FrictionModel, JointFriction

#: Method -> its function for one joint: module, name, and the options that it uses.
ONE_JOINT: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "sweep": ("sweep", "identify_sweep", ("literal", "symmetric", "timing", "delay")),
    "payload": ("sweep_payload", "identify_payload", ("payloads", "timing", "delay")),
    "constant-velocity": ("constant_velocity", "identify_constant_velocity", ("symmetric", "law")),
    "ramp": ("presliding", "identify_ramp", ()),
    "motion": ("motion", "identify_motion", ("cutoff", "gravity", "symmetric", "law", "delay")),
}
Outcome = tuple[Sequence[JointFriction], Sequence[JointEvidence], ArmModel | None]


@guard_keywords
@on_one_thread
@with_free_memory
def identify(  # noqa: PLR0913  (its options are given by keyword)
    logs: Log | Sequence[Log] | Any,
    *,
    law: str | Sequence[str] | None = None,
    method: str = "auto",
    plan: Any = None,
    start: Start | None = None,
    joints: str | Sequence[str] | None = None,
    urdf: str | None = None,
    held_out: Sequence[Log] = (),
    symmetric: bool | None = None,
    gravity: bool | None = None,
    delay: bool = True,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    known: Mapping[str, float] | None = None,
    drive: DriveModel | Drive | None = None,
    loss: str = "huber",
    interval: Interval = "covariance",
    cutoff: float | None = None,
    step: float | None = None,
    literal: bool = False,
    timing: Timing | None = None,
    payloads: Sequence[tuple[float, float]] | None = None,
    accept: Sequence[str] = (),
    repair: bool = False,
    seed: int = 0,
    prior: Any = None,
    reading: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Identify the friction of every joint that moves.

    Without a law, the method follows from the logs, and the data determine the form of the curve. With a law, several laws or
    `auto`, the method is `dynamic`. Every law is then fitted with every third window of time held out, and judged on these windows
    or on the `held_out` logs. The chosen law is finally fitted to all data, together with inertia, a constant torque and, if
    required, gravity. Logs without torque are fitted by forward dynamics with the drive in the loop. The residual is then that
    of the position predicted from the drive's input.

    Args:
        logs: one log or data frame, or several of the same joints, with position or velocity, and torque; or with position and
            the input of the drive (`drive_input`).
        law: None; `auto` for a shortlist that the data can support; `rate`, `rate+element`, or several with commas between. For
            the methods `motion` and `constant-velocity`, `coulomb-viscous` or `polyline` to allow only that.
        method: `auto`, or one of `METHODS`.
        plan: the commanded motion (an object of `backdrive.plans`), or one per log; it defines the windows of a sweep.
        start: start of the plan in the log: seconds after the first sample, or `auto`, from the motion [s]; None: at once.
        joints: name of the joint to identify, or several; None: every joint that moves.
        urdf: path of the robot description; needed for the method `arm`.
        held_out: logs to judge on, not seen by the fit.
        symmetric: force one curve, or equal parameters of a law, for both directions (True), or one each (False); None: chosen
            by the error on held-out data.
        gravity: estimate gravity as sin q and cos q (motion, dynamic); None: if the data require it.
        delay: estimate the delay of the torque behind the motion, or of the drive's input (dynamic).
        bounds: bounds of the law's parameters, `inertia`, `offset`, `gravity_sin`, `gravity_cos` and `delay`, by name [SI].
            Given the drive's input, also of any parameter of the axis and its drive, which is then estimated:
            `drive.resistance`, ... (dynamic; see `dynamic.motion_terms`).
        known: fixed values by name [SI]: `inertia`, `offset`, `gravity_sin`, `gravity_cos`; given the drive's input, any
            parameter of `engine.Axis` (dynamic). `delay` of the torque behind the motion (motion, sweep, arm, dynamic).
        drive: fit motion given this drive's input; None: the drive of the logs, if they hold no torque (dynamic).
        loss: `linear`, `huber` or `absolute` (dynamic).
        interval: `covariance`, `profile` or `bootstrap`; see `dynamic.uncertainty` (dynamic).
        cutoff: low pass of the motion before differentiation [Hz]; None: from sampling rate and encoder.
        step: longest integration step of a fit given the drive's input [s]; None: a part of the fastest time constant of
            drive and inertia, at most 1 ms (dynamic).
        literal: the sweep exactly as printed in the thesis, without corrections.
        timing: the sweep's torque is a `command`, held from its sample on, or a `sample`, taken with the position; None:
            detected from the motion.
        payloads: s and c of the gravity s sin q + c cos q of a known payload in each log, (0, 0) without one [N.m]. Sweeps
            then separate friction of a motor that lifts the load from friction of a load that drives the motor back.
        accept: names of health findings to accept.
        repair: make the safe repairs of a log; each is noted, and undone if it does not lower the held-out error.
        seed: of the starting points of a search.
        prior: knowledge before the logs: a population of siblings (`fleet.merge`), a friction model with errors, or `model.Prior`
            by joint. The result combines both (`JointFriction.prior`), unless they contradict each other (p < 0.01).
        reading: how the logs were read (map, unit, ...), recorded in the model file.
        progress: called with a sentence before every step that may take long. An interruption (Ctrl-C) ends a search with its
            best result so far, if there is one; the result states this.

    Returns:
        The model, the evidence for every joint, the method and the reason for it; after a search also the table of laws with the
        reason for the choice.

    Raises:
        UnhealthyLog: a finding would spoil the result.
        NotIdentifiable: the data do not determine the friction of any joint; joints that fail beside others are only named.
        InvalidInput: an argument or a log does not fit the method.
        UnknownName: no such law, joint or method.
    """
    reading = as_table("reading", reading)
    options = Options(
        law=law,
        method=method,
        start=start,
        joints=joints,
        urdf=urdf,
        symmetric=symmetric,
        gravity=gravity,
        delay=delay,
        bounds=as_table("bounds", bounds),
        known=as_table("known", known),
        drive=drive,
        loss=loss,
        interval=interval,
        cutoff=cutoff,
        step=step,
        seed=seed,
        prior=as_priors(prior),
        literal=literal,
        timing=timing,
        payloads=payloads,
        accept=accept,
        repair=repair,
        progress=progress,
    )
    from backdrive import __version__

    logs, held_out = as_logs(logs), as_logs(held_out)
    if not logs:
        raise InvalidInput("There is no log to identify from.", remedy="Pass one, as `read_log` gives it.")
    options.check()
    logs = [in_order(log, logs[0]) for log in logs]
    held_out = [in_order(log, logs[0]) for log in held_out]
    apart(logs, held_out)
    logs = attach_plan(logs, plan, start)
    if _searches(logs, options):
        from backdrive.identification import dynamic

        dynamic.check(options)
    options.say("Checking the logs")
    warnings: list[str] = []
    logs = [healthy(log, accept, repair, warnings) for log in logs]
    held_out = [healthy(log, accept, repair, warnings) for log in held_out]
    doubted = [note for log in logs for note in log.notes if any(words in note for words in DOUBTED)]
    warnings += [note for log in logs for note in log.notes if AS_SI in note and note not in doubted]
    names, idle = moving_joints(logs, joints)
    method, reason = _method(logs, names, options)
    options.applicable(method)
    warnings += external_torque_notes(logs, method, method == "dynamic" and _is_driven(logs, options))
    warnings += slow_clock(logs) if method in ("sweep", "motion", "arm", "dynamic") else []
    if method != "arm":
        warnings += [f"Joint '{name}' hardly moves and was left out." for name in idle]
    warnings += [TOGETHER] if method == "motion" and move_together(logs, names) else []
    more: dict[str, Any] = {}
    settings: dict[str, Any] = {}
    notes = [note for log in logs for note in log.notes if note not in doubted]
    notes += standing(logs, names) if method != "arm" and options.payloads is None else []
    arm = None
    if method == "dynamic":
        from backdrive.identification.dynamic import fit_joints

        fits, stopped = fit_joints(logs, held_out, names, options, warnings)
        friction, evidence = [f.friction for f in fits], [f.evidence for f in fits]
        more = {
            "choices": tuple(f.choice for f in fits),
            "intervals": {f.choice.joint: f.intervals for f in fits},
            "stopped": stopped,
        }
        chosen = {f.choice.joint: {k: v for k, v in f.settings.items() if v is not None} for f in fits}
        settings = {"settings": {joint: values for joint, values in chosen.items() if values}}
        notes += [note for f in fits for note in f.notes]
    elif method == "arm":
        friction, evidence, arm = _arm(logs, held_out, options)
    else:
        friction, evidence = _by_joint(method, logs, held_out, names, options, warnings)
    friction, evidence = with_priors(friction, evidence, options.prior, logs, warnings)
    model = FrictionModel(
        joints=tuple(friction),
        arm=arm,
        sources=tuple(s for log in logs for s in log.sources),
        options=options.record(method, plan, held_out, reading=reading, **settings),
        version=__version__,
        **coupling_of(logs, [j.joint.name for j in friction]),
    )
    if held_out and method not in ("motion", "arm", "dynamic"):
        options.say("Judging on the held-out logs")
        model, evidence = _validate_on(model, evidence, held_out)
    model, evidence = _with_verdicts(model, evidence, logs, options.user_delay(method))
    limits = limits_of(options.urdf)
    model = replace(
        model,
        joints=tuple(supplement(j, e, logs, limits) for j, e in zip(model.joints, evidence, strict=True)),
    )
    return Identification(
        model=model,
        evidence=tuple(evidence),
        method=method,
        reason=reason,
        warnings=tuple(w for w in dict.fromkeys(warnings) if not any(w in j.warnings for j in model.joints)),
        notes=tuple(note for note in dict.fromkeys(notes) if note not in warnings),
        **more,
    )


def _searches(logs: Sequence[Log], options: Options) -> bool:
    """Return whether the options or the logs require a search instead of a regression."""
    if options.method != "auto":
        return options.method == "dynamic"
    if options.law is not None or options.drive is not None:
        return options.law != "polyline"
    return any(log.torque is None and log.drive_input is not None for log in logs)


def _is_driven(logs: Sequence[Log], options: Options) -> bool:
    from backdrive.identification.dynamic import is_driven

    return is_driven(logs, options)


def _method(logs: Sequence[Log], names: Sequence[str], options: Options) -> tuple[str, str]:
    """Return the method and the reason for it."""
    if _searches(logs, options):
        if _is_driven(logs, options):
            return "dynamic", "laws are fitted to the motion that follows from the drive's input"
        return "dynamic", "laws are fitted to the torque along the logged motion"
    if options.method == "auto":
        return choose_method(logs, names, options.urdf)
    lookup(options.method, METHODS, "method")
    return options.method, "as requested"


def _arm(logs: Sequence[Log], held_out: Sequence[Log], options: Options) -> Outcome:
    if options.urdf is None:
        raise InvalidInput(
            "The method 'arm' needs the robot's description.", remedy="Pass --urdf ROBOT.urdf."
        )
    from backdrive.identification.arm import identify_arm

    options.say("Identifying the arm")
    given: dict[str, Any] = {"cutoff": options.cutoff, "delay": options.user_delay("arm")}
    return identify_arm(logs, options.urdf, held_out=held_out, **given)


def _by_joint(
    method: str,
    logs: Sequence[Log],
    held_out: Sequence[Log],
    names: Sequence[str],
    options: Options,
    warnings: list[str],
) -> tuple[Sequence[JointFriction], Sequence[JointEvidence]]:
    """Return friction and evidence of each joint; a warning names the joints that cannot be identified."""
    results: list[tuple[JointFriction, JointEvidence]] = []
    for k, name in enumerate(names):
        among = f", joint {k + 1} of {len(names)}" if len(names) > 1 else ""
        options.say(f"Identifying {name} ({method}){among}")
        try:
            own = in_motion(logs, name) if options.payloads is None else logs  # a payload belongs to a log
            own, unseen = [own_turn(log, name) for log in own], in_motion(held_out, name)
            results.append(_one(method, own, name, unseen, options))
        except NotIdentifiable as error:
            if options.joints is not None or len(names) == 1:
                raise
            warnings.append(f"Joint '{name}' was left out: {error}")
    if not results:
        raise NotIdentifiable("No joint could be identified.", remedy=" ".join(warnings))
    friction, evidence = zip(*results, strict=True)
    return friction, evidence


def _one(
    method: str, logs: Sequence[Log], name: str, held_out: Sequence[Log], options: Options
) -> tuple[JointFriction, JointEvidence]:
    module, function, heeded = ONE_JOINT["payload" if options.payloads is not None else method]
    late = options.user_delay(method)
    given: dict[str, Any] = {n: late if n == "delay" else getattr(options, n) for n in heeded}
    if isinstance(given.get("law"), (list, tuple)):
        given["law"] = ",".join(given["law"])
    given |= {"held_out": held_out} if method == "motion" else {}
    return getattr(import_module(f"backdrive.identification.{module}"), function)(logs, name, **given)


def _validate_on(
    model: FrictionModel, evidence: Sequence[JointEvidence], held_out: Sequence[Log]
) -> tuple[FrictionModel, list[JointEvidence]]:
    """Return model and evidence with the quality on held-out logs, for methods that do not compute it."""
    qualities = validate(model, held_out)
    joints = tuple(replace(j, held_out=qualities.get(j.joint.name, j.held_out)) for j in model.joints)
    return replace(model, joints=joints), _describe_fit(evidence, model.joints, joints)


def _with_verdicts(
    model: FrictionModel, evidence: Sequence[JointEvidence], logs: Sequence[Log], delay: float | None
) -> tuple[FrictionModel, list[JointEvidence]]:
    """Return model and evidence with the remarks of the plausibility rules."""
    joints = with_verdicts(model.joints, evidence, logs, delay)
    return replace(model, joints=joints), _describe_fit(evidence, model.joints, joints)


def _describe_fit(
    evidence: Sequence[JointEvidence], before: Sequence[JointFriction], after: Sequence[JointFriction]
) -> list[JointEvidence]:
    """Return the evidence with the sentence on the fit updated."""
    return [
        e if new is old else replace(e, verdict=e.verdict.replace(describe_fit(old), describe_fit(new)))
        for e, old, new in zip(evidence, before, after, strict=True)
    ]
