"""Robots of one type as a population: outliers among siblings, and the prediction for a further robot."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive._catalog import did_you_mean
from backdrive.errors import NotIdentifiable, UnknownName
from backdrive.fleet.drift import RATE, benjamini_hochberg, key_of
from backdrive.fleet.history import History, histories
from backdrive.fleet.population_file import MOST_LOGS, Member, Pair, Population
from backdrive.fleet.store import Store
from backdrive.model.prior import DIGITS

FEWEST = 5  # least number of robots of a type for detecting outliers
LEAST = 3  # robots of a population
ROUNDS = 4  # rounds in which outliers are removed from the comparison
TOGETHER = 5.0  # days of a robot that count as one sample, since neighbouring days are correlated
APART = 0.01  # probability below which robots count as outliers, over the whole type [-]


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """A joint that differs from the same joint of its siblings.

    Attributes:
        robot: its name.
        type: of the robot.
        joint: the joint.
        part: of friction, constant or viscous.
        ratio: to the median of its siblings [-].
        siblings: number of robots that it was compared with.
        p: probability by chance [-].
        q: smallest rate of false alarms at which it is named [-].
    """

    robot: str
    type: str
    joint: str
    part: str
    ratio: float
    siblings: int
    p: float
    q: float

    @property
    def sentence(self) -> str:
        """The difference in words."""
        return f"{self.part} is {self.ratio:.2f} times that of {self.siblings} siblings (p = {self.p:.2g})"


def outliers(joints: Sequence[History], *, rate: float = RATE) -> list[Outlier]:
    """Return the joints that differ from their siblings, the clearest first.

    Logarithms at one temperature are compared, by Student's t of each robot against the others that are not outliers
    (externally studentised, in rounds). Benjamini and Hochberg's method limits false alarms over all joints and parts.

    Args:
        joints: their histories.
        rate: share of false alarms among the named that is allowed [-].
    """
    every: list[Outlier] = []
    for group in _groups(joints).values():
        if len(group) < FEWEST:
            continue
        values = _typical(group)
        for part, name in enumerate(("constant", "viscous")):
            known = np.flatnonzero(np.isfinite(values[:, part]))
            if known.size < FEWEST:
                continue
            y = values[known, part]
            for i, p, n in zip(known, *_against_siblings(y), strict=True):
                one = group[i]
                ratio = float(np.exp(values[i, part] - np.median(np.delete(y, np.flatnonzero(known == i)))))
                every.append(
                    Outlier(
                        robot=one.robot,
                        type=one.type,
                        joint=one.joint,
                        part=name,
                        ratio=ratio,
                        siblings=int(n),
                        p=p,
                        q=1.0,
                    )
                )
    if not every:
        return []
    q = benjamini_hochberg(np.array([one.p for one in every]))
    named = [Outlier(**{**one.__dict__, "q": float(v)}) for one, v in zip(every, q, strict=True) if v <= rate]
    return sorted(named, key=lambda one: (one.p, one.robot, one.joint, one.part))


def _groups(joints: Sequence[History]) -> dict[tuple[str, str], list[History]]:
    groups: dict[tuple[str, str], list[History]] = {}
    for one in joints:
        groups.setdefault(key_of(one), []).append(one)
    return groups


def _typical(group: Sequence[History]) -> np.ndarray:
    """Return the logarithms of constant and viscous part of each robot, (r, 2), as medians of the days; NaN if there is none."""
    return np.array([np.median(days, axis=0) for days in _at_one_temperature(group)]).reshape(-1, 2)


def _at_one_temperature(group: Sequence[History]) -> list[np.ndarray]:
    """Return the logarithms of constant and viscous part of each robot and day, (n, 2); NaN where a part is not positive.

    If the temperature is known, they are converted to the group's median temperature with a common slope within robots.
    """
    result = _logarithms(group)
    middle, slope = _warmth(group, result)
    return [
        y - np.where(np.isfinite(one.temperature), one.temperature - (middle or 0.0), 0.0)[:, None] * slope
        for one, y in zip(group, result, strict=True)
    ]


def _logarithms(group: Sequence[History]) -> list[np.ndarray]:
    """Return the logarithms of constant and viscous part of each robot and day, (n, 2); NaN where a part is not positive."""
    result = []
    for one in group:
        both = np.column_stack([one.constant, one.viscous])
        good = np.all(both > 0, axis=0)
        result.append(np.where(good, np.log(np.where(good, both, 1.0)), np.nan))
    return result


def _warmth(group: Sequence[History], logarithms: Sequence[np.ndarray]) -> tuple[float | None, np.ndarray]:
    """Return the group's median temperature [degC], None if it is unknown, and the common slope within robots [1/degC], (2,)."""
    known = [np.isfinite(one.temperature) for one in group]
    warm = np.concatenate([one.temperature[ok] for one, ok in zip(group, known, strict=True)])
    products, squares = np.zeros(2), 0.0
    for one, ok, y in zip(group, known, logarithms, strict=True):
        if ok.sum() > 2:
            T = one.temperature[ok] - one.temperature[ok].mean()
            products, squares = products + np.nan_to_num(T @ y[ok]), squares + float(T @ T)
    slope = products / squares if squares > len(group) else np.zeros(2)
    return float(np.median(warm)) if warm.size else None, slope


def _against_siblings(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return each robot's p-value against the others that are not outliers, and the number of these, (n,) each."""
    from scipy.special import stdtr

    regular = np.ones(y.size, dtype=bool)
    p, count = np.ones(y.size), np.zeros(y.size)
    center = np.median(y)
    scale = 1.4826 * np.median(np.abs(y - center))
    if scale > 0:  # the first round, since extreme outliers would hide others
        regular = np.abs(y - center) < 5.0 * scale
    for _ in range(ROUNDS):
        for i in range(y.size):
            others = regular.copy()
            others[i] = False
            n = int(others.sum())
            if n < FEWEST - 1:
                continue
            spread = float(np.std(y[others], ddof=1))
            t = abs(y[i] - y[others].mean()) / max(spread * np.sqrt(1.0 + 1.0 / n), 1e-300)
            p[i], count[i] = 2.0 * float(stdtr(n - 1, -t)), n
        now = p > APART / y.size
        if np.array_equal(now, regular) or now.sum() < FEWEST:
            break
        regular = now
    return p, count


def merge(folder: str | os.PathLike, *, without: Sequence[str] = ()) -> Population:
    """Return the population of every type and joint: the mean robot, and the spread between robots.

    The method of moments for random effects is used (DerSimonian & Laird 1986). The scatter of the robots' means is the spread
    between robots plus the error of each mean. All values are logarithms of the constant and the viscous part at the median
    temperature.

    Args:
        folder: of the results.
        without: robots that are left out, such as one whose next log is to be combined with the population.

    Raises:
        UnknownName: there are no results of a robot in `without`.
        NotIdentifiable: no type has three robots.
    """
    table = Store.open(folder).table()
    robots = np.array(table.column("robot").to_pylist(), dtype=object)
    for name in without:
        if name not in robots:
            raise UnknownName(
                f"There are no results of robot '{name}' in {folder}.",
                remedy=f"{did_you_mean(name, sorted(set(robots)))}`backdrive fleet status` counts what is there.",
            )
    table = table.filter(~np.isin(robots, list(without)))
    joints = histories(table)
    apart = {(one.robot, one.joint) for one in outliers(joints)}
    members = []
    for (kind, joint), group in sorted(_groups(joints).items()):
        kept = [one for one in group if (one.robot, one.joint) not in apart]
        values = _typical(kept)
        whole = np.asarray(np.isfinite(values).all(axis=1))
        if whole.sum() < LEAST:
            continue
        days = [y for y, ok in zip(_at_one_temperature(kept), whole, strict=True) if ok]
        daily = [np.cov(y.T) if len(y) > 3 else np.zeros((2, 2)) for y in days]
        within = np.array([c / max(len(y) / TOGETHER, 1.0) for c, y in zip(daily, days, strict=True)])
        mean = values[whole].mean(axis=0)
        total = np.cov(values[whole].T)
        between = _positive(total - within.mean(axis=0))
        middle, slope = _warmth(kept, _logarithms(kept))
        members.append(
            Member(
                type=kind,
                joint=joint,
                unit=kept[0].unit,  # type: ignore[arg-type]
                robots=int(whole.sum()),
                left_out=tuple(sorted(one.robot for one in group if (one.robot, one.joint) in apart)),
                top_speed=float(np.median([one.speed for one in kept]) * 2.0),
                mean=(float(mean[0]), float(mean[1])),
                between=_pairs(between),
                within=_pairs(np.mean(daily, axis=0)),
                temperature=middle,
                warmth=(float(slope[0]), float(slope[1])),
            )
        )
    if not members:
        raise NotIdentifiable(
            f"No type in {folder} has {LEAST} robots.",
            remedy="Run more robots, or name their type in a manifest.",
        )
    logs = sorted({digest[:DIGITS] for digest in table.column("digest").to_pylist()})
    return Population(members=tuple(members), logs=tuple(logs) if len(logs) <= MOST_LOGS else ())


def _pairs(matrix: np.ndarray) -> tuple[Pair, Pair]:
    """Return a (2, 2) matrix as rows of plain numbers."""
    (a, b), (c, d) = matrix.tolist()
    return (a, b), (c, d)


def _positive(matrix: np.ndarray) -> np.ndarray:
    """Return the nearest matrix without negative variances."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return (vectors * np.maximum(values, 0.0)) @ vectors.T
