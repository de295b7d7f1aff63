"""Joints whose friction has changed: a significance test of every joint, with false alarms limited by Benjamini and Hochberg,
and the date of each change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.fleet import autocorrelation, changes
from backdrive.fleet.history import PARTS, History, date_of, number_of

RATE = 0.05  # accepted share of false alarms among the named joints [-]
FEWEST = 100_000  # draws without a change, of all joints together, at most `MOST` a joint
LEAST = 20  # of a joint: with m joints the smallest p-value is 1 / (20 m), what the rate of 0.05 needs
MOST = 400
WARMTH = 1.0  # span of temperature from which it is regressed out [degC]
SIBLINGS = 8  # least number of siblings whose common course replaces an unmeasured temperature


@dataclass(frozen=True, kw_only=True)
class Drift:
    """The test result on a joint's change.

    Attributes:
        history: of the joint.
        p: probability of such a change by chance [-]; NaN if the history is too short.
        q: smallest rate of false alarms at which it would be named (Benjamini & Hochberg 1995) [-].
        named: whether it is named at the accepted rate.
        part: the part with the clearest change: level, constant or viscous.
        shape: `ramp` or `step`; empty where it is not named.
        sure: whether the data clearly decide between ramp and step.
        onset: day on which it began.
        interval: 95 % interval of it.
        size: relative change until the last day [-].
        error: its standard error [-].
        season: regressor for the season: `temperature`, `siblings` or an empty string.
        warmth: relative change of the level with temperature [1/degC], if temperature is the only cause; NaN if unknown.
    """

    history: History
    p: float
    q: float = float("nan")
    named: bool = False
    part: str = "level"
    shape: str = ""
    sure: bool = False
    onset: date | None = None
    interval: tuple[date, date] | None = None
    size: float = float("nan")
    error: float = float("nan")
    season: str = ""
    warmth: float = float("nan")

    @property
    def sentence(self) -> str:
        """The change in words."""
        if not np.isfinite(self.p):
            return f"too short to tell: {self.history.day.size} days, {changes.LEAST} needed"
        if not self.named or self.interval is None:
            return f"no significant change (p = {self.p:.2g})"
        how = {"ramp": "growing" if self.size > 0 else "falling", "step": "stepped"}[self.shape]
        amount = f"{100 * self.size:+.1f} +- {196 * self.error:.1f} %"
        when = f"{self.onset} ({self.interval[0]} to {self.interval[1]})"
        doubt = "" if self.sure else ", shape unclear"
        return f"{self.part} {how} by {amount} since {when}{doubt}"


def benjamini_hochberg(p: np.ndarray) -> np.ndarray:
    """Return for each p-value the smallest rate of false discoveries at which it is one (JRSS B 57, 1995), (m,)."""
    order = np.argsort(p)
    scaled = p[order] * p.size / np.arange(1, p.size + 1)
    q = np.empty_like(p)
    q[order] = np.minimum(np.minimum.accumulate(scaled[::-1])[::-1], 1.0)
    return q


def drifts(
    joints: Sequence[History], *, rate: float = RATE, since: date | None = None, seed: int = 0
) -> list[Drift]:
    """Test every joint for a change, and date those that have one.

    Args:
        joints: their histories.
        rate: share of false alarms among the named that is allowed [-].
        since: name only changes whose interval of the start extends beyond this day.
        seed: of the flipped signs.

    Returns:
        One entry a joint, in their order.

    Raises:
        InvalidInput: the rate is none.
    """
    if not 0.0 < rate < 1.0:
        raise InvalidInput(
            f"--rate {rate:g} is not a share of false alarms.", remedy="Give one such as 0.05."
        )
    long = [i for i, one in enumerate(joints) if _fit_for_test(one)]
    result = [Drift(history=one, p=float("nan")) for one in joints]
    if not long:
        return result
    common = _siblings([joints[i] for i in long])
    designs = [_design(joints[i], common.get(key_of(joints[i]))) for i in long]
    values = [autocorrelation.cut_outliers(_logarithms(joints[i])) for i in long]
    found = [
        autocorrelation.correlation(joints[i].day, v[:, :1], d)
        for i, v, (d, _) in zip(long, values, designs, strict=True)
    ]
    sizes = np.array([v.shape[0] for v in values])
    middle = int(np.argsort(sizes)[sizes.size // 2])
    rho = autocorrelation.true_correlation(
        np.hstack(found), joints[long[middle]].day, designs[middle][0], sizes, seed + 1
    )
    whitened = [
        changes.series(joints[i].day, v, d, r)
        for i, v, (d, _), r in zip(long, values, designs, rho, strict=True)
    ]
    p, parts = _probabilities(whitened, seed)
    q = benjamini_hochberg(p)
    for number, i in enumerate(long):
        known = Drift(
            history=joints[i],
            p=float(p[number]),
            q=float(q[number]),
            part=PARTS[parts[number]],
            season=designs[number][1],
            warmth=_warmth(whitened[number], designs[number][1]),
        )
        result[i] = (
            _date_change(known, whitened[number], int(parts[number]), since) if q[number] <= rate else known
        )
    return result


def key_of(one: History) -> tuple[str, str]:
    """Return the key of a group of siblings: type and joint."""
    return one.type, one.joint


def _fit_for_test(one: History) -> bool:
    return one.day.size >= changes.LEAST and bool(np.all(one.level > 0))


def _logarithms(one: History) -> np.ndarray:
    """Return the logarithms of the parts; one that is not positive throughout is replaced by the level, (n, P)."""
    columns = [one.level, one.constant, one.viscous]
    return np.log(np.column_stack([c if np.all(c > 0) else one.level for c in columns]))


def _design(one: History, common: dict[float, float] | None) -> tuple[np.ndarray, str]:
    """Return constant and season as columns (n, k), and the kind of the season's regressor."""
    T = one.temperature
    known = np.isfinite(T)
    ones = np.ones(one.day.size)
    if known.sum() >= max(0.5 * T.size, 3) and np.ptp(T[known]) > WARMTH:
        filled = np.interp(one.day, one.day[known], T[known])
        return np.column_stack([ones, filled - filled.mean()]), "temperature"
    if common is not None:
        moved = np.array([common[d] for d in one.day])
        if np.ptp(moved) > 1e-6:
            return np.column_stack([ones, moved - moved.mean()]), "siblings"
    return ones[:, None], ""


def _siblings(joints: Sequence[History]) -> dict[tuple[str, str], dict[float, float]]:
    """Return the common motion of siblings without a thermometer: by day the median of their level about its mean."""
    groups: dict[tuple[str, str], list[History]] = {}
    for one in joints:
        if not np.isfinite(one.temperature).mean() > 0.5:
            groups.setdefault(key_of(one), []).append(one)
    result = {}
    for key, group in groups.items():
        if len({one.robot for one in group}) < SIBLINGS:
            continue
        moved: dict[float, list[float]] = {}
        for one in group:
            level = np.log(one.level)
            for d, y in zip(one.day, level - np.median(level), strict=True):
                moved.setdefault(d, []).append(y)
        result[key] = {d: float(np.median(y)) for d, y in moved.items()}
    return result


def _probabilities(every: Sequence[changes.Series], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the p-value of every series against flipped ones of all of them, and the part that shows its change best.

    The draws of a joint that is named exclude its own change. A joint that is not named counts as unchanged, so that its draws
    include whatever change it shows.
    """
    count = int(np.clip(FEWEST // len(every), LEAST, MOST))
    observed, parts = np.empty(len(every)), np.empty(len(every), dtype=int)
    null = np.empty((len(every), count))
    whole: dict[int, np.ndarray] = {}
    draws = np.random.default_rng(seed)
    for i, one in enumerate(every):
        W = changes.directions(one, changes.onsets(one.day, changes.GRID))
        residual = one.residual()
        found = changes.largest(W, residual)
        parts[i] = int(np.argmax(found))
        observed[i] = changes.statistic(found.max(), one.freedom)
        null[i] = changes.null_statistics(one, W, residual, draws, count)
        if observed[i] > changes.SUSPECT:
            whole[i] = null[i].copy()
            null[i] = changes.null_statistics(one, W, changes.without_change(W, residual), draws, count)
    q = benjamini_hochberg(_exceedance(observed, null))
    for i, own in whole.items():
        if q[i] > RATE:
            null[i] = own
    return _exceedance(observed, null), parts


def _exceedance(observed: np.ndarray, null: np.ndarray) -> np.ndarray:
    """Return the share of draws without a change that reach each observed statistic, (m,)."""
    reference = np.sort(null.ravel())
    above = reference.size - np.searchsorted(reference, observed, side="left")
    return (1.0 + above) / (1.0 + reference.size)


def _warmth(one: changes.Series, season: str) -> float:
    if season != "temperature":
        return float("nan")
    X = autocorrelation.whitener(one.day, one.rho)(one.design)
    return float(np.linalg.lstsq(X, one.y[:, 0], rcond=None)[0][1])


def _date_change(known: Drift, one: changes.Series, part: int, since: date | None) -> Drift:
    """Return a change with its shape and start; not named if its interval ends before `since`."""
    change = changes.date_change(one, part)
    low, high = change.interval
    return replace(
        known,
        named=since is None or high >= number_of(since),
        shape=change.shape,
        sure=change.sure,
        onset=date_of(change.day),
        interval=(date_of(low), date_of(high)),
        size=float(np.expm1(change.size)),
        error=float(np.exp(change.size) * change.error),
    )
