"""A joint guided by hand to a metronome under five compensators, and the statistics of its force peaks.

NC: none. C, CD: algFC, Iwatani 2017, (3.27), with alpha = 0, without and with dither. P, PD: the same with alpha = 20 1/s. The
hand goes back and forth once in 1.5 s (0.667 Hz); the largest force of each direction in each such window is a peak. Two cases
are compared by Student's t-test with pooled variance, Cohen's d, and a bootstrap interval of the difference of the means.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from backdrive.control import BareLoop
from backdrive.control.compensators import Compensator, Dither, alg_fc
from backdrive.laws.base import Rate
from backdrive.simulation.closed_loop import Record, Scene, play
from backdrive.simulation.hand import Hand, strokes
from backdrive.simulation.joint import JointSimulation

CASES = ("NC", "C", "CD", "P", "PD")
PERIOD = 1e-3  # of the loop [s]
CYCLE = 1.5  # of the metronome [s]
BEGIN = 0.5  # of the first stroke [s]
DECAY = 20.0  # alpha [1/s]
SIDES = ("+", "-")
RESAMPLES = 2000  # of the bootstrap
SIGNIFICANT = 1e-3  # the thesis' ***

Peaks = Mapping[str, np.ndarray]  # case -> (cycles, 2): along +q and -q


@dataclass(frozen=True, kw_only=True)
class Guidance:
    """A joint, a hand, and the assumptions of the compensators.

    Attributes:
        plant: the joint.
        rate: rate law of the compensators.
        stiffness: K of the compensators [N.m/rad or N/m].
        hand: impedance of the hand and noise of its force sensor.
        stroke: of the hand [rad or m].
        dither: R_d [-].
        share: R [-].
        duration: of a stroke [s].
        delay: of the drive [s].
    """

    plant: JointSimulation
    rate: Rate
    stiffness: float
    hand: Hand
    stroke: float
    dither: float
    share: float = 0.9
    duration: float = 0.7
    delay: float = 1e-3

    def replace(self, **changes: Any) -> Guidance:
        """Return a copy with some fields changed."""
        return replace(self, **changes)

    def with_transmission(self, ratio: float) -> Guidance:
        """Return the same with a transmission whose stiffness K_c is `ratio` times K."""
        return self.replace(plant=self.plant.replace(stiffness=ratio * self.stiffness))

    def compensators(self) -> dict[str, Compensator]:
        """Return the five cases."""
        dither = Dither(share=self.dither)
        # no share of the friction instead of no friction: one kernel for all
        made: dict[str, Compensator] = {"NC": alg_fc(self.rate, self.stiffness, share=0.0)}
        for name, rate, wave in (
            ("C", 0.0, None), ("CD", 0.0, dither), ("P", DECAY, None), ("PD", DECAY, dither),
        ):  # fmt: skip
            made[name] = alg_fc(self.rate, self.stiffness, rate, wave, share=self.share)
        return made

    def scenes(self, cycles: int, seed: int) -> list[Scene]:
        """Return a scene for each case; the hand's motion is the same in all.

        Args:
            cycles: of the metronome.
            seed: of the hand's variation, of the noises and of the encoder's phase.
        """
        motion = strokes(
            PERIOD,
            stroke=self.stroke,
            duration=self.duration,
            interval=0.5 * CYCLE,
            count=2 * cycles,
            start=BEGIN,
            seed=seed,
        )
        return [
            Scene(
                plant=self.plant,
                motion=motion,
                hand=self.hand,
                loop=BareLoop(compensator=compensator),
                period=PERIOD,
                delay=self.delay,
                seed=seed,
            )
            for compensator in self.compensators().values()
        ]


def guide(runs: Iterable[tuple[Guidance, int, int]]) -> list[dict[str, Record]]:
    """Play the five cases of many runs in one batch.

    Args:
        runs: guidance, cycles and seed of each.

    Returns:
        Case -> record, for each run.
    """
    made = [guidance.scenes(cycles, seed) for guidance, cycles, seed in runs]
    records = iter(play([scene for scenes in made for scene in scenes], one_kernel=True))
    return [{case: next(records) for case in CASES} for _ in made]


def windows(signal: np.ndarray, cycles: int) -> np.ndarray:
    """Return a signal cut into the metronome's windows, (cycles, samples)."""
    first, size = round(BEGIN / PERIOD), round(CYCLE / PERIOD)
    return signal[first : first + cycles * size].reshape(cycles, size)


def peaks(records: Mapping[str, Record], cycles: int) -> dict[str, np.ndarray]:
    """Return the largest measured force of each window along +q and -q by case [N.m or N], (cycles, 2)."""
    found = {}
    for case, record in records.items():
        force = windows(record.sensed, cycles)
        found[case] = np.stack([force.max(axis=1), -force.min(axis=1)], axis=1)
    return found


def means(found: Peaks) -> np.ndarray:
    """Return mean peaks [N.m or N], (cases, 2)."""
    return np.array([found[case].mean(axis=0) for case in CASES])


def deviations(found: Peaks) -> np.ndarray:
    """Return standard deviations of the peaks [N.m or N], (cases, 2)."""
    return np.array([found[case].std(axis=0, ddof=1) for case in CASES])


def smallest(found: Peaks, case: str = "PD") -> tuple[bool, bool]:
    """Return whether a case has the smallest mean peak, by direction."""
    best = np.argmin(means(found), axis=0)
    return bool(CASES[best[0]] == case), bool(CASES[best[1]] == case)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """The difference between the peaks of two cases.

    Attributes:
        difference: of the means [N.m or N].
        low: lower end of its 95 % bootstrap interval [N.m or N].
        high: upper end [N.m or N].
        t: Student's statistic.
        p: two-sided probability of such a t without a difference.
        effect: Cohen's d, the difference by the pooled standard deviation [-].
    """

    difference: float
    low: float
    high: float
    t: float
    p: float
    effect: float


def compare(a: np.ndarray, b: np.ndarray, seed: int = 0) -> Comparison:
    """Compare two samples of peaks.

    Args:
        a: peaks of the one [N.m or N], (n,).
        b: of the other [N.m or N], (m,).
        seed: of the bootstrap.
    """
    from scipy.special import stdtr

    n, m = a.size, b.size
    freedom = n + m - 2
    pooled = np.sqrt(((n - 1) * a.var(ddof=1) + (m - 1) * b.var(ddof=1)) / freedom)
    difference = float(a.mean() - b.mean())
    t = difference / (pooled * np.sqrt(1.0 / n + 1.0 / m))
    rng = np.random.default_rng(seed)
    drawn = (
        rng.choice(a, (RESAMPLES, n)).mean(axis=1) - rng.choice(b, (RESAMPLES, m)).mean(axis=1)
    )  # fmt: skip
    low, high = np.quantile(drawn, (0.025, 0.975))
    return Comparison(
        difference=difference,
        low=float(low),
        high=float(high),
        t=float(t),
        p=float(2.0 * stdtr(freedom, -abs(t))),
        effect=float(difference / pooled),
    )


def against(found: Peaks, other: str, case: str = "PD", seed: int = 0) -> tuple[Comparison, Comparison]:
    """Compare the peaks of another case with those of a case, along +q and -q."""
    a, b = found[other], found[case]
    return compare(a[:, 0], b[:, 0], seed), compare(a[:, 1], b[:, 1], seed)


def mark(p: float) -> str:
    """Return the thesis' symbol of a t-test: *** for p < 0.1 %, fewer stars for larger p, or ns."""
    return "***" if p < SIGNIFICANT else "**" if p < 0.01 else "*" if p < 0.05 else "ns"


def bars(found: Peaks, seed: int = 0) -> dict[str, Any]:
    """Return what a figure of means, deviations and tests draws."""
    tests = {case: against(found, case, seed=seed) for case in CASES if case != "PD"}
    return {
        "cases": CASES,
        "mean": means(found),
        "deviation": deviations(found),
        "p": {case: tuple(c.p for c in pair) for case, pair in tests.items()},
        "effect": {case: tuple(c.effect for c in pair) for case, pair in tests.items()},
        "interval": {case: tuple((c.low, c.high) for c in pair) for case, pair in tests.items()},
    }


def series(records: Mapping[str, Record], every: int = 1, first: int = 0, last: int | None = None) -> dict:
    """Return the time series of the cases that a figure draws, each thinned.

    Args:
        records: by case.
        every: one sample of so many is kept.
        first: sample to begin with.
        last: sample to end before; None: the end.
    """
    part = slice(first, last, every)
    some = next(iter(records.values()))
    cases = {
        case: {
            "position": record.load[part].copy(),
            "velocity": record.load_velocity[part].copy(),
            "command": record.command[part].copy(),
            "force": record.sensed[part].copy(),
        }
        for case, record in records.items()
    }
    return {"time": some.time[part].copy(), "cases": cases}


def in_words(values: Sequence[Sequence[float]] | np.ndarray, unit: str) -> str:
    """Return mean peaks of the cases in words: `NC 23.5/19.4, C ... N`, along +q and -q."""
    return (
        ", ".join(
            f"{case} {plus:.1f}/{minus:.1f}" for case, (plus, minus) in zip(CASES, values, strict=False)
        )
        + f" {unit}"
    )
