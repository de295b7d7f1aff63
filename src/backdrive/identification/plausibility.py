"""Plausibility of a result: rules applied to the results of every method, and the verdict that follows.

Physics takes precedence over the residual: a result that violates it is not credible, however small the residual. Each rule
checks a joint's parameters with their errors, or the torque residual, and describes the fault in a sentence with numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from backdrive.identification import plausibility_law as laws
from backdrive.identification import plausibility_logs as beside
from backdrive.identification import plausibility_numbers as numbers
from backdrive.identification import plausibility_residual as residual
from backdrive.identification.auto import in_motion
from backdrive.identification.other_motion import OtherMotion
from backdrive.identification.remark import Case, Remark, Severity
from backdrive.identification.result import JointEvidence
from backdrive.logs.log import Log
from backdrive.model import JointFriction, Verdict

ORDER: tuple[Severity, ...] = ("poor", "unknown", "care", "note")

Rule = Callable[[Case], Remark | None]

#: The rules, gravest first, one per line.
RULES: tuple[Rule, ...] = (
    numbers.speed,
    beside.unit_by_name,
    residual.clock,
    numbers.direction,
    numbers.inertia,
    numbers.balance,
    numbers.certainty,
    numbers.external_share,
    numbers.one_way,
    numbers.directions,
    beside.user_delay,
    numbers.delay_at_bound,
    numbers.delay_range,
    beside.plan,
    beside.velocity_scale,
    beside.flat_torque,
    beside.siblings,
    residual.delay,
    residual.structure,
    laws.break_away,
    laws.vague_level,
    laws.controller_step,
    residual.slow_peak,
    residual.torque_steps,
    residual.encoder_steps,
    residual.wild_samples,
    numbers.unseen_presliding,
    numbers.speed_gap,
    numbers.gravity_apart,
    numbers.vague_terms,
    numbers.unknown_error,
)


def remarks(
    friction: JointFriction,
    evidence: JointEvidence,
    logs: Sequence[Log] = (),
    delay: float | None = None,
    others: OtherMotion | None = None,
) -> list[Remark]:
    """Return the remarks of all rules on a joint's result, gravest first.

    Args:
        friction: of the joint.
        evidence: of the same joint.
        logs: fitted logs.
        delay: of the torque behind the motion, if the user knows it [s].
        others: motion of all joints of the logs, shared by their rules; None: computed here.
    """
    others = OtherMotion(logs) if others is None else others
    if evidence.residual is not None:  # a copy: what the rules compute is freed after them
        evidence = replace(evidence, residual=replace(evidence.residual))
    case = Case(friction=friction, evidence=evidence, logs=logs, known_delay=delay, others=others)
    every = [remark for rule in RULES if (remark := rule(case)) is not None]
    return sorted(every, key=lambda remark: ORDER.index(remark.severity))


def with_verdicts(
    joints: Sequence[JointFriction],
    evidence: Sequence[JointEvidence],
    logs: Sequence[Log] = (),
    delay: float | None = None,
) -> tuple[JointFriction, ...]:
    """Return the joints with the rules' remarks before the method's warnings, and the grades that they allow; see `remarks`."""
    others = OtherMotion(logs)

    def of(friction: JointFriction, support: JointEvidence) -> list[Remark]:
        own = logs if friction.method == "arm" else in_motion(logs, friction.joint.name)
        return remarks(friction, support, own, delay, others if len(own) == len(logs) else OtherMotion(own))

    every = (of(j, e) for j, e in zip(joints, evidence, strict=True))
    return tuple(_with_grade(j, e, said) for j, e, said in zip(joints, evidence, every, strict=True))


def _with_grade(friction: JointFriction, evidence: JointEvidence, said: Sequence[Remark]) -> JointFriction:
    if not said:
        return friction
    worst = said[0].severity
    sentences = dict.fromkeys([*(remark.sentence for remark in said), *friction.warnings])
    grade = "good" if worst == "note" else worst
    return replace(friction, warnings=tuple(sentences), verdict=Verdict(grade=grade, text=evidence.verdict))
