"""Joints moved by hand at 0.5 Hz, without and with the compensation of chapter 2: Iwatani 2017, 2.5.1.

The compensator is (2.22): Mahvash and Okamura's contact with K = 1e4 N.m/rad and the curve that the sweep identified on the same
simulated joint, R = 0.9. Gravity is held by the command. The joints are those of Setup B, whose
encoders sit before the transmission.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from backdrive.control import BareLoop
from backdrive.control.compensators.catalog import mahvash_okamura, nothing
from backdrive.identification.metrics import mean_magnitude
from backdrive.laws import Law
from backdrive.simulation import JointSimulation
from backdrive.simulation.closed_loop import Record, Scene, play
from backdrive.simulation.hand import Hand, HandMotion, along
from backdrive.thesis._sweeps import identify_curve
from backdrive.thesis.setups import RATIO, arm

CONTACT, SHARE = 1e4, 0.9  # K [N.m/rad] and R of 2.5
FREQUENCY, CYCLES = 0.5, 11  # of the motion [Hz]; the first cycle is not judged
AMPLITUDE = 0.25  # of the motion, half its stroke [rad]
PERIOD = 1e-3  # of the loop [s]
FIRM, SOFT = 3000.0, 110.0  # stiffness of a hand that prescribes the motion, and of a person's arm [N.m/rad]
FELT = (
    "joint_0",
    "joint_1",
    "joint_2",
    "joint_4",
)  # moved by hand; the others are too much for the thesis' force sensor
SENSOR_NOISE = 0.05  # of the force sensor, at the joint [N.m]


def joints(ratio: float = RATIO) -> tuple[JointSimulation, ...]:
    """Return the joints that Figs. 2.11 and 2.12 move by hand: 0, 1, 2 and 4.

    Args:
        ratio: K_c by K [-].
    """
    return tuple(joint for joint in arm(ratio) if joint.name in FELT)


@lru_cache(maxsize=8)
def curves(seed: int, ratio: float = RATIO) -> dict[str, Law]:
    """Return the friction that a sweep identified on each joint; K_c = ratio K."""
    return {joint.name: identify_curve(joint, seed=seed) for joint in arm(ratio)}


def motion(amplitude: float = AMPLITUDE, cycles: int = CYCLES) -> HandMotion:
    """Return x_h = -A cos(2 pi f t).

    Args:
        amplitude: A [rad].
        cycles: that it lasts.
    """
    t = PERIOD * np.arange(round(cycles / FREQUENCY / PERIOD))
    w = 2.0 * np.pi * FREQUENCY
    return along(-amplitude * np.cos(w * t), amplitude * w * np.sin(w * t))


def grip(stiffness: float, joint: JointSimulation) -> Hand:
    """Return a hand: a soft one is damped like a human arm, a firm one with a damping ratio of 0.7.

    Args:
        stiffness: K_h [N.m/rad].
        joint: that it holds.
    """
    damping = 6.0 if stiffness < 1000.0 else 1.4 * np.sqrt(stiffness * joint.inertia)
    return Hand(stiffness=stiffness, damping=damping, noise=SENSOR_NOISE)


@dataclass(frozen=True, kw_only=True, eq=False)
class HandRecord:
    """A joint that was moved by hand, without and with compensation.

    Attributes:
        joint: that was moved.
        before: without compensation.
        after: with it.
    """

    joint: JointSimulation
    before: Record
    after: Record

    @property
    def speeds(self) -> tuple[float, float]:
        """V_s of (2.23), before and after [rad/s]."""
        return tuple(mean_magnitude(from_second_cycle(r, r.load_velocity)) for r in (self.before, self.after))  # type: ignore[return-value]

    @property
    def torques(self) -> tuple[float, float]:
        """F_s of (2.23), before and after [N.m]."""
        return tuple(mean_magnitude(from_second_cycle(r, r.sensed)) for r in (self.before, self.after))  # type: ignore[return-value]

    @property
    def reduction(self) -> float:
        """How much smaller the torque of the hand is with compensation [%]."""
        before, after = self.torques
        return 100.0 * (1.0 - after / before)

    @property
    def speed_change(self) -> float:
        """How much larger the velocity is with compensation [%]."""
        before, after = self.speeds
        return 100.0 * (after / before - 1.0)

    @property
    def forward(self) -> float:
        """Phase lead gained by the torque's fundamental relative to the velocity's [deg]."""
        a, b = (phase(r.sensed, r) - phase(r.load_velocity, r) for r in (self.before, self.after))
        return float((np.rad2deg(b - a) + 180.0) % 360.0 - 180.0)

    @property
    def inertia_torque(self) -> float:
        """Root mean square of the hand's torque for inertia alone, with compensation [N.m]."""
        return mean_magnitude(from_second_cycle(self.after, self._inertia(self.after)))

    @property
    def reduction_beside_inertia(self) -> float:
        """The reduction of the torque without the part for inertia [%]."""
        rest = [
            mean_magnitude(from_second_cycle(r, r.sensed - self._inertia(r)))
            for r in (self.before, self.after)
        ]
        return 100.0 * (1.0 - rest[1] / rest[0])

    def _inertia(self, record: Record) -> np.ndarray:
        return self.joint.inertia * np.gradient(record.load_velocity, PERIOD)


def from_second_cycle(record: Record, column: np.ndarray) -> np.ndarray:
    """Return a column from the second cycle on."""
    return column[record.time >= 1.0 / FREQUENCY - 0.5 * PERIOD]


def phase(x: np.ndarray, record: Record) -> float:
    """Return the phase of a column's part at 0.5 Hz [rad]."""
    turn = np.exp(-2j * np.pi * FREQUENCY * from_second_cycle(record, record.time))
    return float(np.angle(np.sum(from_second_cycle(record, x) * turn)))


def move_by_hand(
    chosen: Sequence[JointSimulation],
    *,
    seed: int,
    stiffness: float = FIRM,
    amplitudes: Sequence[tuple[float, float]] | None = None,
    cycles: int = CYCLES,
    ratio: float = RATIO,
) -> list[HandRecord]:
    """Move joints by hand, without and with compensation.

    Args:
        chosen: joints.
        seed: of sensors, actuators and the identification.
        stiffness: of the hand [N.m/rad].
        amplitudes: what the hand intends without and with compensation, a pair a joint [rad]; None: `AMPLITUDE`.
        cycles: of the motion.
        ratio: K_c by K of the joints on which friction was identified [-].
    """
    found = curves(seed, ratio)
    scenes = []
    for i, joint in enumerate(chosen):
        intended = (AMPLITUDE, AMPLITUDE) if amplitudes is None else amplitudes[i]
        for amplitude, compensator in zip(
            intended,
            (nothing(), mahvash_okamura(found[joint.name].rate, CONTACT, SHARE, literal=True)),
            strict=False,
        ):
            scenes.append(
                Scene(
                    plant=joint,
                    motion=motion(amplitude, cycles),
                    hand=grip(stiffness, joint),
                    loop=BareLoop(compensator=compensator),
                    seed=1000 * seed + i,
                )
            )
    records = play(scenes)
    return [
        HandRecord(joint=j, before=a, after=b)
        for j, a, b in zip(chosen, records[::2], records[1::2], strict=False)
    ]


@lru_cache(maxsize=1)
def by_hand(seed: int, ratio: float = RATIO) -> tuple[list[HandRecord], list[HandRecord], list[HandRecord]]:
    """Return Joints 0, 1, 2 and 4 moved by the firm hand, the soft one at the same speed and the soft one of the same reach.

    Args:
        seed: as in `move_by_hand`.
        ratio: K_c by K [-].
    """
    chosen = joints(ratio)
    return (
        move_by_hand(chosen, seed=seed, ratio=ratio),
        equally_fast(chosen, seed=seed, ratio=ratio),
        move_by_hand(chosen, seed=seed, stiffness=SOFT, ratio=ratio),
    )


def equally_fast(
    chosen: Sequence[JointSimulation], *, seed: int, stiffness: float = SOFT, ratio: float = RATIO
) -> list[HandRecord]:
    """Move joints by a soft hand whose intended amplitude is large enough to keep the velocity of the prescribed motion.

    A person controls the visible motion, not the force, and so intends a larger motion against a larger resistance.

    Args:
        chosen: joints.
        seed: as in `move_by_hand`.
        stiffness: of the hand [N.m/rad].
        ratio: as in `move_by_hand`.
    """
    goal = AMPLITUDE * 2.0 * np.pi * FREQUENCY / np.sqrt(2.0)
    reach = np.full((len(chosen), 2), AMPLITUDE)
    for _ in range(6):
        done = move_by_hand(
            chosen,
            seed=seed,
            stiffness=stiffness,
            amplitudes=[tuple(r) for r in reach],
            cycles=3,
            ratio=ratio,
        )
        speeds = np.array([m.speeds for m in done])
        reach += 0.9 * (goal - speeds) / (2.0 * np.pi * FREQUENCY / np.sqrt(2.0))
    return move_by_hand(
        chosen, seed=seed, stiffness=stiffness, amplitudes=[tuple(r) for r in reach], ratio=ratio
    )
