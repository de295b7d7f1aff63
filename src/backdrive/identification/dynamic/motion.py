"""`fit_motion`: fit a law, an axis and its drive to motion, without measured torque.

The residual is that of the motion (`motion_problem`). The unknowns are parameters of the law, the axis and its drive
(`motion_terms`). The search tolerates a cost with steps and kinks (`motion_search`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import numpy as np

from backdrive._blas import on_one_thread
from backdrive.engine import Axis
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.dynamic.fit import Fit, conclude
from backdrive.identification.dynamic.motion_log import MotionLog
from backdrive.identification.dynamic.motion_problem import MotionProblem
from backdrive.identification.dynamic.motion_search import MotionSearch, seek
from backdrive.identification.dynamic.motion_terms import Range
from backdrive.identification.dynamic.unknowns import LawShape

FEWEST = 50  # least number of samples for a fit
REFINED = 10  # number of last iterations with narrow differences, for a smooth loss


@on_one_thread
def fit_motion(  # noqa: PLR0913  (its options are given by keyword)
    logs: Sequence[MotionLog] | MotionProblem,
    law: str | LawShape = "coulomb-viscous",
    *,
    axis: Axis | None = None,
    free: Mapping[str, Range] | None = None,
    loss: Literal["linear", "huber", "absolute"] = "linear",
    signal: Literal["position", "velocity"] = "position",
    substeps: int = 1,
    unit: str = "rad",
    begin: int = 256,
    descend: int = 6,
    finish: int = 2,
    iterations: int = 20,
    polish: int = 0,
    begin_at: Mapping[str, float] | None = None,
    seed: int = 0,
    tick: Callable[[str, int, float], None] | None = None,
) -> Fit:
    """Fit a law, an axis and its drive to motions, given the drive's input.

    Args:
        logs: motions of one axis; or a problem, whose own law, axis, ranges, signal, substeps and unit are then used.
        law: `rate`, `rate+element`, or a shape with parameters held fixed.
        axis: the axis with its known parameters; its law is not used.
        free: ranges of the estimated parameters, by name [SI].
        loss: `absolute` for the least mean absolute error, `linear` for the least root mean square.
        signal: the compared signal.
        substeps: number of integration steps per sample.
        unit: of the axis, `rad` or `m`.
        begin: number of starting points that are screened; 1: only `begin_at`.
        descend: number of these that are optimised for a few iterations.
        finish: number of these that are optimised further.
        iterations: largest number of iterations of a descent.
        polish: generations of differential evolution around the best point.
        begin_at: values of the first starting point, by name [SI].
        seed: of all random numbers.
        tick: called with the stage, the iteration and the error: mean absolute for `absolute`, root mean square otherwise.

    Raises:
        InvalidInput: contradictory ranges, or logs that do not match.
        UnknownName: `free` names something that neither law nor axis has.
        NotIdentifiable: no motion, or too few samples.
    """
    if isinstance(logs, MotionProblem):
        problem = logs
    else:
        if axis is None:
            raise InvalidInput(
                "There is no axis.", remedy="In Python, give axis=Axis(...) with everything known of it."
            )
        shape = LawShape.from_name(law) if isinstance(law, str) else law
        problem = MotionProblem(shape, logs, axis, free, signal=signal, substeps=substeps, unit=unit)
    m = problem.size
    if m < max(FEWEST, 2 * len(problem.unknowns)):
        raise NotIdentifiable(
            f"{m} samples are too few to fit {len(problem.unknowns)} numbers to.",
            remedy=f"Record at least {FEWEST}, better several seconds with reversals.",
        )
    search = MotionSearch(problem.residuals, problem.lower, problem.upper, loss=loss)

    def inform(stage: str, i: int, cost: float) -> None:
        if tick is not None:
            tick(stage, i, cost / m if loss == "absolute" else float(np.sqrt(cost / m)))

    with np.errstate(all="ignore"):
        found = seek(
            search,
            problem.point(begin_at or {}),
            (problem.terms.lower, problem.terms.upper),
            begin=begin,
            descend=descend,
            finish=finish,
            iterations=iterations,
            polish=polish,
            refine=0 if loss == "absolute" else REFINED,
            seed=seed,
            tick=inform,
        )
        return conclude(problem, found, loss)


MotionFit = Fit

__all__ = ["MotionFit", "MotionLog", "MotionProblem", "fit_motion"]
