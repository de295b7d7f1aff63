"""A search's straight line, with what the reversals tell of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification.crossing_fit import through_crossings
from backdrive.identification.crossing_search import FAST, Estimate
from backdrive.identification.dynamic.fit import Fit, with_numbers
from backdrive.identification.dynamic.torque import TorqueProblem
from backdrive.identification.motion_error import MotionError
from backdrive.identification.signals import Signals
from backdrive.laws import CoulombViscous, Rigid


def with_crossings(fit: Fit, stretches: Sequence[Signals], error: MotionError) -> Fit:
    """Return a fit with what a fit through the reversals tells; itself where that is nothing.

    Args:
        fit: of torque to all samples that count.
        stretches: of the joint, as they were logged.
        error: of the measured motion.
    """
    problem = fit.problem
    if not isinstance(problem, TorqueProblem) or fit.covariance is None or problem.known or fit.interrupted:
        return fit
    line = problem.shape.rate is CoulombViscous and problem.shape.element is Rigid and error.orders == 2
    names = {
        name: "coulomb" if name == "coulomb_positive" else "viscous" if name == "viscous_positive" else name
        for name in problem.names
    }
    if "viscous_negative" in names:
        names["viscous_positive"] = "viscous_positive"
    if not line or "coulomb_negative" in names or set(fit.covariance.names) != set(names):
        return fit
    if not {"coulomb", *FAST} <= set(names.values()):
        return fit
    order = sorted(names, key=lambda n: (names[n] != "coulomb", names[n] in FAST, names[n] == "delay"))
    rows = [fit.covariance.names.index(name) for name in order]
    first = Estimate(
        names=tuple(names[name] for name in order),
        values=np.array([fit.values[name] for name in order]),
        covariance=fit.covariance.array()[np.ix_(rows, rows)],
    )
    found = through_crossings(stretches, error.of_sample, first)
    if found is None:
        return fit
    numbers, said = found
    one = with_numbers(fit, order, numbers.values, numbers.covariance, numbers.errors)
    return fit if one is None else replace(one, through=said)
