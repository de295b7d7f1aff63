"""The result of a search: a law's parameters with errors, parameters at a bound, and parameters that are not determined."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from backdrive._catalog import lookup
from backdrive.engine import Axis
from backdrive.identification import regression
from backdrive.identification.dynamic import words
from backdrive.identification.dynamic.covariance import search_covariance
from backdrive.identification.dynamic.problem import Problem
from backdrive.identification.dynamic.search import SearchResult
from backdrive.identification.dynamic.torque import TorqueProblem
from backdrive.identification.dynamic.uncertainty import WEAK, intervals
from backdrive.identification.evidence import sentences
from backdrive.identification.motion_bins import BIN_TIME
from backdrive.identification.options import Interval
from backdrive.identification.slip import between_samples
from backdrive.laws import Law
from backdrive.model import Covariance

NEAR = 1e-6  # distance from a bound below which a search coordinate counts as at the bound


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """One law fitted to the torque of one joint given motion, or with axis and drive to its motion given the drive's input.

    Attributes:
        law: the fitted law.
        name: of the law.
        values: all estimated parameters, by name [SI].
        standard_errors: of the parameters [SI]; NaN if unknown.
        covariance: of the parameters whose errors are known; shares enter as logarithms of their ratios to the last share.
        at_bound: names of the parameters that ended at a bound of their range.
        unseen: parameters that these motions do not determine, each with a sentence.
        rms: root mean square of the fitted residual [N.m or N; rad, m, rad/s or m/s for a fit of motion].
        mean_absolute: mean absolute value of the fitted residual [the same unit].
        samples: number of fitted samples.
        aic: Akaike's information criterion for independent residuals; smaller is better.
        evaluations: number of evaluations of all records.
        converged: whether the search converged.
        interrupted: whether a person stopped the search.
        warnings: what makes the result suspect, in sentences.
        problem: the fitted problem, for predictions.
        found: the end of the search, for profiles and bootstraps.
        loss: name of the minimised loss.
        misfit: what the law misses, as a part of the covariance of the search coordinates (`misfit`), (P, P); None: not judged.
        through: what a fit through the reversals told of the numbers, in a sentence; empty: nothing.
    """

    law: Law
    name: str
    values: Mapping[str, float]
    standard_errors: Mapping[str, float]
    covariance: Covariance | None
    at_bound: tuple[str, ...]
    unseen: Mapping[str, str]
    rms: float
    mean_absolute: float
    samples: int
    aic: float
    evaluations: int
    converged: bool
    interrupted: bool
    warnings: tuple[str, ...]
    problem: Problem = field(repr=False)
    found: SearchResult = field(repr=False)
    loss: str
    misfit: np.ndarray | None = field(repr=False, default=None)
    through: str = ""

    @property
    def axis(self) -> Axis:
        """The axis with the fitted law and drive; gains that differ from log to log are not included.

        Raises:
            InvalidInput: torque was fitted, which does not determine an axis with its drive.
        """
        return self.problem.axis_of(self.values)

    def interval(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a parameter; it is asymmetric if the search uses the parameter's logarithm.

        Raises:
            UnknownName: the fit has no such number.
        """
        return lookup(name, self.intervals(), "number of this fit")

    def intervals(
        self, method: Interval = "covariance", *, seed: int = 0, tick: Callable[[str], None] | None = None
    ) -> dict[str, tuple[float, float]]:
        """Return the 95 % interval of every parameter; see `dynamic.uncertainty`.

        Args:
            method: `covariance`, `profile` (all other parameters are refitted) or `bootstrap` (over windows).
            seed: of the bootstrap.
            tick: called with the name of each parameter before its profile.

        Raises:
            UnknownName: no such method.
            InvalidInput: a profile of absolute deviations.
        """
        return self.intervals_until_stop(method, seed=seed, tick=tick)[0]

    def intervals_until_stop(
        self, method: Interval = "covariance", *, seed: int = 0, tick: Callable[[str], None] | None = None
    ) -> tuple[dict[str, tuple[float, float]], bool]:
        """Return the intervals, and False if an interruption left some parameters with the interval of the covariance."""
        ends, done = intervals(
            self.problem,
            self.found,
            self.standard_errors,
            method,
            loss=self.loss,
            step=self.problem.STEP,
            seed=seed,
            tick=tick,
        )
        return self.problem.shape.complete(ends), done

    def predict(self, records: Sequence[Any] | None = None, *, friction: bool = False) -> list[np.ndarray]:
        """Return what the fit predicts, each (n,): torque [N.m or N], or motion from its measured start [rad, m, rad/s or m/s].

        Args:
            records: stretches, or motion logs, of the joint; None: those of the fit.
            friction: return friction alone, without the other terms of the dynamics (fits of torque only).
        """
        return [x[0] for x in self.problem.predict([self.values], records, friction=friction)]

    def errors(self, records: Sequence[Any] | None = None) -> list[np.ndarray]:
        """Return predicted minus measured values at the samples that count, for each record, (m,).

        Args:
            records: stretches, or motion logs, of the joint; None: those of the fit.
        """
        series = self.problem.series(records)
        return [(x - y)[counts] for x, (y, counts) in zip(self.predict(records), series, strict=True)]

    def misses(self, records: Sequence[Any]) -> list[np.ndarray]:
        """Return measured minus predicted values of each record, without what no law can explain (see `bracket`), (n,).

        Args:
            records: stretches, or motion logs, of the joint.
        """
        series = zip(records, self.predict(records), self.problem.series(records), strict=True)
        return [y - np.clip(y, *self.problem.bracket(self.values, record, x)) for record, x, (y, _) in series]


def conclude(
    problem: Problem,
    found: SearchResult,
    loss: str = "huber",
    whiten: Callable[[np.ndarray], np.ndarray] | None = None,
    told: np.ndarray | None = None,
    missed: np.ndarray | None = None,
) -> Fit:
    """Return the fit at the end of a search: values, errors, parameters at a bound and parameters not determined.

    Args:
        problem: whose residuals were fitted.
        found: end of the search.
        loss: of the search.
        whiten: what the search did to the residuals, (..., m); None: nothing.
        told: derivatives of the residuals whose least squares have the errors of the numbers, (m, P); None: those of the search.
        missed: a change of the point that should have been made, whose square its covariance has, (P,); None: there is none.
    """
    before, found = found, problem.sort_elements(found)
    told = found.jacobian if told is None else problem.sort_elements(replace(before, jacobian=told)).jacobian
    values = problem.values(found.point)
    low, inputs = found.point <= problem.lower + NEAR, problem.encoder(found.point)
    at_bound = low | (found.point >= problem.upper - NEAR)
    cov = search_covariance(
        told,
        found.residual,
        found.weight,
        ~at_bound,
        problem.instants if found.instants is None else found.instants,
        inputs if whiten is None else whiten(inputs),
        found.independent,
    )
    matrix = cov.matrix + _between_samples(problem, found, cov.matrix)
    matrix += 0.0 if missed is None else np.outer(missed, missed)
    root = np.sqrt(np.diag(matrix))
    errors, relative = {}, np.full(len(root), np.inf)
    slope = np.array([u.slope(values[u.name]) for u in problem.unknowns])
    for i, u in enumerate(problem.unknowns):
        errors[u.name] = float(root[i] * slope[i])
        least, most = problem.yardstick(u)
        size = min(max(1.0 if u.ratio else abs(values[u.name]), least), most)
        if u.name == "delay" and at_bound[i]:
            relative[i] = 0.0  # the warning on the bound suffices
        elif np.isfinite(root[i]) and size > 0.0:
            relative[i] = errors[u.name] / size
    asked = [i for i, name in enumerate(problem.names) if not name.startswith("start.")]
    unseen, notes = words.unseen(
        [problem.names[i] for i in asked], relative[asked], cov.correlation[np.ix_(asked, asked)], WEAK
    )
    law = problem.shape.law(values)
    for i in np.flatnonzero(at_bound):
        u, end = problem.unknowns[i], "lower" if low[i] else "upper"
        notes.append(
            f"'{u.name}' ended at the {end} bound of its range, {values[u.name]:.3g}{'' if u.unit == '1' else f' {u.unit}'}."
        )
    advice, shape = law.element.advice(law.rate), problem.shape
    ties = {a: b for a, b in shape.ties.items() if a in shape.rate.TIES and "offset" in problem.names}
    notes += sentences(
        (advice, advice or ""),
        (found.interrupted, "The search was interrupted; this is its best result so far."),
        (
            not found.interrupted and not found.converged,
            "The search did not converge within its iterations; the best point is given.",
        ),
        (ties, words.alike(ties)),
    )
    m, rms = len(found.residual), float(np.sqrt(np.mean(found.residual**2)))
    return Fit(
        law=law,
        name=problem.shape.name,
        values=problem.shape.complete(values),
        standard_errors=problem.shape.complete(errors),
        covariance=Covariance.of(problem.names, matrix * np.outer(slope, slope)),
        at_bound=tuple(problem.names[i] for i in np.flatnonzero(at_bound)),
        unseen=unseen,
        rms=rms,
        mean_absolute=float(np.abs(found.residual).mean()),
        samples=m,
        aic=float(m * np.log(max(rms**2, 1e-300)) + 2 * len(problem.unknowns)),
        evaluations=found.evaluations,
        converged=found.converged,
        interrupted=found.interrupted,
        warnings=tuple(notes),
        problem=problem,
        found=found,
        loss=loss,
    )


def with_numbers(
    fit: Fit, names: Sequence[str], numbers: np.ndarray, covariance: np.ndarray, errors: np.ndarray
) -> Fit | None:
    """Return a fit with other numbers than those at the end of its search; None where one is outside of its range.

    Args:
        fit: whose other numbers stay.
        names: of the numbers.
        numbers: (n,) [SI].
        covariance: of them, (n, n).
        errors: their standard errors, (n,).
    """
    problem = fit.problem
    values = {**fit.values, **dict(zip(names, numbers.tolist(), strict=True))}
    known = {**fit.standard_errors, **dict(zip(names, errors.tolist(), strict=True))}
    limits = zip(problem.unknowns, problem.lower, problem.upper, strict=True)
    if not all(low < u.inward(values[u.name]) < high for u, low, high in limits):
        return None
    return replace(
        fit,
        law=problem.shape.law(values),
        values=problem.shape.complete(values),
        standard_errors=problem.shape.complete(known),
        covariance=Covariance.of(names, covariance),
        found=replace(fit.found, point=problem.point(values)),
    )


def _between_samples(problem: Problem, found: SearchResult, matrix: np.ndarray) -> np.ndarray:
    """Return the covariance by what the delay of a torque misses between samples [search coordinate], (P, P).

    Args:
        problem: whose residuals were fitted.
        found: end of the search.
        matrix: covariance by noise, (P, P).
    """
    added = np.zeros(matrix.shape)
    if "delay" not in problem.names or not isinstance(problem, TorqueProblem):
        return added
    k, free = problem.names.index("delay"), np.isfinite(np.diag(matrix))
    if not free[k]:
        return added
    X = found.jacobian[:, free] * np.sqrt(found.weight)[:, None]
    at = int(np.count_nonzero(free[:k]))
    slope = problem.unknowns[k].slope(problem.values(found.point)["delay"])
    others = np.delete(X, at, axis=1)
    move = np.insert(-regression.solve(others.T @ others, others.T @ X[:, at]), at, 1.0)
    period = max(s.dt for s in problem.stretches)
    width = max(1, round(BIN_TIME / period)) if found.instants is None else 1
    added[np.ix_(free, free)] = between_samples(X, at, period, width) / slope**2 * np.outer(move, move)
    return added
