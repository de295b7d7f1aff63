"""What the encoder's rounding does to a fit of torque: it takes from the inertia, and hides what is told of the delay.

    x += (J'WJ - S)^-1 g,     S = mean of E'WE,     g = mean of E'W r

J, W: derivatives of the residuals by the search coordinates x, and their weights; E, r: what rounding adds to the derivatives and
to the residuals, by draws (W. Fuller, Measurement Error Models, 1987, Sec. 1.2). The motion is rounded once more at a random phase
and low-passed; E has its acceleration for the inertia, and minus the rate of change of r for the delay; averaged and whitened like
the residuals. Where viscous friction outweighs inertia, a delay is told apart from an inertia by the jerk alone, of which rounding
is a much larger share than of the acceleration: then a little less inertia looks like a torque that is much too early.

The errors grow likewise, to A C A' with A = (J'WJ - S)^-1 J'WJ and the covariance C. Where rounding is nearly all that a direction
has, it is taken as `MOST` of it, so that the errors stay finite. The numbers stay where a change would be more than the linear step
may claim.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from backdrive.identification.delay import earlier
from backdrive.identification.dynamic.fit import NEAR, Fit, conclude
from backdrive.identification.dynamic.search import Search, SearchResult
from backdrive.identification.dynamic.stretch import Stretch, with_error
from backdrive.identification.dynamic.torque import DRAWS, TorqueProblem

FELT = 0.01  # share of what determines a direction below which rounding is not felt [-]
MOST = 0.9  # largest part of what determines a direction that is taken as noise [-]
LARGE = 0.3  # the same for the inertia alone [-]
FARTHEST = 2.0  # largest change of a number besides inertia and delay [standard error]
WORSE = 1.02  # largest cost, relative to that of the fit [-]
FLAT = 1e-14  # least curvature of a direction, relative to the largest [-]


def restore_inertia(fit: Fit, whiten: Callable[[np.ndarray], np.ndarray] | None = None) -> Fit | None:
    """Return a fit of torque with what rounding took from inertia and delay given back, and with the errors that it leaves.

    Args:
        fit: to all samples that count, or to their whitened means.
        whiten: what its search did to the residuals, (..., m); None: nothing.

    Returns:
        The fit, the same where rounding is not felt or the inertia is known; None if rounding determines the inertia to more
        than `LARGE`.
    """
    problem, found = fit.problem, fit.found
    left = found.interrupted or fit.at_bound or "inertia" not in problem.names
    if left or not isinstance(problem, TorqueProblem) or not problem.count > 0.0:
        return fit
    errors = np.array([fit.standard_errors[name] for name in problem.names])
    free = (found.point > problem.lower + NEAR) & (found.point < problem.upper - NEAR)
    free &= np.isfinite(found.jacobian).all(axis=0) & np.isfinite(errors) & (errors > 0.0)
    at = problem.names.index("inertia")
    if not free[at]:
        return fit
    J, block = found.jacobian[:, free], np.ix_(free, free)
    H = J.T @ (found.weight[:, None] * J)
    size = np.sqrt(np.diag(H))
    value, vector = np.linalg.eigh(H / np.outer(size, size))
    curved = np.sqrt(np.maximum(value, FLAT * value[-1]))
    ways = vector / curved / size[:, None]  # along each of which the cost rises alike
    S, g = _of_rounding(fit, whiten, lambda S: float(np.linalg.eigvalsh(ways.T @ S[block] @ ways)[-1]))
    share, turn = np.linalg.eigh(ways.T @ S[block] @ ways)
    k = int(np.count_nonzero(free[:at]))
    if share[-1] <= FELT:
        return fit
    if S[at, at] * float(ways[k] @ ways[k]) > LARGE:
        return None
    ways = ways @ turn
    restored = ways / (1.0 - np.minimum(share, MOST))  # times ways.T: (J'WJ - S)^-1
    move, grown = np.zeros_like(found.point), np.eye(len(found.point))
    move[free], grown[block] = restored @ (ways.T @ g[free]), restored @ ways.T @ H
    return conclude(problem, _shift(fit, whiten, move, errors), fit.loss, whiten, grown)


def _shift(
    fit: Fit, whiten: Callable[[np.ndarray], np.ndarray] | None, move: np.ndarray, errors: np.ndarray
) -> SearchResult:
    """Return the end of a search at another point; the same where that is too far, at a bound, or fits worse.

    Args:
        fit: whose search ended.
        whiten: what the search did to the residuals; None: nothing.
        move: of its point, (P,).
        errors: standard errors of the fit, (P,).
    """
    problem, found = fit.problem, fit.found
    point, moves = found.point + move, move != 0.0
    low, high = problem.lower + NEAR, problem.upper - NEAR
    far = [
        abs(m * u.slope(fit.values[u.name])) > FARTHEST * e
        for m, u, e in zip(move, problem.unknowns, errors, strict=True)
        if m and u.name not in ("inertia", "delay")
    ]
    if any(far) or np.any(moves & ((point <= low) | (point >= high))):
        return found
    search = Search(
        problem.residuals if whiten is None else lambda p: whiten(problem.residuals(p)),
        problem.lower,
        problem.upper,
        loss=fit.loss,
    )
    residual = search.evaluate(point[None])[0]
    if not search.cost(residual, search.scale(found.residual)) <= WORSE * found.cost:
        return found
    after = replace(search.at(point, residual), instants=found.instants, independent=found.independent)
    return replace(after, converged=found.converged, evaluations=found.evaluations + search.evaluations)


def _of_rounding(
    fit: Fit, whiten: Callable[[np.ndarray], np.ndarray] | None, share: Callable[[np.ndarray], float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return what rounding adds to the normal equations, S, (P, P), and to their right-hand side, g, (P,).

    Args:
        fit: of a `TorqueProblem`.
        whiten: what its search did to the residuals; None: nothing.
        share: largest share of S in what determines the fit: a first draw tells whether rounding is felt at all.
    """
    problem, weight = fit.problem, fit.found.weight
    assert isinstance(problem, TorqueProblem)
    at, late = [problem.values(fit.found.point)], fit.values.get("delay", 0.0)
    before, rng = problem.predict(at), np.random.default_rng(0)
    S, g = np.zeros((len(problem.names),) * 2), np.zeros(len(problem.names))
    for k in range(DRAWS):
        rounded = _round_again(problem, k, rng)
        changes = [x[0] - y[0] for x, y in zip(problem.predict(at, rounded), before, strict=True)]
        series = {"": changes}
        series["inertia"] = [
            earlier(r.acceleration - s.acceleration, late / s.dt)
            for r, s in zip(rounded, problem.stretches, strict=True)
        ]
        if "delay" in problem.names:
            series["delay"] = [-np.gradient(x, s.dt) for x, s in zip(changes, problem.stretches, strict=True)]
        rows = np.array(
            [
                np.concatenate([x[s.judged] for x, s in zip(each, problem.stretches, strict=True)])
                for each in series.values()
            ]
        )
        rows = rows if whiten is None else whiten(rows)
        E = np.zeros((len(problem.names), rows.shape[1]))
        for name, row in zip(list(series)[1:], rows[1:], strict=True):
            i = problem.names.index(name)
            E[i] = row * problem.unknowns[i].slope(fit.values[name])
        S += (E * weight) @ E.T / DRAWS
        g += (E * weight) @ rows[0] / DRAWS
        if k == 0 and share(DRAWS * S) < 0.1 * FELT:
            break
    return S, g


def false_acceleration(problem: TorqueProblem, seed: int = 0) -> np.ndarray:
    """Return the acceleration that the encoder's rounding looks like [rad/s^2 or m/s^2], (DRAWS, m); empty without steps."""
    rng, draws = np.random.default_rng(seed), DRAWS if problem.count > 0.0 else 0
    rows = []
    for k in range(draws):
        pairs = zip(_round_again(problem, k, rng), problem.stretches, strict=True)
        rows.append(np.concatenate([(r.acceleration - s.acceleration)[s.judged] for r, s in pairs]))
    return np.array(rows)


def _round_again(problem: TorqueProblem, k: int, rng: np.random.Generator) -> list[Stretch]:
    """Return the stretches rounded once more, at phases of the k-th part of a step."""
    phases = [(k + rng.uniform()) / DRAWS for _ in problem.stretches]
    return [
        with_error(s, _rounding(s, problem.count, phase))
        for s, phase in zip(problem.stretches, phases, strict=True)
    ]


def _rounding(s: Stretch, step: float, phase: float) -> np.ndarray:
    """Return the error of a position that is rounded to steps which begin at a phase [step], (n,).

    The motion comes from rounded positions, whose phase rounding hardly changes it, and the opposite one changes most: so
    phases are drawn from all of a step alike.
    """
    path = (np.cumsum(s.dp) if s.position is None else s.position) / step + phase
    return step * (np.round(path) - path)
