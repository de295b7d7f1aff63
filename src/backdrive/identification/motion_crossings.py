"""A straight line by motion, with what the reversals tell of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification.crossing_fit import through_crossings
from backdrive.identification.crossing_search import FAST, Estimate
from backdrive.identification.design import Choice
from backdrive.identification.motion_error import MotionError
from backdrive.identification.signals import Signals


def with_crossings(
    choice: Choice, delay: float, stretches: Sequence[Signals], error: MotionError
) -> tuple[Choice, bool]:
    """Return a choice with the numbers of a fit through the reversals, and whether there is one; the choice itself otherwise.

    Args:
        choice: with the delay as its term `jerk`.
        delay: of the torque [s].
        stretches: of one joint, as they were logged.
        error: of the measured motion.
    """
    terms, form = choice.candidate.terms, choice.candidate.form
    line = form.symmetric and form.knots.size == 2 and form.knots[0] == 0.0
    if not line or error.orders != 2 or not {"inertia", "jerk"} <= set(terms):
        return choice, False
    others = [term for term in terms if term not in ("inertia", "jerk")]
    inertia = choice.coefficients[terms.index("inertia")]
    k, top = len(terms), form.knots[1]
    spread = np.zeros((k + 2, k + 2))  # from coefficients to numbers
    spread[0, k] = 1.0
    spread[1, k:] = -1.0 / top, 1.0 / top
    for row, term in enumerate((*others, "inertia"), 2):
        spread[row, terms.index(term)] = 1.0
    spread[-1, terms.index("jerk")] = 1.0 / inertia
    values = spread @ choice.coefficients
    values[-1] += delay
    first = Estimate(
        names=("coulomb", "viscous", *others, *FAST),
        values=values,
        covariance=spread @ choice.covariance @ spread.T,
    )
    found = through_crossings(stretches, error.of_sample, first)
    if found is None:
        return choice, False
    back = np.linalg.inv(spread)
    found_values = found.values.copy()
    found_values[-1] -= delay
    return replace(
        choice, coefficients=back @ found_values, covariance=back @ found.covariance @ back.T
    ), True
