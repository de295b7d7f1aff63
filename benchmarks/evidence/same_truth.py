"""The same truth as before: logs identified by the version before one house and by this one, and what each of them takes.

The old side is the tree of `_before.BEFORE`, taken from git into a temporary folder. Ten simulated logs (`_same_truth_logs` shares
nothing with the package), and real ones where BACKDRIVE_DATA is set: every value within a tenth of the old standard error, every
standard error within a tenth of the old one. Then processor times of a tick, a rollout, an identification and a start of the
command, in turns of old and new, the least of each; no more than 5 % longer. `--short` identifies three logs and takes fewer turns;
`--figures` prints instead the table of every former program's figures, before and now (half an hour; both sides with `--short`).
Larger changes are meant where friction with load, the table of terms or the preparation of signals were mended: they hold on a
simulated log where, over twenty draws of it, values and curve come nearer to what the logs were made of.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from _before import BEFORE, ROOT, interpreter, tree
from _common import Judge, parser
from _same_truth_figures import table
from _same_truth_logs import OURS, REAL, Case, true_curve, truth, write

VALUE, ERROR, SLOWER = 0.1, 0.1, 0.05
NAMES = ("tick", "rollout", "rollout without presliding", "identify", "import", "help")
TWINS, SLACK = 20, 0.1  # draws that judge a change; by which the scatter over so few may be larger
SPREAD = math.log(1.3)  # of a scatter over so few draws, by which two of them may differ
ROUNDING = 1e-9  # relative, of values that have no standard error


class Side:
    """A process that answers with one version of the package, in an environment of its own that also its children start in.

    Args:
        root: of the tree that holds `src`.
        folder: for the environment and the compile cache.
    """

    def __init__(self, root: Path, folder: Path):
        python = interpreter(root, folder)
        environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
        environment |= {"NUMBA_CACHE_DIR": str(folder / "cache"), "OPENBLAS_NUM_THREADS": "1"}
        self.root = root
        self.process = subprocess.Popen(
            [str(python), str(Path(__file__).parent / "_same_truth_side.py")],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, job: dict) -> dict:
        """Return the answer to a job."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(job) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            return {"answer": {"error": f"the process ended with {self.process.wait()}"}, "wall": math.nan}
        answer = json.loads(line)
        assert Path(answer["side"]).is_relative_to(self.root), f"{answer['side']} is not of {self.root}"
        return answer

    def close(self) -> None:
        """End the process."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def compare(judge: Judge, case: Case, before: dict, after: dict) -> bool:
    """Judge what the two sides say of one log, and return whether a change is left to `twins` to judge."""
    if "error" in before or "error" in after:
        words = f"{before.get('error', 'identified')}; now {after.get('error', 'identified')}"
        judge.that(f"{case.name}: {words}", False)
        return False
    moved, changed, missing = 0.0, 0.0, []
    laws = [", ".join(found["law"] for found in side.values()) for side in (before, after)]
    for joint, was in before.items():
        now = after[joint]["numbers"]
        for number, (value, error) in was["numbers"].items():
            if number not in now:
                missing.append(f"{joint}.{number}")
                continue
            known = bool(error) and math.isfinite(error)
            size = error if known else ROUNDING * abs(value) / VALUE or 1.0
            moved = max(moved, abs(now[number][0] - value) / size)
            changed = max(changed, abs(now[number][1] / error - 1.0) if known else 0.0)
    holds = laws[0] == laws[1] and not missing and moved <= VALUE and changed <= ERROR
    words = (
        f"{case.name}: {laws[0]} before, {laws[1]} now; values moved by {moved:.2g} standard errors at most ({VALUE:g}), errors by "
        f"{100.0 * changed:.2g} % ({100.0 * ERROR:g})"
    )
    if holds or case.path:
        judge.that(words, holds)
        return False
    print(f"        {words}")
    return True


def twins(judge: Judge, sides: tuple[Side, ...], case: Case, scratch: Path) -> None:
    """Judge a change by other draws of the same log: root mean square of the error of every number, alone and by its stated error.

    The first may not be larger than before; the second, which is 1 where stated errors hold, not farther from it.
    """
    squares: dict[str, list[list[float]]] = {}
    stated: dict[str, list[list[float]]] = {}
    for twin in range(1, TWINS + 1):
        path = write(case, scratch, twin)
        for k, side in enumerate(sides):
            answer = side.ask(job_of(case, path))["answer"]
            for j, found in enumerate(answer.values()):
                off = {"curve": float(np.std(np.array(found["curve"]) - true_curve(case, j)))}
                given = found["numbers"]
                off |= {n: given[n][0] - true for n, true in truth(case, j).items() if n in given}
                for number in [n for n in off if n in given and given[n][1] and math.isfinite(given[n][1])]:
                    by_error = stated.setdefault(f"joint {j + 1}, {number}", [[], []])
                    by_error[k].append((off[number] / given[number][1]) ** 2)
                for number, error in off.items():
                    squares.setdefault(f"joint {j + 1}, {number}", [[], []])[k].append(error**2)
    for number, sides_off in squares.items():
        rms = [math.sqrt(sum(x) / len(x)) if x else math.nan for x in sides_off]
        words = f"{case.name}, {TWINS} draws, {number}: off the truth by {rms[0]:.3g} rms before, {rms[1]:.3g} now"
        judge.that(words, rms[1] <= rms[0] * (1.0 + SLACK))
    for number, sides_off in stated.items():
        ratio = [math.sqrt(sum(x) / len(x)) if x else math.nan for x in sides_off]
        words = f"{case.name}, {TWINS} draws, {number}: off by {ratio[0]:.3g} stated errors rms before, {ratio[1]:.3g} now"
        holds = not math.isfinite(ratio[0]) or abs(math.log(ratio[1])) <= abs(math.log(ratio[0])) + SPREAD
        judge.that(words, holds)


def job_of(case: Case, path: Path) -> dict:
    """Return what a side is asked for."""
    job = {"what": "identify", "path": str(path), "law": case.law}
    return job | {"options": case.options, "reading": case.reading}


def logs(judge: Judge, sides: tuple[Side, ...], scratch: Path, short: bool) -> None:
    """Identify every log on both sides."""
    cases: list[tuple[Case, Path]] = [(c, write(c, scratch)) for c in (OURS[:3] if short else OURS)]
    root = os.environ.get("BACKDRIVE_DATA")
    if root and not short:
        cases += [(c, Path(root, c.path)) for c in REAL if Path(root, c.path).exists()]
    elif not short:
        print("real logs are left out: BACKDRIVE_DATA is not set")
    for case, path in cases:
        before, after = (side.ask(job_of(case, path)) for side in sides)
        print(f"{case.name}: {before['wall']:.1f} s before, {after['wall']:.1f} s now, compiling included")
        if compare(judge, case, before["answer"], after["answer"]):
            twins(judge, sides, case, scratch)


def times(judge: Judge, sides: tuple[Side, ...], scratch: Path, turns: int) -> None:
    """Take times in turns, the least of all turns each."""
    job = {"what": "time", "path": str(write(OURS[0], scratch))}
    for name in NAMES:
        least = [math.inf, math.inf]
        for turn in range(turns):
            for k in (0, 1) if turn % 2 == 0 else (1, 0):
                answer = sides[k].ask(job | {"name": name})["answer"]
                if name not in answer:
                    judge.that(f"{name}, {('before', 'now')[k]}: {answer.get('error', 'not taken')}", False)
                    return
                least[k] = min(least[k], answer[name])
        what = f"{name}: {1e6 * least[0]:.4g} us before, {1e6 * least[1]:.4g} us now; slower by"
        judge.at_most(what, 100.0 * (least[1] / least[0] - 1.0), 100.0 * SLOWER, "%")


def main() -> None:
    """Run both sides and judge."""
    options = parser(__doc__)
    options.add_argument("--figures", action="store_true", help="the figures of every former program instead")
    given = options.parse_args()
    judge = Judge()
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        (scratch / "before").mkdir()
        old = tree(scratch / "before")
        if old is None:
            print(f"nothing to compare with: no git history that holds {BEFORE} in {ROOT}")
            sys.exit(2)
        if given.figures:
            table(judge, old, ROOT, scratch)
            judge.end()
        sides = tuple(Side(root, scratch / f"side-{name}") for root, name in ((old, "before"), (ROOT, "now")))
        try:
            logs(judge, sides, scratch, given.short)
            times(judge, sides, scratch, 3 if given.short else 25)
        finally:
            for side in sides:
                side.close()
    judge.end()


if __name__ == "__main__":
    main()
