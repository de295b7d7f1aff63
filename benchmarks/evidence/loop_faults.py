"""What the torque loop does when something is wrong: every fault on two simulated joints under a hand.

Setup A and Joint 0 (Iwatani 2017) are guided by hand with algFC2 and dither, and the external force is estimated. In the
middle of it the encoder gives no numbers, or wild ones, or counts from another zero; ticks are missed or of another length; the
drive saturates; the compensator has the wrong sign, or gives more than the friction there is. Then the hand lets go. Required: the
torque stays within the friction law's own bound, fades while readings are not believed, the status says what happened, and
afterwards all is as before. What runs away by over-compensation is caught at the loop's top speed. A new zero behind a gap in the
readings that a motion at top speed could have reached is taken for that motion: nothing could tell. Beside it, in `Loop`:
what is no reading at all raises nothing, a sick joint leaves the others as they are, bit for bit, and nothing is allocated.
"""

from __future__ import annotations

import argparse
import gc
import json
import sys
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from _common import Judge

from backdrive.closed_loop import Record, Scene, play
from backdrive.compensate import Compensator, Dither, alg_fc2
from backdrive.control import JointLoop, Loop
from backdrive.estimate.external import ExternalForce
from backdrive.estimate.friction import alg_fe2, between_counts
from backdrive.plants import machine
from backdrive.plants.hand import Hand, strokes
from backdrive.plants.thesis import joint_0
from backdrive.status import Status

T = 1e-3
BEGIN, END, LEAVE = 2.0, 2.3, 5.2  # of the fault, and when the hand lets go [s]
FADE = 50.0  # of the loop [1/s]
SHARE, DITHER = 0.9, 0.3
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

    expected: Status | None  # None: JUMP where the joint gets faster than its top speed, otherwise OK
    scene: Scene
    fades: bool = False
    undisturbed: float = np.inf  # largest force of the hand by that without the fault
    rests: bool = True
    at: slice = field(default_factory=lambda: slice(round(BEGIN / T), round(END / T)))


def scene(name: str) -> Scene:
    """Return the joint under a hand, without a fault."""
    plant = joint_0(compliant=True) if name == "joint_0" else machine(name)
    K, threshold, hand, stroke, top = SETTINGS[name]
    V_W = between_counts(threshold, plant.encoder_count, T)
    rate = plant.law.rate
    loop = JointLoop(
        compensator=alg_fc2(rate, K, V_W, dither=Dither(share=DITHER), share=SHARE),
        external=ExternalForce(inertia=plant.inertia, friction=alg_fe2(rate, K, V_W)),
        top_speed=top,
        fade=FADE,
    )
    motion = strokes(T, stroke=stroke, duration=0.7, count=6).released(LEAVE, T)
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
        loop = JointLoop(compensator=compensator, external=plain.loop.external, top_speed=top, **changes)
        return plain.replace(loop=loop)

    usual = plain.loop.compensator
    parts = {"friction": usual.friction, "share": SHARE, "dither": usual.dither}
    largest = 0.5 * min(plain.plant.law.coulomb())
    jump, wild = np.where(k >= round(BEGIN / T), 0.25, 0.0), np.zeros(n)
    wild[rng.choice(np.flatnonzero(during), 20, replace=False)] = 1.0
    first = slice(round(BEGIN / T), round(BEGIN / T) + 100)
    return {
        "none": Case(Status.OK, plain),
        "no numbers for 0.3 s": Case(
            Status.NOT_FINITE, fault(np.where(during, np.nan, 0.0)), fades=True, undisturbed=2.5
        ),
        "infinite readings": Case(
            Status.NOT_FINITE, fault(np.where(during, np.inf, 0.0)), fades=True, undisturbed=2.5
        ),
        "20 wild readings in 0.3 s": Case(Status.JUMP, fault(wild), undisturbed=1.3),
        "another zero of the encoder": Case(Status.JUMP, fault(jump), fades=True, undisturbed=2.0, at=first),
        "no numbers, then a zero nearby": Case(
            Status.JUMP if name == "setup_a" else Status.NOT_FINITE,
            fault(np.where(during, np.nan, jump)),
            undisturbed=2.5,
        ),
        "no numbers, then a zero far away": Case(
            Status.JUMP,
            fault(np.where(during, np.nan, 8.0 * jump)),
            fades=True,
            undisturbed=2.5,
            at=slice(round(BEGIN / T), round(END / T) + 100),
        ),
        "every fifth tick runs": Case(Status.OK, fault(missed=during & (k % 5 != 0)), undisturbed=1.3),
        "half of all ticks missed at random": Case(
            Status.OK, fault(missed=rng.random(n) < 0.5), undisturbed=1.3
        ),
        "ticks of 40 ms": Case(Status.BAD_INTERVAL, fault(missed=during & (k % 40 != 0)), undisturbed=2.5),
        "tick of 4 ms throughout": Case(Status.OK, fault(missed=k % 4 != 0), undisturbed=1.3),
        "the drive gives half the friction": Case(
            Status.OK, plain.replace(plant=plain.plant.replace(torque_limit=largest)), undisturbed=2.5
        ),
        "the loop's own limit": Case(Status.SATURATED, running(usual, limit=largest), undisturbed=2.5),
        "wrong sign": Case(Status.OK, running(Reversed(**parts)), undisturbed=4.0, rests=False),
        "R = 1.2": Case(None, running(usual.replace(share=1.2)), rests=False),
        "R = 1.5, also of Phi": Case(None, running(usual.replace(share=1.5)), rests=False),
        "three counts of noise": Case(
            Status.OK, plain.replace(encoder_noise=3.0 * plain.plant.encoder_count), rests=False
        ),
    }


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
    codes = set(r.status[ran].astype(int))
    largest, limit = float(np.abs(r.compensation).max()), bound(r.scene)
    stale = np.abs(r.compensation[case.at])
    faded = float(stale[-1] / largest) if case.fades else np.nan
    top = SETTINGS[name][4]
    speed = float(np.abs(r.motor_velocity).max() / top)
    with np.errstate(invalid="ignore"):
        faster = np.abs(np.diff(r.reading)) > 1.001 * top * T
    expected = case.expected
    if expected is None:
        expected = Status.JUMP if faster.any() else Status.OK
    force = float(np.abs(r.force).max() / np.abs(whole.force).max())
    alone = r.time > LEAVE + 1.0
    wanders = float(np.ptp(r.load[alone]) / abs(SETTINGS[name][3]))
    estimate = float(np.abs(r.estimate).max())
    words = ", ".join(Status(c).name for c in sorted(codes) if c) or "OK"
    print(
        f"  {fault:36s} {words:22s} {largest:7.2f} {limit:7.2f} {faded:9.1e} {force:6.2f} {wanders:8.4f} {speed:6.2f} "
        f"{estimate:8.1f}"
    )
    finite = all(np.isfinite(getattr(r, c)).all() for c in ("command", "compensation", "estimate", "motor"))
    title = f"{name}, {fault}"
    found = {
        "finite": finite,
        "within its bound": largest <= limit * (1.0 + 1e-9),
        "status": int(expected) in codes and (expected is Status.OK) == (codes <= {0}),
        "caught at top speed": speed <= 1.1,
        "all right again": bool(np.all(r.status[round((END + 0.2) / T) :] == Status.OK))
        or case.expected in (Status.SATURATED, Status.OK, None),
        "hand": force <= case.undisturbed,
        "rests": wanders < 0.02 or not case.rests,
        "fades": not case.fades or faded <= 1.0 / (1.0 + FADE * T) ** (stale.size - 3),
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
        records = dict(zip(faults, play([case.scene for case in faults.values()])))
        print(
            f"\n{name}\n  {'fault':36s} {'status':22s} {'torque':>7s} {'bound':>7s} {'faded to':>9s} {'hand':>6s} "
            f"{'wanders':>8s} {'speed':>6s} {'estimate':>8s}"
        )
        before = len(judge.short)
        results[name] = {
            fault: judged(judge, name, fault, case, records[fault], records["none"])
            for fault, case in faults.items()
        }
        judge.that(
            f"{name}: {len(faults)} cases within bounds, with their status", len(judge.short) == before
        )
    print(
        "  torque: largest of the compensator, bound: of its friction law [N.m or N]; faded to: share of it left when readings\n"
        "  are believed again; hand: largest force by that without a fault; wanders: travel from 1 s after the hand has left, by\n"
        "  the stroke; speed: largest by the loop's top speed; estimate: largest external force [N.m or N]"
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
        unbounded += not (np.isfinite(loop.table[5:8]).all() and np.abs(loop.torque).max() <= limit)
    warnings.simplefilter("default")
    judge.that(f"{calls} ticks with odd readings, torques and intervals: {raised} raised", raised == 0)
    judge.that(f"{unbounded} of them left the bound of {limit:.2f} N.m or were no numbers", unbounded == 0)
    for _ in range(300):
        loop.update(np.zeros(6), np.zeros(6))
    judge.that("then every joint is OK again", bool(np.all(loop.codes == 0)))

    sick, well, apart = Loop([joint] * 6, interval=T), Loop([joint] * 6, interval=T), 0
    for k in range(5000):
        q = 0.1 * np.sin(3e-3 * k + np.arange(6))
        bad, u, others = q.copy(), np.full(6, 0.3), np.arange(6) != k % 6
        others[: k // 1000] = True
        bad[5] = rng.choice(odd)
        sick.update(bad, u)
        well.update(q, u)
        apart += not np.array_equal(sick.table[:, :5], well.table[:, :5])
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


def main() -> None:
    """Print the table and the verdict."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures there")
    wanted = parser.parse_args()
    judge = Judge()
    found = {"closed_loop": in_closed_loop(judge), "online": online(judge)}
    if wanted.json:
        wanted.json.write_text(json.dumps(found, indent=1))
    judge.end()


if __name__ == "__main__":
    main()
