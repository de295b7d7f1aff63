"""Grades and remarks on planted trouble, clean logs, and what no log can show; and whether a repair leads away from the truth.

Kinds of trouble (sizes in the table, and smaller ones that are not required) in logs of an independent generator, five
motions in turn. A log counts as caught when it is graded worse than good, refused, or remarked on with a sentence, where its
clean twin (the same noise) is not. Columns: how many were refused, graded, remarked; caught; how many moved Coulomb or viscous by
more than three stated errors and 5 %; the silent ones among those; and the median noncentrality: how much the trouble raises the
residual of a line, inertia, gravity and delay by the true covariance. A log in which that is below 6 is drawn again, but for kinds
that do not show in a residual.

Sizes are those that move Coulomb or viscous so in half of the logs, where a kind does so (`--sizes` prints the ladder); kinds that
move nothing are required at the size in the table all the same. A peak below the slowest speed leaves no trace: there the answer
must say from which speed on it knows. Torque ramps must be read, and right; a searched law must follow a Stribeck peak or say not.

Clean logs have 100 to 5000 Hz, with and without gravity, and presliding over up to 5e-3 rad. A constant gain, a uniform clock, both
signs flipped stay good, and so do strokes under half a radian about centers that span 3.2 rad. Where a check offers a repair, the
repaired law may not lie farther from the truth, by more than three stated errors and 2 %, than without; nor may that of a refused
log be called good and lie off by 5 %, and by 2 % more than that of its clean twin.

    python benchmarks/evidence/verdicts.py --jobs 8
    python benchmarks/evidence/verdicts.py --only clock --logs 5
    python benchmarks/evidence/verdicts.py --sizes --logs 10
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import multiprocessing
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence

import numpy as np
from _common import Judge, first_seed, parser
from _verdicts_cases import Outcome, outcome
from _verdicts_kinds import HIDDEN, KINDS, RIGHT, Kind
from _verdicts_scenes import MOTIONS

CAUGHT = 28 / 30  # of the logs of a kind, at least
FALSE = 0.02  # of the clean logs worse than good, at most

LADDER = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)  # levels of `--sizes`

Job = tuple[str, int, int, float]


def main() -> None:
    """Make, identify and judge every log."""
    made = parser(__doc__)
    made.add_argument("--logs", type=int, default=30, help="logs a kind")
    made.add_argument("--clean", type=int, default=500, help="clean logs")
    made.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    made.add_argument("--only", default="", help="kinds whose name holds this")
    made.add_argument("--sizes", action="store_true", help="print which sizes move the friction, and end")
    made.add_argument("--seed", type=int, help="first seed; a fresh one by default")
    asked = made.parse_args()
    if asked.short:
        asked.logs, asked.clean = min(asked.logs, 1), min(asked.clean, 5)
    judge = Judge()
    first = first_seed(asked.seed)
    jobs = _jobs(asked, first)
    found: dict[tuple[str, int, float], list[Outcome]] = defaultdict(list)
    for done, one in enumerate(_run(jobs, asked.jobs), 1):
        found[one.table, one.kind, one.level].append(one)
        if done % max(len(jobs) // 40, 1) == 0:
            sys.stderr.write(f"{done} of {len(jobs)} logs\n")
            sys.stderr.flush()
    if asked.sizes:
        _sizes(found)
        return
    _planted(judge, found)
    _unplanted(judge, found)
    _repairs(judge, found)
    judge.end()


def _jobs(asked: argparse.Namespace, first: int) -> list[Job]:
    tables = {"kind": KINDS, "right": RIGHT, "hidden": HIDDEN}
    jobs: list[Job] = []
    for table, kinds in tables.items():
        chosen = [i for i, kind in enumerate(kinds) if asked.only in kind.name]
        smaller = [i for i in chosen if kinds[i].smaller and table == "kind"]
        if asked.sizes:
            jobs += [(table, i, first + k, x) for i in smaller for x in LADDER for k in range(asked.logs)]
            continue
        jobs += [(table, i, first + k, 0.0) for k in range(asked.logs) for i in chosen]
        if not asked.short:
            jobs += [(table, i, first + k, 1.0) for k in range(asked.logs) for i in smaller]
    if not asked.only and not asked.sizes:
        jobs += [("clean", 0, first + k, 0.0) for k in range(asked.clean)]
    return jobs


def _run(jobs: Sequence[Job], processes: int) -> Iterable[Outcome]:
    """Return the outcome of every job, as they come."""
    if processes <= 1:
        yield from (outcome(*job) for job in jobs)
        return
    outcome("clean", 0, 0, 0.0)  # compiles before the processes part
    with multiprocessing.get_context("fork").Pool(processes) as pool:
        yield from pool.imap_unordered(_one, jobs)


def _one(job: Job) -> Outcome:
    return outcome(*job)


def _planted(judge: Judge, found: dict) -> None:
    """Print one line a kind, and require that nearly every log is caught."""
    print(
        f"{'kind':36s} {'size':30s} {'logs':>4s} {'refused':>7s} {'graded':>6s} {'remarked':>8s} {'caught':>6s} {'moved':>5s} "
        f"{'silent':>6s} {'noncent.':>8s}  silent in"
    )
    tables = (
        ("kind", KINDS, 0.0, ""),
        ("right", RIGHT, 0.0, "right, or said not to be:"),
        ("kind", KINDS, 1.0, "smaller, not required:"),
    )
    for table, kinds, level, title in tables:
        print(title)
        for i, kind in enumerate(kinds):
            of_kind = found.get((table, i, level), [])
            if not of_kind:
                continue
            caught = [o for o in of_kind if o.caught]
            silent = [o for o in of_kind if o.moved and not o.caught]
            where = Counter(MOTIONS[o.motion] for o in silent)
            print(
                f"{kind.name:36s} {_size(kind, level):30s} {len(of_kind):4d} {sum(o.refused for o in of_kind):7d} "
                f"{sum(o.graded for o in of_kind):6d} {sum(o.remarked for o in of_kind):8d} {len(caught):6d} "
                f"{sum(o.moved for o in of_kind):5d} {len(silent):6d} {np.median([o.told for o in of_kind]):8.3g}  "
                f"{' '.join(f'{name} {n}' for name, n in where.items())}"
            )
            if table == "right" and silent:
                judge.short.append(f"{kind.name}: wrong and called good in {len(silent)} of {len(of_kind)}")
            if kind.genuine and (refused := sum(o.refused for o in of_kind)):
                judge.short.append(f"{kind.name}: refused in {refused} of {len(of_kind)}")
            if table == "kind" and not level and len(caught) < CAUGHT * len(of_kind) - 1e-9:
                wrong = f"{len(silent)} wrong and called good"
                judge.short.append(
                    f"{kind.name} ({_size(kind, level)}): caught in {len(caught)} of {len(of_kind)}, {wrong}"
                )


def _size(kind: Kind, level: float) -> str:
    """Return the size of a kind in words."""
    return f"{kind.at(level):.3g} {kind.unit}".rstrip()


def _sizes(found: dict) -> None:
    """Print which sizes move Coulomb or viscous by more than three stated errors and 5 %, at which noncentrality."""
    print(f"{'kind':36s} {'size':36s} {'logs':>4s} {'moved':>5s} {'noncent.':>8s} {'caught':>6s}")
    for i, kind in enumerate(KINDS):
        for level in LADDER:
            logs = found.get(("kind", i, level), [])
            if logs:
                print(
                    f"{kind.name:36s} {_size(kind, level):36s} {len(logs):4d} {sum(o.moved for o in logs):5d} "
                    f"{np.median([o.told for o in logs]):8.3g} {sum(o.caught for o in logs):6d}"
                )


def _unplanted(judge: Judge, found: dict) -> None:
    """Require that clean logs, and those with what no log shows, are called good."""
    for key, name in [
        (("clean", 0, 0.0), "clean"),
        *((("hidden", i, 0.0), kind.name) for i, kind in enumerate(HIDDEN)),
    ]:
        logs = found.get(key, [])
        if not logs:
            continue
        worse = [o for o in logs if o.refused or o.graded]
        remarked, moved = sum(o.remarks > 0 for o in logs), sum(o.moved for o in logs)
        print(
            f"{name}: {len(worse)} of {len(logs)} worse than good, {remarked} with a remark, {moved} off by more than three "
            "stated errors and 5 %"
        )
        for word, n in Counter(f"{MOTIONS[o.motion]}: {o.why}" for o in worse).most_common(8):
            print(f"  {n} {word}")
        judge.at_most(f"{name}: worse than good", 100.0 * len(worse) / len(logs), 100.0 * FALSE, "%")


def _repairs(judge: Judge, found: dict) -> None:
    """Require that no repair leads away from the truth."""
    every = [o for logs in found.values() for o in logs]
    repaired = [o for o in every if o.repaired]
    away = [o for o in repaired if o.away]
    print(f"{len(repaired)} logs could be repaired, {len(away)} laws led away from the truth")
    names = {"kind": KINDS, "right": RIGHT, "hidden": HIDDEN}
    for (where, why), n in Counter(
        (names[o.table][o.kind].name if o.table in names else "clean", o.repaired) for o in away
    ).most_common():
        print(f"  {n} {where}: {why}")
    judge.that(f"no repair leads away from the truth: {len(away)} of {len(repaired)}", not away)


if __name__ == "__main__":
    main()
