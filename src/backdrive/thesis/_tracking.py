"""Saw-tooth tracking by a low-gain PD with four compensations: Iwatani 2017, 2.5.2.

NC: none. MO: the contact alone with F_0 of the identified curve, (2.24). MOL: beside it B_c v, (2.25), B_c the slope of a straight
line fitted to the identified curve. MOP: beside it the identified curve, (2.22).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from backdrive.control import BareLoop
from backdrive.control.compensators import Compensator
from backdrive.control.compensators.catalog import mahvash_okamura, nothing
from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput
from backdrive.identification.metrics import tracking_error
from backdrive.laws import CoulombViscous, Law, Polyline
from backdrive.simulation import JointSimulation
from backdrive.simulation.closed_loop import Record, Scene, play
from backdrive.simulation.hand import still
from backdrive.thesis._manual import CONTACT, PERIOD, SHARE, curves, joints
from backdrive.thesis.outcome import Claim
from backdrive.thesis.setups import RATIO, arm

CASES = ("NC", "MO", "MOL", "MOP")
GAIN, DAMPING = 200.0, 0.5  # K_p [N.m/rad] and damping ratio of the PD
TOOTH = 0.4  # height of a tooth [rad]
TEETH = {0.1: 1, 0.3: 2, 0.5: 3, 0.7: 4}  # speed [rad/s] -> teeth
DAMPINGS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)  # damping ratios at which the order is looked at
SETTING = (
    f"Compliant joints of Setup B. PD with K_p = {GAIN:g} N.m/rad and a damping ratio of {DAMPING:g}. Saw-teeth of {TOOTH:g} rad "
    f"at {', '.join(f'{v:g}' for v in TEETH)} rad/s. K = {CONTACT:g} N.m/rad, R = {SHARE:g}, curves identified by a sweep of 20 "
    "deg, gravity held. Joints 3 to 5 are assumed but for ratio and torque limit."
)


def saw_teeth(teeth: dict[float, int] | None = None) -> np.ndarray:
    """Return position and velocity of saw-teeth that grow faster, (n, 2).

    Args:
        teeth: speed [rad/s] -> number of teeth; None: `TEETH`.
    """
    velocity = []
    for speed, count in (TEETH if teeth is None else teeth).items():
        flank = np.full(round(TOOTH / speed / PERIOD), speed)
        velocity += [flank, -flank] * count
    v = np.concatenate(velocity)
    return np.column_stack([np.concatenate([[0.0], np.cumsum(v)[:-1]]) * PERIOD, v])


def viscosity(curve: Law) -> float:
    """Return B_c, the slope of a straight line through the pairs of an identified curve [N.m.s/rad]."""
    rate = curve.rate
    if not isinstance(rate, Polyline):
        raise InvalidInput(f"'{curve.name}' has no pairs.", remedy="Give a curve of line sections.")
    return float(np.polyfit(rate.velocity, rate.positive, 1)[0])


def compensators(curve: Law) -> dict[str, Compensator]:
    """Return the four cases for an identified curve."""
    F_0, B_c = float(curve.torque(1e-12)), viscosity(curve)

    def straight(b: float) -> CoulombViscous:
        return CoulombViscous(
            coulomb_positive=F_0, coulomb_negative=F_0, viscous_positive=b, viscous_negative=b
        )

    return {
        "NC": nothing(),
        "MO": mahvash_okamura(straight(0.0), CONTACT, SHARE),
        "MOL": mahvash_okamura(straight(B_c), CONTACT, SHARE),
        "MOP": mahvash_okamura(curve.rate, CONTACT, SHARE, literal=True),
    }


def pd(joint: JointSimulation, gain: float = GAIN, ratio: float = DAMPING) -> Servo:
    """Return a PD for a joint.

    Args:
        joint: to be moved.
        gain: K_p [N.m/rad].
        ratio: of damping; K_d = 2 ratio sqrt(K_p I).
    """
    return Servo(proportional=gain, derivative=2.0 * ratio * np.sqrt(gain * joint.inertia))


def track(
    settings: Sequence[tuple[JointSimulation, Servo]],
    *,
    seed: int,
    target: np.ndarray,
    cases: Sequence[str] = CASES,
    ratio: float = RATIO,
) -> list[dict[str, Record]]:
    """Track a target and return what happened by case.

    Args:
        settings: joints and their controllers.
        seed: of sensors, actuators and the identification.
        target: position and velocity, (n, 2).
        cases: of `CASES`.
        ratio: K_c by K of the joints on which friction was identified [-].
    """
    found = curves(seed, ratio)
    scenes = []
    for i, (joint, servo) in enumerate(settings):
        given = compensators(found[joint.name])
        for case in cases:
            scenes.append(
                Scene(
                    plant=joint,
                    motion=still(len(target)),
                    controller=servo,
                    target=target,
                    loop=BareLoop(compensator=given[case]),
                    seed=1000 * seed + i,
                )
            )
    records = play(scenes)
    n = len(cases)
    return [dict(zip(cases, records[n * i : n * i + n], strict=False)) for i in range(len(settings))]


def error(record: Record) -> float:
    """Return E_s of (2.26) [rad]."""
    return tracking_error(record.wanted, record.reading)


@lru_cache(maxsize=1)
def by_joint(seed: int, ratio: float = RATIO) -> dict[str, dict[str, Record]]:
    """Return the four cases of each joint at the gains that are judged."""
    chosen = arm(ratio)
    done = track([(j, pd(j)) for j in chosen], seed=seed, target=saw_teeth(), ratio=ratio)
    return {joint.name: cases for joint, cases in zip(chosen, done, strict=False)}


def lag_check(done: dict[str, dict[str, Record]]) -> Claim:
    """Return the claim that without compensation the joint follows the slowest teeth late by friction over K_p."""
    speed = min(TEETH)
    flank = round(TOOTH / speed / PERIOD)
    errors = []
    for cases in done.values():
        record = cases["NC"]
        late = (record.wanted - record.reading)[round(0.6 * flank) : round(0.95 * flank)]
        errors.append(float(late.mean() * GAIN / record.scene.plant.law.torque(speed)) - 1.0)
    return Claim(
        what=f"Without compensation the position error is F({speed:g} rad/s)/K_p, the closed form",
        ours=f"{', '.join(f'{100 * e:+.2f}' for e in errors)} % off",
        gate="within 4 %",
        holds=max(abs(e) for e in errors) <= 0.04,
    )


def by_damping(seed: int, ratio: float = RATIO) -> dict[str, dict[float, dict[str, float]]]:
    """Return E_s [rad] by joint, damping ratio and case."""
    chosen = joints(ratio)
    settings = [(j, pd(j, ratio=r)) for j in chosen for r in DAMPINGS]
    done = iter(track(settings, seed=seed, target=saw_teeth({0.3: 1, 0.7: 3}), cases=CASES[1:], ratio=ratio))
    return {j.name: {r: {case: error(x) for case, x in next(done).items()} for r in DAMPINGS} for j in chosen}
