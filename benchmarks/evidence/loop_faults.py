"""What the torque loop does when something is wrong: every fault on two simulated joints under a hand.

Setup A and Joint 0 (Iwatani 2017) are guided by hand with algFC2 and dither, and the external force is estimated. In the
middle of it the encoder gives no numbers, or wild ones, or counts from another zero; ticks are missed or of another length; the
drive saturates; the compensator has the wrong sign, or friction is half of what is believed. Then the hand lets go. Required: the
torque stays within the friction law's own bound and the loop's limit and rate; torque and estimate fade while readings are not
believed; the status says what happened, or the table says that it was not detected; after a passing fault all is as before, after
one longer than the patience the joint is latched without torque. A new zero behind a gap in the readings that a motion at top
speed could have reached is taken for that motion: nothing could tell. A share above 1 is refused. Beside it, in `Loop`: what is no
reading at all raises nothing, a sick joint leaves the others as they are, bit for bit, and no memory is kept.
"""

from __future__ import annotations

import argparse
import gc
import json
import sys
import time
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from _common import Judge

from backdrive.control import JointLoop, Loop, torque_limit
from backdrive.control.compensators import Compensator, Dither, alg_fc2
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe2, between_counts
from backdrive.errors import InvalidInput
from backdrive.laws.base import Rate
from backdrive.simulation import machine
from backdrive.simulation.closed_loop import Record, Scene, play
from backdrive.simulation.hand import Hand, strokes
from backdrive.simulation.machines import joint_0
from backdrive.status import Status

T = 1e-3
BEGIN, BRIEF, END, LEAVE = (
    2.0,
    2.08,
    2.3,
    5.2,
)  # of a fault, a brief one, a long one, and when the hand lets go [s]
FADE = 50.0  # of the loop [1/s]
SHARE, DITHER = 0.9, 0.3
QUIET = {Status.OK, Status.NO_MOTION}  # what a joint without a fault shows
SETTINGS = {  # joint -> K, V_W, hand, stroke, top speed
    "setup_a": (1.2e6, 0.01, Hand(stiffness=800.0, damping=40.0), 0.06, 0.6),
    "joint_0": (5e4, 0.005, Hand(stiffness=120.0, damping=6.0), 0.15, 2.0),
}


class Reversed(Compensator):
    """A compensator whose output is wired the wrong way round; no setting of a `Compensator` can make one."""

    def row(self, dt: float) -> np.ndarray:
        """Return the row with the share's sign turned."""
        c = super().row(dt)
        c[0] = -c[0]
        return c


@dataclass(frozen=True)
class Case:
    """A fault, the status that it should get, and what is required of it."""

    expected: Status | None  # None: it is not detected
    scene: Scene
    fades: bool = False
    latches: bool = False
    runs: bool = False  # it is detected where the joint runs faster than its top speed
    undisturbed: float = np.inf  # largest force of the hand by that without the fault
    rests: bool = True
    at: slice = field(default_factory=lambda: slice(round(BEGIN / T), round(END / T)))


def scene(name: str) -> Scene:
    """Return the joint under a hand, without a fault."""
    plant = joint_0(compliant=True) if name == "joint_0" else machine(name)
    K, threshold, hand, stroke, top = SETTINGS[name]
    V_W = between_counts(threshold, plant.encoder_count, T)
    rate = plant.law.rate
    compensator = alg_fc2(rate, K, V_W, dither=Dither(share=DITHER), share=SHARE)
    loop = JointLoop(
        compensator=compensator,
        external=ExternalForce(inertia=plant.inertia, friction=alg_fe2(rate, K, V_W)),
        top_speed=top,
        limit=torque_limit(compensator, top),
        encoder_count=plant.encoder_count,
        fade=FADE,
    )
    motion = strokes(T, stroke=stroke, duration=0.7, count=6).release(LEAVE, T)
    rest = round(1.5 / T)
    motion = motion.replace(
        position=np.pad(motion.position, (0, rest), mode="edge"),
        velocity=np.pad(motion.velocity, (0, rest)),
        grip=np.pad(motion.grip, (0, rest)),
        push=np.pad(motion.push, (0, rest)),
    )
    return Scene(plant=plant, motion=motion, hand=hand, loop=loop, delay=T)


def cases(plain: Scene, name: str) -> dict[str, Case]:
    """Return the faults by name."""
    n, k = len(plain.motion.position), np.arange(len(plain.motion.position))
    during = (k >= round(BEGIN / T)) & (k < round(END / T))
    brief = (k >= round(BEGIN / T)) & (k < round(BRIEF / T))
    rng = np.random.default_rng(0)
    top = SETTINGS[name][4]

    def fault(readings=None, missed=None) -> Scene:
        columns = np.zeros((n, 2))
        if readings is not None:
            columns[:, 0] = readings
        if missed is not None:
            columns[:, 1] = missed
        return plain.replace(fault=columns)

    def running(compensator: Compensator, **changes) -> Scene:
        usual = plain.loop
        own = {"top_speed": top, "limit": usual.limit, "encoder_count": usual.encoder_count}
        loop = JointLoop(compensator=compensator, external=usual.external, **(own | changes))
        return plain.replace(loop=loop)

    usual = plain.loop.compensator
    parts = {"friction": usual.friction, "share": SHARE, "dither": usual.dither}
    largest = 0.5 * min(plain.plant.law.coulomb())
    jump, wild = np.where(k >= round(BEGIN / T), 0.25, 0.0), np.zeros(n)
    wild[rng.choice(np.flatnonzero(during), 20, replace=False)] = 1.0
    first, short = (slice(round(BEGIN / T), round(end / T)) for end in (BEGIN + 0.05, BRIEF))
    lost = {"fades": True, "undisturbed": 2.5, "at": short}
    weak = plain.plant.replace(law=replace(plain.plant.law, rate=halved(plain.plant.law.rate)))
    return {
        "none": Case(None, plain),
        "no numbers for 80 ms": Case(Status.NOT_FINITE, fault(np.where(brief, np.nan, 0.0)), **lost),
        "infinite readings for 80 ms": Case(Status.NOT_FINITE, fault(np.where(brief, np.inf, 0.0)), **lost),
        "no numbers for 0.3 s": Case(
            Status.NOT_FINITE, fault(np.where(during, np.nan, 0.0)), latches=True, **lost
        ),
        "20 wild readings in 0.3 s": Case(Status.JUMP, fault(wild), undisturbed=2.0),
        "another zero of the encoder": Case(Status.JUMP, fault(jump), fades=True, undisturbed=2.0, at=first),
        "no numbers, then a zero nearby": Case(
            Status.JUMP if name == "setup_a" else Status.NOT_FINITE,
            fault(np.where(brief, np.nan, 0.4 * jump)),
            latches=name == "setup_a",  # the jump comes on top of 80 ms without numbers
            undisturbed=2.5,
        ),
        "no numbers, then a zero far away": Case(
            Status.JUMP, fault(np.where(brief, np.nan, 8.0 * jump)), latches=True, **lost
        ),
        "every fifth tick runs": Case(Status.LATE, fault(missed=during & (k % 5 != 0)), undisturbed=1.3),
        "half of all ticks missed at random": Case(
            Status.LATE, fault(missed=rng.random(n) < 0.5), undisturbed=1.3
        ),
        "ticks of 40 ms for 0.3 s": Case(
            Status.BAD_INTERVAL, fault(missed=during & (k % 40 != 0)), latches=True, undisturbed=2.5
        ),
        "tick of 4 ms throughout": Case(Status.LATE, fault(missed=k % 4 != 0), undisturbed=1.3),
        "the drive gives half the friction": Case(
            None, plain.replace(plant=plain.plant.replace(torque_limit=largest)), undisturbed=2.5
        ),
        "the loop's own limit": Case(Status.SATURATED, running(usual, limit=largest), undisturbed=2.5),
        "wrong sign": Case(None, running(Reversed(**parts)), undisturbed=4.0, rests=False),
        "half the friction": Case(None, plain.replace(plant=weak), rests=False, runs=True),
        "three counts of noise": Case(
            None, plain.replace(encoder_noise=3.0 * plain.plant.encoder_count), rests=False
        ),
    }


def halved(rate: Rate) -> Rate:
    """Return half a law of friction, a polyline or straight lines."""

    def half(name: str, value):
        if name == "velocity":
            return value
        return tuple(0.5 * x for x in value) if isinstance(value, tuple) else 0.5 * value

    return type(rate)(**{name: half(name, value) for name, value in rate.values().items()})


def bound(s: Scene) -> float:
    """Return what the friction law gives at most up to the top speed, with share and dither [N.m or N]."""
    loop = s.loop
    law, top = loop.compensator.friction.law, loop.top_speed
    coulomb = law.coulomb()
    own = loop.compensator.share * max(abs(float(law.torque(v))) for v in (top, -top))
    return min(own + loop.compensator.dither.share * max(coulomb), loop.limit)


def judged(judge: Judge, name: str, fault: str, case: Case, r: Record, whole: Record) -> dict:
    """Print a row of the table and judge it."""
    ran = np.ones(r.time.size, dtype=bool) if r.scene.fault is None else r.scene.fault[:, 1] == 0.0
    codes = {Status(int(c)) for c in r.status[ran]}
    largest, limit, own = float(np.abs(r.compensation).max()), bound(r.scene), r.scene.loop
    step = np.abs(np.diff(r.compensation[ran])) - own.normal_rate * np.diff(r.time[ran])
    stale = slice(case.at.start, case.at.stop)
    faded = float(np.abs(r.compensation[stale][-1]) / largest) if case.fades else np.nan
    seen = np.abs(r.estimate[stale])
    estimate = float(seen[-1] / seen[0]) if case.fades else np.nan
    top = SETTINGS[name][4]
    speed = float(np.abs(r.motor_velocity).max() / top)
    force = float(np.abs(r.force).max() / np.abs(whole.force).max())
    alone = r.time > LEAVE + 1.0
    wanders = float(np.ptp(r.load[alone]) / abs(SETTINGS[name][3]))
    caught = case.runs and Status.OVERSPEED in codes
    latches = case.latches or caught
    words = ", ".join(c.name for c in sorted(codes) if c not in QUIET) or "not detected"
    if fault == "none":
        words = "-"
    print(
        f"  {fault:36s} {words:34s} {largest:7.2f} {limit:7.2f} {faded:9.1e} {estimate:9.1e} {force:6.2f} {wanders:8.4f} "
        f"{speed:6.2f}"
    )
    finite = all(np.isfinite(getattr(r, c)).all() for c in ("command", "compensation", "estimate", "motor"))
    title = f"{name}, {fault}"
    after = r.status[round((END + 0.2) / T) :]
    least = 1.0 / (1.0 + FADE * T) ** (seen.size - 4)
    found = {
        "finite": finite,
        "within its bound": largest <= limit * (1.0 + 1e-9),
        "within its rate": float(step.max()) <= 1e-9,
        "status": case.expected in codes if case.expected is not None else caught or codes <= QUIET,
        "latched": (Status.LATCHED in codes) is latches,
        "slower than top speed": speed <= (1.2 if case.runs else 1.0),
        "all right again": latches or case.expected in (Status.SATURATED, Status.LATE) or set(after) <= QUIET,
        "no torque once latched": not latches or float(np.abs(r.compensation[-1])) == 0.0,
        "hand": force <= case.undisturbed,
        "rests": wanders < 0.02 or not case.rests,
        "torque fades": not case.fades or faded <= least,
        "estimate fades": not case.fades or estimate <= least,
    }
    wrong = [what for what, holds in found.items() if not holds]
    if wrong:
        judge.that(f"{title}: {', '.join(wrong)}", False)
    return {
        "status": words, "largest": largest, "bound": limit, "faded": faded, "force": force,
        "wanders": wanders, "speed": speed, "estimate": estimate, "short": wrong,
    }  # fmt: skip


def in_closed_loop(judge: Judge) -> dict:
    """Play every fault on both joints."""
    results = {}
    for name in SETTINGS:
        plain = scene(name)
        faults = cases(plain, name)
        records = dict(zip(faults, play([case.scene for case in faults.values()]), strict=False))
        print(
            f"\n{name}\n  {'fault':36s} {'status':34s} {'torque':>7s} {'bound':>7s} {'faded to':>9s} {'estimate':>9s} {'hand':>6s} "
            f"{'wanders':>8s} {'speed':>6s}"
        )
        before = len(judge.short)
        results[name] = {
            fault: judged(judge, name, fault, case, records[fault], records["none"])
            for fault, case in faults.items()
        }
        judge.that(
            f"{name}: {len(faults)} cases within bounds, named or printed as not detected",
            len(judge.short) == before,
        )
    print(
        "  torque: largest of the compensator, bound: of its friction law [N.m or N]; faded to: share of it left at the end of\n"
        "  the fault; estimate: share of the external force left then; hand: largest force by that without a fault; wanders:\n"
        "  travel from 1 s after the hand has left, by the stroke; speed: largest by the loop's top speed"
    )
    return results


def online(judge: Judge) -> dict:
    """Feed the loop with what is no reading; compare the joints beside; count what is allocated."""
    joint = scene("joint_0").loop
    rng = np.random.default_rng(0)
    odd = [np.nan, np.inf, -np.inf, 0.0, 1e308, -1e308, 5e-324, 1e9]
    intervals = [None, T, 5 * T, 0, 1, -T, np.nan, np.inf, 1e9, 10**400, "now", np.float32(T)]
    shapes = [np.zeros(5), np.zeros((6, 1)), 0.0, None, "six", [0.0] * 6, np.zeros(6, dtype=np.int32)]
    loop, raised, unbounded = Loop([joint] * 6, interval=T), 0, 0
    limit = bound(scene("joint_0"))
    calls = 20_000
    warnings.simplefilter("error")
    for k in range(calls):
        q = 0.1 * np.sin(3e-3 * k + np.arange(6))
        at = rng.random(6) < 0.2
        q[at] = rng.choice(odd, at.sum())
        given = shapes[k % len(shapes)] if rng.random() < 0.1 else q
        u = shapes[k % len(shapes)] if rng.random() < 0.1 else rng.choice([0.0, 1.0, np.nan, 1e308], 6)
        try:
            loop.update(given, u, intervals[rng.integers(len(intervals))])
        except Exception as error:
            raised += 1
            print(f"    raised: {error!r}")
        numbers = np.isfinite([loop.torque, loop.external, loop.friction]).all()
        unbounded += not (numbers and np.abs(loop.torque).max() <= limit)
    warnings.simplefilter("default")
    judge.that(f"{calls} ticks with odd readings, torques and intervals: {raised} raised", raised == 0)
    judge.that(f"{unbounded} of them left the bound of {limit:.2f} N.m or were no numbers", unbounded == 0)
    loop.acknowledge()
    for _ in range(800):
        loop.update(np.zeros(6), np.zeros(6))
    judge.that("acknowledged, every joint is OK again", set(loop.codes) <= {0})

    sick, well, apart = Loop([joint] * 6, interval=T), Loop([joint] * 6, interval=T), 0
    for k in range(5000):
        q = 0.1 * np.sin(3e-3 * k + np.arange(6))
        bad, u, others = q.copy(), np.full(6, 0.3), np.arange(6) != k % 6
        others[: k // 1000] = True
        bad[5] = rng.choice(odd)
        sick.update(bad, u)
        well.update(q, u)
        apart += not all(
            np.array_equal(getattr(sick, name)[:5], getattr(well, name)[:5])
            for name in ("torque", "external", "friction", "level", "codes")
        )
    judge.that(f"a sick joint beside five: {apart} of 5000 ticks differ in any bit of theirs", apart == 0)

    rows, u = list(0.1 * np.sin(3e-3 * np.arange(20_000)[:, None] + np.arange(6))), np.zeros(6)
    rows[::50] = [np.full(6, np.nan)] * len(rows[::50])
    for row in rows[:2000]:
        well.update(row, u, T)
    gc.collect()
    gc.disable()
    start = sys.getallocatedblocks()
    for row in rows:
        well.update(row, u, T)
    kept = sys.getallocatedblocks() - start
    gc.enable()
    judge.that(f"{len(rows)} ticks keep {kept} blocks of memory", abs(kept) < 20)
    return {"raised": raised, "unbounded": unbounded, "apart": apart, "blocks": kept}


def refused(judge: Judge) -> None:
    """Show that more than the whole friction cannot be asked for."""
    usual = scene("joint_0").loop
    for share in (1.2, 1.5):
        try:
            replace(usual, compensator=usual.compensator.replace(share=share))
        except InvalidInput as error:
            judge.that(f"R = {share} is refused: {error.message}", "share" in error.message)
        else:
            judge.that(f"R = {share} is refused", False)


def main() -> None:
    """Print the table and the verdict."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--short", action="store_true", help="it ends within a minute anyway")
    parser.add_argument("--json", type=Path, help="write the figures there")
    wanted = parser.parse_args()
    judge = Judge()
    begun = time.perf_counter()
    found = {"closed_loop": in_closed_loop(judge), "online": online(judge)}
    refused(judge)
    print(f"  {time.perf_counter() - begun:.0f} s")
    if wanted.json:
        wanted.json.write_text(json.dumps(found, indent=1))
    judge.end()


if __name__ == "__main__":
    main()
