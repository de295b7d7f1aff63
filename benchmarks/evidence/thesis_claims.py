"""Every statement of the thesis about its figures and tables, on two disjoint sets of seeds and held against the ledger.

Met: each comes out on both sets as docs/theory/claims.md says, everything that has a verdict was computed, and every check
of our own holds on both. `--only chapter-3 fig-4.8` runs a part. `--stiffness` prints instead which statements of chapters 3
and 4 come out over K_c/K. The league is a program of its own.
"""

from __future__ import annotations

import importlib
import inspect
import time

from _common import Judge, parser

from backdrive.thesis.catalog import ENTRIES, Entry, choose
from backdrive.thesis.ledger import STATEMENTS, evaluate, headline, missing
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO, RATIOS

ALL = 480.0  # limit of time [s]
APART = 1000  # between the two sets of seeds; an experiment draws fewer hands from each


def run(entries: list[Entry], seed: int) -> dict[str, Outcome]:
    """Return the outcome of each experiment."""
    outcomes = {}
    for entry in entries:
        begun, worked = time.perf_counter(), time.process_time()
        outcomes[entry.name] = importlib.import_module(entry.module).run(seed=seed)
        print(
            f"  {entry.name}, seeds from {seed}: {time.perf_counter() - begun:.1f} s, "
            f"{time.process_time() - worked:.1f} s of processor time",
            flush=True,
        )
    return outcomes


def own_checks(outcome: Outcome) -> list[Claim]:
    """Return the checks of our own that were judged."""
    return [c for c in outcome.claims if not c.statement and c.holds is not None]


def show(outcome: Outcome, other: Outcome) -> None:
    """Print what came out on both sets of seeds."""
    print(f"\n{outcome.name}: {outcome.title}\n  {outcome.setting}")
    for one, two in zip(outcome.claims, other.claims, strict=False):
        kind = one.statement or ("check" if one.holds is not None else "note")
        print(f"  {kind}: {one.what}\n      {one.ours}")
        if one.holds is not None:
            print(
                f"      gate: {one.gate}; comes out: {one.holds}, with the other seeds {two.holds}: {two.ours}"
            )


def judge_all(judge: Judge, entries: list[Entry], seed: int) -> None:
    """Run both sets and judge."""
    sets = [run(entries, first) for first in (seed, seed + APART)]
    for entry in entries:
        show(sets[0][entry.name], sets[1][entry.name])
    came_out = [evaluate(outcomes.values()) for outcomes in sets]
    names = [entry.name for entry in entries]
    listed = [s for s in STATEMENTS if s.experiment in names]
    print("\nstatements:")
    for s in listed:
        both = [c.get(s.name) for c in came_out]
        text = f"{s.name} (Sec. {s.section}): {s.verdict}; comes out {both[0]} and {both[1]}"
        judge.that(text + (f". {s.why}" if s.why else ""), all(s.agrees(holds) for holds in both))
    judge.that(
        f"everything with a verdict was computed: {missing(names, came_out[0])} left",
        not missing(names, came_out[0]),
    )
    known = {s.name for s in STATEMENTS}
    judge.that("everything that was computed is in the ledger", set(came_out[0]) <= known)
    checks = [c for outcomes in sets for outcome in outcomes.values() for c in own_checks(outcome)]
    for check in checks:
        if not check.holds:
            judge.that(f"{check.what}: {check.ours} (gate: {check.gate})", False)
    print(
        f"\n{headline(listed)} {sum(bool(c.holds) for c in checks)} of {len(checks)} checks of our own hold, both sets of seeds."
    )


def over_stiffness(entries: list[Entry], seed: int) -> None:
    """Print which statements come out over K_c/K, as the table of docs/theory/claims.md."""
    table: dict[float, dict[str, bool]] = {}
    for ratio in RATIOS:
        outcomes = []
        for entry in entries:
            program = importlib.import_module(entry.module).run
            if "ratio" in inspect.signature(program).parameters:
                outcomes.append(program(seed=seed, ratio=ratio))
        table[ratio] = evaluate(outcomes)
        print(f"K_c = {ratio:g} K: {sum(table[ratio].values())} of {len(table[ratio])} come out", flush=True)
    print("\n| statement | " + " | ".join(f"{r:g}" for r in RATIOS) + " |\n|---|" + "---|" * len(RATIOS))
    for name in table[RATIO]:
        print(f"| `{name}` | " + " | ".join("+" if table[r][name] else "-" for r in RATIOS) + " |")


def main() -> None:
    """Run, print, judge."""
    made = parser(__doc__)
    made.add_argument("--only", nargs="*", default=[], help="names or chapters; all by default")
    made.add_argument("--seed", type=int, default=0)
    made.add_argument("--stiffness", action="store_true", help="which statements come out over K_c/K")
    given = made.parse_args()
    given.only = given.only or (["chapter-2"] if given.short else [])
    entries = [e for e in choose(given.only) if e.group != "beyond"]
    judge = Judge()
    if given.stiffness:
        over_stiffness(entries, given.seed)
        judge.end()
    begun, worked = time.perf_counter(), time.process_time()
    judge_all(judge, entries, given.seed)
    spent, cpu = time.perf_counter() - begun, time.process_time() - worked
    print(
        f"wall {spent:.0f} s, processor {cpu:.0f} s: on a loaded machine the second says what idle cores would take"
    )
    judge.at_most("time of all, the smaller of wall and processor time", min(spent, cpu), ALL, "s")
    absent = [e.name for e in ENTRIES if not e.available]
    if absent and not given.only:
        judge.that(f"every experiment has a program; without: {', '.join(absent)}", False)
    judge.end()


if __name__ == "__main__":
    main()
