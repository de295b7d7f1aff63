"""`fit_law`: a friction law from logs, torque given motion, with honest uncertainty."""

from __future__ import annotations

import warnings as warnings_
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import BackdriveError, InvalidInput, NotIdentifiable
from backdrive.identification.dynamic import starts as starts_
from backdrive.identification.dynamic import words
from backdrive.identification.dynamic.intervals import intervals
from backdrive.identification.dynamic.search import Found, Search, screen
from backdrive.identification.dynamic.torque import (
    BESIDE,
    LONGEST_DELAY,
    Stretch,
    TorqueProblem,
    earlier,
    stretch,
)
from backdrive.identification.dynamic.uncertainty import WEAK, covariance
from backdrive.identification.dynamic.unknowns import LawShape, Scales, shares
from backdrive.identification.options import Interval
from backdrive.laws import Law

NEAR = 1e-6  # a coordinate so near to its bound is at it
FAR = 3.0  # samples from which on a delay is looked for before the search
TRIES = 3  # of reversals left out where the delay puts them
#: What may be 0 -> times its scale, below which an error counts as small however small the value.
LOOSE = {"delay": 50.0, "offset": 1.0, "gravity_sin": 1.0, "gravity_cos": 1.0}


@dataclass(frozen=True, kw_only=True, eq=False)
class LawFit:
    """One law fitted to the stretches of one joint.

    Attributes:
        law: the law that was found.
        name: of the law.
        values: every number that was sought, by name [SI].
        standard_errors: of them [SI]; NaN where there is none.
        at_bound: names of those that ended at a bound of their range.
        unseen: those that the motion does not show, each with a sentence.
        rms: of measured less predicted torque on the stretches of the fit [N.m or N].
        samples: that were fitted.
        aic: Akaike's information criterion for independent residuals; smaller is better.
        converged: the search came to rest.
        interrupted: a person stopped it.
        warnings: what makes the result suspect, in sentences.
        problem: what was fitted, for predictions.
        found: where the search ended, for profiles and bootstraps.
        loss: that was minimised.
    """

    law: Law
    name: str
    values: Mapping[str, float]
    standard_errors: Mapping[str, float]
    at_bound: tuple[str, ...]
    unseen: Mapping[str, str]
    rms: float
    samples: int
    aic: float
    converged: bool
    interrupted: bool
    warnings: tuple[str, ...]
    problem: TorqueProblem = field(repr=False)
    found: Found = field(repr=False)
    loss: str = "huber"

    def interval(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a number; for what is sought in its logarithm it is asymmetric.

        Raises:
            UnknownName: the fit has no such number.
        """
        return lookup(name, self.intervals(), "number of this fit")

    def intervals(
        self, method: Interval = "covariance", *, seed: int = 0, tick: Callable[[str], None] | None = None
    ) -> dict[str, tuple[float, float]]:
        """Return the 95 % interval of every number; see `dynamic.intervals`.

        Args:
            method: `covariance`, `profile` (all others are fitted again along the number) or `bootstrap` (over windows).
            seed: of the bootstrap.
            tick: called with the name before the profile of each number.

        Raises:
            UnknownName: no such method.
            InvalidInput: a profile of absolute deviations.
        """
        return self.intervals_until_stopped(method, seed=seed, tick=tick)[0]

    def intervals_until_stopped(
        self, method: Interval = "covariance", *, seed: int = 0, tick: Callable[[str], None] | None = None
    ) -> tuple[dict[str, tuple[float, float]], bool]:
        """Return the same, and whether no interruption left numbers with the interval of the covariance."""
        found, done = intervals(
            self.problem, self.found, self.standard_errors, method, loss=self.loss, seed=seed, tick=tick
        )
        return self.problem.shape.complete(found), done

    def predict(self, stretches: Sequence[Stretch], *, friction: bool = False) -> list[np.ndarray]:
        """Return the torque that the fit predicts for stretches [N.m or N], each (n,).

        Args:
            stretches: motions of the joint.
            friction: alone, without the terms of the dynamics.
        """
        return [tau[0] for tau in self.problem.predict([self.values], list(stretches), friction=friction)]

    def misses(self, stretches: Sequence[Stretch]) -> list[np.ndarray]:
        """Return measured less predicted torque [N.m or N], each (n,).

        Friction that jumps at a reversal is at that sample anything between what it is before and after: when within the
        sampling time the joint turned, no law can say.
        """
        found = []
        for s, tau in zip(stretches, self.predict(stretches)):
            low = high = tau
            if self.law.element.SET_VALUED and len(tau) > 2:
                way = np.sign(earlier(s.velocity, self.values.get("delay", 0.0) / s.dt))
                turns = np.flatnonzero(way[1:] != way[:-1])
                near = np.unique(np.clip(turns[:, None] + np.arange(-1, 3), 1, len(tau) - 2))
                low, high = tau.copy(), tau.copy()
                around = np.array([tau[near - 1], tau[near], tau[near + 1]])
                low[near], high[near] = around.min(axis=0), around.max(axis=0)
            found.append(s.torque - np.clip(s.torque, low, high))
        return found


def fit_law(
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
    descend: int = 3,
    iterations: int = 40,
    seed: int = 0,
    begin_at: Mapping[str, float] | None = None,
    tick: Callable[[str, int, float], None] | None = None,
) -> LawFit:
    """Fit one law to stretches of one joint, torque given motion.

    Args:
        law: `rate`, `rate+element`, or a shape with parameters held fixed.
        stretches: of one joint.
        unit: of the joint, `rad` or `m`.
        counts: encoder steps per rad or m, if known.
        terms: of the rest of the dynamics that are sought too; beside `offset` Coulomb friction is alike in both directions.
        delay: seek the time by which torque was recorded later than motion.
        bounds: of parameters, terms and delay, by name [SI].
        known: terms of the dynamics that are not sought, by name [SI].
        scales: sizes that ranges follow from; None: read off the data.
        loss: `linear`, `huber` or `absolute`.
        begin: starts that are screened.
        descend: of them that descend.
        iterations: of a descent at most.
        seed: of the starts.
        begin_at: values to begin at besides the guess, by name [SI].
        tick: called with the law's name, the iteration and the cost.

    Raises:
        NotIdentifiable: no motion, constant torque, or too few samples.
        InvalidInput: contradictory bounds.
    """
    shape = LawShape.named(law) if isinstance(law, str) else law
    if not stretches or sum(len(s.torque) for s in stretches) < 50:
        raise NotIdentifiable(
            f"{sum(len(s.torque) for s in stretches)} samples are too few to fit '{shape.name}' to.",
            remedy="Record at least 50 samples, better a minute of motion with reversals.",
        )
    shape = shape.beside(terms)
    scales = starts_.scales(stretches, terms, unit, counts, known) if scales is None else scales
    about, dt = 0.0, max(s.dt for s in stretches)
    if delay:
        plain = starts_.without_known(stretches, known or {})
        about = begin_at["delay"] if begin_at else starts_.delay_of(plain, terms, LONGEST_DELAY)
        about = about if abs(about) > FAR * dt else 0.0
    inform = None if tick is None else lambda i, c: tick(shape.name, i, c)
    for _ in range(TRIES):
        problem = TorqueProblem(
            shape, stretches, scales, terms=terms, delay=delay, bounds=bounds, known=known, about=about
        )
        search = Search(problem.residuals, problem.lower, problem.upper, loss=loss)
        points = starts_.starts(problem, scales, begin, seed)
        if begin_at is not None:
            points = np.vstack([problem.point(begin_at), points])
        with warnings_.catch_warnings():
            warnings_.simplefilter("ignore", RuntimeWarning)
            chosen = np.vstack([points[:1], screen(search, points, descend)])
            short = [search.run(start, iterations=8) for start in chosen]
            best = min(short, key=lambda f: float(f.residual @ f.residual))
            found = (
                replace(best, interrupted=True)
                if any(f.interrupted for f in short)
                else search.run(best.point, iterations=iterations, tick=inform)
            )
        values = problem.values(found.point)
        late = values.get("delay", 0.0)
        if not shape.element.SET_VALUED or abs(late - about) <= (BESIDE - 2) * dt or found.interrupted:
            break
        about, begin_at, begin, descend = late, values, 2, 1
    return conclude(problem, found, loss)


def conclude(problem: TorqueProblem, found: Found, loss: str = "huber") -> LawFit:
    """Return what a search's end says: values, errors, what is at a bound and what was not seen."""
    found = problem.ordered(found)
    values = problem.values(found.point)
    at_bound = (found.point <= problem.lower + NEAR) | (found.point >= problem.upper - NEAR)
    edges = np.cumsum([int(s.judged.sum()) for s in problem.stretches])
    cov = covariance(
        found.jacobian,
        found.residual,
        found.weight,
        ~at_bound,
        edges.tolist(),
        problem.encoder(found.point),
    )
    root = np.sqrt(np.diag(cov.matrix))
    errors, relative = {}, np.full(len(problem.unknowns), np.inf)
    largest = max(float(np.abs(s.torque).max()) for s in problem.stretches)
    for i, u in enumerate(problem.unknowns):
        errors[u.name] = float(root[i] * u.slope(values[u.name]))
        size = 1.0 if u.ratio else abs(values[u.name])
        if u.name in LOOSE:
            size = min(
                max(size, LOOSE[u.name] * u.scale), max(largest, u.scale) if u.name != "delay" else np.inf
            )
        if np.isfinite(root[i]) and size > 0:
            relative[i] = errors[u.name] / size
    for i, u in enumerate(problem.unknowns):
        if u.name == "delay" and at_bound[i]:
            relative[i] = 0.0  # said below
    unseen, sentences = words.unseen(problem.names, relative, cov.correlation, WEAK)
    law = problem.shape.law(values)
    m = len(found.residual)
    rms = float(np.sqrt(np.mean(found.residual**2)))
    notes = list(sentences)
    names = tuple(u.name for u, hit in zip(problem.unknowns, at_bound) if hit)
    for u, hit in zip(problem.unknowns, at_bound):
        if hit:
            end = (
                "lower"
                if values[u.name] <= u.lower * (1 + 1e-5) + 1e-300
                or found.point[problem.names.index(u.name)]
                <= problem.lower[problem.names.index(u.name)] + NEAR
                else "upper"
            )
            notes.append(f"'{u.name}' ended at the {end} bound of its range, {values[u.name]:.3g} {u.unit}.")
    if advice := law.element.advice(law.rate):
        notes.append(advice)
    if found.interrupted:
        notes.append("The search was interrupted; this is the best that it had found.")
    elif not found.converged:
        notes.append("The search did not come to rest in its iterations; the best point is given.")
    if problem.shape.ties:
        notes.append(words.alike(problem.shape.ties))
    return LawFit(
        law=law,
        name=problem.shape.name,
        values=problem.shape.complete(values),
        standard_errors=problem.shape.complete(errors),
        at_bound=names,
        unseen=unseen,
        rms=rms,
        samples=m,
        aic=float(m * np.log(max(rms**2, 1e-300)) + 2 * len(problem.unknowns)),
        converged=found.converged,
        interrupted=found.interrupted,
        warnings=tuple(notes),
        problem=problem,
        found=found,
        loss=loss,
    )


__all__ = ["BackdriveError", "InvalidInput", "LawFit", "Stretch", "conclude", "fit_law", "shares", "stretch"]
