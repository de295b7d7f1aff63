"""Identification of a whole arm: the base parameters of its rigid bodies, and the friction of every joint.

`arm_terms` defines the terms, `arm_solve` the fit, and `arm_checks` the warnings. All measured torque is judged, rests
included. Only the torque of a moving joint is fitted, since friction at rest is undetermined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification import curves
from backdrive.identification.arm_checks import (
    beyond_range,
    impossible,
    joints_at_zero,
    refuse_degrees,
    refuse_inversion,
    remarks,
)
from backdrive.identification.arm_coupling import guess_coupling
from backdrive.identification.arm_forecast import compare_errors, terms_along
from backdrive.identification.arm_physical import standard_parameters
from backdrive.identification.arm_predict import assess_joint, predict_arm, torque_parts, validate_arm
from backdrive.identification.arm_signals import (
    MOTION_CUTOFF,
    ArmSignals,
    hold_out_all,
    hold_out_blocks,
    prepare_arm,
)
from backdrive.identification.arm_slip import ArmSlip, seek_slip, with_delay
from backdrive.identification.arm_solve import Solution, solve_arm, spread_of
from backdrive.identification.arm_terms import Regressor, Terms, build, fill_load
from backdrive.identification.evidence import evidence
from backdrive.identification.quality import JUDGED_BELOW
from backdrive.identification.result import JointEvidence
from backdrive.identification.signals import Signals
from backdrive.identification.terms import estimates
from backdrive.laws import Growth, Law, Polyline
from backdrive.logs.filters import derivative, low_pass
from backdrive.logs.log import Joint, Log
from backdrive.model import Actuator, ArmModel, Covariance, JointFriction, Validity
from backdrive.robot import Robot, load_robot

SIGNIFICANT = 2.0  # least significance of load friction that is not set to zero [standard error]

__all__ = ["identify_arm", "predict_arm", "validate_arm"]


def identify_arm(
    logs: Log | Sequence[Log],
    urdf: str | Path | Robot,
    *,
    held_out: Sequence[Log] | None = None,
    cutoff: float | None = None,
    load_friction: bool = True,
    delay: float | None = None,
) -> tuple[tuple[JointFriction, ...], tuple[JointEvidence, ...], ArmModel]:
    """Identify the friction of all joints of an arm together with its rigid bodies.

    Args:
        logs: of any lively motion, with position and torque of all joints.
        urdf: path of the robot description, or the robot read from it; joints are matched by name.
        held_out: logs to judge on, not fitted; without any, a quarter of `logs` in contiguous blocks.
        cutoff: low pass of the position before differentiation [Hz]; None: 20.
        load_friction: estimate friction proportional to the torque that the bodies require.
        delay: of the torque behind the motion, if it is known [s]; None: estimated.

    Returns:
        Friction and evidence by joint, in the log's order; and the bodies, in the URDF's order. `dynamics` of a joint contains
        `inertia` of the motor, `offset` of the torque, `transition`, the velocity within which friction changes sign, and
        `time_slip` of the torque if it is significant. Load friction is the growth of the law; if it is not significant, it
        is zero with a standard error. The evidence's torques are low-passed at 5 Hz, like the judged ones.

    Raises:
        InvalidInput: joints, units or channels do not fit, or positions are in degrees.
        NotIdentifiable: the torque's sign is inverted, no joint moves, or there are too few samples.
    """
    logs = [logs] if isinstance(logs, Log) else list(logs)
    if not logs:
        raise InvalidInput("There is no log to identify from.", remedy="Pass at least one.")
    robot = urdf if isinstance(urdf, Robot) else load_robot(urdf)
    whole, robot = robot, robot.without_tools(logs[0].names)
    cutoff = cutoff or MOTION_CUTOFF
    seen = [replace(s, log=k) for k, log in enumerate(logs) for s in prepare_arm(log, robot, cutoff=cutoff)]
    refuse_degrees(robot, seen)
    if held_out:
        unseen = hold_out_all([s for log in held_out for s in prepare_arm(log, robot, cutoff=cutoff)])
    else:
        seen, unseen = hold_out_blocks(seen), []
    rates = {round(s.rate) for s in seen}
    if max(rates) > 1.2 * min(rates):
        raise InvalidInput(
            f"The logs are sampled at {sorted(rates)} Hz.",
            remedy="Resample them alike, or identify one by one.",
        )
    regressor = Regressor(robot, seen)
    terms = terms_along(seen, len(robot.joints))
    rows = build(regressor, terms)
    unknown = robot.base.columns.size + sum(t.size for t in terms)
    if np.count_nonzero(rows.weight) < 2 * unknown:
        raise NotIdentifiable(
            f"{np.count_nonzero(rows.weight)} rows of moving joints are too few for {unknown} coefficients.",
            remedy="Record a longer motion of all joints.",
        )
    refuse_inversion(rows, robot, terms)

    def refill(beta: np.ndarray) -> None:
        fill_load(rows, regressor, terms, beta)

    loaded = np.full(len(terms), load_friction)
    solution = solve_arm(rows, robot, terms, refill, loaded)
    slip, wrong = with_delay(seek_slip(regressor, terms, solution.beta), delay, logs[0].period)
    if slip is not None and slip.is_significant:
        seen, unseen = ([s.shift(slip.delay) for s in some] for some in (seen, unseen))
        regressor = Regressor(robot, seen)
        rows = build(regressor, terms)
        solution = solve_arm(rows, robot, terms, refill, loaded)
    found = np.array(
        [own[-1] > SIGNIFICANT * e[-1] for own, e in zip(solution.own, solution.errors, strict=True)]
    )
    if np.any(
        loaded & ~found
    ):  # terms that are not significant are left out, and the others are fitted again
        loaded &= found
        solution = solve_arm(rows, robot, terms, refill, loaded)
    theta, distance = standard_parameters(robot, solution.beta, spread_of(robot), solution.bodies)
    if 0.0 < distance <= 1.0:
        solution = solution.with_bodies(robot.base.relation @ theta)
    arm = ArmModel(
        urdf_sha256=robot.sha256,
        parameters=tuple(theta.tolist()),
        condition=solution.condition,
        covariance=tuple(map(tuple, (0.5 * (solution.level + solution.level.T)).tolist())),
    )
    outside = beyond_range(robot, [*seen, *unseen])
    warnings = [a + b for a, b in zip(outside, remarks(robot, terms, rows, solution), strict=True)]
    warnings[0] += impossible(distance) + joints_at_zero(robot, whole) + wrong
    guess = guess_coupling(rows, seen, terms, solution)
    if guess is not None:
        warnings[guess.motor] += (guess.sentence(robot.joints),)
    order = [robot.joints.index(name) for name in logs[0].names if name in robot.joints]
    about = {joint.name: joint for joint in logs[0].joints}
    frictions = [
        _friction(about[name], terms[j], solution, j, _load(seen, j), warnings[j], load_friction, slip)
        for j, name in enumerate(robot.joints)
    ]
    everything = [(s, *torque_parts(s, robot, arm, frictions)) for s in (*seen, *unseen)]
    frictions = [
        replace(
            friction,
            fitted=assess_joint(everything, j, lambda s: s.fitted),
            held_out=assess_joint(everything, j, lambda s: s.held_out),
        )
        for j, friction in enumerate(frictions)
    ]
    precision = compare_errors(logs, seen, robot, terms, solution)
    support = [
        replace(
            _evidence(everything, j, frictions[j], terms[j], solution),
            precision=tuple(p for p in precision if p.joint == name),
        )
        for j, name in enumerate(robot.joints)
    ]
    return tuple(frictions[j] for j in order), tuple(support[j] for j in order), arm


def _load(stretches: Sequence[ArmSignals], j: int) -> tuple[float, float]:
    """Return the smallest and the largest torque of a joint, low-passed [N.m or N]."""
    values = np.concatenate([low_pass(s.torque[:, j], JUDGED_BELOW, s.rate)[s.fitted] for s in stretches])
    return float(values.min()), float(values.max())


def _friction(
    joint: Joint,
    terms: Terms,
    solution: Solution,
    j: int,
    loads: tuple[float, float],
    warnings: tuple[str, ...],
    grows: bool,
    slip: ArmSlip | None,
) -> JointFriction:
    """Return one joint's friction from its coefficients; a last, level section keeps the curve constant beyond the top speed.

    If its growth with the load is not significant, it is set to zero but keeps its standard error. Under larger loads than in
    this motion, it is unknown rather than zero.
    """
    own, error, k = solution.own[j], solution.errors[j], terms.knots.size
    values = {"positive": own[:k], "negative": own[k : 2 * k]}
    errors = {"positive": error[:k], "negative": error[k : 2 * k]}
    law = Polyline(
        velocity=(*terms.knots.tolist(), terms.top),
        **{name: (*v.tolist(), float(v[-1])) for name, v in values.items()},
    )
    growth, with_load = None, {}
    if grows:
        slope = float(own[2 * k + 2]) if own[2 * k + 2] > 1e-9 else 0.0
        growth = Growth(load_driving=slope, load_driven=slope)
        with_load = dict.fromkeys(("load_driving", "load_driven"), float(error[2 * k + 2]))
    repeated = [*range(k), k - 1, *range(k, 2 * k), 2 * k - 1]  # the level section repeats the knot before it
    rows = [*repeated, 2 * k, 2 * k + 1, *[2 * k + 2] * len(with_load)]
    names = (*curves.knot_names(k + 1), "offset", "inertia", *with_load)
    found = {
        "offset": (own[2 * k], error[2 * k]),
        "inertia": (own[2 * k + 1], error[2 * k + 1]),
        "transition": (terms.transition, np.nan),
    }
    if slip is not None and slip.is_significant:
        found["time_slip"] = slip.delay, slip.error
    return JointFriction(
        joint=replace(joint, torque_side="joint"),
        law=Law(rate=law, growth=growth),
        standard_errors={name: (*e.tolist(), float(e[-1])) for name, e in errors.items()} | with_load,
        at_bound=tuple(name for name, v in values.items() if np.any(v == 0)),
        dynamics=estimates(found, joint.unit),
        covariance=Covariance.of(names, solution.covariance(j)[np.ix_(rows, rows)]),
        actuator=Actuator(motor_inertia=max(float(own[2 * k + 1]), 0.0)),
        validity=Validity(velocity=(-terms.top, terms.top), load=loads),
        method="arm",
        warnings=warnings,
    )


def _evidence(
    everything: Sequence[tuple[ArmSignals, np.ndarray, np.ndarray]],
    j: int,
    friction: JointFriction,
    terms: Terms,
    solution: Solution,
) -> JointEvidence:
    parts = []
    for s, predicted, rest in everything:
        torque, hat, known = (low_pass(x[:, j], JUDGED_BELOW, s.rate) for x in (s.torque, predicted, rest))
        for mask, seen in ((s.fitted, True), (s.held_out, False)):
            if not mask.any():
                continue
            signals = Signals(
                time=s.time[mask],
                velocity=s.velocity[mask, j],
                acceleration=s.acceleration[mask, j],
                jerk=derivative(s.acceleration[:, j], 1.0 / s.rate)[mask],
                torque=torque[mask],
                rate=s.rate,
                position=s.position[mask, j],
                model_torque=None,
                moving=np.ones(int(mask.sum()), dtype=bool),
                log=s.log,
            )
            parts.append((signals, (torque - known)[mask], hat[mask], seen))
    k = terms.knots.size
    covariance = solution.covariance(j)[: 2 * k, : 2 * k]

    form = curves.Form(name="arm", knots=terms.knots, symmetric=False, spread=np.eye(2 * k))
    of_curve, end = curves.error_of_curve(form, covariance), terms.knots[-1]
    return evidence(friction, parts, lambda velocity: of_curve(np.clip(velocity, -end, end)))
