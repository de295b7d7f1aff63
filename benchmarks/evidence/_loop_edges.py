"""What a `Loop` does at its edges: `stop`, `acknowledge`, `count`, and what construction refuses."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import _loop_joint as plant
import _loop_scenes as scenes
import _loop_settings as settings
import numpy as np
from _common import Judge
from _loop_joint import Joints, T
from _loop_scenes import ticks

from backdrive.control import BareLoop, JointLoop, Loop
from backdrive.errors import InvalidInput


def stops(judge: Judge, rng: np.random.Generator, joints: Joints) -> None:
    """Stop the loop under a hand, and acknowledge it."""
    own, scene = scenes.guided(rng, joints, stays=True)
    loops = settings.loops(settings.how_to(rng, own), own)
    limit, J = np.array([one.limit for one in loops]), len(own)
    loop, x, before = Loop(loops, interval=T), own.start(), np.zeros(J)
    went, grew, rest = 0.0, 0.0, 0.0
    for k in range(ticks(3.0)):
        if k == ticks(1.0):
            loop.stop()
        elif k == ticks(2.0):
            loop.acknowledge()
        loop.update(own.read(x), before)
        torque = np.array(loop.torque)
        slow = limit / 0.5 * T
        if ticks(1.0) <= k < ticks(2.0):
            went = max(
                went,
                float(
                    ((np.abs(torque) - np.maximum(limit - slow * (k - ticks(1.0) + 1), 0.0)) / limit).max()
                ),
            )
        if ticks(1.5) + 1 <= k < ticks(2.0):
            rest = max(rest, float(np.abs(torque).max()))
        if k >= ticks(2.0):
            grew = max(grew, float((np.abs(torque) / (slow * (k - ticks(2.0) + 1))).max()))
        before = torque
        plant.advance(own.p, x, torque, scene.hand[k], scene.push[k])
    judge.that(
        f"stop(): above its ramp by {max(went, 0.0):.3g} of the limit, then {rest:.3g} N.m",
        went <= 1e-9 and rest == 0.0,
    )
    judge.that(
        f"acknowledge(): back within {grew:.6f} of the slow rate, as {loop.update(own.read(x), before).name}",
        grew <= 1.0 + 1e-9,
    )


def counted(judge: Judge) -> None:
    """Let a caller die, and watch its count from another thread."""
    loop = Loop(JointLoop(limit=1.0, top_speed=1.0, encoder_count=1e-5), interval=T)

    def caller() -> None:
        for _ in range(500):
            loop.update(np.zeros(1), np.zeros(1))
            time.sleep(1e-4)

    seen, thread = [loop.count], threading.Thread(target=caller)
    thread.start()
    while thread.is_alive():
        time.sleep(0.01)
        seen.append(loop.count)
    after = loop.count
    time.sleep(0.1)
    grew = all(a <= b for a, b in zip(seen, seen[1:], strict=False)) and len(set(seen)) > 3
    judge.that(f"loop.count: 0, then growing ({grew}), {after} after 500 calls, {loop.count} 0.1 s after the caller ended",
               seen[0] == 0 and grew and after == 500 == loop.count)  # fmt: skip


def refused(judge: Judge) -> list[tuple[str, str]]:
    """Construct what is refused; return the rows of the table."""
    usual = {"limit": 10.0, "top_speed": 3.0, "encoder_count": 1e-4}
    one = plant.drawn(np.random.default_rng(0), 1).with_(F_P=8.0, F_N=8.0, GROWTH=0.0, STRIBECK=0.0)
    own = settings.loops(settings.how_to(np.random.default_rng(0), one), one)[0].compensator

    def joint(**changes: object) -> Loop:
        interval = changes.pop("interval", T)
        return Loop(JointLoop(**{**usual, **changes}), interval=interval)  # type: ignore[arg-type]

    coarse = plant.TURN / 4096.0
    attempts: dict[str, tuple[str, Callable[[], object]]] = {
        "no limit or no top speed": ("required", lambda: JointLoop(encoder_count=1e-4)),  # type: ignore[call-arg]
        "an infinite limit or top speed": ("finite", lambda: (expect(lambda: joint(limit=np.inf)), joint(top_speed=np.inf))),
        "a limit or top speed of NaN": ("finite", lambda: (expect(lambda: joint(limit=np.nan)), joint(top_speed=np.nan))),
        "R above 1": ("gives more than there is", lambda: joint(compensator=own.replace(share=1.01))),
        "encoder too coarse: count/10 ms above 0.1 top speed": (
            "its speed could not be seen", lambda: joint(encoder_count=coarse, top_speed=0.99 * 10.0 * coarse / 0.01)),
        "the same at a period of 20 ms, count/40 ms": (
            "likewise", lambda: joint(encoder_count=coarse, top_speed=0.99 * 10.0 * coarse / 0.04, interval=0.02)),
        "a period of 0.04 or 21 ms": (
            "outside the envelope", lambda: (expect(lambda: joint(interval=4e-5)), joint(interval=0.021))),
        "K count above F": ("a relay", lambda: joint(compensator=own, encoder_count=3e-3, top_speed=5.0)),
        "rate below limit/0.15 s": ("stops too late", lambda: joint(rate=0.99 * 10.0 / 0.15)),
        "a joint without guards in a `Loop`": ("for simulation alone", lambda: Loop(BareLoop(), interval=T)),
        "reset(NaN)": ("it would latch for ever", lambda: joint().reset(np.array([np.nan]))),
    }  # fmt: skip

    def expect(make: Callable[[], object]) -> None:
        try:
            make()
        except (InvalidInput, TypeError):
            return
        raise AssertionError

    rows = []
    for what, (why, make) in attempts.items():
        try:
            expect(make)
            rows.append((what, why))
            judge.that(f"refused: {what}", True)
        except AssertionError:
            judge.that(f"refused: {what}", False)
    joint(encoder_count=coarse, top_speed=10.0 * coarse / 0.01)  # accepted
    joint(interval=5e-5), joint(interval=0.02)
    return rows
