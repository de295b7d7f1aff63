"""The motion of a fit of torque, with its encoder's rounding drawn once more."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from backdrive.identification.delay import earlier
from backdrive.identification.dynamic.fit import Fit
from backdrive.identification.dynamic.stretch import Stretch, with_error
from backdrive.identification.dynamic.torque import DRAWS, TorqueProblem


def of_rounding(
    fit: Fit,
    whiten: Callable[[np.ndarray], np.ndarray] | None,
    fast: np.ndarray,
    clear: np.ndarray,
    felt: Callable[[np.ndarray], bool],
) -> tuple[np.ndarray, np.ndarray]:
    """Return what rounding adds to the normal equations of the fast coordinates, S, (k, k), and to their right-hand side, g, (k,).

    Both are 0 where rounding is not felt.

    Args:
        fit: of a `TorqueProblem`.
        whiten: what its search did to the residuals; None: nothing.
        fast: which coordinates are fast, (P,).
        clear: rows that tell them, (m,).
        felt: whether S is felt at all, which a first draw tells.
    """
    problem, weight = fit.problem, fit.found.weight
    assert isinstance(problem, TorqueProblem)
    own = [problem.unknowns[i] for i in np.flatnonzero(fast)]
    S, g = np.zeros((len(own),) * 2), np.zeros(len(own))
    if not problem.count > 0.0:
        return S, g
    at, late = [problem.values(fit.found.point)], fit.values.get("delay", 0.0)
    before, rng = problem.predict(at), np.random.default_rng(0)
    for k in range(DRAWS):
        rounded = round_again(problem, k, rng)
        changes = [x[0] - y[0] for x, y in zip(problem.predict(at, rounded), before, strict=True)]
        series = {
            "inertia": [
                earlier(a.acceleration - s.acceleration, late / s.dt)
                for a, s in zip(rounded, problem.stretches, strict=True)
            ],
            "delay": [-np.gradient(x, s.dt) for x, s in zip(changes, problem.stretches, strict=True)],
        }
        rows = np.array(
            [
                np.concatenate([x[s.judged] for x, s in zip(each, problem.stretches, strict=True)])
                for each in (changes, *(series[u.name] for u in own))
            ]
        )
        rows = rows if whiten is None else whiten(rows)
        E = np.array([row * u.slope(fit.values[u.name]) for row, u in zip(rows[1:], own, strict=True)])
        S += (E * (weight * clear)) @ E.T / DRAWS
        g += (E * (weight * clear)) @ rows[0] / DRAWS
        if k == 0 and not felt(DRAWS * S):
            return np.zeros_like(S), np.zeros_like(g)
    return S, g


def false_acceleration(problem: TorqueProblem, seed: int = 0) -> np.ndarray:
    """Return the acceleration that the encoder's rounding looks like [rad/s^2 or m/s^2], (DRAWS, m); empty without steps."""
    rng, draws = np.random.default_rng(seed), DRAWS if problem.count > 0.0 else 0
    rows = []
    for k in range(draws):
        pairs = zip(round_again(problem, k, rng), problem.stretches, strict=True)
        rows.append(np.concatenate([(r.acceleration - s.acceleration)[s.judged] for r, s in pairs]))
    return np.array(rows)


def round_again(problem: TorqueProblem, k: int, rng: np.random.Generator) -> list[Stretch]:
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
