"""A joint under admittance control that a hand moves once and lets go: settings, runs and measures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.control.admittance import Admittance
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, alg_fe2, between_counts
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.laws.base import Rate
from backdrive.simulation.closed_loop import Record, play
from backdrive.simulation.hand import Hand, HandMotion, strokes
from backdrive.simulation.joint import JointSimulation
from backdrive.thesis._sensorless import (
    DECAY,
    FAST,
    HAND_A,
    LITERAL,
    PERIOD,
    PRINTED,
    STIFFNESS,
    admittance_scene,
    rms,
    then,
)
from backdrive.thesis.fig_3_4 import identify_rate
from backdrive.thesis.setups import K_B, RATIO, setups

CASES = ("alpha_N", "alpha_H", "algFE2")
SEEDS = 30
HOLD, FREE = 1.2, 3.0  # after the stroke [s]


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A joint under admittance control that a hand moves once and lets go.

    Attributes:
        plant: the joint.
        rate: identified rate law.
        stiffness: K [N/m or N.m/rad].
        threshold: V_W as printed [m/s or rad/s].
        hand: impedance and sensor.
        stroke: of the hand [m or rad].
        admittance: virtual object and position controller.
        filter: of the acceleration.
        still: travel of the load in the last second below which it rests [m or rad].
    """

    plant: JointSimulation
    rate: Rate
    stiffness: float
    threshold: float
    hand: Hand
    stroke: float
    admittance: Admittance
    filter: MotionFilter
    still: float

    def estimators(self) -> dict[str, FrictionEstimator]:
        """Return the three cases."""
        between = between_counts(self.threshold, self.plant.encoder_count, PERIOD)
        return {
            "alpha_N": alg_fe(self.rate, self.stiffness, DECAY),
            "alpha_H": alg_fe(self.rate, self.stiffness, FAST),
            "algFE2": alg_fe2(self.rate, self.stiffness, between, DECAY, FAST),
        }

    def with_mass(self, m: float) -> Setting:
        """Return the same with another virtual inertia [kg or kg.m^2]."""
        return replace(self, admittance=replace(self.admittance, inertia=m))


def joint_0(seed: int = 0, ratio: float = RATIO) -> Setting:
    """Return Joint 0 of Setup B; virtual object, gains and filter are not printed and chosen here."""
    plant = setups(ratio)["joint_0"]
    return Setting(
        plant=plant,
        rate=identify_rate(plant, seed),
        stiffness=K_B,
        threshold=1e-3,
        hand=Hand(stiffness=130.0, damping=6.0, noise=0.05),
        stroke=0.3,
        admittance=Admittance(
            inertia=0.12, viscosity=2.0, proportional=1e4, derivative=60.0, limit=plant.torque_limit
        ),
        filter=MotionFilter(gain=250.0, second_gain=750.0),
        still=1e-4,
    )


def axis(seed: int = 0, ratio: float = RATIO) -> Setting:
    """Return Setup A with virtual object, gains and filter as printed."""
    plant = setups(ratio)["setup_a"]
    return Setting(
        plant=plant,
        rate=identify_rate(plant, seed),
        stiffness=STIFFNESS,
        threshold=0.01,
        hand=HAND_A,
        stroke=0.06,
        admittance=PRINTED,
        filter=LITERAL,
        still=2.5 * plant.encoder_count,
    )


def once(setting: Setting, seed: int) -> HandMotion:
    """Return one stroke of the hand, then a hand that holds and lets go."""
    stroke = strokes(PERIOD, stroke=setting.stroke, duration=0.6, interval=0.7, count=1, seed=seed)
    return then(stroke, hold=HOLD - 0.6, free=FREE)


def runs(setting: Setting, seed: int, seeds: int) -> dict[str, list[Record]]:
    """Return the three cases, one record a seed."""
    motions = [once(setting, seed + i) for i in range(seeds)]
    scenes = [
        admittance_scene(
            setting.plant,
            motion,
            friction,
            seed + i,
            hand=setting.hand,
            admittance=setting.admittance,
            filter=setting.filter,
            inertia=setting.plant.inertia,
        )
        for friction in setting.estimators().values()
        for i, motion in enumerate(motions)
    ]
    records = iter(play(scenes))
    return {case: [next(records) for _ in motions] for case in CASES}


def measure(records: Mapping[str, Sequence[Record]], setting: Setting) -> dict[str, dict[str, np.ndarray]]:
    """Return peak of the measured force, travel in the last second, rest and fluctuation by case, a number a seed."""
    last = round(1.0 / PERIOD)
    measured = {}
    for case, made in records.items():
        travel = np.array([np.ptp(r.load[-last:]) for r in made])
        held = [(r.scene.motion.grip > 0.0) & (r.time > 0.5 + 0.6 + 0.4) for r in made]
        measured[case] = {
            "peak": np.array([np.abs(r.sensed).max() for r in made]),
            "travel": travel,
            "rest": travel < setting.still,
            "free": np.array([rms(r.load_velocity[-last:]) for r in made]),
            "held": np.array([rms(r.load_velocity[h]) for r, h in zip(made, held, strict=False)]),
        }
    return measured
