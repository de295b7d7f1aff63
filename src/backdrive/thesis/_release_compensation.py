"""A compensated joint that a hand moves, holds and lets go: settings, runs and where the load comes to rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.control import BareLoop
from backdrive.control.compensators import Compensator, Dither, alg_fc, alg_fc2
from backdrive.control.estimators.friction import between_counts
from backdrive.simulation.closed_loop import Record, Scene, play
from backdrive.simulation.hand import Hand, HandMotion, strokes
from backdrive.simulation.joint import JointSimulation
from backdrive.thesis.fig_3_4 import identify_rate, intercepts
from backdrive.thesis.setups import K_A, K_B, RATIO, setups

PERIOD = 1e-3  # s
BEGIN, HOLD, AFTER = 0.3, 1.0, 2.0  # before the stroke, between its end and release, after release [s]
LOOKED = 0.5  # the end of the record in which rest is judged [s]
STILL = 2.0  # allowed travel of the load in that time [count]
SLOW, FAST, SWITCH = 20.0, 500.0, 10.0  # alpha_N, alpha_H, r_W [1/s]
CASES = ("alpha_N", "alpha_H", "algFC2")
SEEDS = 20


@dataclass(frozen=True, kw_only=True)
class Release:
    """A joint that is moved, held and let go.

    Attributes:
        plant: the joint.
        stiffness: K [N.m/rad or N/m].
        threshold: V_W [rad/s or m/s].
        dither: R_d [-].
        hand: its impedance.
        stroke: of the hand [rad or m].
        duration: of the stroke [s].
        share: R [-].
        fast: alpha_H [1/s].
        hold: between the end of the stroke and the release [s].
    """

    plant: JointSimulation
    stiffness: float
    threshold: float
    dither: float
    hand: Hand
    stroke: float
    duration: float
    share: float = 1.0
    fast: float = FAST
    hold: float = HOLD

    def compensators(self) -> dict[str, Compensator]:
        """Return the three cases; the threshold lies between two counts."""
        wave, rate = Dither(share=self.dither), identify_rate(self.plant)
        threshold = between_counts(self.threshold, self.plant.encoder_count, PERIOD)
        return {
            "alpha_N": alg_fc(rate, self.stiffness, SLOW, wave, share=self.share),
            "alpha_H": alg_fc(rate, self.stiffness, self.fast, wave, share=self.share),
            "algFC2": alg_fc2(
                rate, self.stiffness, threshold, SLOW, self.fast, SWITCH, wave, share=self.share
            ),
        }

    def motion(self, seed: int) -> HandMotion:
        """Return one stroke, which is held and then let go."""
        one = strokes(
            PERIOD,
            stroke=self.stroke,
            duration=self.duration,
            interval=self.duration + self.hold + AFTER,
            count=1,
            start=BEGIN,
            seed=seed,
        )
        return one.release(BEGIN + self.duration + self.hold, PERIOD)

    def scenes(self, seed: int) -> list[Scene]:
        """Return a scene for each case."""
        motion = self.motion(seed)
        return [
            Scene(
                plant=self.plant,
                motion=motion,
                hand=self.hand,
                loop=BareLoop(compensator=compensator),
                period=PERIOD,
                delay=1e-3,
                seed=seed,
            )
            for compensator in self.compensators().values()
        ]

    @property
    def boundary(self) -> float:
        """Speed alpha_H F/K below which the compensation is less than the friction [rad/s or m/s]."""
        return self.fast * float(np.mean(intercepts(self.plant.law.rate))) / self.stiffness


def joint_0(ratio: float = RATIO) -> Release:
    """Return Joint 0.

    Args:
        ratio: K_c by K [-].
    """
    return Release(
        plant=setups(ratio)["joint_0"],
        stiffness=K_B,
        threshold=0.005,
        dither=0.2,
        hand=Hand(stiffness=120.0, damping=6.0, noise=0.02),
        stroke=0.3,
        duration=0.8,
    )


def setup_a(ratio: float = RATIO) -> Release:
    """Return Setup A.

    Args:
        ratio: K_c by K [-].
    """
    return Release(
        plant=setups(ratio)["setup_a"],
        stiffness=K_A,
        threshold=0.01,
        dither=0.5,
        hand=Hand(stiffness=800.0, damping=40.0, noise=0.05),
        stroke=0.06,
        duration=0.7,
    )


def travel(record: Record) -> float:
    """Return how far the load travelled at the end of a record, in counts of its encoder."""
    end = record.load[-round(LOOKED / PERIOD) :]
    return float(np.ptp(end) / record.scene.plant.encoder_count)


def judge(release: Release, seeds: int, first: int) -> dict[str, Any]:
    """Let go of a joint many times.

    Args:
        release: joint, hand and compensators.
        seeds: how many hands.
        first: seed of the first.

    Returns:
        `rest` (how many of the hands end at rest), `peaks` (largest force of the hand, by hand), `peak` (their mean) and `travel`
        (counts, by hand), each by case; `records` of the first hand.
    """
    scenes = [scene for i in range(seeds) for scene in release.scenes(first + i)]
    records = play(scenes)
    result: dict[str, Any] = {
        "seeds": seeds,
        "records": dict(zip(CASES, records, strict=False)),
        "release": release,
    }
    result["travel"] = {
        case: np.array([travel(r) for r in records[i :: len(CASES)]]) for i, case in enumerate(CASES)
    }
    result["rest"] = {case: int(np.sum(counts < STILL)) for case, counts in result["travel"].items()}
    result["peaks"] = {
        case: np.array([np.abs(r.force).max() for r in records[i :: len(CASES)]])
        for i, case in enumerate(CASES)
    }
    result["peak"] = {case: float(high.mean()) for case, high in result["peaks"].items()}
    return result
