"""Means of torque and regressors over short bins: they filter both sides of a regression alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_banded

from backdrive.errors import NotIdentifiable
from backdrive.identification import design, regression, robust
from backdrive.identification.signals import Signals, default_cutoff
from backdrive.identification.whitening import PIECE, Colour, whiten_both, whiten_some
from backdrive.logs import filters
from backdrive.logs.quantiles import median

BIN_TIME = 0.01  # shortest bin [s]
LONGEST_BIN = 0.1  # longest bin [s]
RINGING = 0.8  # length of a bin after a low pass [period of its cutoff frequency]
SHORTER = 0.7  # the same after the default low pass
OF_A_MOVE = 0.125  # longest bin, relative to the median time between two reversals [-]
BLOCK_TIME = 1.5  # shortest cross-validation block, unless `BLOCKS` requires shorter ones [s]
BLOCKS = (8, 24)  # least and largest number of blocks
# least share of sliding samples in a used bin; least share of moving samples, if there is little motion [-]
FILLED, HALF = 0.9, 0.5
LONG_ENOUGH = 0.25  # least time of sliding near the slowest sliding speed [s]
MOVE = 0.1  # least duration of a move [s]
CHUNK = 200_000  # number of samples per chunk of the regressor
Means = Callable[[Signals, np.ndarray, slice, int], np.ndarray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Bins:
    """Means over bins, of all stretches one after another.

    Attributes:
        X: means of the regressor, (n, p).
        y: means of the torque [N.m or N], (n,).
        used: whether the joint slides for most of the bin, (n,).
        speed: mean speed [rad/s or m/s], (n,).
        blocks: number of cross-validation blocks of all stretches.
    """

    X: np.ndarray
    y: np.ndarray
    used: np.ndarray
    speed: np.ndarray
    blocks: int

    def map_columns(self, spread: np.ndarray) -> Bins:
        """Return the same bins with the regressor X @ spread."""
        return replace(self, X=self.X @ spread)

    def faster(self, speed: float) -> Bins:
        """Return the same bins, of which only those at a speed [rad/s or m/s] or above are used."""
        return replace(self, used=self.used & (self.speed >= speed))

    def slower(self, speed: float, weights: np.ndarray) -> regression.Blocks:
        """Return the normal equations of the used bins below a speed [rad/s or m/s], given the weight of each bin, (n,)."""
        at = np.flatnonzero(self.used & (self.speed < speed))
        return regression.accumulate_rows(self.X, self.y, weights[at], at, self.block, self.blocks)

    def slowest(self, count: float) -> float:
        """Return the speed below which so many used bins lie, at most half of them [rad/s or m/s]; 0 without any."""
        speeds = self.speed[self.used]
        least = min(round(count), speeds.size // 2)
        return float(np.partition(speeds, least)[least]) if speeds.size else 0.0

    def whiten(self, colour: Colour) -> Bins:
        """Return bins transformed so that their noise is white and of the same size.

        Positively correlated noise is modelled as AR(1), and negatively correlated noise as MA(1). The latter occurs in an
        acceleration from an encoder, whose error at the border of two bins affects both.

        Args:
            colour: of the noise of neighbouring bins.
        """
        if (correlation := colour.correlation) < 0.0:
            return self._whiten_opposite(moving_average(correlation))
        if not correlation > 0.0:
            return self
        at = np.flatnonzero(self.used)
        if not colour.beside:
            return replace(
                self, X=whiten_some(self.X, at, correlation), y=whiten_some(self.y, at, correlation)
            )
        X, y = self.X.copy(), self.y.copy()
        for first in range(0, at.size, PIECE):  # copies of all bins would fill the memory
            rows = at[first : first + PIECE]
            white = whiten_both(np.column_stack([self.X[rows], self.y[rows]]), rows, colour)
            X[rows], y[rows] = white[:, :-1], white[:, -1]
        return replace(self, X=X, y=y)

    def _whiten_opposite(self, share: float) -> Bins:
        """Return bins minus a share of the innovation of the preceding bin, if that is used."""
        below = np.zeros(self.y.size)
        below[:-1] = share * (self.used[1:] & self.used[:-1])
        both = solve_banded(
            (1, 0), np.stack([np.ones(self.y.size), below]), np.column_stack([self.X, self.y])
        )
        size = np.sqrt(1.0 + share**2)
        X, y = size * both[:, :-1], size * both[:, -1]
        X[~self.used], y[~self.used] = self.X[~self.used], self.y[~self.used]
        return replace(self, X=X, y=y)

    def equations(self, start: np.ndarray | None = None, rounds: int = robust.MANY) -> regression.Blocks:
        """Return the robustly weighted normal equations of all columns, by block of neighbouring samples.

        Args:
            start: coefficients of a similar fit, which save repetitions, (p,).
            rounds: largest number of repetitions.
        """
        return self.equations_and_weights(start, rounds)[0]

    def equations_and_weights(
        self, start: np.ndarray | None = None, rounds: int = robust.MANY
    ) -> tuple[regression.Blocks, np.ndarray]:
        """Return the result of `equations`, and the weights, (n,)."""
        return robust.robust_blocks(
            self.X, self.y, self.used.astype(float), self.block, self.every, rounds, start
        )

    @cached_property
    def every(self) -> regression.Blocks:
        """The normal equations of all columns and used bins, by block."""
        return regression.accumulate(self.X, self.y, self.used.astype(float), self.block, self.blocks)

    def with_torque(self, y: np.ndarray) -> Bins:
        """Return the same bins with another torque (n,); products of columns that are known stay."""
        made = replace(self, y=y)
        if (known := vars(self).get("every")) is not None:
            block, used = self.block, y * self.used
            first = np.flatnonzero(np.diff(block, prepend=-1))
            sums = np.zeros((self.blocks, self.X.shape[1] + 1))  # a few bins are not in every block
            sums[block[first]] = np.add.reduceat(
                np.column_stack([self.X * used[:, None], used * y]), first, axis=0
            )
            vars(made)["every"] = replace(known, moment=sums[:, :-1], power=sums[:, -1])
        return made

    @property
    def block(self) -> np.ndarray:
        """Index of the block of each bin, (n,)."""
        return regression.block_index(len(self.y), self.blocks)

    def sandwich(self, theta: np.ndarray) -> np.ndarray:
        """Return the covariance of a robust fit from the scatter of the scores of neighbouring samples' blocks, (p, p).

        Args:
            theta: its coefficients, (p,).
        """
        residual = self.y - self.X @ theta
        width = robust.HUBER * robust.robust_spread(residual[self.used]) or np.inf  # without noise, all count
        weight = self.used * robust.huber_weights(residual, width)
        first = np.flatnonzero(np.diff(self.block, prepend=-1))
        weighted = self.X * weight[:, None]
        scores = np.add.reduceat(weighted * residual[:, None], first)[np.add.reduceat(weight, first) > 0.0]
        return regression.cluster_covariance(regression.invert(weighted.T @ self.X), scores)


def moving_average(correlation: float) -> float:
    """Return the coefficient of the MA(1) with a given negative correlation of neighbours [-]."""
    return (1.0 - float(np.sqrt(1.0 - 4.0 * correlation**2))) / (2.0 * correlation)


def bin_time(stretches: Sequence[Signals], cutoff: float | None) -> float:
    """Return the length of a bin [s]: most of a period of the cutoff frequency, against ringing about reversals, within limits.

    The default low pass hardly changes the motion, so shorter bins do: they keep more of what coloured noise leaves to be seen.

    Args:
        stretches: of one joint.
        cutoff: cutoff frequency of the motion's low pass [Hz]; None: the default.
    """
    ringing = RINGING / cutoff if cutoff else SHORTER / default_cutoff(stretches[0].rate)
    period = period_of([s.moves for s in stretches])
    longest = 0.5 * OF_A_MOVE * period if period else LONGEST_BIN
    return max(BIN_TIME, min(ringing, longest, LONGEST_BIN))


def bin_size(s: Signals, seconds: float = BIN_TIME) -> tuple[int, int]:
    """Return the width of a bin of given length [sample], and the number of whole bins."""
    width = max(1, round(seconds * s.rate))
    return width, s.time.size // width


def block_count(duration: float, period: float = 0.0) -> int:
    """Return the number of blocks of neighbouring samples.

    If the log is long enough, a block is at least as long as a period of the motion. A shorter one resembles its neighbours.

    Args:
        duration: of all stretches [s].
        period: of the motion [s].
    """
    return int(min(max(duration / max(BLOCK_TIME, period), BLOCKS[0]), BLOCKS[1]))


def period_of(moves: Sequence[np.ndarray]) -> float:
    """Return the period of a motion, twice the median time between two reversals [s]; 0 if there are no two reversals.

    Args:
        moves: times between reversals of each stretch, from `Signals.moves` [s].
    """
    every = np.concatenate(moves)
    return 2.0 * median(every) if every.size else 0.0


def moves(stretches: Sequence[Signals]) -> int:
    """Return the number of moves: sliding between two reversals or rests that lasts at least `MOVE`."""
    count = 0
    for s in stretches:
        way = (np.sign(s.velocity) * s.sliding)[s.sliding | ~s.moving]
        edges = np.flatnonzero(np.diff(way, prepend=0.0, append=0.0) != 0)
        lasting = np.diff(edges) >= MOVE * s.rate
        count += int(np.count_nonzero(way[edges[:-1]][lasting]))
    return count


def bin_means(
    stretches: Sequence[Signals],
    knots: np.ndarray,
    means: Means = design.means,
    seconds: float = BIN_TIME,
    reversals: bool = False,
    filled: float = FILLED,
) -> Bins:
    """Return the means over bins, with those marked in which the joint slides.

    Args:
        stretches: of one joint.
        knots: of the curve among the columns [rad/s or m/s], (k,).
        means: function that returns the means of the regressor over bins of a stretch, (n, p).
        seconds: length of a bin [s].
        reversals: count reversals and slow motion as sliding.
        filled: least share of sliding samples in a used bin [-].

    Raises:
        NotIdentifiable: all stretches are shorter than a bin.
    """
    total, done = sum(bin_size(s, seconds)[1] for s in stretches), 0
    if not total:
        raise NotIdentifiable(
            f"No stretch between gaps lasts {seconds:.2g} s.", remedy="Record without dropping samples."
        )
    X, (y, used, speed) = np.empty((total, 0)), np.empty((3, total))  # filled: parts would be there twice
    for s in stretches:
        width, count = bin_size(s, seconds)
        per_chunk = max(1, CHUNK // width)
        mask = s.moving if reversals else s.sliding
        for first in range(0, count, per_chunk):
            n = min(per_chunk, count - first)
            rows = slice(first * width, (first + n) * width)
            part = means(s, knots, rows, width)
            if not done:
                X = np.empty((total, part.shape[1]))
            into = slice(done, done + n)
            X[into] = part
            series = s.torque[rows], mask[rows], np.abs(s.velocity[rows])
            y[into], used[into], speed[into] = (filters.means(x, width) for x in series)
            done += n
    return Bins(
        X=X,
        y=y,
        used=used > filled,
        speed=speed,
        blocks=block_count(
            sum(s.time.size / s.rate for s in stretches), period_of([s.moves for s in stretches])
        ),
    )


def slowest_sliding(stretches: Sequence[Signals], knots: np.ndarray) -> float:
    """Return the slowest knot near which the joint slid for a while [rad/s or m/s].

    Args:
        stretches: of one joint.
        knots: speeds, ascending from zero [rad/s or m/s], (k,).
    """
    for knot in knots[1:]:
        kept = 0.0
        for s in stretches:
            speed = np.abs(s.velocity[s.sliding])
            kept += float(np.count_nonzero((speed > 0.5 * knot) & (speed < 1.5 * knot))) / s.rate
        if kept >= LONG_ENOUGH:
            return float(knot)
    return float(knots[-1])
