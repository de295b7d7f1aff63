"""Starting values from the data: Coulomb and viscous friction by regression, stiffness from presliding."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from backdrive.engine import Lanes
from backdrive.errors import NotIdentifiable
from backdrive.identification import regression
from backdrive.identification.delay import earlier
from backdrive.identification.dynamic.stretch import SMOOTHED, Stretch
from backdrive.identification.dynamic.torque import SLOW, TorqueProblem
from backdrive.identification.dynamic.unknowns import Scales
from backdrive.identification.terms import column, columns
from backdrive.laws import Coulomb, HaywardArmstrong, Law, Leuven
from backdrive.laws.base import Sizes
from backdrive.laws.direction import plain as without_direction
from backdrive.logs.filters import low_pass

GRID = 24  # number of break-away distances on the grid for elements side by side
MOST = 2.0  # upper limit of a break-away torque, relative to the largest friction in the data [-]
LONGEST = 15_000  # largest number of samples for the estimate of a delay
EARLIER = (0.0, 0.5)  # delays of further starting points, relative to that of the guess [-]
STILL = 1e-9  # travel below which a joint counts as not moving [rad or m]


def rest_of(
    stretches: Sequence[Stretch], terms: Sequence[str], known: Mapping[str, float] | None = None
) -> tuple[dict[str, float], list[np.ndarray]]:
    """Return rough values of friction and dynamics by linear least squares, and the torque that remains for friction.

    Args:
        stretches: of one joint.
        terms: other terms of the dynamics to estimate.
        known: fixed terms of the dynamics, by name [SI].

    Returns:
        Values by name: `coulomb`, `viscous` and the terms; and the measured torque minus the terms, one series per stretch.
    """
    rows, targets = [], []
    stretches = subtract_terms(stretches, known or {})
    for s in stretches:
        v = s.velocity
        moving = s.judged & (np.abs(v) > SLOW * np.abs(v).max())
        rows.append(np.vstack([np.sign(v), v, columns(s, terms)])[:, moving].T)
        targets.append(s.torque[moving])
    theta = _least_squares(np.concatenate(rows), np.concatenate(targets))
    found = {"coulomb": abs(theta[0]), "viscous": max(theta[1], 0.0)} | dict(
        zip(terms, theta[2:], strict=False)
    )
    left = [
        s.torque - sum((found[t] * column(s, t) for t in terms), np.zeros_like(s.torque)) for s in stretches
    ]
    return {k: float(v) for k, v in found.items()}, left


def _least_squares(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the least-squares coefficients, (P,); columns may differ in size by orders of magnitude."""
    norm = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    return np.linalg.lstsq(A / norm, y, rcond=1e-8)[0] / norm


def subtract_terms(stretches: Sequence[Stretch], known: Mapping[str, float]) -> list[Stretch]:
    """Return stretches with the contribution of known terms subtracted from the torque."""
    return [
        replace(s, torque=s.torque - sum(value * column(s, term) for term, value in known.items()))
        for s in stretches
    ]


def delay_of(stretches: Sequence[Stretch], terms: Sequence[str], reach: float) -> float:
    """Return a coarse estimate of the torque's delay, at which Coulomb and viscous friction fit best [s].

    Args:
        stretches: of one joint; the longest one is used.
        terms: other terms of the dynamics to fit.
        reach: largest magnitude of the delay [s].
    """
    s = max(stretches, key=lambda s: len(s.torque))
    n, dt = len(s.torque), s.dt
    a = max(0, (n - LONGEST) // 2)
    at = slice(a, a + LONGEST)
    v = s.velocity
    motion = np.vstack([np.sign(v), v, columns(s, terms)])[:, at]
    torque, use = s.torque[at], (s.judged & (np.abs(v) > SLOW * np.abs(v).max()))[at]
    measured, farthest = torque[use], round(reach / dt)
    step = max(1, farthest // 12)

    def misfit(late: int) -> float:
        A = earlier(motion, float(late))[:, use].T
        return float(np.sum((measured - A @ regression.solve(A.T @ A, A.T @ measured)) ** 2))

    best = min(range(-(farthest // step) * step, farthest + 1, step), key=misfit)
    return dt * min(range(best - step + 1, best + step), key=misfit)


def scales(
    stretches: Sequence[Stretch],
    terms: Sequence[str],
    unit: str,
    count: float | None,
    known: Mapping[str, float] | None = None,
) -> Scales:
    """Return the typical sizes in the data.

    Args:
        stretches: of one joint.
        terms: other terms of the dynamics to fit.
        unit: of the joint.
        count: encoder steps per rad or m, if known.
        known: fixed terms of the dynamics, by name [SI].

    Raises:
        NotIdentifiable: the joint never moves, or its torque never changes.
    """
    speed = max(float(np.abs(s.velocity).max()) for s in stretches)
    travel = max(float(np.ptp(np.cumsum(s.dp))) for s in stretches)
    if speed == 0.0 or travel < max(STILL, 3.0 / count if count else 0.0):
        raise NotIdentifiable(
            f"The joint never moves (its travel is {travel:.3g} {unit}), so that its friction cannot be seen.",
            remedy="Record a motion with reversals, for example of `backdrive plan`.",
        )
    if max(float(np.ptp(s.torque)) for s in stretches) == 0.0:
        raise NotIdentifiable(
            "The torque is the same number throughout.",
            remedy="Name the channel that holds the measured torque or current.",
        )
    found, left = rest_of(stretches, terms, known)
    force = max(found["coulomb"], 0.3 * float(np.median([np.abs(f).mean() for f in left])), 1e-9)
    length = presliding_length(stretches, left, force)
    length = float(np.clip(length, 1e-7 * travel, 0.2 * travel))
    if count:
        length = max(length, 1.0 / count)
    slowest = 1.0 / (count * max(s.dt for s in stretches)) if count else 0.0
    most = MOST * max(float(np.quantile(np.abs(f), 0.999)) for f in left)
    return Scales(force=force, speed=speed, length=length, unit=unit, slowest=slowest, most=max(most, force))


def presliding_length(stretches: Sequence[Stretch], left: Sequence[np.ndarray], force: float) -> float:
    """Return the distance after a reversal over which friction changes sign, from the median over reversals [rad or m]."""
    found = []
    for s, f in zip(stretches, left, strict=True):
        v = s.velocity
        turns = np.nonzero(np.diff(np.sign(v)) != 0)[0]
        path = np.cumsum(np.abs(s.dp))
        for a, b in zip(turns, np.append(turns[1:], len(v) - 1), strict=False):
            way = np.sign(v[min(a + 2, len(v) - 1)])
            if b - a < 5 or way == 0:
                continue
            along = way * f[a : b + 1]
            beyond = np.nonzero(along >= 0.5 * force)[0]
            if along[0] < 0 and len(beyond) and beyond[0] > 0:
                found.append(path[a + beyond[0]] - path[a])
    moved = [x for x in found if x > 0]
    return float(np.median(moved)) / 2.0 if moved else max(np.ptp(np.cumsum(s.dp)) for s in stretches) * 1e-3


def guess(problem: TorqueProblem, scales: Scales) -> dict[str, float]:
    """Return starting values by name."""
    found, left = rest_of(problem.stretches, problem.terms, problem.known)
    sizes = backward = _sizes(problem, scales, found["coulomb"], found["viscous"], left)
    if problem.shape.rate.MARK and "offset" not in problem.terms:  # Coulomb friction by direction
        sizes, backward = (_sizes_along(problem, scales, left, way, sizes) for way in (1.0, -1.0))
    parameters = problem.shape.rate.PARAMETERS | problem.shape.element.PARAMETERS
    starts = {}
    for name, p in parameters.items():
        along = sizes if without_direction(name) == name else backward
        starts[name] = p.start(along) if callable(p.start) else p.start
    known = {"delay": problem.about} | starts
    parallel = side_by_side(problem, left, scales) if problem.side_by_side else {}
    if "threshold" in problem.names:
        known["threshold"] = threshold(problem, left)
    values = {}
    for u in problem.unknowns:
        plain = u.name.partition("[")[0]
        if u.name in parallel:
            values[u.name] = parallel[u.name]
        else:
            values[u.name] = known.get(plain, found.get(plain, 0.0))
        values[u.name] = float(np.clip(values[u.name], u.lower, u.upper))
    return values


def _sizes(
    problem: TorqueProblem,
    scales: Scales,
    coulomb: float,
    viscous: float,
    left: Sequence[np.ndarray],
    way: float = 0.0,
) -> Sizes:
    """Return the sizes of friction in the data, for one direction (`way` 1 or -1) or for both (0)."""
    F, V = max(coulomb, 0.05 * scales.force), scales.speed
    near = np.concatenate(
        [
            np.abs(f[s.judged & _slow(s) & (way * s.velocity >= 0.0)])
            for s, f in zip(problem.stretches, left, strict=True)
        ]
        or [np.array([F])]
    )
    F_s = float(np.quantile(near, 0.9)) if near.size > 20 else 1.2 * F
    return Sizes(
        coulomb=F,
        breakaway=float(np.clip(F_s, F, 3.0 * F)),
        viscous=min(viscous, 2.0 * F / V),
        speed=V,
        stiffness=scales.force / scales.length,
        length=scales.length,
        lag=scales.lag,
    )


def _sizes_along(
    problem: TorqueProblem, scales: Scales, left: Sequence[np.ndarray], way: float, both: Sizes
) -> Sizes:
    """Return the sizes of friction in one direction, 1 or -1; those of both if there is little motion in that direction."""
    rows, targets = [], []
    for s, f in zip(problem.stretches, left, strict=True):
        speed = way * s.velocity
        moving = s.judged & (speed > SLOW * np.abs(s.velocity).max())
        rows.append(np.vstack([np.ones(moving.sum()), speed[moving]]).T)
        targets.append(way * f[moving])
    if sum(len(y) for y in targets) < 50:
        return both
    F, b = _least_squares(np.concatenate(rows), np.concatenate(targets))
    return _sizes(problem, scales, float(F), max(float(b), 0.0), left, way)


def side_by_side(problem: TorqueProblem, left: Sequence[np.ndarray], scales: Scales) -> dict[str, float]:
    """Return starting values for stiffnesses and share ratios of elements side by side, by name.

    Along a given path, the torque is linear in the strengths of sliders whose break-away distances lie on a grid. Sliders of
    positive strength are merged with neighbours, or the strongest is split, until their number is right.
    """
    from scipy.optimize import nnls

    distance = scales.length * np.geomspace(0.1, 12.0, GRID)
    lanes = Lanes(
        [Law(rate=Coulomb(coulomb=1.0), element=HaywardArmstrong(stiffness=1.0 / d)) for d in distance]
    )
    rows, targets = [], []
    for s, f in zip(problem.stretches, left, strict=True):
        chosen = np.flatnonzero(s.judged & (np.abs(s.velocity) < 2 * SLOW * np.abs(s.velocity).max()))
        chosen = chosen[:: max(1, chosen.size // 2000)]
        dp = bristle(s, f, scales.force) if problem.shape.element is Leuven else s.dp
        play = lanes.torque(np.zeros(GRID, dtype=np.int64), dp[None], s.dt)
        rows.append(play[:, chosen].T)
        targets.append(f[chosen])
    strength = nnls(np.concatenate(rows), np.concatenate(targets))[0]
    count, F = problem.shape.count, scales.force
    active = np.flatnonzero(strength > 0.01 * F)
    if not active.size:
        active, strength = np.array([GRID // 2]), np.full(GRID, F)
    sliders = [(float(strength[i]), float(strength[i] / distance[i])) for i in active]  # torque, stiffness
    while len(sliders) > count:
        gaps = [
            min(a[0], b[0]) * abs(np.log(a[0] * b[1] / (a[1] * b[0])))
            for a, b in zip(sliders, sliders[1:], strict=False)
        ]
        i = int(np.argmin(gaps))
        a, b = sliders[i : i + 2]
        sliders[i : i + 2] = [(a[0] + b[0], a[1] + b[1])]
    while len(sliders) < count:
        i = int(np.argmax([w for w, _ in sliders]))
        w, k = sliders[i]
        sliders[i : i + 1] = [(0.5 * w, 0.65 * k), (0.5 * w, 0.35 * k)]
    sliders.sort(key=lambda one: -one[1])
    values = {f"stiffness[{i}]": k for i, (_, k) in enumerate(sliders)}
    return values | {
        f"share[{i}]": float(np.log(w / sliders[-1][0])) for i, (w, _) in enumerate(sliders[:-1])
    }


def bristle(s: Stretch, friction: np.ndarray, force: float) -> np.ndarray:
    """Return the displacement of the Leuven model's bristle in each sample, estimated from measured friction [rad or m], (n,).

    Args:
        s: the stretch.
        friction: torque minus all other terms of the dynamics [N.m or N], (n,).
        force: typical friction [N.m or N].
    """
    smooth = low_pass(friction, min(SMOOTHED, 0.1 / s.dt) / 3.0, 1.0 / s.dt)
    slow = _slow(s)
    bound = max(float(np.quantile(np.abs(smooth[slow]), 0.95)) if slow.sum() > 20 else force, 1e-9)
    load = np.sign(s.dp) * smooth / bound
    return np.ascontiguousarray(s.dp * (1.0 - np.clip(np.sign(load) * load**2, -1.0, 1.0)))


def threshold(problem: TorqueProblem, left: Sequence[np.ndarray]) -> float:
    """Return the speed that best separates samples with little torque from samples with more [rad/s or m/s]."""
    speed = np.concatenate([np.abs(s.velocity[s.judged]) for s in problem.stretches])
    torque = np.concatenate([np.abs(f[s.judged]) for s, f in zip(problem.stretches, left, strict=True)])
    order = np.argsort(speed)
    speed, torque = speed[order], torque[order]
    half = 0.5 * float(np.median(torque[speed > SLOW * speed[-1]]))
    gain = np.cumsum(
        np.where(torque < half, 1.0, -1.0)
    )  # correctly minus wrongly classified samples below each speed
    return float(speed[int(np.argmax(gain))])


def _slow(s: Stretch) -> np.ndarray:
    speed = np.abs(s.velocity)
    return (speed > 0) & (speed < 2 * SLOW * speed.max())


def starts(problem: TorqueProblem, scales: Scales, count: int, seed: int) -> np.ndarray:
    """Return starting points: the guess, and points scattered around it within the bounds, (count, P)."""
    values = guess(problem, scales)
    centre = problem.point(values)
    rng = np.random.default_rng(seed)
    width = np.array([1.5 if u.log else 1.5 if u.ratio else 0.0 for u in problem.unknowns])
    scattered = centre + width * rng.standard_normal((count - 1, len(centre)))
    for i, u in enumerate(problem.unknowns):
        if not u.log and not u.ratio and u.name not in problem.terms and u.name != "delay":
            reach = np.array([0.3 * abs(float(centre[i])) + 0.05])
            scattered[:, i] += reach * rng.standard_normal(count - 1)
    return np.clip(np.vstack([centre, scattered]), problem.lower, problem.upper)


def with_less_delay(problem: TorqueProblem, points: np.ndarray) -> np.ndarray:
    """Return starting points with half of their delay, or none, (B, P): no point without a delay, or for a law without presliding.

    Friction that builds up over a distance looks late to `delay_of`.
    """
    if "delay" not in problem.names or problem.shape.element.SET_VALUED or problem.about == 0.0:
        return points[:0]
    moved, i = points.copy(), problem.names.index("delay")
    moved[:, i] *= np.resize(EARLIER, len(points))
    return np.clip(moved, problem.lower, problem.upper)
