"""The same truth as before: logs identified by the version before one house and by this one, and what each of them takes.

The old side is the tree of `_before.BEFORE`, taken from git into a temporary folder. Ten simulated logs (`_same_truth_logs` shares
nothing with the package), and real ones where BACKDRIVE_DATA is set: every value within a tenth of the old standard error, every
standard error within a tenth of the old one. Then processor times of a tick, a rollout, an identification and a start of the
command, in turns of old and new, the least of each; no more than 5 % longer. `--short` identifies three logs and takes fewer turns;
`--figures` prints instead the table of every former program's figures, before and now (half an hour; both sides with `--short`).
Larger changes of a value are meant where friction with load, the table of terms or the preparation of signals were mended.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from _before import BEFORE, ROOT, interpreter, tree
from _common import Judge, parser
from _same_truth_figures import table
from _same_truth_logs import OURS, REAL, Case, write

VALUE, ERROR, SLOWER = 0.1, 0.1, 0.05
NAMES = ("tick", "rollout", "rollout without presliding", "identify", "import", "help")
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


def compare(judge: Judge, name: str, before: dict, after: dict) -> None:
    """Judge what the two sides say of one log."""
    if "error" in before or "error" in after:
        judge.that(
            f"{name}: {before.get('error', 'identified')}; now {after.get('error', 'identified')}", False
        )
        return
    laws = [{joint: found["law"] for joint, found in side.items()} for side in (before, after)]
    if laws[0] != laws[1]:
        judge.that(f"{name}: {laws[0]} before, {laws[1]} now", False)
        return
    worst, at, ratio, where, missing = 0.0, "", 0.0, "", []
    for joint, found in before.items():
        now = after[joint]["numbers"]
        for number, (value, error) in found["numbers"].items():
            if number not in now:
                missing.append(f"{joint}.{number}")
                continue
            size = error if error and math.isfinite(error) else ROUNDING * abs(value) / VALUE or 1.0
            moved = abs(now[number][0] - value) / size
            changed = abs(now[number][1] / error - 1.0) if error and math.isfinite(error) else 0.0
            if not moved <= worst:
                worst, at = moved, f" ({joint}.{number}: {value:.6g} before, {now[number][0]:.6g} now)"
            if not changed <= ratio:
                ratio, where = changed, f" ({joint}.{number}: {error:.3g} before, {now[number][1]:.3g} now)"
    count = sum(len(found["numbers"]) for found in before.values())
    law = ", ".join(sorted(set(laws[0].values())))
    judge.that(f"{name}: {law}, {count} numbers, none missing {' '.join(missing)}".rstrip(), not missing)
    judge.at_most(f"values by standard error{at}", worst, VALUE)
    judge.at_most(f"change of standard errors{where}", 100.0 * ratio, 100.0 * ERROR, "%")


def logs(judge: Judge, sides: tuple[Side, ...], scratch: Path, short: bool) -> None:
    """Identify every log on both sides."""
    cases: list[tuple[Case, Path]] = [(c, write(c, scratch)) for c in (OURS[:3] if short else OURS)]
    root = os.environ.get("BACKDRIVE_DATA")
    if root and not short:
        cases += [(c, Path(root, c.path)) for c in REAL if Path(root, c.path).exists()]
    elif not short:
        print("real logs are left out: BACKDRIVE_DATA is not set")
    for case, path in cases:
        job = {"what": "identify", "path": str(path), "law": case.law}
        job |= {"options": case.options, "reading": case.reading}
        before, after = (side.ask(job) for side in sides)
        print(f"{case.name}: {before['wall']:.1f} s before, {after['wall']:.1f} s now, compiling included")
        compare(judge, case.name, before["answer"], after["answer"])


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
