"""`fit_motion`: a law, an axis and its drive from motion alone, where no torque was measured.

The motion itself is what a law must explain (`motion_problem`); what is sought are the law's numbers and any of the axis and
its drive (`motion_terms`), in a search that bears a cost with steps and folds (`motion_search`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from backdrive._blas import on_one_thread
from backdrive.engine import Axis
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.dynamic import words
from backdrive.identification.dynamic.motion_log import MotionLog
from backdrive.identification.dynamic.motion_problem import MotionProblem
from backdrive.identification.dynamic.motion_search import MotionSearch, seek
from backdrive.identification.dynamic.motion_terms import Range
from backdrive.identification.dynamic.search import Found
from backdrive.identification.dynamic.uncertainty import WEAK, covariance
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.laws import Law

NEAR = 1e-6  # a search coordinate so near to its bound is at it
FEWEST = 50  # samples
REFINED = 10  # last iterations of a loss without kinks
FLEXIBLE = ("offset", "gravity_sin", "gravity_cos", "drive.delay")  # may be 0: judged by their range


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionFit:
    """A law, an axis and its drive fitted to motions.

    Attributes:
        axis: with the law and the drive that were found; for logs with gains of their own, those are not in it.
        name: of the law.
        values: every number that was sought, by name [SI].
        standard_errors: of them [SI]; NaN where there is none.
        at_bound: names of those that ended at a bound of their range.
        unseen: those that these motions do not show, each with a sentence.
        mean_absolute: error of the motion over all samples [rad, m, rad/s or m/s].
        rms: root mean square of the same.
        samples: that were fitted.
        evaluations: of the whole set of logs.
        converged: the search came to rest.
        interrupted: a person stopped it.
        warnings: what makes the result suspect, in sentences.
        problem: what was fitted, for predictions.
        found: where the search ended.
    """

    axis: Axis
    name: str
    values: Mapping[str, float]
    standard_errors: Mapping[str, float]
    at_bound: tuple[str, ...]
    unseen: Mapping[str, str]
    mean_absolute: float
    rms: float
    samples: int
    evaluations: int
    converged: bool
    interrupted: bool
    warnings: tuple[str, ...]
    problem: MotionProblem = field(repr=False)
    found: Found = field(repr=False)

    @property
    def law(self) -> Law:
        """The friction law that was found."""
        return self.axis.law

    def predict(self, logs: Sequence[MotionLog] | None = None) -> list[np.ndarray]:
        """Return the motion from the measured start of every log [rad, m, rad/s or m/s], each (n,).

        Args:
            logs: other motions of the axis; None: those of the fit.
        """
        problem = self.problem if logs is None else self.problem.on(logs)
        starts = {
            n: self.values.get(n, 0.0) if logs is None else 0.0
            for n in problem.names
            if n.startswith("start.")
        }
        return [motion[0] for motion in problem.predict([{**self.values, **starts}])]

    def errors(self, logs: Sequence[MotionLog] | None = None) -> list[np.ndarray]:
        """Return predicted less measured motion of every log's judged samples [rad, m, rad/s or m/s].

        Args:
            logs: other motions of the axis; None: those of the fit.
        """
        logs = self.problem.logs if logs is None else logs
        found = []
        for log, motion in zip(logs, self.predict(None if logs is self.problem.logs else logs)):
            error = motion - (log.position if self.problem.signal == "position" else log.velocity)
            found.append(error if log.judged is None else error[log.judged])
        return found


@on_one_thread
def fit_motion(
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
) -> MotionFit:
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
        shape = LawShape.named(law) if isinstance(law, str) else law
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
        return _conclude(problem, found)


def _conclude(problem: MotionProblem, found: Found) -> MotionFit:
    values = problem.values(found.point)
    at_bound = (found.point <= problem.lower + NEAR) | (found.point >= problem.upper - NEAR)
    sizes = [len(g.position) if g.judged is None else int(g.judged.sum()) for g in problem.logs]
    cov = covariance(found.jacobian, found.residual, found.weight, ~at_bound, np.cumsum(sizes).tolist())
    root = np.sqrt(np.diag(cov.matrix))
    errors, relative = {}, np.full(len(root), np.inf)
    for i, u in enumerate(problem.unknowns):
        errors[u.name] = float(root[i] * u.slope(values[u.name]))
        size = 1.0 if u.ratio else abs(values[u.name])
        if u.name in FLEXIBLE or u.name.startswith("start."):
            size = max(size, 0.1 * (u.upper - u.lower))
        if np.isfinite(root[i]) and size > 0.0:
            relative[i] = errors[u.name] / size
    seen = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith("start.")]
    unseen, notes = words.unseen(
        [problem.names[i] for i in seen], relative[seen], cov.correlation[np.ix_(seen, seen)], WEAK
    )
    for i in np.flatnonzero(at_bound):
        u, end = problem.unknowns[i], "lower" if found.point[i] <= problem.lower[i] + NEAR else "upper"
        notes.append(f"'{u.name}' ended at the {end} bound of its range, {values[u.name]:.3g} {u.unit}.")
    fitted = problem.axis_of(values)
    if advice := fitted.law.element.advice(fitted.law.rate):
        notes.append(advice)
    if found.interrupted:
        notes.append("The search was interrupted; this is the best that it had found.")
    elif not found.converged:
        notes.append("The search did not come to rest in its iterations; the best point is given.")
    if problem.shape.ties:
        notes.append(words.alike(problem.shape.ties))
    return MotionFit(
        axis=fitted,
        name=problem.shape.name,
        values=problem.shape.complete(values),
        standard_errors=problem.shape.complete(errors),
        at_bound=tuple(problem.names[i] for i in np.flatnonzero(at_bound)),
        unseen=unseen,
        mean_absolute=float(np.abs(found.residual).mean()),
        rms=float(np.sqrt(np.mean(found.residual**2))),
        samples=len(found.residual),
        evaluations=found.evaluations,
        converged=found.converged,
        interrupted=found.interrupted,
        warnings=tuple(notes),
        problem=problem,
        found=found,
    )


__all__ = ["MotionFit", "MotionLog", "MotionProblem", "fit_motion"]
