"""The joints of the league, the assumptions on them, and the scenes for every method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from backdrive.control import JointLoop
from backdrive.engine.servo import Servo
from backdrive.laws import CoulombViscous, HaywardArmstrong, Law, Polyline
from backdrive.laws.base import Rate
from backdrive.simulation.closed_loop import Record, Scene
from backdrive.simulation.hand import Hand, HandMotion, along, pushes, strokes
from backdrive.simulation.joint import JointSimulation
from backdrive.thesis.setups import setups

DT = 1e-3
SUBSTEP = 1e-4  # s, of the truth: 50 steps a period of its fastest oscillation
LETS_GO, PUSHES = 1.35, 2.35  # s, in the scene of release and break-away
REST = 1.0  # s, at the end of a scene, in which a limit cycle is looked for
STIFF, SOFT = 2.0, 0.5  # hands, by the contender's own [-]
DWELL = 0.8  # s, that the hand stays between its strokes in the scene of a dwell
STROKES = 4  # of a hand that guides; the first is not judged
EPISODES = ("release", "knock", "stiff", "soft", "dwell", "tracking")  # scenes of a method, in this order


@dataclass(frozen=True, kw_only=True)
class Setting:
    """The difference of the true joint from the assumed one.

    Attributes:
        name: in words.
        friction: factor on the true friction [-].
        stiffness: factor on the true stiffness of the transmission [-].
        delay: of the drive beyond one tick [s].
        noise: of the encoder beside its counts, in counts [1].
    """

    name: str
    friction: float = 1.0
    stiffness: float = 1.0
    delay: float = 0.0
    noise: float = 0.0


NOMINAL = Setting(name="as believed")
SETTINGS = (
    NOMINAL,
    Setting(name="encoder noise of a count", noise=1.0),
    Setting(name="friction 20 % less", friction=0.8),
    Setting(name="friction 20 % more", friction=1.2),
    Setting(name="stiffness 20 % less", stiffness=0.8),
    Setting(name="one more tick of delay", delay=DT),
    Setting(name="two more ticks of delay", delay=2 * DT),
    Setting(name="friction 15 % down by warmth", friction=0.85),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Contender:
    """A joint of the league.

    Attributes:
        name: of the joint.
        truth: with its friction on the load's side, a presliding element, torque ripple.
        rate: what identification gave.
        coulomb: mean Coulomb torque [N.m or N].
        stiffness: of the transmission, as believed [N.m/rad or N/m].
        stroke: of the hand [rad or m].
        hand: that guides it.
        ripple: amplitude of the torque's ripple [N.m or N].
        cycles: of it a unit of motion, times 2 pi [1/rad or 1/m].
    """

    name: str
    truth: JointSimulation
    rate: Rate
    coulomb: float
    stiffness: float
    stroke: float
    hand: Hand
    ripple: float
    cycles: float

    @property
    def count(self) -> float:
        """Step of the encoder [rad or m]."""
        return self.truth.encoder_count

    def plant(self, setting: Setting) -> JointSimulation:
        """Return the joint as it is in a setting."""
        rate = self.truth.law.rate
        factor = setting.friction
        if isinstance(rate, Polyline):
            rate = Polyline(
                velocity=rate.velocity,
                positive=tuple(factor * f for f in rate.positive),
                negative=tuple(factor * f for f in rate.negative),
            )
        else:
            rate = CoulombViscous(**{name: factor * value for name, value in rate.values().items()})
        return self.truth.replace(
            law=Law(rate=rate, element=self.truth.law.element),
            stiffness=setting.stiffness * self.truth.stiffness,
        )


@lru_cache(maxsize=1)
def contenders() -> tuple[Contender, ...]:
    """Return Setup A and Joints 0 to 2 of `setups`; the true joints are harder to compensate than the assumed ones."""
    found = []
    for joint in setups().values():
        linear = joint.unit == "m"
        stroke = 0.06 if linear else 0.15
        hand = Hand(stiffness=800.0, damping=40.0) if linear else Hand(stiffness=130.0, damping=6.0)
        rate = joint.law.rate
        if isinstance(rate, Polyline):
            coulomb, believed = rate.positive[0], rate
            uneven = Polyline(  # more friction in slow motion than a curve identified in motion contains
                velocity=rate.velocity,
                positive=(1.08 * rate.positive[0], *rate.positive[1:]),
                negative=(1.05 * rate.negative[0], *rate.negative[1:]),
            )
        else:
            coulomb = 0.5 * (rate.coulomb_positive + rate.coulomb_negative)  # type: ignore[attr-defined]
            believed = uneven = rate
        element = HaywardArmstrong(stiffness=8.0 * joint.stiffness)
        turns = 2.0 * np.pi / 0.02 if joint.unit == "m" else 100.0
        found.append(
            Contender(
                name=joint.name,
                truth=joint.replace(
                    law=Law(rate=uneven, element=element), friction_side="load", torque_noise=0.005 * coulomb
                ),
                rate=believed,
                coulomb=coulomb,
                stiffness=joint.stiffness,
                stroke=stroke,
                hand=hand,
                ripple=0.02 * coulomb,
                cycles=2.0 * turns,
            )
        )
    return tuple(found)


def scenes(
    who: Contender, loop: JointLoop, setting: Setting, seed: int, names: Sequence[str] = EPISODES
) -> list[Scene]:
    """Return what a compensator plays, in the order of `names`.

    In `release` the hand moves the joint, waits, lets go and touches it lightly against the stroke. `knock` is a push on a free
    joint. `stiff` and `soft` are strokes of either hand, and `dwell` those of the soft hand with pauses. `tracking` is a
    saw-tooth motion at low gains.
    """
    plant = who.plant(setting)
    common = {
        "plant": plant,
        "loop": loop,
        "delay": DT + setting.delay,
        "ripple": who.ripple,
        "ripple_cycles": who.cycles,
        "encoder_noise": setting.noise * who.count / np.sqrt(12.0),
        "substep": SUBSTEP,
        "seed": seed,
    }
    made = []
    for name in names:
        own: dict[str, object]
        if name == "release":
            own = {"motion": release(who), "hand": who.hand}
        elif name == "knock":
            t = DT * np.arange(2200)
            own = {"motion": pushes(2.0 * who.coulomb * ((t > 0.1) & (t < 0.16)))}
        elif name == "tracking":
            saw, target = saw_tooth(who)
            own = {
                "motion": pushes(np.zeros(len(saw)), position=float(saw[0])),
                "controller": low_gains(plant),
                "target": target,
            }
        else:
            own = {"motion": hand_strokes(who, name, seed), "hand": hand_of(who, name)}
        made.append(Scene(**own, **common))  # type: ignore[arg-type]
    return made


def hand_of(who: Contender, name: str) -> Hand:
    """Return the stiff hand or the soft one, of the same damping ratio."""
    factor = STIFF if name == "stiff" else SOFT
    return Hand(stiffness=factor * who.hand.stiffness, damping=np.sqrt(factor) * who.hand.damping)


def hand_strokes(who: Contender, name: str, seed: int) -> HandMotion:
    """Return strokes to a metronome, or with a dwell after each."""
    interval, count = (0.7 + DWELL, 3) if name == "dwell" else (0.75, STROKES)
    return strokes(
        DT, stroke=who.stroke, duration=0.7, interval=interval, count=count, variation=0.05, seed=seed
    )


def saw_tooth(who: Contender) -> tuple[np.ndarray, np.ndarray]:
    """Return rounded saw-teeth of 0.5 Hz, (n,), and them with their velocity, (n, 2)."""
    t = DT * np.arange(2200)
    saw = who.stroke * (2.0 / np.pi) * np.arcsin(0.98 * np.sin(np.pi * t))
    return saw, np.stack([saw, np.gradient(saw, DT)], axis=1)


def release(who: Contender) -> HandMotion:
    """Return a stroke, a hold, letting go, and a force that grows against the direction of the stroke."""
    one = strokes(DT, stroke=who.stroke, duration=0.6, count=1, start=0.2, variation=0.0)
    n = round((PUSHES + 1.2) / DT)
    pad = n - len(one.position)
    motion = along(
        np.pad(one.position, (0, max(pad, 0)), "edge")[:n], np.pad(one.velocity, (0, max(pad, 0)))[:n]
    ).release(LETS_GO, DT)
    t = DT * np.arange(n)
    push = np.where(t > PUSHES, -2.2 * who.coulomb * (t - PUSHES) / 1.2, 0.0)
    return motion.replace(push=push)


def low_gains(plant: JointSimulation) -> Servo:
    """Return a soft position controller with a damping ratio of 0.7."""
    bandwidth = 14.0
    return Servo(
        proportional=plant.inertia * bandwidth**2,
        derivative=1.4 * plant.inertia * bandwidth,
        filter_time=2e-3,
    )


def shaking(who: Contender, freed: Record, knocked: Record) -> dict[str, float]:
    """Return the residual motion at rest: limit cycle and fluctuation [rad or m], and the energy put in [J]."""
    go, push = round(LETS_GO / DT), round(PUSHES / DT)
    tail = slice(-round(REST / DT), None)
    return {
        "cycle": float(0.5 * np.ptp(knocked.motor[tail])),
        "fluctuation": float(np.ptp(freed.load[go:push])),
        "energy": float(np.sum(knocked.compensation[tail][:-1] * np.diff(knocked.motor[tail]))),
    }


def scores(who: Contender, records: Mapping[str, Record]) -> dict[str, float]:
    """Return the scores of a compensator in its scenes, SI units.

    Args:
        who: the joint.
        records: by name, of some of `EPISODES`.
    """
    found: dict[str, float] = {}
    if "tracking" in records:
        error = records["tracking"].wanted - records["tracking"].load
        found["tracking"] = float(np.sqrt(np.mean(error**2)))
    if "release" in records:
        found["touch"] = light_touch(who, records["release"])
        found |= shaking(who, records["release"], records["knock"])
    if "dwell" in records:
        found["dwell"] = dwell_force(records["dwell"])
    for name in ("stiff", "soft"):
        if name in records:
            force = np.abs(records[name].force[1250 : 500 + 750 * STROKES]).reshape(STROKES - 1, 750)
            found[f"{name}_peak"] = float(force.max(axis=1).mean())
            found[f"{name}_rms"] = float(np.sqrt(np.mean(force**2)))
    return found


def light_touch(who: Contender, freed: Record) -> float:
    """Return the force that moves the joint again after a dwell, against its last stroke [N.m or N]."""
    push = round(PUSHES / DT)
    moved = np.flatnonzero(np.abs(freed.load[push:] - freed.load[push - 1]) > 5e-3 * who.stroke)
    return float(np.abs(freed.force[push + moved[0]])) if moved.size else 2.2 * who.coulomb


def dwell_force(dwelt: Record) -> float:
    """Return the root mean square of the hand's force in the second half of its dwells [N.m or N]."""
    interval, half = round((0.7 + DWELL) / DT), round(0.5 * DWELL / DT)
    ends = [500 + interval * (i + 1) for i in range(2)]
    return float(np.sqrt(np.mean([dwelt.force[end - half : end] ** 2 for end in ends])))
