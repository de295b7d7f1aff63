"""Gap-free motion and torque of one joint, ready for the kernels of a fit."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from backdrive.identification.delay import earlier
from backdrive.identification.dynamics import increments
from backdrive.identification.signals import Signals, default_cutoff, turns
from backdrive.laws import REFERENCE
from backdrive.logs.filters import derivative, low_pass

SMOOTHED = 100.0  # default bandwidth of encoder noise in the velocity [Hz]
BESIDE = 6  # number of samples on each side of a rest or reversal that do not count if friction jumps there


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretch:
    """Gap-free motion and torque of one joint, ready for the kernels.

    Attributes:
        dp: position increments [rad or m], (n,).
        position: [rad or m], (n,); None for a velocity-only log.
        acceleration: [rad/s^2 or m/s^2], (n,).
        torque: measured [N.m or N], (n,).
        dt: sampling time [s].
        load: motor-side and external torque [N.m or N], (n, 2) or (1, 2).
        temperature: [degC], (n,) or (1,).
        judged: samples that count, (n,).
        sliding: samples at which the joint slides steadily, (n,), or (1,) for all.
        only_sliding: whether only sliding samples count.
        bandwidth: of encoder noise in the velocity [Hz].
        cutoff: of the low pass of its motion [Hz]; None: the default.
    """

    dp: np.ndarray
    position: np.ndarray | None
    acceleration: np.ndarray
    torque: np.ndarray
    dt: float
    load: np.ndarray = field(default_factory=lambda: np.zeros((1, 2)))
    temperature: np.ndarray = field(default_factory=lambda: np.array([REFERENCE]))
    judged: np.ndarray
    sliding: np.ndarray = field(default_factory=lambda: np.ones(1, dtype=bool))
    only_sliding: bool = False
    bandwidth: float = SMOOTHED
    cutoff: float | None = None

    @property
    def velocity(self) -> np.ndarray:
        """Velocity of the interval that ends at each sample [rad/s or m/s], (n,)."""
        return self.dp / self.dt

    def rows(self, part: slice) -> Stretch:
        """Return a part of the samples; what is given once for all of them stays."""
        whole = {name: x for name, x in vars(self).items() if isinstance(x, np.ndarray)}
        n = len(self.torque)
        return replace(self, **{name: x[part] for name, x in whole.items() if len(x) == n})


def stretch(
    signals: Signals,
    *,
    load: np.ndarray | None = None,
    temperature: np.ndarray | None = None,
    bandwidth: float = SMOOTHED,
    cutoff: float | None = None,
) -> Stretch:
    """Return prepared signals as a stretch.

    Args:
        signals: result of `identification.signals.prepare`.
        load: motor-side and external torque [N.m or N], (n, 2).
        temperature: [degC], (n,).
        bandwidth: of encoder noise in the velocity, at most that of the motion's low pass [Hz].
        cutoff: of that low pass [Hz]; None: the default.
    """
    dt = 1.0 / signals.rate
    dp = increments(signals.position, signals.velocity, dt)
    judged = np.isfinite(signals.torque)
    edge = min(max(5, math.ceil(signals.rate / bandwidth)), len(judged) // 10)
    judged[:edge] = judged[len(judged) - edge :] = False  # the low pass and a shift lack the motion beyond
    return Stretch(
        dp=np.ascontiguousarray(dp),
        position=signals.position,
        acceleration=signals.acceleration,
        torque=signals.torque,
        dt=dt,
        load=np.zeros((1, 2)) if load is None else np.ascontiguousarray(load),
        temperature=np.array([REFERENCE]) if temperature is None else np.ascontiguousarray(temperature),
        judged=judged,
        sliding=signals.sliding,
        bandwidth=bandwidth,
        cutoff=cutoff,
    )


def with_error(s: Stretch, e: np.ndarray) -> Stretch:
    """Return a stretch with an error of the measured position added, low-passed like it.

    Args:
        s: the stretch.
        e: error [rad or m], (n,).
    """
    e = low_pass(e, s.cutoff or default_cutoff(1.0 / s.dt), 1.0 / s.dt)
    return replace(
        s,
        dp=s.dp + np.diff(e, prepend=e[:1]),
        position=None if s.position is None else s.position + e,
        acceleration=s.acceleration + derivative(derivative(e, s.dt), s.dt),
    )


def near_reversals(s: Stretch, reach: int, late: float = 0.0) -> np.ndarray:
    """Return which samples are at most so many samples from a reversal, (n,).

    Args:
        s: the stretch.
        reach: distance [sample].
        late: delay of the torque behind the motion [sample].
    """
    velocity = earlier(s.velocity, float(round(late)))
    after = turns(velocity) + 1
    edges = np.zeros(len(velocity) + 1, dtype=int)
    np.add.at(edges, np.maximum(after - reach, 0), 1)
    np.add.at(edges, np.minimum(after + reach, len(velocity)), -1)
    return np.cumsum(edges[:-1]) > 0


def moving(s: Stretch, slowest: float, late: float = 0.0) -> Stretch:
    """Return a stretch in which slow samples, reversals and their neighbours do not count.

    Args:
        s: the stretch.
        slowest: speed below which a sample is slow [rad/s or m/s].
        late: delay of the torque behind the motion [sample].
    """
    velocity = earlier(s.velocity, float(round(late)))
    resting = (np.abs(velocity) < slowest) | (np.diff(np.sign(velocity), prepend=0.0) != 0)
    near = np.convolve(resting, np.ones(2 * BESIDE + 1), mode="same") > 0
    return replace(s, judged=s.judged & ~near)
