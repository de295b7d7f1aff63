"""Fit every law of a shortlist to one joint, compare them on held-out windows, and fit the chosen law to all data.

A `Task` defines what is fitted: torque given motion (`torque_task`), or motion given the drive's input (`motion_task`).
"""

from __future__ import annotations

import time as clock
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from backdrive.errors import BackdriveError, InvalidInput, NotIdentifiable
from backdrive.identification.dynamic import choice as choice_
from backdrive.identification.dynamic import directions
from backdrive.identification.dynamic.choice import Candidate, Choice
from backdrive.identification.dynamic.crossing import slips_too_early
from backdrive.identification.dynamic.fit import Fit
from backdrive.identification.dynamic.misfit import with_misfit
from backdrive.identification.dynamic.progress import WHOLE, Work, size_of
from backdrive.identification.dynamic.stopping import result_or_none
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.identification.options import Options
from backdrive.identification.result import JointEvidence
from backdrive.logs.log import Joint
from backdrive.model import JointFriction

EXACT = 1e-5  # held-out error, relative to the measured signal, below which a law is not refined [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class JointFit:
    """The outcome for one joint.

    Attributes:
        friction: for the model.
        evidence: for the report.
        choice: the laws tried, and the chosen one.
        intervals: 95 % interval of each parameter of the last fit [SI].
        stopped: a person interrupted the fit; this is the best result so far.
        notes: changes made to the data, in sentences.
        settings: settings that the fit chose, for the model's options.
    """

    friction: JointFriction
    evidence: JointEvidence
    choice: Choice
    intervals: Mapping[str, tuple[float, float]]
    stopped: bool = False
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)


class Task(ABC):
    """One joint's records, the fit of a law to them, and the result of the fit.

    Attributes:
        info: the joint.
        options: options of the user.
        laws: names of the laws to try.
        others: names of parameters that may be bounded beside those of the laws.
        shown: records that the laws are fitted to.
        judges: records that the laws are compared on.
        masks: samples of `judges` that count, (n,) each.
        whole: all records, for the last fit; None if separate logs are held out.
        what: name, unit and root mean square of the measured quantity, for the reason of the choice.
        remarks: remarks on the data, which precede the warnings of a fit.
        notes: changes made to the data, in sentences.
    """

    info: Joint
    options: Options
    laws: Sequence[str]
    others: Sequence[str]
    shown: Sequence[Any]
    judges: Sequence[Any]
    masks: Sequence[np.ndarray]
    whole: Sequence[Any] | None
    what: tuple[str, str, float]
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @abstractmethod
    def fit(self, law: str, records: Sequence[Any], begin_at: Mapping[str, float] | None = None) -> Fit:
        """Return the fit of one law to records, from a cold start or from values by name [SI]."""

    @abstractmethod
    def error(self, one: Fit) -> tuple[float, int]:
        """Return the mean squared error on the fitted data, and the number of samples."""

    def shows(self, one: Fit) -> bool:
        """Return whether the records determine a law's presliding and the law is possible; otherwise another law is preferred."""
        return True

    def differs(self, one: Fit) -> bool:
        """Return whether the residuals of a symmetric law justify a fit by direction; False if there is no such test."""
        return False

    def judges_of(self, one: Fit) -> Sequence[Any]:
        """Return the records on which a fit is compared with the other candidates."""
        return self.judges

    @abstractmethod
    def explains(self, final: Fit, judged: Fit) -> bool:
        """Return whether to use the fit to all data; otherwise the fit without held-out data is used."""

    def sharpen(self, final: Fit) -> Fit:
        """Return the final fit with smaller errors, where the noise allows it; by default the same."""
        return final

    @abstractmethod
    def finish(self, final: Fit, judged: Fit) -> tuple[JointFriction, JointEvidence]:
        """Return friction and evidence from the final fit and from the fit without held-out data."""

    @abstractmethod
    def settings(self, final: Fit, held_out: float) -> dict[str, Any]:
        """Return the settings that the fit chose, for the model's options."""


def fit_joint(task: Task) -> JointFit:
    """Return the fit of one joint.

    Raises:
        InvalidInput: a bound names a parameter that neither laws nor joint have.
        NotIdentifiable: no law can be fitted or judged.
        KeyboardInterrupt: a person interrupted the fit before there was a result to keep.
    """
    name = task.info.name
    check_bounds(task.options.bounds, task.laws, task.others)
    work = work_of(task)
    options = task.options = replace(task.options, progress=work.say)
    candidates: list[Candidate] = []
    failure: BackdriveError | None = None
    stopped = False
    for k, law in enumerate(task.laws):
        among = f", law {k + 1} of {len(task.laws)}" if len(task.laws) > 1 else ""
        work.begin(f"{name}: fitting {law}{among}")
        begun = clock.perf_counter()
        try:
            one = _candidate(task, law, begun)
            candidates.append(one)
            stopped = bool(one.fit and one.fit.interrupted)
        except BackdriveError as error:
            candidates.append(Candidate(name=law, seconds=clock.perf_counter() - begun, remark=error.message))
            failure = error
        except KeyboardInterrupt:
            stopped = True
        if stopped:
            break
    if not any(np.isfinite(c.held_out) for c in candidates):
        if stopped:
            raise KeyboardInterrupt
        raise failure or NotIdentifiable("No law could be judged.", remedy="Record a longer log.")
    what, unit, size = task.what
    choice = choice_.choose(name, candidates, unit, size, what)
    if not stopped and (more := _by_direction(task, choice, candidates, work)) is not None:
        stopped = bool(more.fit and more.fit.interrupted)
        again = choice_.choose(name, [*candidates, more], unit, size, what)
        if again.chosen == more.name:
            choice = again
            candidates.append(more)
        elif np.isfinite(more.held_out):
            words = f"With numbers for each direction, {more.parameters} in all, it leaves {more.held_out:.3g} {unit}"
            choice = replace(choice, reason=f"{choice.reason} {words}; the simpler law is kept.")
    best = choice.candidate().fit
    assert best is not None
    final, remarks = best, list(task.remarks)
    if not stopped:
        final, stopped = _final(task, best, work, remarks)
    if not stopped:
        final = with_misfit(final, best, choice_.ties(choice))
    work.end()
    ends, done = final.intervals_until_stop(
        "covariance" if stopped else options.interval,
        seed=options.seed,
        tick=lambda number: options.say(f"{name}: profile of {number}"),
    )
    if stopped or not done:
        stopped = True
        remarks.append(interruption(task.laws, candidates, done))
    friction, evidence = task.finish(final, best)
    return JointFit(
        friction=replace(friction, warnings=(*remarks, *friction.warnings)),
        evidence=evidence,
        choice=choice,
        intervals={number: e for number, e in ends.items() if not number.startswith("start.")},
        stopped=stopped,
        notes=task.notes,
        settings=task.settings(final, choice.candidate().held_out),
    )


def _final(task: Task, best: Fit, work: Work, remarks: list[str]) -> tuple[Fit, bool]:
    """Return the fit to all data, or the best one if that explains them worse, and whether a person stopped it."""
    final, whole = best, task.whole
    if whole is not None:
        work.begin(f"{task.info.name}: fitting {best.name} to everything")
        again = result_or_none(lambda: task.fit(best.name, whole, best.values))
        stopped = again is None or again.interrupted
        if again is not None and task.explains(again, best):
            final = again
        elif not stopped:
            remarks.append(
                "The fit to all data explains the log worse than the fit without the held-out windows, so the "
                "latter's parameters are used."
            )
        if stopped:
            return final, True
    sharp = result_or_none(lambda: task.sharpen(final)) if task.options.interval == "covariance" else final
    return (final, True) if sharp is None else (sharp, sharp.interrupted)


def work_of(task: Task) -> Work:
    """Return the work of a joint: a fit of every law, and one to all data where windows are held out."""
    samples = sum(map(len, task.masks))
    sizes = [size_of(law, samples) for law in task.laws]
    last = [WHOLE * max(sizes)] if task.whole is not None and sizes else []
    return Work(task.options.say, [*sizes, *last])


def _by_direction(
    task: Task, choice: Choice, candidates: Sequence[Candidate], work: Work
) -> Candidate | None:
    """Return the chosen law with parameters for each direction, fitted like the others; None if residuals do not justify it."""
    one = choice.candidate().fit
    if one is None or task.options.symmetric is not None or not one.problem.shape.rate.SYMMETRIC:
        return None
    law = directions.name_by_direction(one.name)
    if choice.candidate().held_out <= EXACT * task.what[2]:
        return None  # the residual is rounding error
    if law in [c.name for c in candidates] or not task.differs(one):
        return None
    work.begin(f"{task.info.name}: fitting {law}", size_of(law, sum(map(len, task.masks))))
    begun = clock.perf_counter()
    try:
        return result_or_none(lambda: _candidate(task, law, begun))
    except BackdriveError as error:
        return Candidate(name=law, seconds=clock.perf_counter() - begun, remark=error.message)


def _candidate(task: Task, law: str, begun: float) -> Candidate:
    """Return one law, fitted without the held-out data and judged on them."""
    one = task.fit(law, task.shown)
    squares = choice_.held_out_errors(one, task.judges_of(one), task.masks)
    square, count = task.error(one)
    return Candidate(
        name=one.name,
        parameters=len(one.problem.unknowns),
        error=float(np.sqrt(square)),
        held_out=float(np.sqrt(squares.mean())) if squares.size else np.nan,
        aic=count * np.log(max(square, 1e-300)) + 2 * len(one.problem.unknowns),
        seconds=clock.perf_counter() - begun,
        remark=choice_.remark(one.unseen, not slips_too_early(one.values)),
        shown=task.shows(one),
        fit=one,
        windows=squares,
    )


def check_bounds(bounds: Mapping[str, Any], laws: Sequence[str], others: Sequence[str]) -> None:
    """Refuse a bound on an unknown parameter.

    Args:
        bounds: of estimated parameters, by name.
        laws: names of the fitted laws.
        others: names of parameters beside those of the laws.

    Raises:
        InvalidInput: neither a law nor the joint has such a parameter.
    """
    shapes = [LawShape.from_name(law) for law in laws]
    names = dict.fromkeys(n for s in shapes for n in (*s.rate.PARAMETERS, *s.element.PARAMETERS))
    for name in bounds:
        if name.partition("[")[0] not in {*names, *others}:
            raise InvalidInput(
                f"'{name}' is bounded, and neither {', '.join(laws)} nor the joint has it.",
                remedy=f"There is {', '.join(names)}; and {', '.join(others)}.",
            )


def interruption(listed: Sequence[str], candidates: Sequence[Candidate], done: bool) -> str:
    """Return a sentence on an interrupted fit.

    Args:
        listed: names of all laws to be fitted.
        candidates: laws that were fitted.
        done: whether all requested intervals were computed.
    """
    left = [LawShape.from_name(name).name for name in listed[len(candidates) :]]
    said = "The fit was interrupted; this is its best result so far."
    said += f" Not tried: {', '.join(left)}." if left else ""
    return said + ("" if done else " Intervals not yet computed are those of the covariance.")
