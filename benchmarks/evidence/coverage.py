"""Stated 95 % intervals against the truth, by an independent generator (`_independent.py`), through the public door.

A cell is a method, a condition and a quantity (Coulomb, viscous, curve at its knots), pooled over knots and directions. Of
each: the share of truths inside the stated interval; its median width by that of an oracle (least squares with the same terms
and knots by the true motion and covariance, rounding of the encoder included, the delay free, the same t quantile); how often
nothing is told; and the share of logs with more than a tenth of their numbers beyond three stated errors. Beside the width stand
three that no gate asks of: by that of an oracle whose encoder does not round (`exact`), which no log can have; and by the
oracle's, the width that the true covariance gives where the joint slides for sure (`slides`), and with the true crossing of
zero known (`crosses`): the oracle takes friction to jump there (`_coverage_oracle`). A straight line is the truth, without a
Stribeck peak, so that Coulomb and viscous are what they are; knots within a smooth crossing of zero are left out. An interval
is the stated one, or 1.96 standard errors.

Where nothing can be told (two constant speeds: no degree of freedom; three moves; a motion that leaves the delay open by more
than two samples) nothing may be.

    python benchmarks/evidence/coverage.py --jobs 8
    python benchmarks/evidence/coverage.py --logs 20 --only "AR(0.98), 200 Hz"
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import math
import multiprocessing
import sys
import time
from collections import defaultdict

import numpy as np
from _common import Judge, first_seed, parser
from _coverage_cells import Number, numbers
from _coverage_conditions import CONDITIONS
from scipy import stats

INSIDE = (0.88, 0.99)  # share of truths in the 95 % interval
WHOLE = 200  # logs of a whole run
WIDTH = 1.5  # median width by the oracle's, at most
OPEN = 0.1  # share that may be told nothing of
BEYOND, SHARE, LOGS = 3.0, 0.1, 0.02  # stated errors; of a log's numbers; of the logs
CHANCE = 1e-3  # with which a short run may be off without being judged
ERROR = 1.959964  # half width of a 95 % interval [standard error]


def main() -> None:
    """Identify every log, print the table, judge the cells."""
    made = parser(__doc__)
    made.add_argument("--logs", type=int, default=WHOLE, help="logs a condition")
    made.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    made.add_argument("--only", default="", help="conditions whose name holds this")
    made.add_argument("--no-search", action="store_true", help="without the method `dynamic`")
    made.add_argument("--seed", type=int, help="first seed; a fresh one by default")
    asked = made.parse_args()
    if asked.short:
        asked.logs, asked.no_search = min(asked.logs, 3), True
    chosen = [i for i, c in enumerate(CONDITIONS) if asked.only in c.name]
    if not chosen:
        print(f"no condition holds {asked.only!r}: {', '.join(c.name for c in CONDITIONS)}")
        sys.exit(2)
    judge = Judge()
    first = first_seed(asked.seed)
    jobs = [(i, first + k, not asked.no_search) for k in range(asked.logs) for i in chosen]
    cells: dict[tuple[str, str, str], list[Number]] = defaultdict(list)
    for done, found in enumerate(_run(jobs, asked.jobs), 1):
        for number in found:
            cells[number.condition, number.method, number.quantity].append(number)
        _progress(done, len(jobs))
    silent = {c.name for c in CONDITIONS if c.silent}
    heads = ("inside", "width", "exact", "slides", "crosses", "bias", "open", "beyond")
    print(
        f"{'condition':30s} {'method':24s} {'quantity':9s} {'logs':>5s} {'n':>6s} {''.join(f' {h:>7s}' for h in heads)}"
    )
    for key in sorted(cells, key=lambda k: ([c.name for c in CONDITIONS].index(k[0]), k)):
        _judge(judge, key, cells[key], key[0] in silent, asked.logs)
    print(f"{len(cells)} cells, {len(judge.short)} of them fall short")
    if asked.logs < WHOLE:
        print(
            f"a short run: what chance does once in {1.0 / CHANCE:g} cells is not judged; {WHOLE} logs have no such slack"
        )
    judge.end()


def _run(jobs: list[tuple[int, int, bool]], processes: int):
    """Return the numbers of every job, as they come."""
    if processes <= 1:
        yield from (numbers(*job) for job in jobs)
        return
    numbers(*jobs[0])  # compiles before the processes part
    with multiprocessing.get_context("fork").Pool(processes) as pool:
        yield from pool.imap_unordered(_one, jobs)


def _one(job: tuple[int, int, bool]) -> list[Number]:
    return numbers(*job)


def _judge(judge: Judge, key: tuple[str, str, str], cell: list[Number], silent: bool, logs: int) -> None:
    """Print a cell, and require what is wanted of it."""
    told = [n for n in cell if n.told]
    open_ = 1.0 - len(told) / len(cell)
    name = " | ".join(key)
    if silent:
        print(f"{key[0]:30s} {key[1]:24s} {key[2]:9s} {logs:5d} {len(cell):6d} {'':48s} {100 * open_:6.0f}%")
        if told:
            judge.short.append(f"{name}: told in {100 - 100 * open_:.0f} %, where nothing can be told")
        return
    if not told:
        print(f"{key[0]:30s} {key[1]:24s} {key[2]:9s} {logs:5d} {len(cell):6d} {'':48s} {100 * open_:6.0f}%")
        judge.short.append(f"{name}: never told")
        return
    error, width = np.array([n.error for n in told]), np.array([n.width for n in told])
    inside = float(np.mean(np.abs(error) <= width))
    least = np.array([n.least for n in told])
    ratio = _median(width / least)
    exact = _median(width / np.array([n.exact for n in told]))
    slides, crosses = (
        _median(np.array([getattr(n, kind) / n.least for n in told])) for kind in ("sliding", "crossing")
    )
    by_log: dict[int, list[bool]] = defaultdict(list)
    for n in told:
        by_log[n.log].append(abs(n.error) > BEYOND / ERROR * n.width)
    wild = float(np.mean([np.mean(b) > SHARE for b in by_log.values()]))
    bias = float(np.median(error / width) * ERROR)
    widths = "".join(f" {x:7.2f}" for x in (ratio, exact, slides, crosses, bias))
    print(
        f"{key[0]:30s} {key[1]:24s} {key[2]:9s} {len(by_log):5d} {len(cell):6d} {100 * inside:7.1f}%{widths} "
        f"{100 * open_:6.1f}% {100 * wild:6.1f}%"
    )
    short, n = logs < WHOLE, len(by_log)
    off = []
    if not INSIDE[0] <= inside <= INSIDE[1] and not (short and stats.binom.cdf(inside * n, n, 0.95) > CHANCE):
        off.append(f"{100 * inside:.1f} % inside (88 to 99 %)")
    if not ratio <= WIDTH * (_wider_by_chance(told) if short else 1.0):
        off.append(f"{ratio:.2f} times as wide as the oracle (at most {WIDTH:g})")
    if open_ > OPEN and not (short and stats.binom.sf(open_ * logs - 1.0, logs, OPEN) > CHANCE):
        off.append(f"nothing told in {100 * open_:.0f} % (at most 10 %)")
    if wild > LOGS and not (short and stats.binom.sf(wild * n - 1.0, n, LOGS) > CHANCE):
        off.append(f"{100 * wild:.1f} % of logs far off (at most 2 %)")
    if off:
        judge.short.append(f"{name}: {'; '.join(off)}")


def _wider_by_chance(told: list[Number]) -> float:
    """Return by which factor the median width of a short run may be off."""
    by_log: dict[int, list[float]] = defaultdict(list)
    for n in told:
        by_log[n.log].append(n.width / n.least)
    sizes = np.log([max(_median(np.array(each)), 1e-300) for each in by_log.values()])
    if sizes.size < 2:
        return math.inf
    error = 1.25 * float(sizes.std(ddof=1)) / math.sqrt(sizes.size)  # of a median
    return math.exp(float(stats.t.ppf(1.0 - CHANCE, sizes.size - 1)) * error)


def _median(ratio: np.ndarray) -> float:
    """Return the median of those that are finite."""
    return float(np.median(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else math.nan


def _progress(done: int, total: int) -> None:
    """Show the state on stderr, now and then."""
    if done == total or done % max(total // 50, 1) == 0:
        sys.stderr.write(f"{time.strftime('%H:%M:%S')} {done} of {total} logs\n")
        sys.stderr.flush()


if __name__ == "__main__":
    main()
