"""The choice of method and bandwidth: the smallest expected error over this log, as for a Wiener filter.

    error^2 = integral |1 - H|^2 S_f + |H|^2 S_n  df,        S_f = S - S_n where S > 4 S_n, else 0

H is the response of an estimator with its lag removed. S is the spectrum of the force estimated without smoothing, S_n that of
its noise, at most S. The noise has four parts: white noise of the torque; the torque residual, as first-order noise of the same
size and long-run variance; the noise of reversals (`reversals`); and encoder steps, differentiated twice. Free motion shows S_n,
since nothing acts there, but a joint that is pushed reverses elsewhere. With it, S_n is the geometric mean of both. So a slow
and weak force is smoothed, and an abrupt one is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.external.reversals import ABRUPT

BANDS = 40  # of frequency, equal in its logarithm
STEPS = 33  # bandwidths that are tried
SLOWEST, FASTEST = 5.0, 0.5  # the lowest [1/s], the highest by the sampling rate [-]
SIMPLER = 1.02  # relative error by which a simpler method may be worse and is still chosen [-]
SEEN = 4.0  # ratio of power to noise above which power counts as that of a force [-]
HIGHEST = 0.4  # frequency that is looked at, by the sampling rate [-]
BLEND = 2  # bands on each side over which the spectrum of free motion is averaged
LEAST = 16  # samples of a spectrum


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
        turning: additional noise near reversals, averaged over the log, which a law fitted and judged in sliding does not
            contain [N.m or N].
        abrupt: correlation time of that noise [s].
    """

    count: float
    inertia: float
    torque: float
    misfit: float
    correlation: float
    cutoff: float
    rate: float
    turning: float = 0.0
    abrupt: float = ABRUPT

    def spectrum(self, frequency: np.ndarray) -> np.ndarray:
        """Return the power by frequency, of positive ones alone [(N.m)^2/Hz or N^2/Hz]."""
        w, dt = 2.0 * np.pi * frequency, 1.0 / self.rate
        low_pass = 1.0 / (1.0 + (frequency / self.cutoff) ** 4)
        steps = (self.inertia * w**2 * low_pass) ** 2 * self.count**2 / 12.0
        time = max(self.correlation, 0.5 * dt)
        coloured = 4.0 * time * self.misfit**2 / (1.0 + (w * time) ** 2)
        abrupt = 4.0 * self.abrupt * self.turning**2 / (1.0 + (w * self.abrupt) ** 2)
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


def power_by_band(force: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the spectrum of a series in bands of frequency: middles [Hz], powers [(N.m)^2/Hz or N^2/Hz], and lines in each.

    Args:
        force: at least 16 samples [N.m or N], (n,).
        rate: sampling frequency [Hz].
    """
    n = force.size
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
    return middle, whole, count[used]


def of_free_motion(free: Sequence[tuple[np.ndarray, float]], frequency: np.ndarray) -> np.ndarray | None:
    """Return the spectrum of the noise that free motion shows [(N.m)^2/Hz or N^2/Hz]; None if it is too short.

    Args:
        free: by stretch of free motion, the force estimated without smoothing, and the sampling frequency [Hz].
        frequency: wanted [Hz], (m,).
    """
    total, weight = np.zeros(frequency.size), 0.0
    around = np.ones(2 * BLEND + 1)
    for force, rate in free:
        if force.size < LEAST:
            continue
        middle, power, count = power_by_band(force, rate)
        smooth = np.convolve(power * count, around, "same") / np.convolve(count, around, "same")
        duration = force.size / rate
        total += duration * np.exp(np.interp(np.log(frequency), np.log(middle), np.log(smooth + 1e-300)))
        weight += duration
    return total / weight if weight > 0.0 else None


def choose(
    force: np.ndarray,
    noise: Noise,
    method: str | None = None,
    free: Sequence[tuple[np.ndarray, float]] = (),
) -> tuple[str, float]:
    """Return the method and its bandwidth [1/s].

    Args:
        force: as estimated without smoothing, at least 16 samples [N.m or N], (n,).
        noise: that disturbs it.
        method: to find the bandwidth of; None: any.
        free: by stretch of free motion, the force as estimated without smoothing, and the sampling frequency [Hz]; the
            geometric mean of its spectrum and that of `noise` counts.
    """
    rate = noise.rate
    middle, whole, count = power_by_band(force, rate)
    shown = of_free_motion(free, middle)
    disturbance = noise.spectrum(middle)
    if shown is not None:
        disturbance = np.sqrt(disturbance * shown)
    wanted = np.where(whole > SEEN * disturbance, whole - disturbance, 0.0)
    disturbance = np.minimum(disturbance, whole)
    s = 2.0j * np.pi * middle
    names = list(RESPONSES) if method is None else [LIKE.get(method, method)]
    bandwidths = np.geomspace(min(SLOWEST, FASTEST * rate), FASTEST * rate, STEPS)
    error = np.empty((len(names), STEPS))
    for i, name in enumerate(names):
        for k, L in enumerate(bandwidths.tolist()):
            response = RESPONSES[name](s, L) * np.exp(s / L)
            missed, let_through = np.abs(1.0 - response) ** 2, np.abs(response) ** 2
            error[i, k] = np.sum(count * (missed * wanted + let_through * disturbance))
    least = error.min(axis=1)
    chosen = int(np.argmax(least <= SIMPLER**2 * least.min()))
    return method or names[chosen], float(bandwidths[error[chosen].argmin()])
