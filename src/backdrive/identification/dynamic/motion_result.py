"""From a fit of motion to a joint of a model, with the evidence that a report shows: in torque, as its drive must have given it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification.dynamic.choice import Choice
from backdrive.identification.dynamic.driven import Driven, held_out_masks
from backdrive.identification.dynamic.law_fit import LawFit, conclude
from backdrive.identification.dynamic.motion import MotionFit
from backdrive.identification.dynamic.motion_terms import UNITS
from backdrive.identification.dynamic.result import finish
from backdrive.identification.dynamic.search import Found, Search
from backdrive.identification.dynamic.torque import Stretch, TorqueProblem
from backdrive.identification.dynamic.unknowns import Scales
from backdrive.identification.options import Options, describe_drive
from backdrive.identification.result import JointEvidence
from backdrive.logs.log import Joint
from backdrive.model import Estimate, JointFriction

RIGID = ("inertia", "offset", "gravity_sin", "gravity_cos")
OTHERS = ("load_inertia", "stiffness", "damping", "load_dependence")


def finish_motion(
    joint: Joint,
    final: MotionFit,
    judged: MotionFit,
    choice: Choice,
    fitted: Sequence[Driven],
    unseen: Sequence[Driven],
    options: Options,
    scales: Scales,
) -> tuple[JointFriction, JointEvidence]:
    """Return a joint's friction and its evidence.

    Args:
        joint: whose friction it is.
        final: fitted to everything.
        judged: fitted without what it is judged on.
        choice: of the law.
        fitted: stretches of the fit.
        unseen: the same of held-out logs.
        options: for what is known, and the loss.
        scales: that ranges followed from.
    """
    stretches = [d.stretch(final.axis.drive) for d in fitted]
    tests = [d.stretch(final.axis.drive) for d in unseen]
    masks = held_out_masks(fitted, final.axis.drive.controller != "open")
    friction, evidence = finish(
        joint,
        _in_torque(final, stretches, options, scales),
        _in_torque(judged, stretches, options, scales),
        choice,
        [(d.signals, s) for d, s in zip(fitted, stretches)],
        [(d.signals, s) for d, s in zip(unseen, tests)],
        masks,
    )
    units = {u.name: u.unit for u in final.problem.unknowns}
    numbers = {*final.problem.shape.rate.PARAMETERS, *final.problem.shape.element.PARAMETERS}
    dynamics = dict(friction.dynamics) | _given(final, options, joint, numbers)
    dynamics |= {
        n: Estimate(value=v, unit=units[n], standard_error=final.standard_errors[n])
        for n, v in final.values.items()
        if n.startswith("drive.") or (n in OTHERS and n not in numbers)
    }
    friction = replace(
        friction,
        dynamics=dynamics,
        method=f"fit of {final.name}: motion given the drive's input",
    )
    return friction, evidence


def _in_torque(one: MotionFit, stretches: Sequence[Stretch], options: Options, scales: Scales) -> LawFit:
    """Return a fit of motion as one of the torque that its drive must have given."""
    values, shape = {**options.known, **one.values}, one.problem.shape
    numbers = {*shape.rate.PARAMETERS, *shape.element.PARAMETERS}
    terms = [t for t in RIGID if t in values and t not in numbers]
    problem = TorqueProblem(shape, stretches, scales, terms=terms)
    point = problem.point(values)
    search = Search(problem.residuals, problem.lower, problem.upper, loss=options.loss)
    residual = search.evaluate(point[None])
    found = Found(
        point=point,
        cost=0.0,
        residual=residual[0],
        jacobian=search.jacobian(point[None], residual)[0],
        weight=search.weights(residual[0], search.scale(residual[0])),
        converged=True,
        evaluations=search.evaluations,
    )
    seen = conclude(problem, found, options.loss)
    return replace(
        seen,
        values={n: values.get(n, v) for n, v in seen.values.items()},
        standard_errors={n: one.standard_errors.get(n, np.nan) for n in seen.values},
        at_bound=one.at_bound,
        unseen=one.unseen,
        warnings=one.warnings,
    )


def _given(final: MotionFit, options: Options, joint: Joint, numbers: set[str]) -> dict[str, Estimate]:
    """Return the numbers of the drive and the axis that were given and not sought, so that the model can be run again."""
    side = 0 if joint.unit == "rad" else 1
    found = {
        f"drive.{n}": v
        for n, v in describe_drive(final.axis.drive).items()
        if isinstance(v, float) and np.isfinite(v)
    }
    found |= {n: float(v) for n, v in options.known.items() if n not in RIGID and n not in numbers}
    units = {n: UNITS[n][side] if n in UNITS else "SI" for n in found}
    return {n: Estimate(value=v, unit=units[n]) for n, v in found.items()}
