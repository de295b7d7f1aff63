"""Fig. 4.3 of Iwatani 2017: the identified friction that the estimators of chapter 4 take."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.laws.base import Rate
from backdrive.report.pictures.canvas import LIGHT, dots, house_style
from backdrive.simulation.closed_loop import Scene, play
from backdrive.simulation.hand import Hand, along
from backdrive.thesis import _sensorless_plots as own
from backdrive.thesis import fig_3_4
from backdrive.thesis._sensorless import DECAY, HAND_A, PERIOD, STIFFNESS, metronome, rms
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import setups

PRINTED = 6.85  # F of Joint 0, the intercept of the printed figure [N.m]
LEVER = 0.4  # from metres of Setup A to radians of Joint 0 [m]
CYCLES = 10
FAST = {"m": 0.0125, "rad": 0.03}  # speed above which friction slides fully [m/s, rad/s]


def run(seed: int = 0, cycles: int = CYCLES) -> Outcome:
    """Identify both setups as in Fig. 3.4 and use the curves on a motion of another kind.

    Args:
        seed: of noises and of the hand.
        cycles: of the metronome in the motion that tries the curves.
    """
    before = fig_3_4.run(seed)
    panels = {name: before.data["panels"][name] for name in ("setup_a", "joint_0")}
    plants = setups()
    rates = {name: fig_3_4.identify_rate(plants[name], seed) for name in panels}
    error = {name: _errors(name, rates[name], seed, cycles) for name in panels}
    F_p, F_n = panels["setup_a"]["intercepts"]
    F = 0.5 * sum(panels["joint_0"]["intercepts"])
    numbers = {"setup_a.F_p": F_p, "setup_a.F_n": F_n, "joint_0.F": F}
    numbers |= {f"{name}.{what}": x for name, by in error.items() for what, x in by.items()}
    return Outcome(
        name="fig-4.3",
        title="Identified friction over velocity, as the estimators use it",
        setting=(
            "The identification of Fig. 3.4, each direction on its own; simulated sweeps of Setup A and Joint 0. The "
            "curves are then tried "
            f"on a hand's motion that they were not identified from ({cycles} cycles of the metronome, no actuator force)."
        ),
        claims=(
            Claim(
                what="The intercept of Joint 0 is the F that its estimator uses.",
                thesis=f"F = {PRINTED} N m",
                ours=f"{F:.2f} N m",
                gate="within 4 %",
                holds=abs(F / PRINTED - 1.0) < 0.04,
                why="The curve bends down, and a line through the two slowest knots meets zero above the truth (6.85 N m).",
            ),
            Claim(
                what="The curves give the friction of a motion that they were not identified from.",
                ours="; ".join(
                    f"{name}: RMS error {by['error']:.3f} of {by['friction']:.2f} {by_unit}"
                    for (name, by), by_unit in zip(error.items(), ("N", "N m"), strict=False)
                ),
                gate="below 3 % while the joint slides",
                holds=all(by["error"] < 0.03 * by["friction"] for by in error.values()),
                why="Friction as algFE (4.16) estimates it from the encoder, beside the law that was put in at the true velocity.",
            ),
        ),
        data={"panels": panels},
        numbers=numbers,
    )


def _errors(name: str, rate: Rate, seed: int, cycles: int) -> dict[str, float]:
    """Return the RMS error of the estimated friction while the joint slides, and that of the friction [N or N.m]."""
    plant = setups()[name]
    motion, hand, stiffness = metronome(cycles, seed), HAND_A, STIFFNESS
    if plant.unit == "rad":
        motion = along(motion.position / LEVER, motion.velocity / LEVER)
        hand, stiffness = Hand(stiffness=130.0, damping=6.0, noise=0.05), 5e4
    record = play(Scene(plant=plant, motion=motion, hand=hand, seed=seed))
    external = ExternalForce(inertia=plant.inertia, friction=alg_fe(rate, stiffness, DECAY))
    friction = external.run(record.reading, record.command, PERIOD)[1]
    # at a steady speed v the spring of algFE carries all of the friction above alpha F/K only
    slides = np.abs(record.load_velocity) > FAST[plant.unit]
    truth = plant.law.torque(record.load_velocity)
    return {"error": rms((friction - truth)[slides]), "friction": rms(truth[slides])}


TITLES = {"setup_a": "(a) Setup A", "joint_0": "(b) Setup B, Joint 0"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: samples, the identified curve, the true one dashed."""
    with house_style():
        figure, axes = own.sheet(1, 2, height=300.0)
        for a, (joint, panel) in zip(axes[0], outcome.data["panels"].items(), strict=False):
            length, force = ("m", "N") if panel["unit"] == "m" else ("rad", "N·m")
            dots(
                a,
                LIGHT,
                panel["samples_velocity"],
                panel["samples_friction"],
                own.SENSOR,
                size=1.6,
                alpha=0.25,
            )
            a.plot([], [], "o", color=own.SENSOR, markersize=3, label="samples")
            a.plot(panel["velocity"], panel["curve"], color=LIGHT.fitted, linewidth=1.8, label="identified")
            a.plot(
                panel["velocity"],
                panel["truth"],
                color=LIGHT.ink,
                linewidth=1.0,
                linestyle=own.DASHED,
                label="put in",
            )
            own.level(a)
            own.name(a, TITLES[joint], f"velocity [{length}/s]", f"friction [{force}]")
            own.key(a, "upper left")
    return figure
