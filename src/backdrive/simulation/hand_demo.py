"""The demo after its identification: a hand moves the joint, with and without compensation, and its force is estimated
without a sensor.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from backdrive.control import JointLoop, torque_limit
from backdrive.control.compensators import Dither, alg_fc, nothing
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.laws import Law
from backdrive.simulation.closed_loop import Record, Scene, play
from backdrive.simulation.hand import Hand, strokes
from backdrive.simulation.machines import MACHINES

DT = 1e-3
SHARE, SOFTER = (
    0.9,
    0.5,
)  # R, and K by the stiffness of the transmission: Iwatani 2017, (2.21), and what keeps it stable
SHOWN = 4.0  # s, of the pictures

#: Above which the loop takes the joint for a runaway, by its unit [rad/s, m/s].
TOP_SPEED = {"rad": 3.0, "m": 0.6}


@dataclass(frozen=True, kw_only=True, eq=False)
class HandDemo:
    """A joint moved by a hand.

    Attributes:
        bare: without compensation; its estimates are of the force of the hand.
        compensated: with the thesis' compensator and the identified friction.
        unit: of force, `N.m` or `N`.
        motion_unit: `rad` or `m`.
        stiffness: of the transmission [N.m/rad or N/m].
        top_speed: above which the loop switches off [rad/s or m/s].
        force: root mean square of the hand's force, without and with compensation [N.m or N].
        error: root mean square of estimate minus sensor, divided by that of the sensor, without compensation [-].
    """

    bare: Record = field(repr=False)
    compensated: Record = field(repr=False)
    unit: str
    motion_unit: str
    stiffness: float
    top_speed: float
    force: tuple[float, float]
    error: float


def simulate_hand(name: str, law: Law, inertia: float, seed: int = 0) -> HandDemo:
    """Let a hand move a machine of the thesis, with its identified friction.

    Args:
        name: of the machine, `joint_1` for example.
        law: identified friction curve.
        inertia: identified, or known [kg.m^2 or kg].
        seed: of noises and strokes.
    """
    make = MACHINES[name]
    plant = make() if name == "setup_a" else make(compliant=True)
    plant = plant.replace(friction_side="load")
    K = SOFTER * plant.stiffness
    linear = plant.unit == "m"
    top = TOP_SPEED[plant.unit]
    hand = (
        Hand(stiffness=800.0, damping=40.0, noise=0.1)
        if linear
        else Hand(stiffness=130.0, damping=6.0, noise=0.05)
    )
    motion = strokes(DT, stroke=0.06 if linear else 0.2, duration=0.7, count=6, seed=seed)
    external = ExternalForce(inertia=inertia, friction=alg_fe(law.rate, K), gravity_sin=0.0, gravity_cos=0.0)
    scenes = [
        Scene(
            plant=plant,
            motion=motion,
            hand=hand,
            loop=JointLoop(
                compensator=compensator,
                external=external,
                top_speed=top,
                limit=torque_limit(compensator, top),
                encoder_count=plant.encoder_count,
            ),
            seed=seed,
        )
        for compensator in (nothing(), alg_fc(law.rate, K, 20.0, Dither(share=0.3), SHARE))
    ]
    bare, compensated = play(scenes, one_kernel=True)
    rms = [float(np.sqrt(np.mean(r.force**2))) for r in (bare, compensated)]
    wrong = float(np.sqrt(np.mean((bare.estimate - bare.sensed) ** 2)))
    return HandDemo(
        bare=bare,
        compensated=compensated,
        unit="N" if linear else "N.m",
        motion_unit=plant.unit,
        stiffness=plant.stiffness,
        top_speed=top,
        force=(rms[0], rms[1]),
        error=wrong / rms[0],
    )
