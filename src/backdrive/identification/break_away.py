"""The break-away torque of a joint on a torque ramp: the friction that it overcomes as it begins to slide.

A joint creeps before it slides, so the torque at which its speed passes a threshold is not the break-away torque. That is the
torque u0 = u(t0) at the start t0 of a slide from rest that fits the measured one,

    J a + B v = u - u0 = k (t - t0),   J (x - x0) + B integral of (x - x0) = k (t - t0)^3 / 6,

with the slope k of the ramp. Each t0 gives a linear regression on the position, and the t0 with the smallest residual is used.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from backdrive.identification.noise import covariance_of_fit

SETTLED = 2.0  # least displacement of a slide, relative to the displacement before the slip [-]
COUNTED = 20.0  # least displacement of a slide [encoder step]
RISE = 0.1  # relative growth of the torque over which the slide is evaluated [-]
FEWEST = 12  # least number of samples of a slide
MISFIT = 5.0  # relative uncertainty of the friction per relative residual of the slide's equation [-]
EARLY = 1.0  # longest time between the start of a slide and its detection [s]
EDGE = 0.1  # length of a ramp's ends, which may be round [s]
BENDS = 4  # degree of the polynomial for a ramp's deviation from a line, which is insensitive to noise
STRAIGHT = 0.01  # largest RMS deviation of a ramp from its line, relative to the range of the torque [-]
LINE = 0.3  # share of a ramp before a slip to which a line is fitted, if the whole ramp is not a line [-]
SHORTEST = 8  # least number of samples for a line
ROOT_3 = np.sqrt(3.0)


class Line(NamedTuple):
    """The torque along a ramp, a straight line.

    Attributes:
        first: first sample of the line.
        terms: level at the first sample [N.m or N] and slope [N.m or N per sample], (2,).
        covariance: of the terms, valid for coloured noise, (2, 2).
    """

    first: int
    terms: np.ndarray
    covariance: np.ndarray

    def at(self, samples: np.ndarray) -> np.ndarray:
        """Return the torque at samples [N.m or N], (n,)."""
        return self.terms[0] + self.terms[1] * (samples - self.first)

    def error(self, sample: float) -> float:
        """Return the standard error of the torque at a sample [N.m or N]."""
        row = np.array([1.0, sample - self.first])
        return float(np.sqrt(max(row @ self.covariance @ row, 0.0)))


def line(torque: np.ndarray, smooth: np.ndarray, turns: tuple[int, int], rate: float) -> Line | None:
    """Return the straight line of a ramp between its turns; None if the ramp is not straight, or too short.

    Args:
        torque: of the log, as measured [N.m or N], (n,).
        smooth: the low-passed torque [N.m or N], (n,).
        turns: first and last sample of the ramp.
        rate: sampling rate [Hz].
    """
    inner = slice(turns[0] + round(EDGE * rate), turns[1] - round(EDGE * rate))
    if inner.stop - inner.start < SHORTEST:
        return None
    y = torque[inner]
    X = np.stack([np.ones(y.size), np.arange(y.size)], axis=1)
    terms = np.linalg.lstsq(X, y, rcond=None)[0]
    bend = np.polynomial.Polynomial.fit(X[:, 1], smooth[inner] - X @ terms, BENDS)(X[:, 1])
    if np.sqrt(np.mean(bend**2)) > STRAIGHT * np.ptp(smooth):
        return None
    covariance = covariance_of_fit(X, y - X @ terms, np.ones(y.size, dtype=bool))
    return Line(inner.start, terms, covariance)


def overcome(
    torque: np.ndarray,
    ramp: Line | None,
    position: np.ndarray,
    slip: tuple[int, int, int],
    least: float,
    rate: float,
) -> tuple[float, float] | None:
    """Return the friction that a joint overcomes as it begins to slide, and its standard error [N.m or N].

    Args:
        torque: of the log, as measured [N.m or N], (n,).
        ramp: line of the ramp; None if the ramp is not straight.
        position: of the log [rad or m], (n,).
        slip: samples at which the ramp starts, the slip is detected, and the torque turns.
        least: displacement after the detection from which on the joint slides [rad or m].
        rate: sampling rate [Hz].

    Returns:
        Friction and standard error; None if the ramp is not straight, or the slide is too short.
    """
    from scipy.optimize import minimize_scalar, nnls  # a slow import, which only ramps need

    begin, at, turn = slip
    end = turn - round(EDGE * rate)
    gone = np.flatnonzero(np.abs(position[at:end] - position[at]) > least)
    if ramp is None or not gone.size:
        return None
    first = at + int(gone[0])
    risen = np.abs(ramp.at(np.arange(first, end)) - ramp.at(np.array([first])))
    last = first + int(np.searchsorted(risen, RISE * abs(float(ramp.at(np.array([first]))[0]))))
    if last - first < FEWEST:
        return None
    before = slice(max(at - round(4 * EDGE * rate), begin), at - round(EDGE * rate))
    rest = float(np.median(position[before])) if before.stop > before.start else float(position[at])
    x = np.abs(position[at:last] - rest)
    travel = np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1])) / rate])
    motion = np.stack([x, travel], axis=1)[first - at :]
    scale = np.linalg.norm(motion, axis=0)
    time = np.arange(first - at, last - at) / rate

    def misfit(start: float) -> float:
        impulse = (time - start) ** 3
        return nnls(motion / scale, impulse)[1] / float(np.linalg.norm(impulse))

    found: Any = minimize_scalar(misfit, bounds=(-EARLY, time[0] - 1.0 / rate), method="bounded")
    sample = at + found.x * rate
    friction = float(ramp.at(np.array([sample]))[0])
    return friction, float(np.hypot(ramp.error(sample), MISFIT * found.fun * friction))


def onset(
    torque: np.ndarray, velocity: np.ndarray, at: int, rate: float, cutoff: float
) -> tuple[float, float]:
    """Return the torque at the start of a slip, from the line of the ramp before it, and its uncertainty [N.m or N].

    Let t be the time since the start of the slip, under a rising torque. The speed grows with t^2 if inertia limits it, and
    with t if viscous friction limits it. So t lies between one and two times speed divided by acceleration.

    Args:
        torque: as measured, from the start of the ramp to the detection of the slip [N.m or N], (n,).
        velocity: of the whole log [rad/s or m/s].
        at: sample of the log at which the slip is detected.
        rate: sampling rate [Hz].
        cutoff: cutoff frequency of the position's low pass [Hz].
    """
    acceleration = (velocity[min(at + 1, velocity.size - 1)] - velocity[at - 1]) * rate / 2.0
    lag = min(abs(velocity[at]) / max(abs(acceleration), 1e-300), 2.0 / cutoff)
    before = torque[-max(round(LINE * torque.size), SHORTEST) :]
    time = (np.arange(before.size) - (before.size - 1)) / rate
    slope, level = np.polyfit(time, before, 1)
    left = before - level - slope * time
    blur = abs(slope) * np.hypot(0.5 * lag, 1.0 / cutoff) / ROOT_3
    return float(level - 1.5 * slope * lag), float(np.hypot(blur, 2.0 * np.std(left) / np.sqrt(before.size)))
