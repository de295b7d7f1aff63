"""From a fit of motion to a joint of a model, with the evidence that a report shows: in torque, as its drive must have given it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.fitting.choice import Choice
from backdrive.fitting.driven import Driven
from backdrive.fitting.law_fit import conclude
from backdrive.fitting.motion import MotionFit
from backdrive.fitting.request import Request
from backdrive.fitting.result import finish
from backdrive.fitting.search import Found, Search
from backdrive.fitting.torque import TorqueProblem
from backdrive.fitting.unknowns import Scales
from backdrive.identification.result import JointEvidence
from backdrive.log import Joint
from backdrive.model import Estimate, JointFriction

RIGID = ("inertia", "offset", "gravity_sin", "gravity_cos")
OTHERS = ("load_inertia", "stiffness", "damping", "load_dependence")


def finish_motion(
    joint: Joint,
    final: MotionFit,
    choice: Choice,
    fitted: Sequence[Driven],
    unseen: Sequence[Driven],
    asked: Request,
    scales: Scales,
) -> tuple[JointFriction, JointEvidence]:
    """Return a joint's friction and its evidence.

    Args:
        joint: whose friction it is.
        final: fitted to everything.
        choice: of the law.
        fitted: stretches of the fit.
        unseen: the same of held-out logs.
        asked: for what is known, and the loss.
        scales: that ranges followed from.
    """
    stretches = [d.stretch(final.axis.drive) for d in fitted]
    tests = [d.stretch(final.axis.drive) for d in unseen]
    values, shape = {**asked.known, **final.values}, final.problem.shape
    numbers = {*shape.rate.PARAMETERS, *shape.element.PARAMETERS}
    terms = [t for t in RIGID if t in values and t not in numbers]
    problem = TorqueProblem(shape, stretches, scales, terms=terms)
    point = problem.point(values)
    search = Search(problem.residuals, problem.lower, problem.upper, loss=asked.loss)
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
    seen = conclude(problem, found, asked.loss)
    in_torque = replace(
        seen,
        values={n: values.get(n, v) for n, v in seen.values.items()},
        standard_errors={n: final.standard_errors.get(n, np.nan) for n in seen.values},
        at_bound=final.at_bound,
        unseen=final.unseen,
        warnings=final.warnings,
    )
    friction, evidence = finish(
        joint,
        in_torque,
        in_torque,
        choice,
        [(d.signals, s) for d, s in zip(fitted, stretches)],
        [(d.signals, s) for d, s in zip(unseen, tests)],
        [np.zeros(len(s.torque), dtype=bool) for s in stretches],
    )
    units = {u.name: u.unit for u in final.problem.unknowns}
    dynamics = dict(friction.dynamics) | {
        n: Estimate(value=v, unit=units[n], standard_error=final.standard_errors[n])
        for n, v in final.values.items()
        if n.startswith("drive.") or (n in OTHERS and n not in numbers)
    }
    friction = replace(
        friction,
        dynamics=dynamics,
        held_out=friction.held_out if unseen else None,
        method=f"fit of {final.name}: motion given the drive's input",
    )
    return friction, evidence
