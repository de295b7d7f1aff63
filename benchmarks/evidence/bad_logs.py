"""Bad logs: faults are named where they are, healthy logs are left alone, damaged files never hurt.

Each fault of the table is planted, at its smallest size, in random clean logs of simulated joints, one fault a log; it counts
as found when a warning or a spoiling finding of its name lies on the right joint and the right rows. Any such finding on a log
without a fault is a false one. Then every reader gets files that are cut and mutated.

    python benchmarks/evidence/bad_logs.py --faults-only --planted 300 --clean 1000
    python benchmarks/evidence/bad_logs.py --readers-only --n 10000
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter

import numpy as np
from _clean_logs import clean_log
from _common import Judge
from _log_faults import FAULTS, Fault
from _sample_faults import Planted

from backdrive.health import CHECKS, Finding, check

FOUND, FALSE, MINUTES = 0.99, 0.005, 10.0
#: Seeds of this program; the thresholds of the checks were chosen on others.
FIRST = 7_000_000


def main() -> None:
    """Print the table of faults, then one line a reader."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--faults-only", action="store_true", help="no files")
    parser.add_argument("--readers-only", action="store_true", help="no faults")
    parser.add_argument("--clean", type=int, default=1000, help="clean logs to check")
    parser.add_argument("--planted", type=int, default=300, help="logs a fault is planted in")
    parser.add_argument("--n", type=int, default=10_000, help="damaged files a reader")
    parser.add_argument("--seed", type=int, default=FIRST, help="first seed of the clean logs")
    asked = parser.parse_args()
    judge = Judge()
    if not asked.readers_only:
        faults(judge, asked.clean, asked.planted, asked.seed)
    if not asked.faults_only:
        readers(judge, asked.n)
    judge.end()


def faults(judge: Judge, clean: int, planted: int, first: int) -> None:
    """Plant every fault `planted` times, check `clean` logs without, and judge both."""
    begun = time.perf_counter()
    count, found, alone = Counter(), Counter(), Counter()
    false: list[str] = []
    looked = 0
    for step in range(100 * max(planted, 1) + clean):
        open_ = [i for i in range(len(FAULTS)) if count[i] < planted]
        if looked >= clean and not open_:
            break
        log = clean_log(first + step)
        if looked < clean:
            looked += 1
            named = bad(check(log.log))
            if named:
                false.append(f"seed {log.seed} ({log.motion}): {named[0].sentence}")
        for i in open_:
            case = FAULTS[i].plant(log, np.random.default_rng([first + step, i]))
            if case is None:
                continue
            named = bad(check(case.log))
            hit = names(FAULTS[i], case, named)
            count[i], found[i] = count[i] + 1, found[i] + hit
            alone[i] += hit and {f.name for f in named} == {FAULTS[i].name}
        done = sum(min(count[i], planted) for i in range(len(FAULTS)))
        tell(
            f"{looked} clean logs, {done} of {planted * len(FAULTS)} faults, {time.perf_counter() - begun:.0f} s"
        )
    tell("")
    print(
        f"{'fault':18s} {'smallest size that must be found':64s} {'planted':>7s} {'found':>7s} {'alone':>7s}"
    )
    for i, fault in enumerate(FAULTS):
        share, only = found[i] / max(count[i], 1), alone[i] / max(count[i], 1)
        print(f"{fault.name:18s} {fault.size:64s} {count[i]:7d} {100 * share:6.1f}% {100 * only:6.1f}%")
    print(f"false findings: {len(false)} of {looked} clean logs; {time.perf_counter() - begun:.0f} s")
    for sentence in false[:10]:
        print(f"  {sentence}")
    if planted:
        least = min(range(len(FAULTS)), key=lambda i: found[i] / max(count[i], 1))
        worst = found[least] / max(count[least], 1)
        judge.that(
            f"every fault planted {planted} times", all(count[i] >= planted for i in range(len(FAULTS)))
        )
        judge.that(
            f"every fault found where it is: {100 * worst:.2f} % of {FAULTS[least].name}, {FAULTS[least].size} (at least 99 %)",
            all(found[i] >= FOUND * count[i] for i in range(len(FAULTS))),
        )
        unplanted = sorted(
            {c.name for c in CHECKS} - {f.name for f in FAULTS} - {"no-friction", "plan-mismatch"}
        )
        judge.that(
            f"every check that can warn has a fault in the table {unplanted or ''}".strip(), not unplanted
        )
    if looked:
        judge.at_most("clean logs with a false finding", 100 * len(false) / looked, 100 * FALSE, "%")


def bad(findings: list[Finding]) -> list[Finding]:
    """Return the findings that are more than a remark."""
    return [f for f in findings if f.severity != "note"]


def names(fault: Fault, case: Planted, findings: list[Finding]) -> bool:
    """Return whether a finding has the fault's name, joint and, within two samples, rows."""
    for finding in findings:
        if finding.name != fault.name or finding.joint != case.joint:
            continue
        if case.rows is None or finding.where is None:
            return True
        at = np.searchsorted(finding.where, case.rows)
        near = finding.where[np.clip(np.stack([at - 1, at]), 0, finding.where.size - 1)]
        if np.any(np.abs(near - case.rows) <= 2):
            return True
    return False


def readers(judge: Judge, n: int) -> None:
    """Give every reader `n` damaged files through the guarded child."""
    from _reader_fuzz import WRITERS, fuzz

    for reader in WRITERS:
        tell(f"{reader}: {n} damaged files")
        result = fuzz(reader, n, 1)
        tell("")
        counts = ", ".join(f"{k} {v}" for k, v in result["counts"].items())
        print(
            f"{reader:8s} {n} files in {result['seconds']:.0f} s, slowest {result['slowest']:.2f} s: {counts}"
        )
        for example in result["examples"]:
            print(f"  {example}")
        wrong = {key: result[key] for key in ("untyped", "hangs", "parent_deaths")}
        judge.that(f"{reader}: {wrong}", not any(wrong.values()))
        judge.at_most(f"{reader}: time", result["seconds"] / 60, MINUTES, "min")


def tell(sentence: str) -> None:
    """Show the present state on a terminal, over the last one."""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r{sentence:100s}" if sentence else f"\r{'':100s}\r")
        sys.stderr.flush()


if __name__ == "__main__":
    main()
