"""A starting point for laws with a Stribeck peak.

Given the speed at which the peak falls and the delay of the torque, such a law and the dynamics are linear in all other
parameters. So both are tried on a grid, with least squares at each of its points. A scattered point hardly finds a wide peak,
which Coulomb and viscous friction and a later torque explain nearly as well.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from backdrive.engine import Lanes
from backdrive.identification import regression
from backdrive.identification.delay import earlier
from backdrive.identification.dynamic.torque import SLOW, TorqueProblem
from backdrive.laws import Law, Rate
from backdrive.laws.direction import BACKWARD, ByDirection

PEAK = ("coulomb", "breakaway", "stribeck_velocity", "viscous")
SPEEDS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.6)  # at which a peak may fall, relative to the top speed [-]
SHARES = (0.0, 0.5)  # trial delays, as parts of the rough one [-]
SAMPLES = (-3, -2, -1, 0, 1, 2, 3)  # and beside it [sample]
LONGEST, MANY = 15_000, 4000  # samples that are read, and samples that are fitted to


def peak_start(problem: TorqueProblem, values: Mapping[str, float]) -> dict[str, float] | None:
    """Return starting values by name, from the best point of the grid; None for another law, or where no peak is possible.

    Args:
        problem: to be solved.
        values: by name, for what is not sought here.
    """
    kind = problem.shape.rate
    one = kind.ONE if issubclass(kind, ByDirection) else kind
    if not set(PEAK) <= set(problem.names) or not set(PEAK) <= set(one.PARAMETERS) or one.NEEDS:
        return None
    s, regressors = max(
        zip(problem.stretches, problem.regressors, strict=True), key=lambda pair: len(pair[0].torque)
    )
    begin = max(0, (len(s.torque) - LONGEST) // 2)
    at = slice(begin, begin + LONGEST)
    v, judged = s.velocity[at], s.judged[at]
    top = float(np.abs(v).max(initial=0.0))
    use = np.flatnonzero(judged & (np.abs(v) > SLOW * top))
    use = use[:: max(1, use.size // MANY)]
    terms = problem.terms
    if use.size < 10 * (len(terms) + len(PEAK)):
        return None
    y = (s.torque - np.array(list(problem.known.values())) @ regressors[len(terms) :])[at][use]
    rough = values.get("delay", 0.0)
    late = (
        {rough + k * s.dt for k in SAMPLES} | {share * rough for share in SHARES}
        if "delay" in problem.names
        else {rough}
    )
    motion, peaks = np.vstack([v, regressors[: len(terms), at]]), _peaks(one, values, top)
    best: tuple[float, dict[str, float]] = np.inf, {}
    for delay in sorted(late):
        moved = earlier(motion, delay / s.dt)[:, use]
        level = np.sign(moved[0])
        of_peaks = peaks.torque(np.zeros(len(SPEEDS), dtype=np.int64), s.dt * moved[:1], s.dt) - level
        for fall, peak in zip(SPEEDS, of_peaks, strict=True):
            A = np.vstack([level, peak, moved]).T
            theta = regression.solve(A.T @ A, A.T @ y)
            misfit = float(np.sum((y - A @ theta) ** 2))
            if misfit < best[0] and theta[0] > 0.0 and theta[0] + theta[1] > 0.0:
                friction = (theta[0], theta[0] + theta[1], fall * top, max(theta[2], 0.0))
                best = (
                    misfit,
                    dict(zip(PEAK, map(float, friction), strict=True))
                    | {"delay": delay}
                    | dict(zip(terms, theta[3:].tolist(), strict=True)),
                )
    found = best[1]
    return {**values, **found, **{name + BACKWARD: found[name] for name in PEAK}} if found else None


def _peaks(kind: type[Rate], values: Mapping[str, float], top: float) -> Lanes:
    """Return laws without viscous friction, of Coulomb friction 1 and a peak of 1 more, which falls at one of the speeds each."""
    others = {name: values.get(name, kind.EXAMPLE.get(name)) for name in kind.PARAMETERS if name not in PEAK}
    numbers = [dict(zip(PEAK, (1.0, 2.0, fall * top, 0.0), strict=True)) for fall in SPEEDS]
    return Lanes([Law(rate=kind(**others, **each)) for each in numbers])
