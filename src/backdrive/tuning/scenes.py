"""The simulation scenes in which a proposal is judged on joints within the model's uncertainty.

A joint has friction on the far side of its transmission and the encoder on the near one (Iwatani 2017, Fig. 3.2). In
presliding, the encoder shows K_c: the transmission in series with the friction's own contact (`laws.ViscoElastoplastic`).
Their shares are unknown and are drawn at random. With a rigid contact, a hand force below break-away would have no effect on
the encoder. The hand of the stated stroke is nearly a prescribed motion; friction would reduce the stroke of a soft hand, and
results would not be comparable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.control import JointLoop
from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput
from backdrive.simulation.closed_loop import Record, Scene
from backdrive.simulation.hand import Hand, HandMotion, pushes, strokes
from backdrive.tuning import rules
from backdrive.tuning.bounds import check_numbers
from backdrive.tuning.facts import Facts
from backdrive.tuning.members import Member

SUBSTEP = 1e-4  # longest integration step while searching [s]
FINE = 4e-5  # the same while checking [s]
PUSHED = 0.03  # time of the knock, a push of 2 F [s]
SETTLED = 2.0  # length of the scene of a knock [s]
WINDOW = 0.5  # at its end, in which the joint has to rest [s]
PACE = 30.0  # steps a period of the joint's fastest oscillation that an integration needs
FINEST = 2e-6  # shortest integration step that ends within minutes [s]
LEAST = 10.0  # least stroke relative to F/K_c, so that not all of it is presliding [-]
BEYOND = 10.0  # largest speed of a stroke, relative to the model's top speed [-]
USUAL_DURATION = 0.5  # of the stated stroke [s]
PEAK = 1.875  # peak speed of a minimum-jerk stroke by length/duration [-]


@dataclass(frozen=True, kw_only=True)
class Stroke:
    """The motion of the hand.

    Attributes:
        length: from end to end [rad or m].
        duration: of a stroke [s].
        interval: between the beginnings of strokes [s].
        count: of strokes; the first is not judged.
        hand: its impedance.
    """

    length: float
    duration: float
    interval: float
    count: int
    hand: Hand

    def motion(self, dt: float) -> HandMotion:
        """Return the hand's motion, all strokes alike."""
        whole = strokes(
            dt,
            stroke=self.length,
            duration=self.duration,
            interval=self.interval,
            count=self.count,
            start=0.1,
            variation=0.0,
        )
        n = round((0.1 + self.interval * self.count) / dt)
        return whole.replace(**{k: getattr(whole, k)[:n] for k in ("position", "velocity", "grip", "push")})


def usual_stroke(facts: Facts, length: float | None = None, duration: float = USUAL_DURATION) -> Stroke:
    """Return the stroke for judging a joint: with pauses of half its duration, and a hand with nearly prescribed motion.

    Args:
        facts: of the joint.
        length: of the stroke [rad or m]; None: 0.15 rad or 0.06 m.
        duration: of it [s].

    Raises:
        InvalidInput: one of them is out of its bounds, the whole stroke is presliding, or it is faster than 10 times the
            model's range and than 10 times the stated stroke.
    """
    where = f"Joint '{facts.name}'"
    check_numbers(where, stroke=length, duration=duration)
    usual = 0.15 if facts.unit == "rad" else 0.06
    length = usual if length is None else length
    if duration < 20.0 * facts.interval:
        raise InvalidInput(
            f"{where}: duration = {duration:g} s is less than 20 intervals.",
            remedy="Take a longer one (--duration) or sample faster (--interval).",
        )
    if length < LEAST * facts.coulomb / facts.stiffness:
        raise InvalidInput(
            f"{where}: stroke = {length:g} {facts.unit} is presliding, F/K_c is {facts.coulomb / facts.stiffness:.3g}.",
            remedy=f"Give --stroke {LEAST:g} times that or more.",
        )
    speed, fastest = PEAK * length / duration, BEYOND * max(facts.top_speed, PEAK * usual / USUAL_DURATION)
    if speed > fastest:
        raise InvalidInput(
            f"{where}: a stroke of {length:g} {facts.unit} in {duration:g} s is as fast as {speed:.3g} {facts.unit}/s, the "
            f"model's range ends at {facts.top_speed:.3g} {facts.unit}/s.",
            remedy=f"Up to {fastest:.3g} {facts.unit}/s is tuned for: give a shorter --stroke or a longer --duration.",
        )
    stiffness = 15.0 * facts.coulomb / length
    damping = 1.4 * float(np.sqrt(stiffness * facts.inertia))  # a damping ratio of 0.7
    return Stroke(
        length=length,
        duration=duration,
        interval=1.5 * duration,
        count=3,
        hand=Hand(stiffness=stiffness, damping=damping),
    )


def substep(facts: Facts, member: Member, longest: float) -> float:
    """Return the integration step for a joint: a share of the period of motor and load against their springs."""
    M = member.motor_share * member.inertia
    L = member.inertia - M
    omega = float(np.sqrt(member.transmission * (1.0 / M + 1.0 / L) + member.bristle / L))
    return min(longest, 2.0 * np.pi / omega / PACE, facts.interval)


def check_step(facts: Facts, members: Sequence[Member]) -> None:
    """Refuse joints whose integration would take hours.

    Raises:
        InvalidInput: motor and load swing too fast on their springs.
    """
    step = min(substep(facts, m, FINE) for m in members)
    if step < FINEST:
        raise InvalidInput(
            f"Joint '{facts.name}': motor and load swing on K_c with up to {1.0 / (PACE * step):.3g} Hz. This would need an "
            f"integration step of {step:.2g} s, and the shortest is {FINEST:g} s.",
            remedy="This is implausibly fast: give --inertia in kg.m^2 or kg and --stiffness in N.m/rad or N/m at the joint, "
            "and "
            "look at --motor-share.",
        )


def scene(
    facts: Facts, member: Member, loop: JointLoop, motion: HandMotion, longest: float, **more: object
) -> Scene:
    """Return a scene of a joint."""
    return Scene(
        plant=member.plant(facts),
        motion=motion,
        loop=loop,
        period=facts.interval,
        substep=substep(facts, member, longest),
        encoder_noise=facts.noise * facts.count,
        seed=member.seed,
        **more,  # type: ignore[arg-type]
    )


def knock(
    facts: Facts,
    member: Member,
    loop: JointLoop,
    longest: float = SUBSTEP,
    length: float = SETTLED,
    **more: object,
) -> Scene:
    """Return a push of 2 F for 30 ms on a free joint."""
    t = facts.interval * np.arange(round(length / facts.interval))
    push = np.where((t > 0.05) & (t < 0.05 + PUSHED), 2.0 * member.friction * facts.coulomb, 0.0)
    return scene(facts, member, loop, pushes(push), longest, **more)


def guidance(facts: Facts, member: Member, loop: JointLoop, stroke: Stroke, longest: float = SUBSTEP, **more):
    """Return the strokes of the hand."""
    return scene(facts, member, loop, stroke.motion(facts.interval), longest, hand=stroke.hand, **more)


def release(facts: Facts, member: Member, loop: JointLoop, stroke: Stroke, longest: float = FINE, **more):
    """Return one stroke, a hold of 0.3 s, letting go, and after 1 s a force that grows against the stroke."""
    T = facts.interval
    one = strokes(
        T,
        stroke=stroke.length,
        duration=stroke.duration,
        interval=stroke.interval,
        count=1,
        start=0.1,
        variation=0.0,
    )
    go, push = release_time(stroke), pull_time(stroke)
    t = T * np.arange(round((push + 0.6) / T))
    n = t.size
    pad = max(n - one.position.size, 0)
    motion = HandMotion(
        position=np.pad(one.position, (0, pad), "edge")[:n],
        velocity=np.pad(one.velocity, (0, pad))[:n],
        grip=(t < go).astype(float),
        push=np.where(t > push, -2.5 * facts.coulomb * (t - push) / 0.6, 0.0),
    )
    return scene(facts, member, loop, motion, longest, hand=stroke.hand, **more)


def release_time(stroke: Stroke) -> float:
    """Return when the hand lets go in `release` [s]."""
    return 0.1 + stroke.duration + 0.3


def pull_time(stroke: Stroke) -> float:
    """Return when the force begins to grow in `release` [s]."""
    return release_time(stroke) + 1.0


def tracking(facts: Facts, member: Member, loop: JointLoop, stroke: Stroke, longest: float = SUBSTEP):
    """Return a rounded saw-tooth that a soft position controller follows, with a damping ratio of 0.7 at 14 rad/s."""
    T = facts.interval
    t = T * np.arange(round(3.0 / T))
    saw = stroke.length * (2.0 / np.pi) * np.arcsin(0.98 * np.sin(np.pi * t))
    servo = Servo(
        proportional=facts.inertia * 14.0**2, derivative=1.4 * facts.inertia * 14.0, filter_time=2e-3
    )
    target = np.stack([saw, np.gradient(saw, T)], axis=1)
    return scene(
        facts, member, loop, pushes(np.zeros(t.size), float(saw[0])), longest, controller=servo, target=target
    )


# ------------------------------------------------------------------------------------------------------------ scores


def amplitude(record: Record, window: float = WINDOW, of: str = "motor") -> float:
    """Return the half-amplitude of the motor, or `of` the load, at the end of a scene [rad or m]."""
    tail = getattr(record, of)[-round(window / record.scene.period) :]
    return 0.5 * float(np.ptp(tail)) if np.all(np.isfinite(tail)) else np.inf


def energy(record: Record, window: float = WINDOW) -> float:
    """Return the energy that the compensation puts into the joint at the end of a scene [J]."""
    tail = slice(-round(window / record.scene.period), None)
    return float(np.sum(record.compensation[tail][:-1] * np.diff(record.motor[tail])))


def peak_force(record: Record, stroke: Stroke) -> float:
    """Return the mean over the strokes, the first left out, of the hand's largest force [N.m or N]."""
    T = record.scene.period
    edges = [round((0.1 + stroke.interval * i) / T) for i in range(1, stroke.count + 1)]
    peaks = [float(np.abs(record.force[a:b]).max()) for a, b in zip(edges, edges[1:], strict=False)]
    mean = float(np.mean(peaks))
    return mean if np.isfinite(mean) else np.inf


def breakaway(record: Record, stroke: Stroke, coulomb: float) -> float:
    """Return the force that moved the joint again in `release` [N.m or N]; the largest force applied if none did."""
    k = round(pull_time(stroke) / record.scene.period) + 1
    moved = np.flatnonzero(np.abs(record.load[k:] - record.load[k]) > 5e-3 * stroke.length)
    return float(abs(record.force[k + moved[0]])) if moved.size else 2.5 * coulomb


def bound_of(facts: Facts, member: Member, share: float) -> float:
    """Return r_c/(1 - R F_believed/F) + 1 count of a joint [rad or m]."""
    F = member.friction * facts.coulomb
    return rules.limit_cycle(F, member.stiffness, share / member.friction) + facts.count
