"""`fit_law`: fit a friction law to torque given motion, with an uncertainty that accounts for correlated residuals."""

from __future__ import annotations

import warnings as warnings_
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.identification.dynamic import starts as starts_
from backdrive.identification.dynamic.fit import Fit, conclude
from backdrive.identification.dynamic.peak_start import peak_start
from backdrive.identification.dynamic.search import Search, screen
from backdrive.identification.dynamic.stretch import BESIDE, Stretch
from backdrive.identification.dynamic.torque import LONGEST_DELAY, TorqueProblem
from backdrive.identification.dynamic.unknowns import LawShape, Scales
from backdrive.identification.windows import windows_of

FAR = 3.0  # delay above which reversals are shifted before the search [sample]
TRIES = 3  # largest number of searches, each with reversals shifted by the delay of the last one
DESCENTS = 3  # number of starting points that are optimised first
SHORT = 8  # largest number of iterations of each of these
ROUGH = 1e-4  # relative decrease of the cost below which one of these has ended; the last descent goes on from the best
LONGEST_DESCENT = 40  # largest number of iterations from the best of them
STEPS = (2 + DESCENTS) * SHORT + LONGEST_DESCENT  # the guess, the screened ones, and one with less delay
ENOUGH = 60_000  # largest number of samples for all descents but one from their end


def fit_law(  # noqa: PLR0913  (its options are given by keyword)
    law: str | LawShape,
    stretches: Sequence[Stretch],
    *,
    unit: str = "rad",
    counts: float | None = None,
    terms: Sequence[str] = ("inertia", "offset"),
    delay: bool = True,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    known: Mapping[str, float] | None = None,
    scales: Scales | None = None,
    loss: str = "huber",
    begin: int = 48,
    descend: int = DESCENTS,
    iterations: int = LONGEST_DESCENT,
    seed: int = 0,
    begin_at: Mapping[str, float] | None = None,
    tick: Callable[[str, int, float], None] | None = None,
) -> Fit:
    """Fit one law to the torque of one joint given its motion.

    Args:
        law: `rate`, `rate+element`, or a shape with parameters held fixed.
        stretches: of one joint.
        unit: of the joint, `rad` or `m`.
        counts: encoder steps per rad or m, if known.
        terms: other terms of the dynamics to estimate. With `offset`, Coulomb friction is equal in both directions.
        delay: estimate the time by which torque was recorded later than motion.
        bounds: of parameters, terms and delay, by name [SI].
        known: fixed terms of the dynamics, by name [SI].
        scales: typical sizes, which determine the ranges; None: from the data.
        loss: `linear`, `huber` or `absolute`.
        begin: number of starting points that are screened.
        descend: number of these that are optimised for a few iterations.
        iterations: largest number of iterations of the last descent.
        seed: of the starts.
        begin_at: values of a further starting point, by name [SI].
        tick: called with the law's name, the iteration counted over all descents (up to `STEPS` by default), and the cost.

    Raises:
        NotIdentifiable: no motion, constant torque, or too few samples.
        InvalidInput: contradictory bounds.
    """
    shape = LawShape.from_name(law) if isinstance(law, str) else law
    if not stretches or sum(len(s.torque) for s in stretches) < 50:
        raise NotIdentifiable(
            f"{sum(len(s.torque) for s in stretches)} samples are too few to fit '{shape.name}' to.",
            remedy="Record at least 50 samples, better a minute of motion with reversals.",
        )
    shape = shape.beside(terms)
    scales = starts_.scales(stretches, terms, unit, counts, known) if scales is None else scales
    about, dt = 0.0, max(s.dt for s in stretches)
    if delay:
        plain = starts_.subtract_terms(stretches, known or {})
        about = begin_at["delay"] if begin_at else starts_.delay_of(plain, terms, LONGEST_DELAY)
        about = about if abs(about) > FAR * dt else 0.0

    def inform(before: int) -> Callable[[int, float], None]:
        return lambda i, c: tick(shape.name, before + i, c) if tick is not None else None

    def problem_of(part: Sequence[Stretch], about: float) -> TorqueProblem:
        return TorqueProblem(
            shape, part, scales, terms=terms, delay=delay, bounds=bounds, known=known, about=about
        )

    part = windows_of(stretches, ENOUGH)
    if part is not None:
        try:
            problem_of(part, about)
        except NotIdentifiable:  # they show too little motion
            part = None
    for _ in range(TRIES):
        problem = problem_of(part or stretches, about)
        search = Search(problem.residuals, problem.lower, problem.upper, loss=loss)
        points = starts_.starts(problem, scales, begin, seed)
        if begin_at is not None:
            points = np.vstack([problem.point(begin_at), points])
        elif (peak := peak_start(problem, problem.values(points[0]))) is not None:
            points = np.vstack([points, np.clip(problem.point(peak), problem.lower, problem.upper)])
        with warnings_.catch_warnings():
            warnings_.simplefilter("ignore", RuntimeWarning)
            sooner = starts_.with_less_delay(problem, points)
            more = screen(search, sooner, 1) if len(sooner) else sooner
            chosen = np.vstack([points[:1], screen(search, points, descend), more])
            short = [
                search.run(start, iterations=SHORT, tolerance=ROUGH, tick=inform(k * SHORT))
                for k, start in enumerate(chosen)
            ]
            best = min(short, key=lambda f: float(f.residual @ f.residual))
            found = (
                replace(best, interrupted=True)
                if any(f.interrupted for f in short)
                else search.run(best.point, iterations=iterations, tick=inform(len(chosen) * SHORT))
            )
        values = problem.values(found.point)
        late = values.get("delay", 0.0)
        if not shape.element.SET_VALUED or abs(late - about) <= (BESIDE - 2) * dt or found.interrupted:
            break
        about, begin_at, begin, descend = late, values, 2, 1
    if part is not None:
        stopped, problem = found.interrupted, problem_of(stretches, about)
        search = Search(problem.residuals, problem.lower, problem.upper, loss=loss)
        found = search.run(
            problem.point(values), iterations=0 if stopped else iterations, tick=inform((2 + descend) * SHORT)
        )
        found = replace(found, interrupted=stopped or found.interrupted)
    return conclude(problem, found, loss)


LawFit = Fit

__all__ = ["LawFit", "Stretch", "conclude", "fit_law"]
