"""`fit_motion`: a law, an axis and its drive from motion alone, where no torque was measured.

A law must explain the motion itself (`motion_problem`). The unknowns are the parameters of the law and any parameters of the
axis and its drive (`motion_terms`). The search tolerates a cost with steps and folds (`motion_search`).
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

FEWEST = 50  # samples
REFINED = 10  # last iterations of a loss without kinks


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
    """Fit a law, an axis and its drive to motions, from the drive's input alone.

    Args:
        logs: motions of one axis, or a problem made of them; then the next arguments are the problem's.
        law: `rate`, `rate+element`, or a shape with parameters held fixed.
        axis: everything that is not sought; its law is not used.
        free: ranges of what is sought, by name [SI].
        loss: `absolute` for the least mean absolute error, `linear` for the least root mean square.
        signal: what is compared.
        substeps: integration steps a sample.
        unit: of the axis, `rad` or `m`.
        begin: starts that are screened; 1: only `begin_at`.
        descend: of them that descend a little.
        finish: of those that descend to the end.
        iterations: of a descent at most.
        polish: generations of differential evolution around the best.
        begin_at: values to begin at, by name [SI].
        seed: of everything that is drawn.
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
