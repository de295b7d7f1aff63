"""Means of torque and regressors over short bins: they filter both sides of a regression alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification import design, regression
from backdrive.identification.signals import Signals
from backdrive.logs import filters

BIN_TIME = 0.01  # torque and regressors are averaged over this long, at least [s]
LONGEST_BIN = 0.1  # and at most [s]
OF_A_MOVE = 0.125  # and at most over so much of the time between two reversals [-]
BLOCK_TIME = 1.5  # aimed length of a cross-validation block [s]
BLOCKS = (8, 24)  # least and most blocks
FILLED, HALF = 0.9, 0.5  # share of a bin that must be of sliding; of motion, where there is little of it [-]
CHUNK = 200_000  # samples turned into a regressor at a time
Means = Callable[[Signals, np.ndarray, slice, int], np.ndarray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Bins:
    """Means over bins, of all stretches one after another.

    Attributes:
        X: of the regressor, (n, p).
        y: of the torque [N.m or N], (n,).
        used: whether the joint slides for most of the bin, (n,).
        speed: mean size of the velocity [rad/s or m/s], (n,).
        blocks: how many blocks of neighbours all stretches are cut into.
    """

    X: np.ndarray
    y: np.ndarray
    used: np.ndarray
    speed: np.ndarray
    blocks: int

    def map_columns(self, spread: np.ndarray) -> Bins:
        """Return the same with the regressor X @ spread."""
        return replace(self, X=self.X @ spread)

    def faster(self, speed: float) -> Bins:
        """Return the same with only those used that are at least so fast [rad/s or m/s]."""
        return replace(self, used=self.used & (self.speed >= speed))

    def whiten(self, correlation: float) -> Bins:
        """Return bins whitened by an AR(1) model of their noise, scaled to keep the size of the noise.

        Args:
            correlation: of the noise of neighbouring bins [-].
        """
        if not correlation > 0.0:
            return self
        at = np.flatnonzero(self.used)
        before, after = at[:-1], at[1:]
        kept = correlation ** (after - before)
        size = np.sqrt(1.0 - kept**2)
        X, y, rows, torque = self.X.copy(), self.y.copy(), self.X[at], self.y[at]
        X[after] = (rows[1:] - kept[:, None] * rows[:-1]) / size[:, None]
        y[after] = (torque[1:] - kept * torque[:-1]) / size
        return replace(self, X=X, y=y)

    def equations(self) -> regression.Blocks:
        """Return the robustly weighted normal equations of all columns, by block of neighbouring samples."""
        w = regression.robust_weights(self.X, self.y, self.used.astype(float))
        block = regression.block_index(len(self.y), self.blocks)
        return regression.accumulate(self.X, self.y, w, block, self.blocks)


def bin_time(stretches: Sequence[Signals], cutoff: float) -> float:
    """Return the length of a bin [s]: a period of the low pass's corner frequency, which removes the ringing about reversals.

    Args:
        stretches: of one joint.
        cutoff: of the low pass of its motion [Hz].
    """
    turns = [np.flatnonzero(np.diff(np.sign(s.velocity[s.sliding])) != 0) for s in stretches]
    moves = np.concatenate([np.diff(at) / s.rate for at, s in zip(turns, stretches, strict=True)])
    longest = OF_A_MOVE * float(np.median(moves)) if moves.size else LONGEST_BIN
    return max(BIN_TIME, min(1.0 / cutoff, longest, LONGEST_BIN))


def bin_size(s: Signals, seconds: float = BIN_TIME) -> tuple[int, int]:
    """Return the width of a bin of so long [s] and the number of whole bins [sample]."""
    width = max(1, round(seconds * s.rate))
    return width, s.time.size // width


def block_count(duration: float) -> int:
    """Return how many blocks of neighbouring samples stretches of so long together [s] are cut into."""
    return int(np.clip(duration / BLOCK_TIME, *BLOCKS))


def bin_means(
    stretches: Sequence[Signals],
    knots: np.ndarray,
    means: Means = design.means,
    seconds: float = BIN_TIME,
    reversals: bool = False,
    filled: float = FILLED,
) -> Bins:
    """Return the means over bins, where the joint slides.

    Args:
        stretches: of one joint.
        knots: of the curve among the columns [rad/s or m/s], (k,).
        means: what gives the means of the regressor over bins of some samples of a stretch, (n, p).
        seconds: of each bin [s].
        reversals: take part as well.
        filled: share of a bin that must take part for it to be used [-].
    """
    parts = []
    for s in stretches:
        width, count = bin_size(s, seconds)
        per_chunk = max(1, CHUNK // width)
        mask = s.moving if reversals else s.sliding
        for first in range(0, count, per_chunk):
            n = min(per_chunk, count - first)
            rows = slice(first * width, (first + n) * width)
            series = s.torque[rows], mask[rows], np.abs(s.velocity[rows])
            parts.append([means(s, knots, rows, width), *(filters.means(x, width) for x in series)])
    X, y, used, speed = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Bins(
        X=X,
        y=y,
        used=used > filled,
        speed=speed,
        blocks=block_count(sum(s.time.size / s.rate for s in stretches)),
    )
