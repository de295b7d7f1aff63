"""Every experiment of the thesis, run in simulation: each claim and each gate judged, and the time that it takes.

`--only chapter-3 fig-4.8` runs a part. `backdrive reproduce` draws the same and binds it into a book.
"""

from __future__ import annotations

import time

from _common import Judge, parser

from backdrive.thesis.catalog import ENTRIES, choose
from backdrive.thesis.run import Result, run_all

ALL, ONE = 600.0, 60.0  # limits of time [s]


def told(judge: Judge, result: Result) -> None:
    """Print and judge the claims of one experiment."""
    print(f"\n{result.entry.name}: {result.entry.title} ({result.seconds:.1f} s)")
    if result.outcome is None:
        judge.that(f"{result.entry.name} runs: {result.error}", False)
        return
    for claim in result.outcome.claims:
        thesis = f"; thesis: {claim.thesis}" if claim.thesis else ""
        if claim.holds is None:
            print(f"  info  {claim.what}: {claim.ours}{thesis}")
            continue
        gate = f" (gate: {claim.gate})" if claim.gate else ""
        judge.that(f"{claim.what}: {claim.ours}{gate}{thesis}", claim.holds)
        if not claim.holds and claim.why:
            print(f"        why: {claim.why}")
    judge.at_most(f"{result.entry.name}: time", result.seconds, ONE, "s")


def main() -> None:
    """Run, print, judge."""
    made = parser(__doc__)
    made.add_argument("--only", nargs="*", default=[], help="names or chapters; all by default")
    made.add_argument("--seed", type=int, default=0)
    given = made.parse_args()
    given.only = given.only or (["chapter-2"] if given.short else [])
    judge = Judge()
    entries = choose(given.only)
    begun = time.perf_counter()
    done = {result.entry.name: result for result in run_all(entries, seed=given.seed)}
    wall = time.perf_counter() - begun
    for entry in entries:
        told(judge, done[entry.name])
    held = sum(len(r.of(True)) for r in done.values())
    short = sum(len(r.of(False)) for r in done.values())
    print(f"\n{held} claims hold, {short} fall short; {len(done)} experiments in {wall:.0f} s")
    judge.at_most("time of all", wall, ALL, "s")
    absent = [e.name for e in ENTRIES if not e.available]
    if absent and not given.only:
        judge.that(f"every experiment has a program; without: {', '.join(absent)}", False)
    judge.end()


if __name__ == "__main__":
    main()
