"""The friction of a joint from a fit to its motion: law, terms of the dynamics, covariance, and what makes it suspect."""

from __future__ import annotations

import numpy as np

from backdrive.identification import curves, design
from backdrive.identification.evidence import sentences
from backdrive.identification.remark import ONE_WAY_ONLY
from backdrive.identification.terms import estimates
from backdrive.logs.log import Joint
from backdrive.model import Covariance, JointFriction, Validity
from backdrive.model.covariance import errors_by_parameter


def as_friction(
    choice: design.Choice,
    coefficients: np.ndarray,
    joint: Joint,
    velocity: tuple[float, float],
    delay: float = 0.0,
) -> JointFriction:
    """Return the joint's friction for coefficients of the chosen candidate, fitted to motion with a given delay [s]."""
    candidate = choice.candidate
    k = len(candidate.terms)
    law = curves.to_law(candidate.form, coefficients[k:])
    parameters, of_law = curves.sensitivity(candidate.form, law)
    terms = [("time_slip" if term == "jerk" else term) for term in candidate.terms]
    size = [
        1.0 / coefficients[candidate.terms.index("inertia")] if term == "jerk" else 1.0
        for term in candidate.terms
    ]
    spread = np.zeros((k + len(parameters), coefficients.size))
    spread[:k, :k], spread[k:, k:] = np.diag(size), of_law
    names, covariance = (*terms, *parameters), spread @ choice.covariance @ spread.T
    errors = errors_by_parameter(names, covariance)
    values = {
        term: (value * s, errors[term]) for term, value, s in zip(terms, coefficients, size, strict=False)
    }
    if "time_slip" in values:
        values["time_slip"] = values["time_slip"][0] + delay, values["time_slip"][1]
    return JointFriction(
        joint=joint,
        law=law,
        standard_errors={name: e for name, e in errors.items() if name not in terms},
        dynamics=estimates(values, joint.unit),
        covariance=Covariance.of(names, covariance),
        validity=Validity(velocity=velocity),
        method="motion",
    )


def warnings_of(choice: design.Choice, joint: Joint, both_directions: bool) -> tuple[str, ...]:
    """Return warnings on what makes a result suspect."""
    symmetric, apart = choice.candidate.form.symmetric, "offset" in choice.candidate.terms
    return sentences(
        (not both_directions, ONE_WAY_ONLY),
        (
            not symmetric and apart,
            f"Friction at {_slowest(choice, joint.unit)} was taken as equal in both directions, and the constant torque "
            "that is left as an offset: the data cannot tell the two apart.",
        ),
        (
            not symmetric and not apart,
            "A constant bias torque (cable, current offset, gravity) cannot be told from friction that differs by "
            "direction; it is part of the identified friction.",
        ),
        (
            choice.condition > 1e4,
            f"The motion separates the terms poorly (condition number {choice.condition:.1e}).",
        ),
    )


def _slowest(choice: design.Choice, unit: str) -> str:
    """Return the speed of the slowest knot in words; the joint's unit is `rad` or `m`."""
    speed = float(choice.candidate.form.knots[0])
    return f"{speed:.2g} {unit}/s, the slowest speed of the curve," if speed else "rest"
