"""Whose friction has changed: joints found, false alarms, dates with their intervals, and robots unlike their siblings.

5,000 joints a fleet, daily for 180 days, repeatability 2 %, day-to-day correlation 0.6, seasons of 15 %; 2 % of the joints ramp by
10 % in the last 60 days. Rows are drawn by numpy (`_fleet_rows.py`); some joints also from logs, through `backdrive fleet`.
"""

from __future__ import annotations

import sys
import tempfile
import time
from datetime import date
from pathlib import Path

import numpy as np
from _common import Judge, first_seed, parser
from _fleet_rows import FIRST, rows

from backdrive.fleet.drift import Drift, drifts
from backdrive.fleet.history import History, histories, number_of
from backdrive.fleet.population import outliers


def joints_of(drawn: dict[str, np.ndarray]) -> list[History]:
    """Return drawn rows as histories."""
    day = FIRST + np.arange(drawn["constant"].shape[1], dtype=float)
    parts = zip(drawn["constant"], drawn["viscous"], drawn["temperature"], strict=False)
    return [
        History(
            robot=f"r{i:04d}",
            type="",
            joint="j1",
            unit="rad",
            day=day,
            constant=c,
            viscous=v,
            temperature=T,
            speed=1.0,
        )
        for i, (c, v, T) in enumerate(parts)
    ]


def dates(found: list[Drift], begin: float) -> tuple[list[float], list[bool]]:
    """Return how many days each onset is off, and whether the truth is inside its interval."""
    off, inside = [], []
    for one in found:
        assert one.onset is not None
        assert one.interval is not None
        off.append(number_of(one.onset) - begin)
        inside.append(number_of(one.interval[0]) <= begin <= number_of(one.interval[1]))
    return off, inside


def changed(judge: Judge, seed: int, fleets: int, joints: int) -> None:
    """Name the joints of fleets with drift."""
    found, false, off, inside, shapes = [], [], [], [], []
    for k in range(fleets):
        drawn = rows(seed + k, joints, 0.02)
        begun = time.process_time()
        result = drifts(joints_of(drawn))
        spent = time.process_time() - begun
        named = np.array([one.named for one in result])
        right = named & drawn["ramps"]
        found.append(right.sum() / drawn["ramps"].sum())
        false.append((named & ~drawn["ramps"]).sum() / max(named.sum(), 1))
        o, i = dates([one for one, r in zip(result, right, strict=False) if r], float(drawn["begin"]))
        off, inside = off + o, inside + i
        shapes += [one.shape == "ramp" for one, r in zip(result, right, strict=False) if r]
        print(
            f"  fleet {k}: {named.sum()} named, {right.sum()} rightly; {spent:.1f} s of processor", flush=True
        )
    judge.that(f"found {100 * np.mean(found):.1f} % of what ramps (at least 90)", np.mean(found) >= 0.9)
    judge.that(f"mean share of false {100 * np.mean(false):.2f} % (at most 6)", np.mean(false) <= 0.06)
    near, covered = float(np.mean(np.abs(off) <= 7)), float(np.mean(inside))
    sentence = f"onset within 7 days in {100 * near:.0f} % (80), or inside its interval in {100 * covered:.1f} % (90 to 98)"
    if len(off) < 200:  # one standard error of the share would be more than 1.5 %
        print(f"  {sentence}: {len(off)} joints are too few to judge")
    else:
        judge.that(sentence, near >= 0.8 or 0.9 <= covered <= 0.98)
    print(
        f"  ramps called ramps: {100 * np.mean(shapes):.0f} %; onset off by {np.median(np.abs(off)):.0f} days in the median"
    )


def unchanged(judge: Judge, seed: int, fleets: int, joints: int, thermometer: float = 0.0) -> int:
    """Name nothing in fleets without drift."""
    alarms, ratio = 0, []
    for k in range(fleets):
        result = drifts(joints_of(rows(seed + k, joints, 0.0, thermometer=thermometer)))
        alarms += any(one.named for one in result)
        ratio.append([np.mean([one.p <= level for one in result]) / level for level in (0.1, 0.01, 0.001)])
    shares = ", ".join(
        f"{r:.2f} at {a:g}" for r, a in zip(np.mean(ratio, axis=0), (0.1, 0.01, 0.001), strict=False)
    )
    print(
        f"  p-values below a level, by that level: {shares} (thermometer noise {thermometer:g} degC)",
        flush=True,
    )
    return alarms


def steps(seed: int, joints: int) -> None:
    """Tell steps from ramps."""
    drawn = rows(seed, joints, 0.1, step=0.1)
    result = drifts(joints_of(drawn))
    for name, shape in (("ramps", "ramp"), ("steps", "step")):
        mine = [one for one, is_it in zip(result, drawn[name], strict=False) if is_it and one.named]
        right, sure = sum(one.shape == shape for one in mine), sum(one.sure for one in mine)
        wrong = sum(one.sure and one.shape != shape for one in mine)
        print(
            f"  {name}: {len(mine)} of {drawn[name].sum()} named, {right} called {shape}; {sure} surely, {wrong} of these wrongly"
        )


def siblings(judge: Judge, seed: int, fleets: int) -> None:
    """Find the robot whose constant part is 1.35 times its siblings' mean, their spread being 5 %."""
    hits, others = 0, 0
    for k in range(fleets):
        drawn = rows(seed + k, 40, 0.0)
        typical = np.median(drawn["constant"], axis=1)
        drawn["constant"][7] *= 1.35 * np.delete(typical, 7).mean() / typical[7]
        apart = outliers(joints_of(drawn))
        hits += any(one.robot == "r0007" for one in apart)
        others += len({one.robot for one in apart} - {"r0007"})
    judge.that(f"a robot unlike its siblings found in {hits} of {fleets} fleets", hits >= 0.95 * fleets)
    print(f"  other robots named in these fleets: {others} of {39 * fleets}")


def from_logs(judge: Judge, seed: int, joints: int, every: int) -> None:
    """Find ramps in logs of every so many days: through reading, identification, Parquet and back."""
    from _fleet_processes import fleet

    draws = np.random.default_rng(seed)
    seconds, rate = 8.0, 100.0
    drawn = rows(seed, joints, 0.1)
    t = np.arange(round(seconds * rate)) / rate
    with tempfile.TemporaryDirectory(prefix="fleet-") as scratch:
        place = Path(scratch)
        for j in range(joints):
            (place / "logs" / f"r{j:04d}").mkdir(parents=True)
            for k in range(0, drawn["constant"].shape[1], every):
                q, dq, ddq = np.zeros((3, t.size))
                for hertz, amplitude in ((0.25, 0.8), (0.6, 0.45), (1.4, 0.1)):
                    w, shift = 2 * np.pi * hertz, draws.uniform(0, 2 * np.pi)
                    q += amplitude * np.sin(w * t + shift)
                    dq += amplitude * w * np.cos(w * t + shift)
                    ddq -= amplitude * w * w * np.sin(w * t + shift)
                tau = 0.5 * ddq + drawn["constant"][j, k] * np.sign(dq) + drawn["viscous"][j, k] * dq
                tau = tau + 4.0 * np.sin(q) + 0.05 * draws.standard_normal(t.size)
                warm = np.full(t.size, drawn["temperature"][j, k])
                name = date.fromordinal(date(1970, 1, 1).toordinal() + FIRST + k)
                np.savez(place / "logs" / f"r{j:04d}" / f"{name}.npz", t=t, q=q, tau=tau, temp=warm)
        use = fleet(place / "logs", "-o", place / "results", "--workers", 2)
        if use.code:
            print(use.output)
            sys.exit(1)
        from backdrive.fleet.store import Store

        result = drifts(histories(Store.open(place / "results").table(), today=FIRST + 400))
    named = np.array([one.named for one in result])
    right, wrong = int((named & drawn["ramps"]).sum()), int((named & ~drawn["ramps"]).sum())
    print(
        f"  {joints} joints from logs, one every {every} days: {use.wall:.0f} s, {use.processor:.0f} s of processor"
    )
    sentence = f"from logs: {right} of {drawn['ramps'].sum()} ramps found, {wrong} others named"
    if joints < 100:
        print(f"  {sentence} (too few to judge)")
        return
    judge.that(sentence, right >= 0.9 * drawn["ramps"].sum() and wrong <= max(1, 0.06 * named.sum()))


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--seed", type=int)
    options.add_argument("--joints", type=int, help="that are identified from logs")
    given = options.parse_args()
    seed, judge = first_seed(given.seed), Judge()
    fleets, joints = (2, 1000) if given.short else (20, 5000)
    print(f"{fleets} fleets of {joints} joints, 2 % ramp")
    changed(judge, seed, fleets, joints)
    print(f"{fleets} fleets without drift")
    alarms = unchanged(judge, seed + 1000, fleets, joints)
    most = 3 if fleets == 20 else 1
    judge.that(f"anything named in {alarms} of {fleets} (at most {most})", alarms <= most)
    noisy = unchanged(judge, seed + 2000, 2, joints, thermometer=0.5)
    print(f"  with a thermometer that is off by 0.5 degC from day to day: named in {noisy} of 2 (not judged)")
    print("steps and ramps")
    steps(seed + 3000, 1000)
    print("siblings")
    siblings(judge, seed + 4000, 20)
    count = 6 if given.short and given.joints is None else 200 if given.joints is None else given.joints
    if count:
        print("logs")
        from_logs(judge, seed + 5000, count, 3 if given.short else 1)
    judge.end()


if __name__ == "__main__":
    main()
