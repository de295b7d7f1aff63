"""Parameters chosen for a joint: what the limit-cycle bound is worth on 200 random joints, and how good a search's choice is.

First part, 200 joints, no dither but where it says so: a knock of 2 F for 30 ms, time to stop, and then half a second in which the
motor is watched. Within the conditions (K below the lower end of K_c's interval, R F below the least friction, a delay of at most a
tick, a transmission damped by 3 % or more; alpha = 20, which was fixed after a first run with alpha up to 500) the amplitude has to
stay below r_c/(1 - R) + 1 count, r_c = F/K_c of the joint as it is and R the compensating torque by its friction. Then each
condition is broken by itself.

Second part, the same joints: the proposal of `backdrive tune --wish light` (search, then off the border) against the best point
of a grid of 160 that passes the same safety test (K_c by 20 %, F by 10 %, and what goes with them in `scenes.corners`), by the
hand's mean peak force over the stated stroke: 0.15 rad in 0.5 s every 0.75 s, a hand of 15 F/stroke with a damping ratio of 0.7.

Third part, the first of these joints: proposals for the three wishes that can be stated and the even one. Each wish's own number
(force of the hand, light touch, way after a knock) has to be the least of the three at its own point, the points have to differ,
and every number that lies within 1 % of its range's end has to be named.

Ranges, drawn evenly (L: in the logarithm): F 1 to 30 N.m L; r_c 3e-5 to 5e-4 rad L, which makes K_c = F/r_c; F by inertia 2 to 30
rad/s^2 L; the motor's share of it 0.05 to 0.4; F/(K_c count) 5 to 400 L; growth 0 to 1 F a rad/s; damping ratio 0.03 to 0.15 L;
contact by transmission 1 to 8 L; delay 0 to 1 ms; true K_c within 20 %, true F within 10 % of what is believed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from _common import Judge

from backdrive.control import BareLoop
from backdrive.control.compensators import Dither
from backdrive.control.joint_loop import BRISK, LATCH_TIME, friction_of, torque_limit
from backdrive.errors import NotIdentifiable
from backdrive.laws import CoulombViscous
from backdrive.simulation.closed_loop import play
from backdrive.tuning import members as members_
from backdrive.tuning import rules, scenes
from backdrive.tuning.facts import Facts
from backdrive.tuning.goals import compensator, goal_of
from backdrive.tuning.members import Member
from backdrive.tuning.propose import fixed_rule, full_rule, thesis_numbers
from backdrive.tuning.reasons import IN_WORDS, edges, presliding_radius
from backdrive.tuning.refine import refine
from backdrive.tuning.search import best_safe, search
from backdrive.tuning.wishes import OWN, WISHES

JOINTS, COMPARED, WISHED = 200, 200, 60
Case = tuple[Facts, Member, dict[str, float]]  # as believed, as it is, numbers
T = 1e-3
GRID = [
    {"share": R, "stiffness": k, "decay": a}
    for R in (0.5, 0.6, 0.7, 0.75, 0.8, 0.83, 0.86, 0.89)
    for k in (0.15, 0.3, 0.45, 0.6, 0.72)
    for a in (5.0, 20.0, 100.0, 500.0)
]


def log(rng, low: float, high: float) -> float:
    return float(low * (high / low) ** rng.random())


def joint(seed: int) -> Case:
    """Return a joint as believed, as it is, and numbers within the conditions."""
    rng = np.random.default_rng(seed)
    F = log(rng, 1.0, 30.0)
    K_c = F / log(rng, 3e-5, 5e-4)
    inertia = F / log(rng, 2.0, 30.0)
    growth = F * rng.random()
    rate = CoulombViscous(
        coulomb_positive=F, coulomb_negative=F, viscous_positive=growth, viscous_negative=growth
    )
    facts = Facts(
        name=f"joint_{seed}",
        unit="rad",
        rate=rate,
        coulomb=F,
        friction=(0.9, 1.1),
        stiffness=K_c,
        stiffness_interval=(0.8 * K_c, 1.2 * K_c),
        inertia=inertia,
        inertia_interval=(0.85 * inertia, 1.15 * inertia),
        motor_share=float(rng.uniform(0.05, 0.4)),
        count=F / K_c / log(rng, 5.0, 400.0),
        delay=T,
        interval=T,
        top_speed=1.0,
    )
    truth = Member(
        friction=float(rng.uniform(0.9, 1.1)),
        stiffness=float(rng.uniform(0.8, 1.2)) * K_c,
        contact=log(rng, 1.0, 8.0),
        inertia=inertia,
        motor_share=facts.motor_share,
        damping=log(rng, 0.03, 0.15),
        delay=T * rng.random(),
        temperature=20.0,
        seed=seed,
    )
    numbers = {
        "share": float(rng.uniform(0.5, 0.88)),
        "stiffness": float(0.8 * rng.uniform(0.2, 1.0)),
        "decay": log(rng, 5.0, 500.0),
    }
    return facts, truth, numbers


def rate_of(facts: Facts, z: dict[str, float]) -> float:
    """Return the normal rate of torque that a loop on this joint has [N.m/s], at a trip speed of three times the model's."""
    used, top = compensator(facts, z), 3.0 * facts.top_speed
    return max(torque_limit(used, top) / LATCH_TIME, BRISK * friction_of(used.friction.law, top)[0])


def restless(
    cases: list[Case], dither: float = 0.0, longest: float = 4e-5, rated: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the half-amplitude at the end of a knock, its bound, and the count of each joint.

    `dither`: R_d by what is left below the least friction, 0.9 - R; `rated`: within the loop's rate of torque.
    """
    played, bounds = [], []
    for facts, truth, z in cases:
        R_d = min(dither * (facts.friction[0] - z["share"]), 1.0)
        sine = Dither(share=R_d, mode="reset") if R_d > 0.0 else None
        ratio = z["share"] / truth.friction
        length = 0.1 + min(1.2 * rules.stopping_time(ratio, scenes.PUSHED), 3.0) + 1.0
        loop = BareLoop(compensator=compensator(facts, z, sine), rate=rate_of(facts, z) if rated else None)
        played.append(scenes.knock(facts, truth, loop, longest, length))
        bounds.append(scenes.bound_of(facts, truth, z["share"] + R_d))
    found = np.array([scenes.amplitude(r) for r in play(played)])
    return found, np.array(bounds), np.array([f.count for f, _, _ in cases])


def told(what: str, cases: list[Case], dither: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Print a line of the table and return what it says."""
    found, bound, count = restless(cases, dither)
    over, worst = found > bound, float((found / bound).max())
    none = int(np.sum(~np.isfinite(bound)))
    print(
        f"  {what:<46} over the bound {over.sum():3d} of {found.size - none:3d}, at most {worst:8.3g} times it; "
        f"up to 2 counts {100 * np.mean(found <= 2 * count):5.1f} %, up to 1 {100 * np.mean(found <= count):5.1f} %, "
        f"median {np.median(found / count):8.2g}, largest {np.max(found / count):8.2g}"
    )
    return found, bound, count


def safety(judge: Judge, joints: int) -> None:
    """Judge the bound within its conditions, and tell what happens outside."""
    drawn = [joint(s) for s in range(joints)]
    cases = [(f, m, {**z, "decay": 20.0}) for f, m, z in drawn]
    print(f"limit cycles, {joints} joints (alpha = 20 1/s, the thesis' at rest, where nothing else is said)")
    found, bound, count = told("within the conditions", cases)
    judge.that(
        f"no amplitude above r_c/(1 - R) + 1 count: {(found > bound).sum()} of {joints}",
        bool((found <= bound).all()),
    )
    judge.that(
        f"at rest, half-amplitude up to 2 counts: {100 * np.mean(found <= 2 * count):.1f} % (at least 95)",
        bool(np.mean(found <= 2 * count) >= 0.95),
    )
    fine = restless(cases[:40], longest=1e-5)[0]
    print(
        f"  steps of 10 us instead of 40 us, 40 joints: at rest {np.sum(fine <= 2 * count[:40])}, was "
        f"{np.sum(found[:40] <= 2 * count[:40])}; over the bound {np.sum(fine > bound[:40])}"
    )
    found, bound, count = told("alpha 5 to 500", drawn)
    judge.that(
        f"the same for alpha 5 to 500: {(found > bound).sum()} of {joints} above r_c/(1 - R) + 1 count",
        bool((found <= bound).all()),
    )
    calm = np.array([presliding_radius(*case) < 0.99 for case in drawn])
    rests = found <= 2 * count
    print(
        f"    {100 * np.mean(rests):.1f} % of all rest; {calm.sum()} have a linear presliding of spectral radius below 0.99; "
        f"of the others {100 * np.mean(rests[~calm]):.1f} % are"
    )
    judge.that(
        f"at rest, alpha 5 to 500, where the spectral radius is below 0.99 ({calm.sum()} of {joints}): "
        f"{100 * np.mean(rests[calm]):.1f} % (at least 95)",
        bool(np.mean(rests[calm]) >= 0.95),
    )
    limited(judge, cases)
    rng = np.random.default_rng(1)
    for what, change in broken(rng).items():
        told(what, [change(*case) for case in cases])
    found, bound, _ = told("dither of 0.9 (0.9 - R) F", cases, 0.9)
    judge.that(
        f"with dither, (R + R_d) F below the least friction: {(found > bound).sum()} of {joints} above r_c/(1 - R - R_d) + 1 count",
        bool((found <= bound).all()),
    )
    told("dither of 3 (0.9 - R) F", cases, 3.0)


def limited(judge: Judge, cases: list[Case]) -> None:
    """Judge what the loop's rate of torque changes: rest after a knock, and the hand's mean peak force."""
    free, bound, count = restless(cases)
    held, _, _ = restless(cases, rated=True)
    changed = int(np.sum((free <= 2 * count) != (held <= 2 * count)))
    scenes_of, strokes = [], []
    for facts, truth, z in cases:
        stroke = scenes.usual_stroke(facts)
        strokes += [stroke] * 2
        for rate in (None, rate_of(facts, z)):
            loop = BareLoop(compensator=compensator(facts, z), rate=rate)
            scenes_of.append(scenes.guidance(facts, truth, loop, stroke))
    force = np.array(
        [scenes.peak_force(r, s) for r, s in zip(play(scenes_of), strokes, strict=False)]
    ).reshape(-1, 2)
    ratio = force[:, 1] / force[:, 0]
    print(
        f"  the loop's rate of torque: {changed} of {len(cases)} joints rest otherwise, {np.sum(held > bound)} over the bound; the "
        f"hand feels {100 * (np.median(ratio) - 1):+.2f} % (median), {100 * (ratio.max() - 1):+.2f} % at most"
    )
    judge.that(
        "the rate of torque changes no joint's rest and no hand's force by 1 %",
        changed == 0 and bool(np.abs(ratio - 1.0).max() <= 0.01),
    )


def broken(rng: np.random.Generator) -> dict[str, Callable[..., Case]]:
    """Return what breaks one condition each."""
    return {
        "K 1 to 2 times the true K_c": lambda f, m, z: (
            f,
            m,
            {**z, "stiffness": rng.uniform(1.0, 2.0) * m.stiffness / f.stiffness},
        ),
        "R F 1 to 1.1 times the true friction": lambda f, m, z: (
            f,
            m,
            {**z, "share": rng.uniform(1.0, 1.1) * m.friction},
        ),
        "delay of 2 to 3 ticks": lambda f, m, z: (f, replace(m, delay=rng.uniform(2.0, 3.0) * T), z),
        "delay of 4 to 6 ticks": lambda f, m, z: (f, replace(m, delay=rng.uniform(4.0, 6.0) * T), z),
        "damping ratio 0 to 0.02": lambda f, m, z: (f, replace(m, damping=rng.uniform(0.0, 0.02)), z),
    }


def choice(judge: Judge, joints: int) -> None:
    """Judge the search against the grid."""
    print(f"the search against a grid of {len(GRID)}, {joints} joints")
    ratios: dict[str, list[float]] = {
        "proposal": [],
        "search alone": [],
        "fixed rule": [],
        "thesis": [],
        "thesis, R = 0.9, K = K_c/2": [],
    }
    safe: dict[str, list[bool]] = {name: [] for name in ratios}
    rest, none, seconds = [], 0, []
    for seed in range(joints):
        facts, _, _ = joint(seed)
        goal = goal_of("backdrive", facts, scenes.usual_stroke(facts), wish="light")
        force = goal.parts[0]
        scores = goal.values(force, GRID)
        at, _ = best_safe(goal, GRID, scores)
        begun = time.process_time()
        found = search(goal, seed=seed, starts=[fixed_rule(facts), full_rule(facts)])
        if at < 0 or found.numbers is None:
            none += 1
            print(f"  joint {seed}: grid safe {at >= 0}, search safe {found.numbers is not None}")
            if at >= 0:
                ratios["proposal"].append(np.inf)
                safe["proposal"].append(False)
            continue
        try:
            kept = refine(goal, found.numbers, members_.sample(facts, 64, seed), seed)
        except NotIdentifiable:  # refused: neither safe nor near the grid's best
            none += 1
            print(f"  joint {seed}: the search's numbers cannot be made safe")
            ratios["proposal"].append(np.inf)
            safe["proposal"].append(False)
            continue
        seconds.append(time.process_time() - begun)
        rows = {
            "proposal": kept,
            "search alone": found.numbers,
            "fixed rule": fixed_rule(facts),
            "thesis": thesis_numbers(facts),
            "thesis, R = 0.9, K = K_c/2": {"share": 0.9, "stiffness": 0.5, "decay": 20.0},
        }
        for name, s, w in zip(
            rows, goal.values(force, list(rows.values())), goal.worst(list(rows.values())), strict=False
        ):
            ratios[name].append(float(s / scores[at]))
            safe[name].append(bool(w <= 1.0))
        unrest = goal.unrests([kept], members_.sample(facts, 64, 1000 + seed))[0]
        rest.append(float(np.mean(unrest <= 1.0)))
    for name, values in ratios.items():
        r, ok = np.array(values), np.array(safe[name])
        print(
            f"  {name:<28} safe on {ok.sum():3d} of {ok.size}; force by the best of the grid, median {np.median(r):.3f}, worst "
            f"{r.max():.3f}; safe and within 15 % on {100 * np.mean(ok & (r <= 1.15)):.0f} %"
        )
    print(
        f"  of 64 joints freshly drawn from each one's intervals {100 * np.mean(rest):.1f} % rest with the proposal "
        f"(worst joint {100 * min(rest):.0f} %); search and check take {np.median(seconds):.1f} s of processor time; "
        f"{none} joints without a safe point"
    )
    good = np.mean(np.array(safe["proposal"]) & (np.array(ratios["proposal"]) <= 1.15))
    judge.that(
        f"safe and within 15 % of the grid's best on {100 * good:.1f} % of joints (at least 90)",
        bool(good >= 0.9),
    )


def proposal(
    facts: Facts, wish: str, seed: int
) -> tuple[dict[str, float], dict[str, float], list[str]] | None:
    """Return the numbers for a wish, what a hand feels of them and what is said of their ranges; None where none is safe."""
    goal = goal_of("backdrive", facts, scenes.usual_stroke(facts), wish=wish)
    found = search(goal, seed=seed, starts=[fixed_rule(facts), full_rule(facts)])
    if found.numbers is None:
        return None
    try:
        kept = refine(goal, found.numbers, members_.sample(facts, 64, seed), seed)
    except NotIdentifiable:
        return None
    return kept, {k: float(v[0]) for k, v in goal.part_scores([kept]).items()}, edges(goal, kept)


def at_an_end(facts: Facts, z: dict[str, float]) -> set[str]:
    """Return which numbers lie within 1 % of an end of the range that the goal states, in its own scale."""
    ranges = goal_of("backdrive", facts, scenes.usual_stroke(facts)).ranges
    names = set()
    for name, (low, high) in ranges.items():
        scale = np.log if high >= 5.0 * low else float
        way = (scale(z[name]) - scale(low)) / (scale(high) - scale(low))
        if not 0.01 < way < 0.99:
            names.add(name)
    return names


def wishes(judge: Judge, joints: int) -> None:
    """Judge the points for the wishes, and whether numbers at an end are named."""
    print(f"wishes, {joints} joints")
    own: dict[str, list[bool]] = {wish: [] for wish in OWN}
    felt: dict[str, list[list[float]]] = {wish: [] for wish in WISHES}
    apart, ends, unnamed, slow = [], dict.fromkeys(WISHES, 0), 0, dict.fromkeys(WISHES, 0)
    for seed in range(joints):
        facts, _, _ = joint(seed)
        points = {wish: proposal(facts, wish, seed) for wish in WISHES}
        if any(p is None for p in points.values()):
            print(f"  joint {seed}: not every wish has a safe point")
            continue
        for wish, (z, feels, sentences) in points.items():  # type: ignore[misc]
            felt[wish].append(list(feels.values()))
            at = at_an_end(facts, z)
            ends[wish] += bool(at)
            slow[wish] += "decay" in at and z["decay"] < 10.0
            unnamed += sum(not any(s.startswith(IN_WORDS[name]) for s in sentences) for name in at)
        for wish, name in OWN.items():
            mine = points[wish][1][name]  # type: ignore[index]
            own[wish].append(all(mine < points[w][1][name] for w in OWN if w != wish))  # type: ignore[index]
        numbers = [tuple(points[w][0].values()) for w in OWN]  # type: ignore[index]
        apart.append(len(set(numbers)) == len(OWN))
    for wish, values in felt.items():
        means = np.mean(values, axis=0)
        words = ", ".join(f"{name} {m:.3f}" for name, m in zip(WISHES[wish], means, strict=False))
        print(
            f"  {wish:<6} {words}; a number at an end of its range on {ends[wish]} joints, alpha_N at the lower one on {slow[wish]}"
        )
    for wish, best in own.items():
        share = 100.0 * float(np.mean(best))
        judge.that(
            f"{wish}: the least {OWN[wish]} of the three wishes on {share:.0f} % of {len(best)} joints (at least 90)",
            share >= 90.0,
        )
        others = [
            np.mean([v[list(WISHES[wish]).index(OWN[wish])] for v in felt[w]]) for w in OWN if w != wish
        ]
        mine = np.mean([v[list(WISHES[wish]).index(OWN[wish])] for v in felt[wish]])
        judge.that(f"{wish}: mean {OWN[wish]} {mine:.3f} (below {min(others):.3f})", bool(mine < min(others)))
    judge.that(f"three points on {100 * np.mean(apart):.0f} % of joints (all)", all(apart))
    judge.that(f"numbers at an end of their range that are not named: {unnamed}", unnamed == 0)


def main() -> None:
    """Print the tables and the verdict."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--joints", type=int, default=JOINTS)
    parser.add_argument("--compared", type=int, default=COMPARED)
    parser.add_argument("--wished", type=int, default=WISHED)
    parser.add_argument("--short", action="store_true", help="16 joints, 2 of them against the grid")
    options = parser.parse_args()
    if options.short:
        options.joints, options.compared, options.wished = 16, 2, 2
    judge, begun = Judge(), time.perf_counter()
    safety(judge, options.joints)
    print(f"  {time.perf_counter() - begun:.0f} s")
    if options.compared:
        choice(judge, options.compared)
    print(f"  {time.perf_counter() - begun:.0f} s")
    if options.wished:
        wishes(judge, options.wished)
    print(f"  {time.perf_counter() - begun:.0f} s, {time.process_time():.0f} s of processor time")
    judge.end()


if __name__ == "__main__":
    main()
