"""What a curve misses of the friction at a speed, as a part of its error there.

The mean residual of a range of speeds is compared with the scatter of its means over passes, the runs of neighbouring bins in one
direction. Where it is significant, the curve is off by it: a straight line at slow speeds, where a Stribeck peak begins.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from backdrive.identification.design import COLUMNS, Choice
from backdrive.identification.motion_bins import Bins

RATIO = 1.25  # of the ends of a range of speeds [-]
PASSES, FEWEST = 4, 8  # least number of passes and of bins of a range
CHANCE = 2e-4  # probability by which noise alone has a mean residual that counts [-]
LIKELY = 0.01  # the same for the slowest ranges, behind which a straight line that misses them holds [-]
EDGE = 1.6  # speed below which any mean residual counts: a Stribeck peak may begin there [slowest speed]


@dataclass(frozen=True, kw_only=True, eq=False)
class Misses:
    """Sizes of significant misses.

    Attributes:
        speeds: middles of the ranges, ascending [rad/s or m/s], (2, m): along +q, and along -q.
        sizes: 0 where noise explains the residual [N.m or N], (2, m).
        seen: speed from which on enough bins show the friction [rad/s or m/s].
        held: speed behind the slowest ranges, of those below `EDGE`, where something likely is missed [rad/s or m/s].
    """

    speeds: np.ndarray
    sizes: np.ndarray
    seen: float = 0.0
    held: float = 0.0

    def at(self, velocity: np.ndarray) -> np.ndarray:
        """Return the misses at velocities [N.m or N], (n,)."""
        found = [
            np.interp(np.abs(velocity), v, size) for v, size in zip(self.speeds, self.sizes, strict=True)
        ]
        return np.where(velocity < 0.0, found[1], found[0])

    def beside(
        self, standard_error: Callable[[np.ndarray], np.ndarray]
    ) -> Callable[[np.ndarray], np.ndarray]:
        """Return the standard error of a curve at velocities with the misses."""
        return lambda velocity: np.hypot(standard_error(velocity), self.at(velocity))

    def on(self, choice: Choice) -> Choice:
        """Return a choice of line sections whose errors at the knots count the misses; unchanged for a straight line.

        A knot counts the largest miss of the sections beside it.
        """
        form, k = choice.candidate.form, len(choice.candidate.terms)
        if form.knots.size < 3 or not self.sizes.any():
            return choice
        covariance, n = choice.covariance.copy(), form.knots.size
        ways = zip((1.0, -1.0), self.speeds, self.sizes, strict=True)
        for first, (sign, speeds, sizes) in zip(range(k, choice.coefficients.size, n), ways, strict=False):
            at, size = slice(first, first + n), self.at(sign * np.maximum(form.knots, 1e-300))
            section = np.searchsorted(form.knots, speeds, side="right") - 1
            for beside in (section, section + 1):
                np.maximum.at(size, np.clip(beside, 0, n - 1), sizes)
            covariance[at, at] += np.diag(size**2)
        return replace(choice, covariance=covariance)


NOTHING = Misses(speeds=np.zeros((2, 1)), sizes=np.zeros((2, 1)))


def misses_of(bins: Bins, choice: Choice, slowest: float) -> Misses:
    """Return what a fitted curve misses.

    Args:
        bins: of all columns, not whitened; those of the fit are used.
        choice: the fit.
        slowest: speed from which on the curve is fitted [rad/s or m/s].
    """
    of_all = choice.candidate.spread @ choice.coefficients
    way = np.sign(bins.X[:, len(COLUMNS) :] @ of_all[len(COLUMNS) :])
    rows = np.flatnonzero(bins.used & (way != 0.0))
    left = (bins.y - bins.X @ of_all)[rows]
    return misses_at(rows, way[rows] * bins.speed[rows], left, slowest, choice.candidate.form.symmetric)


def misses_at(
    rows: np.ndarray, velocity: np.ndarray, left: np.ndarray, slowest: float, symmetric: bool
) -> Misses:
    """Return what a curve misses at velocities, from its residual there.

    Args:
        rows: numbers of bins or samples, ascending; a pass goes on in consecutive ones, (n,).
        velocity: other than 0 [rad/s or m/s], (n,).
        left: measured minus predicted torque [N.m or N], (n,).
        slowest: speed from which on the curve is fitted [rad/s or m/s].
        symmetric: the curve is the same both ways.
    """
    way, speed = np.sign(velocity), np.abs(velocity)
    run = np.cumsum(np.r_[True, (np.diff(rows) > 1) | (np.diff(way) != 0.0)][: rows.size]) - 1
    sides = [np.ones(rows.size, dtype=bool)] if symmetric else [way > 0.0, way < 0.0]
    ends = [_end_of_slowest(speed[side], run[side]) for side in sides]
    if not max(ends) < speed.max(initial=0.0):
        return NOTHING
    top, first = float(speed.max()), max(RATIO * slowest, *ends)
    count = max(int(np.log(top / first) / np.log(RATIO)), 1)
    edges = np.r_[0.0, first * (top / first) ** (np.arange(count + 1) / count)]
    group = np.clip(np.searchsorted(edges, speed, side="left") - 1, 0, count)
    middle = np.bincount(group, speed, count + 1) / np.maximum(np.bincount(group, minlength=count + 1), 1)
    middle = np.where(middle > 0.0, middle, np.sqrt(edges[1:] * edges[:-1]))
    edge = max(int(np.searchsorted(middle, EDGE * slowest)), 1)
    found = [_sizes((way * left)[side], group[side], run[side], count + 1, edge) for side in sides]
    last = max(int(np.argmin(np.r_[likely, False])) for _, likely in found)
    held = min(last, edge, count)
    return Misses(
        speeds=np.tile(middle, (2, 1)),
        sizes=np.array([found[0][0], found[-1][0]]),
        held=float(middle[held]) if held else 0.0,
    )


def _end_of_slowest(speed: np.ndarray, run: np.ndarray) -> float:
    """Return the speed below which enough bins of enough passes lie [rad/s or m/s]; infinite if there are too few.

    Args:
        speed: of each bin [rad/s or m/s], (n,).
        run: number of the pass of each bin, (n,).
    """
    first = np.flatnonzero(np.diff(run, prepend=-1))
    if first.size < PASSES or speed.size < FEWEST:
        return np.inf
    slowest = np.minimum.reduceat(speed, first)  # of each pass
    return float(
        max(np.partition(slowest, PASSES - 1)[PASSES - 1], np.partition(speed, FEWEST - 1)[FEWEST - 1])
    )


def _sizes(
    along: np.ndarray, group: np.ndarray, run: np.ndarray, count: int, edge: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the significant mean residual of each range of speeds less what noise adds, and where it likely is one, (count,) each.

    Args:
        along: residual, positive where friction is larger than the curve [N.m or N], (n,).
        group: range of each bin, (n,).
        run: number of the pass of each bin, (n,).
        count: number of ranges.
        edge: number of the slowest ones in which any mean residual counts.
    """
    number = np.bincount(group, minlength=count)
    mean = np.bincount(group, along, count) / np.maximum(number, 1)
    runs = int(run.max(initial=0)) + 1
    pair = group * runs + run
    sums = np.bincount(pair, along - mean[group], count * runs).reshape(count, runs)
    passes = np.count_nonzero(np.bincount(pair, minlength=count * runs).reshape(count, runs), axis=1)
    spread = np.einsum("gr,gr->g", sums, sums) * passes / np.maximum(passes - 1, 1)
    variance = spread / np.maximum(number, 1) ** 2
    enough, free = (passes >= PASSES) & (number >= FEWEST), np.maximum(passes - 1, 1)
    limit = stdtrit(free, 1.0 - 0.5 * CHANCE)
    limit[:edge] = 0.0
    counts = enough & (np.abs(mean) > limit * np.sqrt(variance))
    likely = enough & (np.abs(mean) > stdtrit(free, 1.0 - 0.5 * LIKELY) * np.sqrt(variance))
    return np.where(counts, np.sqrt(np.maximum(mean**2 - variance, 0.0)), 0.0), likely
