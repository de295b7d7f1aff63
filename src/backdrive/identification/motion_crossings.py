"""A straight line by motion, with what the reversals tell of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification.crossing_fit import delay_at_crossings, through_crossings
from backdrive.identification.crossing_search import FAST, Estimate
from backdrive.identification.design import Choice
from backdrive.identification.motion_error import MotionError
from backdrive.identification.signals import Signals
from backdrive.identification.slip import Slip


def with_crossings(
    choice: Choice, delay: float, stretches: Sequence[Signals], error: MotionError
) -> tuple[Choice, str]:
    """Return a choice with what a fit through the reversals tells, and a sentence on it; the choice itself where it tells nothing.

    Args:
        choice: with the delay as its term `jerk`.
        delay: of the torque [s].
        stretches: of one joint, as they were logged.
        error: of the measured motion.
    """
    if (spread := _spread(choice, error)) is None:
        return choice, ""
    found = through_crossings(stretches, error.of_sample, _first(choice, delay, spread))
    if found is None:
        return choice, ""
    found, said = found
    back = np.linalg.inv(spread)
    found_values = found.values.copy()
    found_values[-1] -= delay
    return replace(
        choice, coefficients=back @ found_values, covariance=back @ found.covariance @ back.T
    ), said


def slip_at_crossings(slip: Slip, choice: Choice, stretches: Sequence[Signals], error: MotionError) -> Slip:
    """Return a delay as the reversals tell it; the same one where they do not.

    Args:
        slip: a delay that the motion tells poorly.
        choice: with that delay as its term `jerk`.
        stretches: of one joint, as they were logged.
        error: of the measured motion.
    """
    if (spread := _spread(choice, error)) is None:
        return slip
    found = delay_at_crossings(stretches, error.of_sample, _first(choice, slip.delay, spread))
    return slip if found is None or found[1] > slip.error else replace(slip, delay=found[0], error=found[1])


def _spread(choice: Choice, error: MotionError) -> np.ndarray | None:
    """Return the matrix from a straight line's coefficients to its numbers, (p, p); None of other curves or without inertia."""
    terms, form = choice.candidate.terms, choice.candidate.form
    line = form.symmetric and form.knots.size == 2 and form.knots[0] == 0.0
    if not line or error.orders != 2 or not {"inertia", "jerk"} <= set(terms):
        return None
    inertia = choice.coefficients[terms.index("inertia")]
    k, top = len(terms), form.knots[1]
    spread = np.zeros((k + 2, k + 2))
    spread[0, k] = 1.0
    spread[1, k:] = -1.0 / top, 1.0 / top
    for row, term in enumerate((*_others(choice), "inertia"), 2):
        spread[row, terms.index(term)] = 1.0
    spread[-1, terms.index("jerk")] = 1.0 / inertia
    return spread


def _others(choice: Choice) -> tuple[str, ...]:
    return tuple(term for term in choice.candidate.terms if term not in ("inertia", "jerk"))


def _first(choice: Choice, delay: float, spread: np.ndarray) -> Estimate:
    """Return the numbers of a fit without the reversals."""
    values = spread @ choice.coefficients
    values[-1] += delay
    return Estimate(
        names=("coulomb", "viscous", *_others(choice), *FAST),
        values=values,
        covariance=spread @ choice.covariance @ spread.T,
    )
