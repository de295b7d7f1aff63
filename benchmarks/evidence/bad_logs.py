"""Bad logs: faults are named where they are, healthy logs are left alone, damaged files never hurt.

Each fault of the table is planted, at its smallest size, in random clean logs of simulated joints, one fault a log; it counts
as found when a warning or a spoiling finding of its name lies on the right joint and the right rows. Any such finding on a log
without a fault is a false one. Then every reader gets files that are cut and mutated.

Columns: in how many of the clean logs a fault met its conditions, which stand below it; how often it was planted so, and found;
found and nothing else named; and found wherever in the first clean logs it could be put at all, conditions or not. Seeds are
fresh ones, whose first is printed: nothing was tuned on them.

    python benchmarks/evidence/bad_logs.py --faults-only --planted 300 --clean 4000
    python benchmarks/evidence/bad_logs.py --readers-only --n 10000
"""

from __future__ import annotations

import sys
import textwrap
import time

import numpy as np
from _clean_logs import Clean, clean_log
from _common import Judge, first_seed, parser
from _log_faults import FAULTS, Fault
from _sample_faults import Planted
from scipy import stats

from backdrive.logs.health import CHECKS, Finding, check

FOUND, FALSE, MINUTES = 0.99, 0.005, 10.0
CHANCE = 0.00135  # with which a count may be as low by its share: that of three standard deviations of a normal number


def main() -> None:
    """Print the table of faults, then one line a reader."""
    made = parser(__doc__)
    made.add_argument("--faults-only", action="store_true", help="no files")
    made.add_argument("--readers-only", action="store_true", help="no faults")
    made.add_argument("--clean", type=int, default=4000, help="clean logs to check")
    made.add_argument("--planted", type=int, default=300, help="logs a fault is planted in")
    made.add_argument("--n", type=int, default=10_000, help="damaged files a reader")
    made.add_argument("--seed", type=int, help="first seed of the clean logs; a fresh one by default")
    asked = made.parse_args()
    if asked.short:
        asked.clean, asked.planted, asked.n = min(asked.clean, 200), min(asked.planted, 6), min(asked.n, 200)
    judge = Judge()
    if not asked.readers_only:
        faults(judge, asked.clean, asked.planted, first_seed(asked.seed))
    if not asked.faults_only:
        readers(judge, asked.n)
    judge.end()


class Tally:
    """What became of one fault: planted under its conditions and anywhere."""

    def __init__(self, fault: Fault, number: int):
        self.fault, self.number = fault, number
        self.tried = self.planted = self.found = self.alone = self.put = self.seen = 0

    def plant(self, log: Clean) -> None:
        """Plant the fault in a log under its conditions, and look."""
        self.tried += 1
        case = self.fault.plant(log, np.random.default_rng([log.seed, self.number]))
        if case is not None:
            named = bad(check(case.log))
            hit = names(self.fault, case, named)
            self.planted, self.found = self.planted + 1, self.found + hit
            self.alone += hit and {f.name for f in named} == {self.fault.name}

    def put_anywhere(self, log: Clean) -> None:
        """Plant the fault in a log wherever it can be put, and look."""
        case = self.fault.plant(log, np.random.default_rng([log.seed, self.number, 1]), anywhere=True)
        if case is not None:
            self.put += 1
            self.seen += names(self.fault, case, bad(check(case.log)))

    @property
    def admitted(self) -> float:
        """Share of the clean logs that met the conditions [-]."""
        return self.planted / max(self.tried, 1)

    @property
    def share(self) -> float:
        """Share found of those planted under the conditions [-]."""
        return self.found / max(self.planted, 1)

    @property
    def everywhere(self) -> float:
        """Share found of those put anywhere [-]."""
        return self.seen / max(self.put, 1)


def faults(judge: Judge, clean: int, planted: int, first: int) -> None:
    """Plant every fault `planted` times, check `clean` logs without, and judge both."""
    begun = time.perf_counter()
    tallies = [Tally(fault, i) for i, fault in enumerate(FAULTS)]
    false: list[str] = []
    looked = 0
    for seed in range(first, first + 100 * max(planted, 1) + clean):
        open_ = [t for t in tallies if t.planted < planted]
        if looked >= clean and not open_:
            break
        log = clean_log(seed)
        if looked < clean:
            looked += 1
            named = bad(check(log.log))
            if named:
                false.append(f"seed {log.seed} ({log.motion}): {named[0].sentence}")
        for t in open_:
            t.plant(log)
        for t in tallies:
            if t.put < planted:
                t.put_anywhere(log)
        done = sum(min(t.planted, planted) for t in tallies)
        tell(
            f"{looked} clean logs, {done} of {planted * len(FAULTS)} faults, {time.perf_counter() - begun:.0f} s"
        )
    tell("")
    print(
        f"{'fault':18s} {'smallest size that must be found':58s} {'admitted':>8s} {'planted':>7s} {'found':>7s} {'alone':>7s} "
        f"{'anywhere':>8s}"
    )
    for t in tallies:
        print(
            f"{t.fault.name:18s} {t.fault.size:58s} {100 * t.admitted:7.1f}% {t.planted:7d} {100 * t.share:6.1f}% "
            f"{100 * t.alone / max(t.planted, 1):6.1f}% {100 * t.everywhere:7.1f}%"
        )
        if t.fault.where:
            print(textwrap.fill(t.fault.where, 120, initial_indent=21 * " ", subsequent_indent=21 * " "))
    print(f"false findings: {len(false)} of {looked} clean logs; {time.perf_counter() - begun:.0f} s")
    for sentence in false[:10]:
        print(f"  {sentence}")
    if planted:
        judge_faults(judge, tallies, planted)
    if looked:
        judge.at_most("clean logs with a false finding", 100 * len(false) / looked, 100 * FALSE, "%")


def judge_faults(judge: Judge, tallies: list[Tally], planted: int) -> None:
    """Judge what was found, under the conditions and anywhere."""
    judge.that(f"every fault planted {planted} times", all(t.planted >= planted for t in tallies))
    every = sum(t.found for t in tallies) / max(sum(t.planted for t in tallies), 1)
    judge.that(
        f"faults found where they are, under the conditions below each, all together: {100 * every:.2f} % (at least 99 %)",
        every >= FOUND,
    )
    for t in tallies:
        if stats.binom.cdf(t.found, t.planted, t.fault.share) < CHANCE:
            judge.that(f"{t.fault.name}, {t.fault.size}: found in {100 * t.share:.1f} %", False)
    least = min(tallies, key=lambda t: t.share)
    judge.that(
        f"each of them as often as its share tells (99 % but where the table says less), or less by chance; least: "
        f"{100 * least.share:.1f} % of {least.fault.name}, {least.fault.size}",
        not judge.short,
    )
    missing = sorted(
        {c.name for c in CHECKS} - {t.fault.name for t in tallies} - {"no-friction", "plan-mismatch"}
    )
    judge.that(f"every check that can warn has a fault in the table {missing or ''}".strip(), not missing)


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
