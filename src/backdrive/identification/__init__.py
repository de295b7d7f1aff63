"""From logs to a friction model: `identify`, and `validate` on logs that the fit did not see."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from backdrive._blas import on_one_thread
from backdrive._catalog import lookup
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.auto import METHODS, choose_method, moving_joints, own_turn
from backdrive.identification.evidence import explained
from backdrive.identification.request import (
    apart,
    applicable,
    healthy,
    in_order,
    move_together,
    planned,
    slow_clock,
    unused_torque,
)
from backdrive.identification.result import Curve as Curve
from backdrive.identification.result import Identification as Identification
from backdrive.identification.result import JointEvidence as JointEvidence
from backdrive.identification.result import Samples as Samples
from backdrive.identification.timing import Timing
from backdrive.identification.validate import validate as validate
from backdrive.logs.log import Log
from backdrive.model import FrictionModel, JointFriction
from backdrive.plans import plan_to_dict


@on_one_thread
def identify(
    logs: Log | Sequence[Log],
    *,
    method: str = "auto",
    plan: Any = None,
    joints: Sequence[str] | None = None,
    urdf: str | None = None,
    held_out: Sequence[Log] = (),
    symmetric: bool | None = None,
    gravity: bool | None = None,
    law: str | None = None,
    literal: bool = False,
    timing: Timing | None = None,
    payloads: Sequence[tuple[float, float]] | None = None,
    cutoff: float | None = None,
    accept: Sequence[str] = (),
    repair: bool = False,
    progress: Callable[[str], None] | None = None,
    reading: Mapping[str, Any] | None = None,
) -> Identification:
    """Identify the friction of every joint that moves.

    Args:
        logs: one log, or several of the same joints.
        method: `auto`, or one of `METHODS`.
        plan: the motion that was commanded (an object of `backdrive.plans`), or one a log; gives the sweep its windows.
        joints: names of the joints wanted; None: every joint that moves.
        urdf: path of the robot description; needed for the method `arm`.
        held_out: logs to judge on, not seen by the fit.
        symmetric: force one curve for both directions (True) or one each (False).
        gravity: estimate gravity as sin q and cos q (motion); None: where the data ask for it.
        law: `coulomb-viscous` or `polyline` to allow only that (motion, constant velocity); None: what the data ask for.
        literal: the sweep exactly as printed in the thesis, without corrections.
        timing: the sweep's torque is a `command`, held from its sample on, or a `sample`, taken with the position; None: as
            the motion tells.
        payloads: s and c of the gravity s sin q + c cos q of a known payload in each log, (0, 0) without [N.m]: sweeps then
            tell friction where the motor lifts from friction where it is driven back.
        cutoff: low pass of the motion before differentiation [Hz].
        accept: names of health findings to accept.
        repair: mend the log where an honest repair exists; each is noted.
        progress: called with a sentence before every step that may take long.
        reading: how the logs were read (map, unit, ...), to be remembered in the model file.

    Returns:
        The model, the evidence for every joint, and which method ran and why.

    Raises:
        UnhealthyLog: a finding would spoil the result.
        NotIdentifiable: the data do not determine the friction.
        InvalidInput: an argument or a log does not fit the method.
    """
    from backdrive import __version__

    say = progress or (lambda sentence: None)
    logs = [logs] if isinstance(logs, Log) else list(logs)
    if not logs:
        raise InvalidInput("There is no log to identify from.", remedy="Pass at least one.")
    logs = [in_order(log, logs[0]) for log in logs]
    held_out = [in_order(log, logs[0]) for log in held_out]
    apart(logs, held_out)
    logs = planned(logs, plan)
    say("Checking the logs")
    warnings: list[str] = []
    logs = [healthy(log, accept, repair, warnings) for log in logs]
    held_out = [healthy(log, accept, repair, warnings) for log in held_out]
    names, idle = moving_joints(logs, joints)
    if method == "auto":
        method, reason = choose_method(logs, names, urdf)
    else:
        lookup(method, METHODS, "method")
        reason = "it was asked for"
    applicable(
        method,
        joints=joints,
        urdf=urdf,
        gravity=gravity,
        law=law,
        literal=literal,
        timing=timing,
        payloads=payloads,
        cutoff=cutoff,
    )
    warnings += unused_torque(logs, method)
    warnings += slow_clock(logs) if method in ("sweep", "motion", "arm") else []
    if method != "arm":
        warnings += [f"Joint '{name}' hardly moves and was left out." for name in idle]
    if method == "motion" and move_together(logs, names):
        warnings.append(
            "Several joints move at once and pull on each other; the single-axis model does not know that pull. Pass the robot's "
            "description (--urdf), or torques known from elsewhere (--map tau_model=...)."
        )
    arm = None
    if method == "arm":
        if urdf is None:
            raise InvalidInput(
                "The method 'arm' needs the robot's description.", remedy="Pass --urdf ROBOT.urdf."
            )
        from backdrive.identification.arm import identify_arm

        say("Identifying the arm")
        friction, evidence, arm = identify_arm(logs, urdf, held_out=held_out, cutoff=cutoff)
    else:
        found: list[tuple[JointFriction, JointEvidence]] = []
        for name in names:
            say(f"Identifying {name} ({method})")
            try:
                found.append(
                    _one(
                        method,
                        logs,
                        name,
                        held_out,
                        symmetric=symmetric,
                        gravity=gravity,
                        law=law,
                        literal=literal,
                        timing=timing,
                        payloads=payloads,
                        cutoff=cutoff,
                    )
                )
            except NotIdentifiable as error:
                if joints is not None or len(names) == 1:
                    raise
                warnings.append(f"Joint '{name}' was left out: {error}")
        if not found:
            raise NotIdentifiable("No joint could be identified.", remedy=" ".join(warnings))
        friction, evidence = zip(*found)
    options = {
        "method": method,
        "symmetric": symmetric,
        "gravity": gravity,
        "law": law,
        "literal": literal,
        "timing": timing,
        "payloads": None if payloads is None else [list(p) for p in payloads],
        "cutoff": cutoff,
        "accept": list(accept),
        "repair": repair,
        "joints": list(joints or []),
        "urdf": urdf,
        "plan": [plan_to_dict(p) for p in plan]
        if isinstance(plan, (list, tuple))
        else plan and plan_to_dict(plan),
        "held_out": [{"path": s.path, "sha256": s.sha256} for log in held_out for s in log.sources],
        "reading": dict(reading or {}),
    }
    off = {"literal": False, "repair": False, "accept": [], "held_out": [], "joints": [], "reading": {}}
    notes = [note for log in logs for note in log.notes]
    model = FrictionModel(
        joints=tuple(friction),
        arm=arm,
        sources=tuple(s for log in logs for s in log.sources),
        options={k: v for k, v in options.items() if v is not None and v != off.get(k)},
        version=__version__,
    )
    model = replace(model, joints=tuple(_with_temperature(j, logs) for j in model.joints))
    if held_out and method not in ("motion", "arm"):
        say("Judging on the held-out logs")
        model, evidence = _judged_on(model, evidence, held_out)
    return Identification(
        model=model,
        evidence=tuple(evidence),
        method=method,
        reason=reason,
        warnings=tuple(dict.fromkeys(warnings)),
        notes=tuple(dict.fromkeys(notes)),
    )


def _judged_on(
    model: FrictionModel, evidence: Sequence[JointEvidence], held_out: Sequence[Log]
) -> tuple[FrictionModel, list[JointEvidence]]:
    """Return model and evidence with the quality on held-out logs, for methods that do not judge themselves."""
    qualities = validate(model, held_out)
    joints = tuple(replace(j, held_out=qualities.get(j.joint.name, j.held_out)) for j in model.joints)
    said = [
        replace(e, verdict=e.verdict.replace(explained(before), explained(after)))
        for e, before, after in zip(evidence, model.joints, joints)
    ]
    return replace(model, joints=joints), said


def _one(method: str, logs, name: str, held_out, **options) -> tuple[JointFriction, JointEvidence]:
    logs = [own_turn(log, name) for log in logs]
    if method == "sweep" and options["payloads"] is not None:
        from backdrive.identification.sweep_payload import identify_payload

        return identify_payload(logs, name, options["payloads"], timing=options["timing"])
    if method == "sweep":
        from backdrive.identification.sweep import identify_sweep

        return identify_sweep(
            logs, name, literal=options["literal"], symmetric=options["symmetric"], timing=options["timing"]
        )
    if method == "constant-velocity":
        from backdrive.identification.constant_velocity import identify_constant_velocity

        return identify_constant_velocity(logs, name, symmetric=options["symmetric"], law=options["law"])
    if method == "ramp":
        from backdrive.identification.presliding import identify_ramp

        return identify_ramp(logs, name)
    from backdrive.identification.motion import identify_motion

    return identify_motion(
        logs,
        name,
        held_out=held_out,
        cutoff=options["cutoff"],
        gravity=options["gravity"],
        symmetric=options["symmetric"],
        law=options["law"],
    )


def _with_temperature(friction: JointFriction, logs: Sequence[Log]) -> JointFriction:
    """Return the joint with the range of temperatures that the logs saw."""
    import numpy as np

    seen = [log.select(friction.joint.name).temperature for log in logs]
    values = np.concatenate([t[np.isfinite(t)] for t in seen if t is not None] or [np.empty(0)])
    if not values.size:
        return friction
    return replace(
        friction, validity=replace(friction.validity, temperature=(float(values.min()), float(values.max())))
    )
