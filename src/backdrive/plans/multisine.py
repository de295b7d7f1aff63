"""A periodic multisine: a band of frequencies, with phases for low crest factors of position and velocity."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.parameters import whole
from backdrive.plans.base import MotionPlan, Options, between, settle, settle_count

MOST_HARMONICS = 500
_ROUNDS = 300  # of the search for phases
_FINE = 64  # samples per period of the highest frequency, where extremes are looked for
_MARGIN = 1.0 / (
    1.0 - 0.5 * (np.pi / _FINE) ** 2
)  # a true extreme is at most so much above the sampled one (Bernstein)


@dataclass(frozen=True)
class Multisine(MotionPlan):
    """Sines at all multiples of 1/period inside a band, with equal velocity amplitudes, as large as the stroke allows.

    The joint passes many speeds and accelerations in one run, which suits the identification from any motion. The phases are
    drawn from a seed and then improved for low crest factors. Each step clips the signal, keeps its phases and restores the
    amplitudes (Van der Ouderaa, Schoukens, Renneboog, IEEE Trans. Instrum. Meas. 37, 1988). They are part of the plan, so a
    stored plan is the same motion everywhere. The amplitude grows from rest at the center before the first period, and decays
    after the last.

    Attributes:
        stroke: full stroke, peak to peak [rad or m].
        low: lowest frequency of the band [Hz].
        high: highest frequency of the band [Hz].
        period: after which it repeats [s].
        periods: number of whole periods at full stroke.
        lead_in: duration of the swelling, and of the ebbing [s]; by default one period of the lowest frequency.
        seed: of the phases.
        phases: of the sines [rad], one each; empty: found from the seed.
    """

    stroke: float
    low: float
    high: float
    period: float
    _: KW_ONLY
    periods: int = 3
    seed: int = 0
    phases: tuple[float, ...] = ()

    kind: ClassVar[str] = "multisine"
    options: ClassVar[tuple[str, ...]] = ("stroke", "cycles", "band", "period", "seed")

    @classmethod
    def build(cls, options: Options, **common: Any) -> Multisine:
        """Return the multisine of options of the command line."""
        stroke, band = options.need("stroke"), options.need("band")
        if len(band) != 2:
            raise InvalidInput(
                f"--band {','.join(map(str, band))}: not two frequencies.",
                remedy="For example --band 0.1,2 [Hz].",
            )
        more = {
            "periods" if name == "cycles" else name: x for name, x in options.subset("cycles", "seed").items()
        }
        return cls(stroke, band[0], band[1], options.need("period"), **more, **common)

    def __post_init__(self):
        settle(self, positive=("stroke", "low", "high", "period"), finite=("center", "start"))
        settle_count(self, "periods")
        if self.high * self.period > MOST_HARMONICS + 0.5:
            raise InvalidInput(
                f"{self.high:g} Hz is the {self.high * self.period:.4g}th multiple of 1/{self.period:g} Hz.",
                remedy=f"Give a lower frequency or a shorter period: at most {MOST_HARMONICS} multiples.",
            )
        count = self.harmonics.size
        if not count:
            raise InvalidInput(
                f"No multiple of 1/{self.period:g} Hz lies in the band from {self.low:g} to {self.high:g} Hz.",
                remedy="Give a wider band or a longer period.",
            )
        object.__setattr__(self, "seed", whole("Multisine.seed", self.seed, 0))
        if self.lead_in is None:
            object.__setattr__(self, "lead_in", 1.0 / float(self.frequencies[0]))
        settle(self, positive=("lead_in",))
        phases = tuple(float(p) for p in self.phases) or _low_crest(self.harmonics, self.seed)
        if len(phases) != count or not all(math.isfinite(p) for p in phases):
            raise InvalidInput(
                f"Multisine.phases holds {len(phases)} numbers for {count} sines.",
                remedy="Give one finite phase a sine, or none.",
            )
        object.__setattr__(self, "phases", phases)

    @property
    def harmonics(self) -> np.ndarray:
        """Multiples of 1/period in the band, (m,)."""
        least = math.ceil(min(self.low * self.period, MOST_HARMONICS + 1.0) - 1e-9)
        most = math.floor(min(self.high * self.period, MOST_HARMONICS) + 1e-9)
        return np.arange(max(least, 1), most + 1)

    @property
    def frequencies(self) -> np.ndarray:
        """Frequencies of the sines [Hz], (m,)."""
        return self.harmonics / self.period

    @cached_property
    def _shape(self) -> tuple[float, float]:
        """Factor of the sines and middle of their range, so that they fill the stroke."""
        t = np.arange(_FINE * int(self.harmonics[-1])) * (self.period / (_FINE * int(self.harmonics[-1])))
        x = self._sum(t, 0)
        low, high = float(x.min()), float(x.max())
        return self.stroke / (_MARGIN * (high - low)), 0.5 * (low + high)

    def _sum(self, t: np.ndarray, order: int) -> np.ndarray:
        """Sum of the sines of amplitude 1/harmonic, or a derivative, at times since the first period (n,)."""
        total = np.zeros_like(t)
        for k, phase in zip(self.harmonics, self.phases, strict=True):
            w = 2.0 * np.pi * k / self.period
            total += w**order / k * np.sin(w * t + phase + 0.5 * np.pi * order)
        return total

    def _swell(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Factor from 0 to 1 and back, with two derivatives, at times since the start."""
        x = np.minimum(t, self.duration - t) / self._lead
        inside = (x > 0) & (x < 1)
        x = np.clip(x, 0.0, 1.0)
        sign = np.where(t < 0.5 * self.duration, 1.0, -1.0)
        first = np.where(inside, sign * 30.0 * (x * (1.0 - x)) ** 2 / self._lead, 0.0)
        second = np.where(inside, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / self._lead**2, 0.0)
        return x**3 * (10.0 - 15.0 * x + 6.0 * x**2), first, second

    def _motion(self, t: np.ndarray, order: int) -> np.ndarray:
        flat = np.clip(np.ravel(t) - self.start, 0.0, self.duration)
        factor, middle = self._shape
        e = self._swell(flat)
        y = [
            factor * (self._sum(flat - self._lead, k) - (middle if k == 0 else 0.0)) for k in range(order + 1)
        ]
        if order == 0:
            result = self.center + e[0] * y[0]
        elif order == 1:
            result = e[1] * y[0] + e[0] * y[1]
        else:
            result = e[2] * y[0] + 2.0 * e[1] * y[1] + e[0] * y[2]
        return result.reshape(np.shape(t))

    def windows(self) -> np.ndarray:
        """Return the start and end of each whole period on the log's clock [s], (periods, 2)."""
        return between(self.start + self._lead + self.period * np.arange(self.periods + 1))

    @property
    def duration(self) -> float:
        """From rest to rest [s]."""
        return 2.0 * self._lead + self.periods * self.period

    @cached_property
    def _peaks(self) -> tuple[float, float]:
        """Greatest speed and acceleration, over one period and both transitions."""
        step = self.period / (_FINE * int(self.harmonics[-1]))
        one = np.arange(0.0, self.period + 2.0 * self._lead, step)
        late = self.duration - self._lead + np.arange(0.0, self._lead, step)
        t = self.start + np.concatenate([one[one < self.period + self._lead], late])
        v, a = (_MARGIN * float(np.abs(self._motion(t, k)).max()) for k in (1, 2))
        return v, a

    @property
    def peak_velocity(self) -> float:
        """Greatest speed [rad/s or m/s]."""
        return self._peaks[0]

    @property
    def peak_acceleration(self) -> float:
        """Greatest acceleration [rad/s^2 or m/s^2]."""
        return self._peaks[1]


def _low_crest(harmonics: np.ndarray, seed: int) -> tuple[float, ...]:
    """Return phases with low crest factors of position and velocity: random ones, clipped and restored many times.

    Clipping the position alone would lead to a square wave that rests at the ends of the stroke and contains no information
    on friction. So three of four rounds clip the velocity, and the phases with the least product of both crest factors are
    used.
    """
    size = 1 << int(np.ceil(np.log2(8 * harmonics[-1] + 1)))
    phases = np.random.default_rng(seed).uniform(-np.pi, np.pi, harmonics.size)
    best, least = phases, np.inf
    for k in range(_ROUNDS):
        spectrum = np.zeros((2, size // 2 + 1), dtype=complex)
        spectrum[0, harmonics] = -0.5j / harmonics * np.exp(1j * phases)  # sines
        spectrum[1, harmonics] = 0.5 * np.exp(1j * phases)  # their derivatives
        signals = np.fft.irfft(spectrum, size)
        reach = np.ptp(signals[0]) * np.abs(signals[1]).max()
        if reach < least:
            best, least = phases, reach
        which = min(k % 4, 1)
        x = signals[which]
        middle, clip = 0.5 * (x.max() + x.min()), (0.75 + 0.22 * k / _ROUNDS) * 0.5 * np.ptp(x)
        kept = np.fft.rfft(np.clip(x, middle - clip, middle + clip))[harmonics]
        phases = np.angle(kept if which else 1j * kept)
    return tuple(float(p) for p in best)
