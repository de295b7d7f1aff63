"""External force without a force sensor: the cases of Iwatani 2017, chapter 4, the hand, and the measures.

CT: rate law with a dead zone of velocity, (4.17). HA: Hayward and Armstrong's contact, (4.16) with alpha = 0. P: algFE, (4.16)
with alpha = 20 1/s. The force sensor is the hand's true force with noise. All estimators take the friction curve that a sweep of
the same joint found (Figs. 3.4, 4.3). A hand goes back and forth to a metronome, holds the joint at rest and lets go.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from backdrive.control import BareLoop
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, between_counts, ct, ha
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.laws.base import Rate
from backdrive.simulation.closed_loop import Admittance, Record, Scene
from backdrive.simulation.hand import Hand, HandMotion, strokes
from backdrive.simulation.joint import JointSimulation

CASES = ("CT", "HA", "P")
ORDER = ("P", "CT", "HA")  # from the best to the worst, as the thesis has it
PERIOD = 1e-3  # T [s]
STIFFNESS = 1.2e6  # K on Setup A [N/m], Sec. 4.6.1
DECAY = 20.0  # alpha_N [1/s], Sec. 4.6.1
FAST = 500.0  # alpha_H [1/s], Sec. 4.7.2
INERTIA = 10.0  # estimate of the moving mass of Setup A [kg], Sec. 4.6.1
THRESHOLD = 0.01  # V of CT [m/s], Sec. 4.6.1
CASCADE = MotionFilter()  # one filter behind another: 100 m/s^2, 300 m/s^3
LITERAL = MotionFilter.literal()  # G = 10, H = 2, on the position
HAND_A = Hand(stiffness=800.0, damping=40.0, noise=0.2)  # on Setup A
STROKE, DURATION = 0.06, 0.7  # of the hand on Setup A [m], [s]
INTERVAL, BEGIN = 0.75, 0.5  # between strokes, before the first [s]
PRINTED = Admittance(inertia=1.0, viscosity=15.0, proportional=1e5, derivative=1e3, limit=600.0)  # Sec. 4.6.2
ADMITTANCE = Admittance(inertia=2.0, viscosity=15.0, proportional=1e5, derivative=1e3, limit=600.0)
REST = 1e-4  # speed below which Setup A is at rest [m/s]
MOST = 100  # longest delay that is tried [samples]


def estimators(
    plant: JointSimulation, rate: Rate, stiffness: float = STIFFNESS
) -> dict[str, FrictionEstimator]:
    """Return the friction estimators CT, HA and P of a joint.

    Args:
        plant: the joint, for the count that the threshold of CT is put off.
        rate: rate law that they assume.
        stiffness: K [N/m].
    """
    threshold = between_counts(THRESHOLD, plant.encoder_count, PERIOD)
    return {
        "CT": ct(rate, threshold),
        "HA": ha(rate, stiffness),
        "P": alg_fe(rate, stiffness, DECAY),
    }


def metronome(
    cycles: int, seed: int, *, hold: float = 0.0, free: float = 0.0, interval: float = INTERVAL
) -> HandMotion:
    """Return strokes on Setup A, then a hand that holds the joint for a while [s], then lets go of it [s]."""
    motion = strokes(
        PERIOD, stroke=STROKE, duration=DURATION, interval=interval, count=2 * cycles, start=BEGIN, seed=seed
    )
    return then(motion, hold=hold, free=free)


def then(motion: HandMotion, *, hold: float, free: float) -> HandMotion:
    """Return a motion that goes on with a hand at rest [s] and then without a hand [s]."""
    n, m = round(hold / PERIOD), round(free / PERIOD)

    def longer(x: np.ndarray, last: float, end: float) -> np.ndarray:
        return np.concatenate([x, np.full(n, last), np.full(m, end)])

    x = float(motion.position[-1])
    return motion.replace(
        position=longer(motion.position, x, x),
        velocity=longer(motion.velocity, 0.0, 0.0),
        grip=longer(motion.grip, 1.0, 0.0),
        push=longer(motion.push, 0.0, 0.0),
    )


def admittance_scene(
    plant: JointSimulation,
    motion: HandMotion,
    friction: FrictionEstimator,
    seed: int,
    *,
    hand: Hand = HAND_A,
    admittance: Admittance = ADMITTANCE,
    filter: MotionFilter = CASCADE,
    inertia: float = INERTIA,
    delay: float = 0.0,
) -> Scene:
    """Return a joint under sensorless admittance control; without a delay the command acts at once, for one tick.

    Args:
        plant: the joint.
        motion: of the hand.
        friction: estimator.
        seed: of noises and of the encoder's phase.
        hand: impedance and sensor.
        admittance: virtual object and position controller (4.6).
        filter: of the acceleration.
        inertia: that the estimator assumes [kg or kg.m^2].
        delay: of the drive [s].
    """
    external = ExternalForce(inertia=inertia, friction=friction, filter=filter)
    return Scene(
        plant=plant,
        motion=motion,
        hand=hand,
        loop=BareLoop(external=external),
        controller=admittance,
        period=PERIOD,
        delay=delay,
        seed=seed,
    )


def virtual_force(record: Record, admittance: Admittance, filter: MotionFilter = CASCADE) -> np.ndarray:
    """Return the force on the virtual object, m q'' + b q' of the encoder, Iwatani 2017, (4.19) [N or N.m], (n,)."""
    velocity, acceleration = filter.run(record.reading, PERIOD)
    return admittance.virtual_force(velocity, acceleration)


def rms(x: np.ndarray) -> float:
    """Return the root mean square, in the unit of x; 0 of nothing."""
    return float(np.sqrt(np.mean(np.square(x)))) if x.size else 0.0


def lag(late: np.ndarray, early: np.ndarray) -> float:
    """Return the delay by which one signal follows another best, in the mean square [s]."""
    n = early.size
    errors = [np.mean((late[k:] - early[: n - k]) ** 2) for k in range(MOST)]
    return PERIOD * int(np.argmin(errors))


def ranks(values: Mapping[str, np.ndarray], order: Sequence[str] = ORDER) -> int:
    """Return in how many runs the values of the cases strictly increase in this order; values (runs, ...) each."""
    columns = np.array([values[case] for case in order])
    rising = np.all(np.diff(columns, axis=0) > 0.0, axis=0)
    return int(np.sum(rising.reshape(rising.shape[0], -1).all(axis=1)))


def ran_away(record: Record) -> bool:
    """Return whether the command of an admittance-controlled joint was at its limit for more than 1 % of the time."""
    limit = record.scene.controller.limit if isinstance(record.scene.controller, Admittance) else np.inf
    return bool(np.mean(np.abs(record.command) >= 0.999 * limit) > 0.01)


def in_words(values: Mapping[str, float], unit: str, cases: Iterable[str] = ORDER, digits: int = 1) -> str:
    """Return values by case in words: `P 3.4, CT 4.2, HA 6.7 N`."""
    return ", ".join(f"{case} {values[case]:.{digits}f}" for case in cases) + f" {unit}"
