"""What a law misses, as a part of the errors of its parameters.

Errors of noise alone hold only if the law does. Three things tell what it misses. Without its slowest samples, where friction
crosses zero and breaks away, a fit moves by d, of which noise explains the variance V; where it moves by significantly more,
d^2 - V is added (Hausman, Econometrica 46, 1978). Other laws may explain what was held out as well, with other numbers: the
square of the difference is added (Buckland, Burnham & Augustin, Biometrics 53, 1997). And where the Stribeck velocity is not
told, nor is friction at rest: a narrower peak is possible, as below the slowest sliding of a curve (`curves.widen_below`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from backdrive.identification import noise
from backdrive.identification.crossing_fit import SAID
from backdrive.identification.curves import PEAK
from backdrive.identification.dynamic import words
from backdrive.identification.dynamic.covariance import inverse, slope_of_scores
from backdrive.identification.dynamic.fit import Fit
from backdrive.identification.dynamic.torque import TorqueProblem
from backdrive.identification.dynamic.uncertainty import WEAK
from backdrive.identification.terms import RIGID
from backdrive.model import Covariance

SLOWEST = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)  # shares of the samples that are left out, the slowest ones [-]
SURE = 2.5  # least change of a coordinate that counts, relative to what noise explains [standard error]
MOST = 10.0  # largest growth of a coordinate's variance without the slow samples for which its change is told [-]
LEAST = 50  # least number of samples, and of those that are left out


def with_misfit(fit: Fit, best: Fit, others: Sequence[Fit] = ()) -> Fit:
    """Return a fit whose errors count what its law misses, with a sentence on each number that depends on it much.

    Args:
        fit: to all data.
        best: of the same law, without the held-out data.
        others: of other laws, that explain the held-out data as well, without them too.
    """
    free = np.isfinite([fit.standard_errors[name] for name in fit.problem.names])
    if not free.any() or fit.interrupted:
        return fit
    slow, sentences = without_slow(fit, free)
    rest, unseen = at_rest(fit, free)
    added = [slow, rest]
    for other in others:
        apart, said = between(fit, best, other, free)
        added.append(np.outer(apart, apart))
        sentences += said
    return _widen(fit, np.sum(added, axis=0), unseen, sentences)


def between(fit: Fit, best: Fit, other: Fit, free: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Return by how much the numbers of two laws differ [search coordinate], (P,), 0 where they mean different things.

    Args:
        fit: whose coordinates are meant.
        best: of the same law.
        other: of another law, to the same data as `best`.
        free: coordinates with an error, (P,).
    """
    same = type(best.law.rate) is type(other.law.rate)
    apart, said = np.zeros(free.size), []
    for i, u in enumerate(fit.problem.unknowns):
        alike = u.name in (*RIGID, "delay") or (same and u.name in best.law.rate.PARAMETERS)
        told = np.isfinite(other.standard_errors.get(u.name, np.nan)) and u.name not in other.unseen
        if free[i] and alike and told and u.name in best.values:
            apart[i] = float(u.inward(other.values[u.name]) - u.inward(best.values[u.name]))
            if _is_much(fit, u.name, abs(other.values[u.name] - best.values[u.name])):
                said.append(
                    f"'{other.name}' explains what was held out as well, with {other.values[u.name]:.3g} instead of "
                    f"{best.values[u.name]:.3g} for '{u.name}': its error includes the difference."
                )
    return apart, said


def without_slow(fit: Fit, free: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Return what slow samples move beyond noise, as a covariance of the search coordinates, (P, P), and sentences.

    Args:
        fit: of torque; another one is not judged, nor one with numbers of the reversals.
        free: coordinates with an error, (P,).
    """
    problem, found = fit.problem, fit.found
    nothing = np.zeros((free.size, free.size))
    instants = problem.instants if found.instants is None else found.instants
    if not isinstance(problem, TorqueProblem) or instants.size < LEAST or fit.through == SAID:
        return nothing, []
    speed = np.concatenate([np.r_[np.abs(s.velocity), np.zeros(noise.LONGEST)] for s in problem.stretches])
    speed = speed[np.minimum(instants, speed.size - 1)]
    size = np.linalg.norm(found.jacobian[:, free], axis=0)
    J, score = found.jacobian[:, free] / size, found.weight * found.residual
    moves, most, shares = [], np.zeros(size.size), np.zeros(size.size)
    for share in SLOWEST:
        slow = speed <= np.quantile(speed, share)
        if not LEAST <= np.count_nonzero(slow) < slow.size:
            continue
        moved = _shift(J, score, found.weight, instants, slow) / size
        shares = np.where(np.abs(moved) > most, share, shares)
        most = np.maximum(most, np.abs(moved))
        moves.append(moved)
    total = np.zeros((size.size, size.size)) if not moves else sum(np.outer(m, m) for m in moves)
    scale = most / np.sqrt(np.maximum(np.diag(total), 1e-300))
    nothing[np.ix_(free, free)] = total * np.outer(scale, scale)
    said = []
    for i, (row, share) in enumerate(zip(np.flatnonzero(free), shares, strict=True)):
        u = problem.unknowns[row]
        change = most[i] * abs(u.slope(fit.values[u.name]))
        if _is_much(fit, u.name, change):
            said.append(
                f"'{u.name}' ({fit.values[u.name]:.3g}) rests on the slowest {100.0 * share:g} % of the samples: without them it "
                f"changes by {change:.2g}, which its error includes. The law does not hold there: compare others, or add slow "
                "motion."
            )
    return nothing, said


def at_rest(fit: Fit, free: np.ndarray) -> tuple[np.ndarray, dict[str, str]]:
    """Return the covariance of break-away friction that a fit to sliding does not see, (P, P), and sentences by name.

    Args:
        fit: of torque; another one is not judged.
        free: coordinates with an error, (P,).
    """
    added, found = np.zeros((free.size, free.size)), {}
    if isinstance(fit.problem, TorqueProblem) and fit.problem.shape.element.SET_VALUED:
        for i, u in enumerate(fit.problem.unknowns):
            fall = u.name.replace("breakaway", "stribeck_velocity")
            if free[i] and fall != u.name and fall in fit.unseen and u.name not in fit.unseen:
                value = fit.values[u.name]
                added[i, i] = (PEAK * value / u.slope(value)) ** 2
                found |= words.unseen([u.name], np.array([PEAK]), np.eye(1), WEAK)[0]
    return added, found


def _shift(
    J: np.ndarray, score: np.ndarray, weight: np.ndarray, instants: np.ndarray, slow: np.ndarray
) -> np.ndarray:
    """Return how far the coordinates move without slow samples, less what noise explains; 0 where that is all, (P,).

    The fit without them is a Gauss-Newton step away, and the change a weighted sum of the noise, whose variance follows from
    the autocorrelation of the residuals.

    Args:
        J: derivatives of the residuals, of unit length, (m, P).
        score: weighted residuals, (m,).
        weight: of the residuals, (m,).
        instants: index of the sample of each residual, (m,).
        slow: samples to leave out, (m,).
    """
    whole, rest = inverse(J.T @ (weight[:, None] * J)), J * ~slow[:, None]
    without = inverse(rest.T @ (weight[:, None] * rest))
    at = instants - instants[0]
    Z, scores, used = np.zeros((at[-1] + 1, J.shape[1])), np.zeros(at[-1] + 1), np.zeros(at[-1] + 1, bool)
    Z[at], scores[at], used[at] = rest @ without - J @ whole, score, True
    covariance, _ = noise.covariance_of_scores(Z, scores, used, np.linalg.pinv(Z.T @ Z))
    variance = np.maximum(np.diag(covariance), 0.0) / slope_of_scores(weight) ** 2
    moved = -(Z[at].T @ score)
    told = (np.diag(without) < MOST * np.diag(whole)) & (np.abs(moved) > SURE * np.sqrt(variance))
    return np.where(told, np.sign(moved) * np.sqrt(np.maximum(moved**2 - variance, 0.0)), 0.0)


def _is_much(fit: Fit, name: str, change: float) -> bool:
    """Return whether a change makes a number weak that was not: larger than `WEAK` of it, and than its error."""
    known = name in fit.law.rate.PARAMETERS and name not in fit.unseen
    return known and change > max(WEAK * abs(fit.values[name]), fit.standard_errors[name])


def _widen(fit: Fit, added: np.ndarray, unseen: Mapping[str, str], sentences: Sequence[str]) -> Fit:
    """Return a fit whose covariance is larger by a matrix in search coordinates, (P, P), with further warnings."""
    if not added.any():
        return fit
    problem = fit.problem
    slope = np.array([u.slope(fit.values[u.name]) for u in problem.unknowns])
    more = added * np.outer(slope, slope)
    errors = {
        name: float(np.hypot(fit.standard_errors[name], np.sqrt(more[i, i])))
        for i, name in enumerate(problem.names)
    }
    covariance = fit.covariance
    if covariance is not None:
        rows = [problem.names.index(name) for name in covariance.names]
        covariance = Covariance.of(covariance.names, covariance.array() + more[np.ix_(rows, rows)])
    return replace(
        fit,
        standard_errors=problem.shape.complete(errors),
        covariance=covariance,
        misfit=added,
        unseen={**fit.unseen, **unseen},
        warnings=(*fit.warnings, *unseen.values(), *dict.fromkeys(sentences)),
    )
