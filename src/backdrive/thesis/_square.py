"""The square of Iwatani 2017, 3.5.2: a hand at the grip of the six-axis arm, Joints 0 to 2 compensated together.

MuJoCo simulates the rigid bodies. Joints 0 to 2 are those of `setups`; position controllers hold Joints 3 to 5. The thesis does
not print the following; it is assumed. The hand is that of Setup A (800 N/m, 40 N.s/m, 5 % variation). The sides are 0.12 m
long, along x (away from the base) and y. At the start the upper arm is upright and the forearm level. Each beat of the
metronome is one side. With two sides per beat, as for the strokes of Setup A, such a hand oscillates about its path with the
arm's inertia, and its path is not a square. `fig_3_10` prints the results for that pace too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from backdrive.control import BareLoop
from backdrive.control.compensators import Compensator
from backdrive.simulation.arm import Arm, ArmRecord, local_servos
from backdrive.simulation.arm_loop import guide, polygon
from backdrive.simulation.hand import Hand
from backdrive.thesis._hand_guiding import CASES, PERIOD, Guidance
from backdrive.thesis.fig_3_4 import identify_rate
from backdrive.thesis.outcome import Claim
from backdrive.thesis.setups import JOINTS, K_B, RATIO, WRIST, setups, wrist

ARM = JOINTS[1:]
SIDE = 0.12  # of the square [m]
STROKE, INTERVAL = 1.4, 1.5  # of a side [s], between the beginnings of sides [s]: a side a beat
BEGIN = 0.5  # of the first stroke [s]
POSTURE = (-0.17, np.pi / 2, -np.pi / 2, 0.0, 0.0, 0.0)  # upper arm upright, forearm level [rad]
HAND = Hand(stiffness=800.0, damping=40.0, noise=0.05)  # [N/m], [N.s/m], [N]
AXES = ("x", "y")
SETTING = (
    "The six-axis arm of Setup B in MuJoCo. Joints 0, 1 and 2 are free and compensated together, 3 to 5 held by position "
    "controllers. Friction is on the load's side: F = 6.85, 9.56 and 3.15 N.m, K_c = K = 5e4 N.m/rad. One tick of delay, gravity "
    "held. A hand of "
    f"800 N/m and 40 N.s/m leads the grip around a square of {SIDE:g} m in x and y, a side in {STROKE:g} s every {INTERVAL:g} s, "
    "5 % variation, sensor noise 0.05 N. Compensators as printed: alpha = 20 1/s, dither 15 Hz with R_d = 0.3, no factor R, curves "
    "as identified by the sweep."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class SquareRun:
    """The arm led around the square under one compensator.

    Attributes:
        record: of all ticks.
        sensed: force of the hand by its sensor [N], (n, 2): along x and y.
        grip: position of the grip [m], (n, 2).
        velocity: of the grip [m/s], (n, 2).
    """

    record: ArmRecord
    sensed: np.ndarray
    grip: np.ndarray
    velocity: np.ndarray


def guidances(ratio: float = RATIO) -> dict[str, Guidance]:
    """Return Joints 0 to 2, the curves that their sweeps find, and a hand of 120 N.m/rad and 6 N.m.s/rad for single strokes.

    Args:
        ratio: K_c by K [-].
    """
    plants = setups(ratio)
    return {
        name: Guidance(
            plant=plants[name],
            rate=identify_rate(plants[name]),
            stiffness=K_B,
            hand=Hand(stiffness=120.0, damping=6.0, noise=0.02),
            stroke=0.2,
            dither=0.3,
            share=1.0,
        )
        for name in ARM
    }


def arm_of(plants: Mapping[str, Guidance]) -> Arm:
    """Return the arm with these joints as its first three; gravity is that of its bodies."""
    joints = [*(plants[name].plant for name in ARM), *(wrist(number) for number in WRIST)]
    return Arm([j.replace(gravity_cos=0.0, torque_noise=0.0) for j in joints], posture=POSTURE)


def path(seed: int, rounds: int, pace: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the hand's path around the square relative to the grip [m], and its velocity [m/s], (n, 3) each.

    Args:
        seed: of the variation from stroke to stroke.
        rounds: squares.
        pace: times faster than `INTERVAL` says [-].
    """
    return polygon(
        [(0, 0, 0), (SIDE, 0, 0), (SIDE, SIDE, 0), (0, SIDE, 0)],
        dt=PERIOD,
        duration=STROKE / pace,
        interval=INTERVAL / pace,
        rounds=rounds,
        start=BEGIN,
        variation=0.05,
        seed=seed,
    )


def lead_around(
    plants: Mapping[str, Guidance],
    compensators: Mapping[str, Compensator],
    seed: int,
    *,
    rounds: int,
    pace: float = 1.0,
) -> SquareRun:
    """Lead the arm around the square.

    Args:
        plants: Joints 0 to 2.
        compensators: of them.
        seed: of the hand and its sensor.
        rounds: squares.
        pace: as in `path`.
    """
    arm = arm_of(plants)
    held = range(len(ARM), len(arm.joints))
    servos = local_servos(arm.joints)
    record = guide(
        arm,
        *path(seed, rounds, pace=pace),
        hand=HAND,
        loops={i: BareLoop(compensator=compensators[name]) for i, name in enumerate(ARM)},
        servos={j: servos[j] for j in held},
        period=PERIOD,
        delay=1,
    )
    noise = HAND.noise * np.random.default_rng(seed + 1).standard_normal((len(record.time), 2))
    assert record.grip is not None
    at = record.grip[:, :2] - record.grip[0, :2]
    return SquareRun(
        record=record,
        sensed=record.force[:, :2] + noise,
        grip=at,
        velocity=np.gradient(at, PERIOD, axis=0),
    )


@lru_cache(maxsize=4)
def by_case(seed: int, ratio: float, rounds: int, pace: float = 1.0) -> dict[str, SquareRun]:
    """Return the five cases, for both figures.

    Args:
        seed: of the hand.
        ratio: K_c by K [-].
        rounds: squares.
        pace: as in `path`.
    """
    plants = guidances(ratio)
    cases = {name: plant.compensators() for name, plant in plants.items()}
    return {
        case: lead_around(plants, {name: cases[name][case] for name in ARM}, seed, rounds=rounds, pace=pace)
        for case in CASES
    }


def work_check(cases: Mapping[str, SquareRun]) -> Claim:
    """Return the claim that without compensation the hand's work is that of friction, by the simulator's truth.

    The force along x and y is that of the sensor, along z that of the hand.

    Args:
        cases: of `by_case`.
    """
    bare = cases["NC"]
    record = bare.record
    assert record.grip is not None
    force = np.column_stack([bare.sensed, record.force[:, 2]])
    hand = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(record.grip, axis=0)))
    moved = np.diff(record.load[:, : len(ARM)], axis=0)
    taken = sum(
        float(np.sum(plant.plant.law.torque(moved[:, i] / PERIOD) * moved[:, i]))
        for i, plant in enumerate(guidances().values())
    )
    return Claim(
        what="Without compensation the measured work of the hand is that of the joints' friction, by the simulator's truth",
        ours=f"{100 * (hand / taken - 1):+.2f} % off",
        gate="within 5 %",
        holds=abs(hand / taken - 1.0) <= 0.05,
    )


def windows(signal: np.ndarray, rounds: int, pace: float = 1.0) -> np.ndarray:
    """Return a signal cut into squares, (rounds, samples)."""
    first, size = round(BEGIN / PERIOD), round(4 * INTERVAL / pace / PERIOD)
    return signal[first : first + rounds * size].reshape(rounds, size)


def peaks(cases: Mapping[str, SquareRun], axis: int, rounds: int, pace: float = 1.0) -> dict[str, np.ndarray]:
    """Return the largest force of each square along an axis and against it by case [N], (rounds, 2).

    Args:
        cases: of `by_case`.
        axis: 0: x, 1: y.
        rounds: squares.
        pace: as in `path`.
    """
    cut = {case: windows(guided.sensed[:, axis], rounds, pace) for case, guided in cases.items()}
    return {case: np.stack([f.max(axis=1), -f.min(axis=1)], axis=1) for case, f in cut.items()}
