"""The torque loop on joints that it knows nothing of: what it does when it is wrong, and what it never does.

An elastoplastic slider written beside this program (`_loop_joint`: 50 substeps a tick of 1 ms, F/M 3 to 60 rad/s^2, 1 to 3 ticks
of delay, 4096 to 2^17 counts a turn) under a hand that guides and lets go, or alone after a nudge of 2 to 5 F. The limit is at most
1.5 R F(top speed) of the true joint. Each fault is played with the how-to's settings, with the tuner's (joints tuned for real in
this run), and with the smallest that construction accepts, each beside the same joint, hand and nudge at zero torque. A nudge ends
where the joint runs from the hand (0.3 to 0.8 of its top speed): no loop can undo what a hand goes on to put in.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import multiprocessing
import os
import time
from collections.abc import Callable
from typing import Any

import _loop_edges as edges
import _loop_fuzz as fuzz
import _loop_joint as plant
import _loop_scenes as scenes
import _loop_settings as settings
import numpy as np
from _common import Judge
from _loop_cases import LATCHED, LONGER, OVERSPEED, Seen, cases, judged
from _loop_joint import ABOVE, Joints
from _loop_scenes import Fault, Scene
from _loop_settings import Settings

from backdrive.control import torque_limit
from backdrive.status import Status

JOBS: list[Callable[[Judge], Any]] = []  # of the processes
Make = Callable[[np.random.Generator, Joints], Settings]


def reference(joints: Joints, scene: Scene) -> np.ndarray:
    """Return the time above 1.2 top speed at zero torque [s], (J,)."""
    x, speeds = joints.start(), np.zeros_like(scene.push)
    plant.untouched(joints.p, x, scene.hand, scene.push, 0, speeds)
    return x[ABOVE]


def faults(
    judge: Judge, rng: np.random.Generator, joints: Joints, make: Make, scene_of: Callable
) -> dict[str, Seen]:
    """Play every fault with a setting in a scene."""
    kinds = cases()
    table = {name: Seen() for name in kinds}
    own, scene = scene_of(rng, joints)
    s = make(rng, own)
    own, usual = own.with_(TOP=s.top), own
    above, before = reference(own, scene), len(judge.short)
    print(
        f"  {s.words + ', ' + scene_of.__name__:46s} {'latched':>7s} {'torque':>7s} {'speed':>6s} {'longer':>7s} {'pulled':>7s}"
    )
    for name, case in kinds.items():
        model = dict(case.model)
        if model.get("inertia") == "wrong":
            model["inertia"] = np.where(rng.random(len(own)) < 0.5, 3.0, 1.0 / 3.0)
        fault = case.make(rng, len(scene.push), own)
        r = scenes.play(own, settings.loops(s, usual, **model), scene, fault)
        wrong, f = judged(name, case, s, fault, r, above, table[name])
        print(
            f"    {name:44s} {100 * f['latched']:5.0f} % {f['largest']:7.4f} {f['speed']:6.2f} {f['longer']:7.3f} "
            f"{f['pulled']:7.3f}"
        )
        if wrong:
            judge.that(f"{s.words}, {scene_of.__name__}, {name}: " + "; ".join(wrong), False)
    judge.that(
        f"{s.words}, {scene_of.__name__}: {len(kinds)} faults on {len(own)} joints as promised",
        len(judge.short) == before,
    )
    return table


def unpromised(rng: np.random.Generator, joints: Joints, make: Make) -> None:
    """Print what is not judged: limits that are taken from a wrong model, and a nudge that goes on whatever the joint does."""
    own, scene = scenes.nudged(rng, joints)
    s, kinds = make(rng, own), cases()
    hard = own.with_(SHOVE=np.inf)
    for what, each, limit in (
        ("limit by `torque_limit` of", own, torque_limit),
        ("nudged 0.1 s on end,", hard, None),
    ):
        above = reference(each, scene)
        for name in ("friction 30 % less", "model x 2", "model x 10"):
            r = scenes.play(each, settings.loops(s, each, **kinds[name].model, limit=limit), scene, Fault())
            longer, latched = r.state[ABOVE] - above, (r.codes == LATCHED).any(axis=0)
            print(
                f"  not judged: {s.words}, {what} {name}: latched {100 * np.mean(latched):.0f} %, at most "
                f"{longer.max():.3f} s longer above 1.2 top speed ({100 * np.mean(longer > LONGER):.0f} % more than 50 ms), up to "
                f"{(r.speed.max(axis=0) / s.top).max():.2f} top speed"
            )


def healthy(judge: Judge, rng: np.random.Generator, joints: Joints, make: Make, draws: int) -> None:
    """Guide joints whose friction is known within 10 %, up to 0.9 top speed, against a stop too, and see that nothing latches."""
    own, scene = scenes.guided(rng, joints, most=1.1, lasts=8.0, stays=True)
    place = scene.hand[:, 1]
    reach = np.maximum(place.max(axis=0), 1e-3)
    omega = rng.uniform(200.0, 500.0, len(own))
    stop = np.where(rng.random(len(own)) < 0.6, rng.uniform(0.5, 0.9, len(own)), np.inf)
    own = own.with_(
        K_W=own.p[plant.M] * omega**2, B_W=own.p[plant.M] * omega * rng.uniform(0.1, 1.0, len(own))
    )
    s, scale = make(rng, own), np.ones(len(own))
    loops = settings.loops(s, own, factor=rng.uniform(0.9, 1.1, len(own)))
    for _ in range(6):
        hand = scene.hand.copy()
        hand[:, 1:] *= scale
        r = scenes.play(own.with_(WALL=stop * reach * scale), loops, Scene(hand, scene.push), Fault())
        fastest = r.speed.max(axis=0) / s.top
        if np.all(fastest <= 0.9):
            break
        scale *= np.where(fastest > 0.9, 0.88 / fastest, 1.0)
    within = np.flatnonzero(fastest <= 0.9)[:draws]
    codes = r.codes[:, within]
    shares = {x.name: 100 * float(np.mean(codes == int(x))) for x in Status if np.any(codes == int(x))}
    pushed = np.mean(np.isfinite(stop[within]))
    print(
        f"  {s.words}: {within.size} joints, fastest {np.median(fastest[within]):.2f} of top speed in the median, "
        f"{fastest[within].max():.2f} at most; {100 * pushed:.0f} % against a stop; ticks: "
        + ", ".join(f"{k} {v:.2f} %" for k, v in shares.items())
    )
    bad = (
        np.isin(codes, (int(OVERSPEED), int(LATCHED), int(Status.JUMP), int(Status.NOT_FINITE)))
        .any(axis=0)
        .sum()
    )
    judge.that(
        f"{s.words}: {bad} of {within.size} healthy joints latched or were named ({draws} wanted)",
        bad == 0 and within.size >= draws,
    )


def table(judge: Judge, found: list[dict[str, Seen]], refusals: list[tuple[str, str]]) -> None:
    """Print what is named, bounded and refused, with the how-to's settings and the tuner's."""
    print(
        f"\n| {'fault':46s} | {'done':7s} | {'status':10s} | {'seen in':7s} | {'latched':7s} | why |\n|---|---|---|---|---|---|"
    )
    short = []
    for name, case in cases().items():
        draws, named, acted, latched = (
            sum(getattr(seen[name], x) for seen in found) for x in ("draws", "named", "acted", "latched")
        )
        share, status = (
            f"{100 * named / max(acted, 1):.0f} %",
            "" if case.status is None else case.status.name,
        )
        print(
            f"| {name:46s} | {case.done:7s} | {status:10s} | {share:7s} | {100 * latched / draws:5.0f} % | {case.why} |"
        )
        if case.done == "named" and not 0 < named == acted:
            short.append(name)
    for what, why in refusals:
        print(f"| {what:46s} | refused | {'':10s} | {'':7s} | {'':7s} | {why} |")
    print(
        "  seen in: of the draws in which the fault acts; latched: of all draws. A bounded fault is named OVERSPEED where, and\n"
        "  only where, the joint gets faster than its top speed; with calls missed and not told, where it seems to"
    )
    judge.that(
        "what is named is named in every draw in which it acts" + "".join(f", not: {x}" for x in short),
        not short,
    )


def apart(number: int) -> tuple[str, list[str], Any]:
    """Do a job in a process of its own; return what it printed, what falls short, and what it came to."""
    judge, said = Judge(), io.StringIO()
    with contextlib.redirect_stdout(said):
        found = JOBS[number](judge)
    return said.getvalue(), judge.short, found


def done(judge: Judge, jobs: list[Callable[[Judge], Any]]) -> list[Any]:
    """Do jobs side by side, print what they print, and return what they come to."""
    JOBS[:] = jobs
    found = []
    with multiprocessing.get_context("fork").Pool(min(len(jobs), os.cpu_count() or 1)) as pool:
        for said, short, result in pool.imap(apart, range(len(jobs)), chunksize=1):
            print(said, end="", flush=True)
            judge.short += short
            found.append(result)
    return found


def main() -> None:
    """Print the tables and the verdict."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--short", action="store_true", help="fewer draws, joints and ticks")
    short = parser.parse_args().short
    draws, distinct, many = (16, 1, 40) if short else (200, 8, 500)
    calls, deep = (2e4, 2e6) if short else (1e6, 1e8)
    judge, begun = Judge(), time.perf_counter()

    def clock(what: str) -> None:
        print(f"{what}: {time.perf_counter() - begun:.0f} s", flush=True)

    print("the joint against closed forms")
    for name, (found, exact) in plant.closed_forms().items():
        judge.that(
            f"{name}: {found:.4f}, exactly {exact:.4f}", bool(abs(found - exact) <= 0.01 * exact + 1e-6)
        )
    refusals = edges.refused(judge)
    edges.counted(judge)
    rng = np.random.default_rng(11)
    edges.stops(judge, rng, plant.drawn(rng, 50))
    clock("joint, refusals, count, stop")

    ends = 3.0 * 20.0 ** np.linspace(0.0, 1.0, distinct + 1)
    print(f"{distinct} joints by `tune(facts, joints={settings.DRAWS})`, evenly over F/M")
    pairs = done(judge, [lambda _, i=i: settings.tuned(i, ends[i], ends[i + 1]) for i in range(distinct)])
    tuned = settings.Tuned([one for one, _, _ in pairs], [tuning for _, tuning, _ in pairs])
    print(f"  {sum(len(why) for _, _, why in pairs)} others were refused")
    judge.that(
        "`Tuning.loop` hands on what is played here, limit, trip speed and count, R below the least friction",
        all(settings.handed_on(one, tuning) for one, tuning, _ in pairs),
    )
    clock("tuning")

    pull, plenty = draws // 4, many + many // 5

    def free(rng: np.random.Generator, n: int) -> Joints:
        return plant.drawn(rng, n)

    jobs: list[Callable[[Judge], Any]] = []
    for i, (draw, make) in enumerate(
        ((free, settings.how_to), (tuned.draw, tuned.settings), (free, settings.least))
    ):
        for k, scene_of in enumerate((scenes.nudged, scenes.guided)):
            if short and i and k:
                continue

            def fault(judge: Judge, i=i, k=k, draw=draw, make=make, scene_of=scene_of) -> dict[str, Seen]:
                rng = np.random.default_rng([11, i, k])
                return faults(judge, rng, plant.pulled(rng, draw(rng, draws + pull), pull), make, scene_of)

            jobs.append(fault)
    print(
        "\nfaults. torque: largest output by the limit; speed: largest by the top speed; longer: time above 1.2 top speed beyond\n"
        "that at zero torque [s], at most; pulled: the same on joints with an outer torque of 0.1 to 0.5 F besides, not judged"
    )
    found = done(judge, jobs)
    clock("faults")
    print("healthy guiding, model within 10 %; limits taken from a wrong model; readings that are none")
    jobs = [
        lambda judge: fuzz.through_kernel(judge, deep),
        lambda judge: fuzz.through_update(judge, int(calls)),
    ]
    for i, (draw, make) in enumerate(((free, settings.how_to), (tuned.draw, tuned.settings))):

        def guide(judge: Judge, i=i, draw=draw, make=make) -> None:
            rng = np.random.default_rng([12, i])
            healthy(judge, rng, draw(rng, plenty), make, many)
            unpromised(rng, draw(rng, draws), make)

        jobs.append(guide)
    done(judge, jobs)
    table(judge, found[: 2 if short else 4], refusals)
    clock("all")
    judge.end()


if __name__ == "__main__":
    main()
