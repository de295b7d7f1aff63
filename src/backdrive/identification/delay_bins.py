"""Means over bins along a delayed motion, for many values of the delay.

Everything that does not depend on the delay is computed once. Columns that are linear in a series are its means with other
weights, and sine and cosine of a position are interpolated like the position. Only the curve's functions need each sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy

import numpy as np

from backdrive.identification import curves, design
from backdrive.identification.delay import cubic, earlier
from backdrive.identification.motion_bins import (
    CHUNK,
    FILLED,
    Bins,
    bin_size,
    block_count,
    period_of,
)
from backdrive.identification.signals import Signals
from backdrive.logs import filters

OF_JERK = 40.0  # cutoff frequency of the jerk, against encoder errors [Hz]
MARGIN = 0.2  # longest delay that needs no new arrays [s]


class DelayStretch:
    """One stretch, of which all that does not depend on the delay is computed once.

    Args:
        s: motion and torque.
        seconds: of the bins [s].
        jerk: without encoder errors [rad/s^3 or m/s^3], (n,); None: that of the motion after a low pass; (0,): 0.
    """

    def __init__(self, s: Signals, seconds: float, jerk: np.ndarray | None = None):
        self.width, self.count = bin_size(s, seconds)
        self.rate, self.samples = s.rate, s.time.size
        self.duration, self.moves = s.time.size / s.rate, s.moves
        self.torque = filters.means(s.torque, self.width)
        self._known = np.zeros(self.count)
        if s.model_torque is not None:
            self._known = filters.means(s.model_torque, self.width)
        self._moving, self._sliding = s.moving, s.sliding
        self._margin = round(MARGIN * s.rate) + 3
        self._velocity = s.velocity
        smooth = filters.low_pass_rows([s.jerk], OF_JERK, s.rate)[0] if jerk is None else jerk
        self._longer = self._with_ends([s.acceleration, *(s.pull or ())], self._margin)
        self._jerk = self._with_ends([-smooth] if smooth.size else [], self._margin)

    def with_sliding(self, sliding: np.ndarray) -> DelayStretch:
        """Return the same stretch with other samples that slide, (n,)."""
        made = copy(self)
        made._sliding = sliding
        return made

    def _with_ends(self, rows: Sequence[np.ndarray] | np.ndarray, margin: int) -> np.ndarray:
        """Return series of all samples as rows, extended by their first and last values on both sides."""
        longer = np.empty((len(rows), self.samples + 2 * margin))
        for row, x in zip(longer, rows, strict=True):
            row[:margin], row[margin:-margin], row[-margin:] = x[0], x, x[-1]
        return longer

    def _reach(self, margin: int) -> None:
        """Extend the series by at least `margin` samples."""
        if margin > self._margin:
            inside = slice(self._margin, self._margin + self.samples)
            self._longer = self._with_ends(self._longer[:, inside], margin)
            self._jerk = self._with_ends(self._jerk[:, inside], margin)
            self._margin = margin

    def _means(self, series: np.ndarray, whole: int, weights: tuple[float, ...]) -> np.ndarray:
        """Return the means of extended series over bins, delayed by an integer number of samples and by weights, (k, n)."""
        width, kernel = self.width, np.convolve(np.ones(self.width) / self.width, weights)
        taps = np.zeros((-(-kernel.size // width), width))  # those of a bin, and of the ones after it
        taps.reshape(-1)[: kernel.size] = kernel
        moved = np.empty((len(series), self.count))
        for row, of_row in zip(series[:, self._margin - whole - 2 :], moved, strict=True):
            parts = taps @ row[: self.count * width].reshape(-1, width).T
            of_row[:] = parts[0]
            for k in range(1, len(taps)):
                of_row[:-k] += parts[k, k:]
            for k in range(max(self.count - len(taps) + 1, 0), self.count):  # these reach beyond the last bin
                of_row[k] = kernel @ row[k * width : k * width + kernel.size]
        return moved

    def head(self, delay: float) -> np.ndarray:
        """Return the means of `design.COLUMNS` along the motion delayed by a time [s], (n, 6)."""
        whole, weights = cubic(delay * self.rate)
        whole = min(max(whole, -self.samples - 2), self.samples + 2)
        self._reach(abs(whole) + 3)
        columns = np.zeros((len(design.COLUMNS), self.count))
        moved = self._means(self._longer, whole, weights)
        columns[0], columns[2], columns[5] = moved[0], 1.0, self._known
        columns[3 : 2 + len(moved)] = moved[1:]
        columns[1 : 1 + len(self._jerk)] = self._means(self._jerk, whole, weights)
        return columns.T

    def curve(self, delay: float, knots: np.ndarray, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Write the means of a curve's functions, (n, 2 k); return those of sliding [-] and of the speed [rad/s or m/s], (n,)."""
        size, samples = self.count * self.width, delay * self.rate
        velocity = earlier(self._velocity, samples)[:size]
        sliding = (later(self._sliding, round(samples)) & self._moving)[:size]
        step = max(1, CHUNK // self.width) * self.width
        slides, speed = np.empty((2, self.count))
        for first in range(0, size, step):
            part, into = (
                velocity[first : first + step],
                slice(first // self.width, (first + step) // self.width),
            )
            shapes[into] = curves.basis_means(part, knots, self.width)
            slides[into] = filters.means(sliding[first : first + step], self.width)
            speed[into] = filters.means(np.abs(part), self.width)
        return slides, speed

    def change(self, delay: float, candidate: design.Candidate, coefficients: np.ndarray) -> np.ndarray:
        """Return the derivative of the means of a predicted torque by the delay [N.m/s or N/s], (n,); see `delay_slope`."""
        samples = (
            min(max(delay * self.rate, -self.samples - 2.0), self.samples + 2.0) + 0.5
        )  # a bin ends between two
        whole = math.floor(samples)
        weights = samples - whole, 1.0 - (samples - whole)
        self._reach(abs(whole) + 3)
        first, size = self._margin - whole - 1, self.count + 1
        velocity, motion, jerk = (
            weights[0] * x[:, first :: self.width][:, :size]
            + weights[1] * x[:, first + 1 :: self.width][:, :size]
            for x in (self._with_ends([self._velocity], self._margin), self._longer, self._jerk)
        )
        head = candidate.spread @ coefficients  # as in `head`
        curve = coefficients[None, len(candidate.terms) :]
        torque = curves.torques(candidate.form, curve, velocity[0], np.zeros(size, dtype=int))
        torque += head[[0, 3, 4]][: len(motion)] @ motion + head[[1]][: len(jerk)] @ jerk
        return (torque[:-1] - torque[1:]) * (self.rate / self.width)


def later(mask: np.ndarray, samples: int) -> np.ndarray:
    """Return a mask delayed by whole samples, (n,); beyond its ends, it keeps its first and last value."""
    if samples == 0 or not mask.size:
        return mask
    samples = min(max(samples, -mask.size), mask.size)
    moved = np.empty_like(mask)
    if samples > 0:
        moved[:samples], moved[samples:] = mask[0], mask[:-samples]
    else:
        moved[samples:], moved[:samples] = mask[-1], mask[-samples:]
    return moved


def bins_at_delay(
    stretches: Sequence[DelayStretch],
    delay: float,
    knots: np.ndarray,
    candidate: design.Candidate | None = None,
) -> Bins:
    """Return the bins that `bin_means` would return for motion and load delayed by a time.

    Args:
        stretches: of one joint.
        delay: of the torque behind the motion [s].
        knots: of the fine basis [rad/s or m/s], (k,).
        candidate: return its columns alone; None: all columns.
    """
    terms, symmetric = list(range(len(design.COLUMNS))), False
    if candidate is not None:
        terms, symmetric = [design.COLUMNS.index(t) for t in candidate.terms], candidate.form.symmetric
        knots = candidate.form.knots
    k, total, begin = knots.size, sum(s.count for s in stretches), 0
    X = np.empty((total, len(terms) + (1 if symmetric else 2) * k))
    y, sliding, speed = np.empty((3, total))
    for s in stretches:
        rows = slice(begin, begin + s.count)
        X[rows, : len(terms)] = s.head(delay)[:, terms]
        shapes = np.empty((s.count, 2 * k)) if symmetric else X[rows, len(terms) :]
        sliding[rows], speed[rows] = s.curve(delay, knots, shapes)
        if symmetric:
            np.add(shapes[:, :k], shapes[:, k:], out=X[rows, len(terms) :])
        y[rows] = s.torque
        begin += s.count
    count = block_count(sum(s.duration for s in stretches), period_of([s.moves for s in stretches]))
    return Bins(X=X, y=y, used=sliding > FILLED, speed=speed, blocks=count)
