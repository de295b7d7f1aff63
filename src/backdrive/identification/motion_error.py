"""The white error of a measured motion: the rounding to an encoder's steps, or noise of the sensor.

After differentiation its mean square grows with the fifth power of the cutoff frequency for a position, with the third for a
velocity. Sensor noise is measured above a tenth of the sampling rate, where there is hardly any motion, as a median over
frequencies and over the log. A velocity may have been computed from positions: its noise then grows with the frequency, and the
positions' noise is returned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import comb

import numpy as np

from backdrive.identification.motion_bins import moving_average
from backdrive.identification.robust import robust_spread
from backdrive.identification.whitening import LAGS, WHITE, Colour, power_of
from backdrive.logs.filters import gain_of_derivative, power_gain
from backdrive.logs.log import Log
from backdrive.logs.quantiles import median
from backdrive.logs.resolution import channel_step, encoder_step

GRID = 1024  # number of frequencies for the error
LENGTH, MOST = 512, 8  # length of a piece [sample], and largest number of pieces
ABOVE = 0.1  # lowest frequency at which the noise is measured [sampling rate]
FINER = 6  # differences of which the median size tells the noise of a sample, whatever corners the motion has at reversals
BANDS = 4  # number of bands of frequencies in which the noise of a velocity is compared
BENDS = 4  # differences that take the motion away
LAG = 50  # distance of the samples between which passed steps are counted
MORE = 1.5  # least noise relative to that of the rounding, above which it is not the rounding alone [-]


@dataclass(frozen=True, kw_only=True)
class MotionError:
    """White error of the measured motion of one joint.

    Attributes:
        size: its standard deviation [rad or m; of a velocity: a second].
        orders: derivatives from what is measured to the acceleration [-]: 2 for a position, 1 for a velocity.
        step: of the encoder, if its rounding is the error [rad or m; of a velocity: a second]; 0 for noise.
        fast: standard deviation of most samples, beside corners of the motion, if it is smaller; 0: not measured [unit of `size`].
    """

    size: float = 0.0
    orders: int = 2
    step: float = 0.0
    fast: float = 0.0

    @classmethod
    def of_steps(cls, step: float) -> MotionError:
        """Return the error of positions that are rounded to steps [rad or m]."""
        return cls(size=step / 12.0**0.5, step=step)

    @property
    def of_sample(self) -> float:
        """Standard deviation at one sample, without what rounding adds at low frequencies (`_excess`)."""
        return self.step / 12.0**0.5 if self.step else self.fast or self.size

    def spectrum(self, cutoff: float, rate: float, beyond: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Return the power of the error by frequency in a derivative of the low-passed motion; its mean is the mean square.

        Args:
            cutoff: of the low pass [Hz].
            rate: sampling rate [Hz].
            beyond: derivatives after the acceleration [-].

        Returns:
            Frequencies by the rate [-], and the power there [rad^2/s^4 or m^2/s^4, by s^2 for each further derivative], (k,) each.
        """
        f = (np.arange(GRID) + 0.5) / (2 * GRID)
        of_derivatives = (rate * gain_of_derivative(f)) ** (self.orders + beyond)
        gain = power_gain(f, min(cutoff / rate, 0.49)) * of_derivatives
        return f, (self.size * gain) ** 2

    def in_acceleration(self, cutoff: float, rate: float, width: int = 1, colour: Colour = WHITE) -> float:
        """Return the mean square error of the acceleration [rad^2/s^4 or m^2/s^4].

        Args:
            cutoff: of the low pass [Hz].
            rate: sampling rate [Hz].
            width: length of the means of the acceleration [sample].
            colour: of the noise of neighbouring means, which `Bins.whiten` makes white.
        """
        power, angle, turn = _of_means(self, cutoff, rate, width)
        if (correlation := colour.correlation) < 0.0:
            share = moving_average(correlation)
            white = (1.0 + share**2) / (1.0 + share**2 + 2.0 * share * turn)
        else:
            noise = (1.0 - correlation**2) / (1.0 + correlation**2 - 2.0 * correlation * turn)
            false = power_of(colour.rounding, angle)
            white = (1.0 + sum(colour.beside[:1])) / (noise - colour.averaged + np.maximum(false, 0.0))
        return float(np.mean(power * white))

    def between_means(self, cutoff: float, rate: float, width: int) -> tuple[float, ...]:
        """Return the mean products of the error of means of the acceleration by lag [rad^2/s^4 or m^2/s^4], (LAGS,).

        Args:
            cutoff: of the low pass [Hz].
            rate: sampling rate [Hz].
            width: length of the means [sample].
        """
        power, angle, _ = _of_means(self, cutoff, rate, width)
        return tuple(float(np.mean(power * np.cos(lag * angle))) for lag in range(LAGS))


@lru_cache(maxsize=1)  # each fit of a log asks for them
def _of_means(
    error: MotionError, cutoff: float, rate: float, width: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the power of means of the acceleration, the shift by one of them [rad], and its real part, by frequency, (k,) each."""
    f, power = error.spectrum(cutoff, rate)
    mean = (np.sin(np.pi * f * width) / (width * np.sin(np.pi * f))) ** 2
    turn = np.cos(2.0 * np.pi * f * width)
    return power * mean, np.arccos(turn), turn


def motion_error(log: Log, measured: np.ndarray, rate: float, *, white: bool = False) -> MotionError:
    """Return the white error of the positions of a log of one joint, or of its velocities if it has no positions.

    Args:
        log: of one joint.
        measured: positions [rad or m] or velocities [rad/s or m/s] without gaps, (n,).
        rate: sampling rate [Hz].
        white: take rounding as white noise, also where a step lasts many samples.
    """
    if log.position is not None:
        size, step = _noise(measured)[0], encoder_step(log)
        rounding = MotionError.of_steps(step)
        if size > MORE * rounding.size:
            fast = min(_of_most(measured), size)
            return MotionError(size=size, fast=fast if fast > MORE * rounding.size else rounding.size)
        return rounding if white else replace(rounding, size=rounding.size * _excess(measured, step))
    step = channel_step(log, "velocity", 0)
    size, of_positions = _noise(measured, velocity=True)
    per, orders = (rate, 2) if of_positions else (1.0, 1)
    if size > MORE * step / 12.0**0.5:
        return MotionError(size=size / per, orders=orders)
    return MotionError(size=step / 12.0**0.5 / per, orders=orders, step=step / per)


def _excess(measured: np.ndarray, step: float) -> float:
    """Return how much larger rounding is at low frequencies than white noise of its size [-].

    Where a step lasts many samples, rounding is a saw-tooth, whose power lies below the frequency of the steps or a few times that,
    and not below half the sampling rate.

    Args:
        measured: positions, rounded [rad or m], (n,).
        step: of the encoder [rad or m].
    """
    if not step > 0.0 or measured.size <= LAG:
        return 1.0
    passed = np.abs(measured[LAG:] - measured[:-LAG]) / (LAG * step)
    moving = passed[passed > 0.0]
    rate = float(np.sqrt(np.mean(moving**2))) if moving.size else 1.0
    return float(np.sqrt(max(0.5 / max(rate, 1e-3), 1.0)))


def mean_error(errors: Sequence[MotionError], samples: Sequence[int]) -> MotionError:
    """Return one error with the mean square of several logs'; if positions and velocities differ, of the kind with more samples.

    Args:
        errors: of each log.
        samples: number of samples of each log.
    """
    count = {
        orders: sum(n for e, n in zip(errors, samples, strict=True) if e.orders == orders)
        for orders in (2, 1)
    }
    orders = max(count, key=lambda key: count[key])
    if not count[orders]:
        return MotionError()
    alike = [(e, n) for e, n in zip(errors, samples, strict=True) if e.orders == orders]
    size, fast = (
        float(np.sqrt(sum(n * x**2 for x, n in each) / count[orders]))
        for each in ([(e.size, n) for e, n in alike], [(e.of_sample, n) for e, n in alike])
    )
    step = max(e.step for e, _ in alike)
    told = not step and any(e.fast for e, _ in alike)
    return MotionError(size=size, orders=orders, step=step, fast=fast if told else 0.0)


def _of_most(x: np.ndarray) -> float:
    """Return the standard deviation of white noise in most samples of a signal, (n,), by the median size of differences."""
    return robust_spread(np.diff(x, FINER)) / comb(2 * FINER, FINER) ** 0.5


def _noise(x: np.ndarray, velocity: bool = False) -> tuple[float, bool]:
    """Return the standard deviation of white noise in a signal, (n,), and whether its integral has it instead.

    Args:
        x: signal.
        velocity: the signal may be the difference of one with white noise, over one sampling interval or over two.
    """
    count = min(MOST, (x.size - BENDS) // LENGTH)
    if count < 1:
        return 0.0, False
    starts = np.linspace(0, x.size - BENDS - LENGTH, count).astype(int)
    pieces = np.diff(np.stack([x[k : k + LENGTH + BENDS] for k in starts]), BENDS, axis=1)
    window = np.hanning(LENGTH)
    f = np.arange(round(ABOVE * LENGTH), LENGTH // 2) / LENGTH
    power = np.abs(np.fft.rfft(pieces * window)[:, -f.size - 1 : -1]) ** 2
    power /= np.log(2.0) * np.sum(window**2) * (2.0 * np.sin(np.pi * f)) ** (2 * BENDS)
    shapes = [np.ones(f.size)]
    if velocity:
        shapes += [4.0 * np.sin(np.pi * f) ** 2, np.sin(2.0 * np.pi * f) ** 2]
    best = int(np.argmin([_uneven(power / shape) for shape in shapes])) if velocity else 0
    return math.sqrt(median((power / shapes[best]).ravel())), best > 0


def _uneven(power: np.ndarray) -> float:
    """Return how much the median power differs between bands of frequencies, (m, k), relative [-]."""
    medians = [np.median(band) for band in np.array_split(power, BANDS, axis=1)]
    return float(np.std(np.log(np.maximum(medians, 1e-300))))
