"""Means over bins along the motion of some time before, for any number of such times.

What does not depend on the delay is made once. Columns that are linear in a series are means of it with other weights, and
the sine and cosine of a position are interpolated as the position is; only the curve's functions need each sample.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.identification import curves, design
from backdrive.identification.delay import cubic, earlier
from backdrive.identification.motion_bins import CHUNK, FILLED, Bins, bin_size, block_count
from backdrive.identification.signals import Signals
from backdrive.logs import filters

MARGIN = 0.2  # delays up to this are reached without new arrays [s]


class ShiftedStretch:
    """One stretch.

    Args:
        s: motion and torque.
        seconds: of the bins [s].
    """

    def __init__(self, s: Signals, seconds: float):
        self.width, self.count = bin_size(s, seconds)
        self.signals = s
        self.torque = filters.means(s.torque, self.width)
        head = design.head(s)
        self._still = [
            filters.means(x, self.width) for x in (head[2], head[5])
        ]  # the constant, the known torque
        self._series = np.stack([head[k] for k in (0, 1, 3, 4)])
        self._margin = 0
        self._longer = self._series
        self._reach(round(MARGIN * s.rate) + 3)

    def _reach(self, margin: int) -> None:
        """Continue the series by their first and last values, at least so many samples."""
        if margin > self._margin:
            series, self._margin = self._series, margin
            self._longer = np.concatenate(
                [np.repeat(series[:, :1], margin, axis=1), series, np.repeat(series[:, -1:], margin, axis=1)],
                axis=1,
            )
            self._series = self._longer[:, margin : margin + series.shape[1]]

    def head(self, delay: float) -> np.ndarray:
        """Return the means of `design.COLUMNS` along the motion of a time before [s], (n, 6)."""
        whole, weights = cubic(delay * self.signals.rate)
        whole = min(max(whole, -self.signals.time.size - 2), self.signals.time.size + 2)
        self._reach(abs(whole) + 3)
        size, width = self.count * self.width, self.width
        part = self._longer[:, self._margin - whole - 2 :]
        kernel = np.convolve(np.ones(width) / width, weights)
        moved = part[:, :size].reshape(4, self.count, width) @ kernel[:width]
        for k in range(width, width + 3):
            moved += kernel[k] * part[:, k : k + size : width]
        one, known = self._still
        return np.stack([moved[0], moved[1], one, moved[2], moved[3], known], axis=1)

    def curve(self, delay: float, knots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the means of a curve's functions (n, 2 k), of sliding [-] and of the speed [rad/s or m/s], (n,) each."""
        s, size = self.signals, self.count * self.width
        samples = delay * s.rate
        velocity = earlier(s.velocity, samples)[:size]
        sliding = (later(s.sliding, round(samples)) & s.moving)[:size]
        step = max(1, CHUNK // self.width) * self.width
        parts = [
            curves.basis_means(velocity[first : first + step], knots, self.width)
            for first in range(0, max(size, 1), step)
        ]
        means = (filters.means(x, self.width) for x in (sliding, np.abs(velocity)))
        return np.concatenate(parts), *means


def later(mask: np.ndarray, samples: int) -> np.ndarray:
    """Return a mask moved by whole samples, its ends held, (n,)."""
    if samples == 0 or not mask.size:
        return mask
    samples = min(max(samples, -mask.size), mask.size)
    moved = np.empty_like(mask)
    if samples > 0:
        moved[:samples], moved[samples:] = mask[0], mask[:-samples]
    else:
        moved[samples:], moved[:samples] = mask[-1], mask[-samples:]
    return moved


def shifted_bins(
    stretches: Sequence[ShiftedStretch],
    delay: float,
    knots: np.ndarray,
    candidate: design.Candidate | None = None,
) -> Bins:
    """Return what `bin_means` does of motion and load shifted back by a time.

    Args:
        stretches: of one joint.
        delay: of the torque behind the motion [s].
        knots: of the fine basis [rad/s or m/s], (k,).
        candidate: whose columns alone are returned; None: all.
    """
    parts = []
    for s in stretches:
        head = s.head(delay)
        if candidate is not None:
            head, knots = head[:, [design.COLUMNS.index(t) for t in candidate.terms]], candidate.form.knots
        shapes, sliding, speed = s.curve(delay, knots)
        if candidate is not None and candidate.form.symmetric:
            shapes = shapes[:, : knots.size] + shapes[:, knots.size :]
        parts.append([np.hstack([head, shapes]), s.torque, sliding, speed])
    X, y, used, speed = (np.concatenate(part) for part in zip(*parts, strict=True))
    count = block_count([s.signals for s in stretches])
    return Bins(X=X, y=y, used=used > FILLED, speed=speed, blocks=count)
