"""The choice of method and bandwidth: the smallest expected error over this log, as for a Wiener filter.

    error^2 = integral |1 - H|^2 S_f + |H|^2 S_n  df,        S_f = S - S_n where S > 4 S_n, else 0

H is the response of an estimator with its lag removed. S is the spectrum of the force estimated without smoothing, S_n that of
its noise. The noise has three parts. The first is white noise of the torque. The second is the torque residual, as first-order
noise of the same size and long-run variance, shorter near reversals. The third is encoder steps, differentiated twice. So a
slow and weak force is smoothed, and an abrupt one is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.control.estimators.of_model import WIDTH
from backdrive.identification.bands import states
from backdrive.identification.signals import Signals
from backdrive.model import JointFriction

BANDS = 40  # of frequency, equal in its logarithm
STEPS = 33  # bandwidths that are tried
SLOWEST, FASTEST = 5.0, 0.5  # the lowest [1/s], the highest by the sampling rate [-]
SIMPLER = 1.02  # relative error by which a simpler method may be worse and is still chosen [-]
SEEN = 4.0  # ratio of power to noise above which power counts as that of a force [-]
ABRUPT = 0.01  # correlation time of the residual near a reversal [s]
HIGHEST = 0.4  # frequency that is looked at, by the sampling rate [-]


@dataclass(frozen=True, kw_only=True)
class Noise:
    """The noise of the estimate.

    Attributes:
        count: step of the encoder, 0 where it has none [rad or m].
        inertia: M, which converts acceleration to force [kg.m^2 or kg].
        torque: standard deviation of the noise of the torque from sample to sample [N.m or N].
        misfit: standard deviation of the model's torque residual beyond that [N.m or N].
        correlation: correlation time of that residual [s].
        cutoff: corner of the low pass on the position [Hz].
        rate: sampling frequency [Hz].
        turning: additional residual near reversals, averaged over the log, which a law fitted and judged in sliding does not
            contain [N.m or N].
    """

    count: float
    inertia: float
    torque: float
    misfit: float
    correlation: float
    cutoff: float
    rate: float
    turning: float = 0.0

    def spectrum(self, frequency: np.ndarray) -> np.ndarray:
        """Return the power by frequency, of positive ones alone [(N.m)^2/Hz or N^2/Hz]."""
        w, dt = 2.0 * np.pi * frequency, 1.0 / self.rate
        low_pass = 1.0 / (1.0 + (frequency / self.cutoff) ** 4)
        steps = (self.inertia * w**2 * low_pass) ** 2 * self.count**2 / 12.0
        time = max(self.correlation, 0.5 * dt)
        coloured = 4.0 * time * self.misfit**2 / (1.0 + (w * time) ** 2)
        abrupt = 4.0 * ABRUPT * self.turning**2 / (1.0 + (w * ABRUPT) ** 2)
        return 2.0 * dt * (self.torque**2 + steps) + coloured + abrupt


def first_order(s: np.ndarray, L: float) -> np.ndarray:
    """Return the response of the momentum and the disturbance observer."""
    return L / (L + s)


def threefold(s: np.ndarray, L: float) -> np.ndarray:
    """Return that of the extended observer, whose three poles lag by 1/L together."""
    return (3.0 * L / (3.0 * L + s)) ** 3


def of_kalman(s: np.ndarray, L: float) -> np.ndarray:
    """Return that of the stationary Kalman filter for a force that walks at random, with the same lag."""
    p = 2.0 * L
    return p**3 / (s**3 + 2.0 * p * s**2 + 2.0 * p**2 * s + p**3)


#: Method -> response by s = i w and L, the simplest first.
RESPONSES: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "momentum": first_order,
    "extended": threefold,
    "kalman": of_kalman,
}
LIKE = {"direct": "momentum", "disturbance": "momentum"}  # of other methods


def turning_of(friction: JointFriction, stretches: Sequence[Signals]) -> float:
    """Return the RMS torque residual near reversals, averaged over the whole log [N.m or N].

    Args:
        friction: of a model.
        stretches: of the log.
    """
    bands = friction.bands
    if bands is None or bands.moving is None or bands.reversing is None:
        return 0.0
    more = max(bands.reversing.half_width**2 - bands.moving.half_width**2, 0.0) / WIDTH**2
    share = np.mean(np.concatenate([states(s)[s.moving] for s in stretches]) == 1)
    return float(np.sqrt(share * more)) if np.isfinite(share) else 0.0


def choose(force: np.ndarray, noise: Noise, method: str | None = None) -> tuple[str, float]:
    """Return the method and its bandwidth [1/s].

    Args:
        force: as estimated without smoothing, at least 16 samples [N.m or N], (n,).
        noise: that disturbs it.
        method: to find the bandwidth of; None: any.
    """
    n, rate = force.size, noise.rate
    window = np.hanning(n)
    power = np.abs(np.fft.rfft((force - force.mean()) * window)) ** 2 * 2.0 / (rate * np.sum(window**2))
    frequency = np.fft.rfftfreq(n, 1.0 / rate)
    edges = np.geomspace(1.0 * rate / n, HIGHEST * rate, BANDS + 1)
    home = np.searchsorted(edges, frequency[1:], side="right") - 1
    home[(home < 0) | (home >= BANDS)] = BANDS
    count = np.bincount(home, minlength=BANDS + 1)[:BANDS]
    used = count > 0
    whole = np.bincount(home, power[1:], BANDS + 1)[:BANDS][used] / count[used]
    middle = np.bincount(home, frequency[1:], BANDS + 1)[:BANDS][used] / count[used]
    disturbance = noise.spectrum(middle)
    wanted = np.where(whole > SEEN * disturbance, whole - disturbance, 0.0)
    s = 2.0j * np.pi * middle
    names = list(RESPONSES) if method is None else [LIKE.get(method, method)]
    bandwidths = np.geomspace(min(SLOWEST, FASTEST * rate), FASTEST * rate, STEPS)
    error = np.empty((len(names), STEPS))
    for i, name in enumerate(names):
        for k, L in enumerate(bandwidths.tolist()):
            response = RESPONSES[name](s, L) * np.exp(s / L)
            missed, let_through = np.abs(1.0 - response) ** 2, np.abs(response) ** 2
            error[i, k] = np.sum(count[used] * (missed * wanted + let_through * disturbance))
    least = error.min(axis=1)
    chosen = int(np.argmax(least <= SIMPLER**2 * least.min()))
    return method or names[chosen], float(bandwidths[error[chosen].argmin()])
