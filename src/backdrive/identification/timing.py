"""The timing of a log's torque: sampled with the position, or commanded from that sample on.

A command u_k acts from t_k to t_k+1, on average half an interval later than position and velocity at t_k. A measured torque
belongs to t_k itself. Confusing the two biases a sweep's curve by up to -1.9 I V^3 T / A^2. The inertia distinguishes them,
since a torque with the delay d adds -I d times the jerk (`design`). Encoder errors in the jerk reduce its coefficient, which
would look like no delay: the response to a known shift of the motion tells by how much (`slip`). Only sliding tells: near a
reversal, where the jerk is largest, the instant at which friction changes sign would be taken for a delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from backdrive.identification import curves, regression
from backdrive.identification.delay import delay_signals
from backdrive.identification.motion_bins import Bins, bin_means, bin_time
from backdrive.identification.noise import covariance_of_fit
from backdrive.identification.signals import Signals
from backdrive.identification.slip import LEVER, LEVER_SAMPLES, SHOWN

Timing = Literal["command", "sample"]
NEAR = 0.25  # largest distance of a delay from that of a command (-0.5) or a sample (0) [sampling interval]
MORE = 2.0  # least number of bins, by that of the unknowns [-]
FAR = 3.0  # least distance of a delay from that of the other one [standard error]


def torque_timing(stretches: Sequence[Signals]) -> tuple[Timing | None, float, float]:
    """Detect from the motion whether the torque was commanded or sampled.

    Args:
        stretches: of one joint, at one sampling rate.

    Returns:
        `command`, `sample`, or None if the inertia does not rule out one of them; the delay of the torque behind the motion and its
        standard error [s].
    """
    speeds = np.concatenate([np.abs(s.velocity[s.moving]) for s in stretches])
    if not speeds.size or not speeds.max() > 0:
        return None, float("nan"), float("nan")
    knots = float(np.percentile(speeds, 99.9)) * np.array(
        [curves.SHARES[i] for i in curves.COARSE["7 sections"]]
    )
    lever = max(LEVER, LEVER_SAMPLES / stretches[0].rate)
    now = _fit(stretches, knots)
    then = _fit([delay_signals(s, lever) for s in stretches], knots)
    share = (now.delay - then.delay) / lever if now and then else 0.0
    if not (now and share > SHOWN):  # without inertia, or with a jerk that is mostly the encoder's error
        return None, float("nan"), float("nan")
    delay, error = now.delay / min(share, 1.0), now.error() / min(share, 1.0)
    period = 1.0 / stretches[0].rate
    to_command, to_sample = abs(delay + 0.5 * period), abs(delay)
    if to_command <= NEAR * period and to_sample > FAR * error:
        return "command", delay, error
    if to_sample <= NEAR * period and to_command > FAR * error:
        return "sample", delay, error
    return None, delay, error


class _Fit(NamedTuple):
    """A fit with inertia and jerk as its first columns."""

    bins: Bins
    blocks: regression.Blocks
    theta: np.ndarray

    @property
    def delay(self) -> float:
        """What the jerk tells, before its response is known [s]."""
        return float(self.theta[1] / self.theta[0])

    def error(self) -> float:
        """Return its standard error [s]."""
        bins, theta = self.bins, self.theta
        coloured = covariance_of_fit(bins.X, bins.y - bins.X @ theta, bins.used)[1, 1]
        # larger where the noise moves the joint, and the servo answers
        of_blocks = regression.sandwich(self.blocks, theta)[1, 1]
        return float(np.sqrt(max(coloured, of_blocks, 0.0)) / theta[0])


def _fit(stretches: Sequence[Signals], knots: np.ndarray) -> _Fit | None:
    """Return a fit of means; None without inertia.

    Args:
        stretches: of one joint.
        knots: of the curve [rad/s or m/s], (k,).
    """
    bins = bin_means(stretches, knots, _means, bin_time(stretches, None))
    if np.count_nonzero(bins.used) < MORE * bins.X.shape[1]:
        return None
    blocks = bins.equations()
    theta = blocks.solution()
    return _Fit(bins, blocks, theta) if theta[0] > 0 else None


def _means(s: Signals, knots: np.ndarray, rows: slice, width: int) -> np.ndarray:
    """Return means of acceleration, negative jerk, a parabola of the position, and a symmetric curve, (n, 5 + k)."""
    position = np.zeros_like(s.velocity) if s.position is None else s.position - s.position.mean()
    shape = curves.hats(np.abs(s.velocity), knots) * np.sign(s.velocity)[:, None]
    every = np.column_stack([s.acceleration, -s.jerk, np.ones_like(position), position, position**2, shape])
    return every[rows].reshape(-1, width, every.shape[1]).mean(axis=1)
