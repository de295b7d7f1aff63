"""Would the tests notice? Mutations of the code, each run against the tests named for its room.

Some mutations are named below: a law, a threshold or a correction that is a little wrong, as a slip of the pen would leave it.
The others are drawn at random (`--seed`), as many from every room, over the operators that `_mutants.py` lists. Each is made in
a copy of the tree, and the room's tests run there without the compiler, until the first fails. A mutation is killed when a
test fails or the tests do not end in time. First the tests run on the copy as it is: there they have to pass. At least 95 % of all
mutations have to be killed; what survives is printed with its place. A mutation that changes nothing that anybody could see is
argued in `EQUIVALENT`: those count neither way, and may be 5 % of the drawn at most.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Queue

from _common import Judge
from _mutants import Mutation, mutations, named

ROOT = Path(__file__).resolve().parents[2]
SOURCE = "src/backdrive"
COPIED = ("src", "tests", "docs", "benchmarks", "examples")
KILLED, ARGUED = 0.95, 0.05
SLOWEST = 300.0  # for the tests without a mutation [s]
PATIENCE = 30.0, 4.0  # with one they are stopped after this, or after so many times as long as without [s, -]

#: Room -> the files it is made of (below src/backdrive) -> the tests that are to notice, the quickest first. Searches of laws
#: (`identification/dynamic`) are not drawn from: `recover_laws` and `xl330` judge those.
ROOMS: dict[str, dict[tuple[str, ...], tuple[str, ...]]] = {
    "kernels": {
        ("laws/rates/*.py", "laws/elements/*.py", "laws/kernels.py", "laws/base.py", "laws/growth.py"): (
            "test_reference_rows.py", "test_reference_laws.py", "test_growth.py", "test_reference_solve.py", "test_laws_rates.py",
            "test_laws_elements.py", "test_laws_forms.py", "test_laws.py",
        ),
        ("engine/*.py",): (
            "test_reference_solve.py", "test_reference_engine.py", "test_engine.py", "test_engine_tick.py", "test_plants.py",
        ),
    },
    "compensators": {
        ("control/compensators/*.py",): (
            "test_reference_estimate.py", "test_reference_control.py", "test_compensate*.py", "test_loop*.py",
            "test_closed_loop.py",
        ),
    },
    "estimators": {
        ("control/estimators/*.py",): (
            "test_reference_estimate.py", "test_reference_control.py", "test_estimate_online.py", "test_external_force.py",
            "test_adaptation.py", "test_sliding_mode.py",
        ),
    },
    "loop": {
        ("control/*.py", "status.py"): (
            "test_reference_loop.py", "test_reference_control.py", "test_loop*.py", "test_adaptation.py", "test_closed_loop.py",
        ),
    },
    "identification": {
        (
            "identification/sweep*.py", "identification/function_a.py", "identification/load_fit.py", "identification/timing.py",
        ): (
            "test_reference_sweep_fit.py", "test_reference_sweeps.py", "test_reference_fits.py",
            "test_reference_identification.py", "test_timing.py", "test_sweep.py",
        ),
        ("identification/noise.py",): ("test_reference_noise.py", "test_reference_identification.py", "test_noise.py"),
        ("identification/arm*.py",): ("test_reference_arm.py",),
        (
            "identification/options.py", "identification/auto.py", "identification/validate.py", "identification/result.py",
            "identification/pipeline.py",
        ): ("test_reference_requests.py", "test_identify.py"),
        ("identification/ramp*.py", "identification/break_away.py", "identification/presliding.py"): (
            "test_reference_ramps.py", "test_reference_fits.py", "test_presliding.py",
        ),
        (
            "identification/[cde]*.py", "identification/motion.py", "identification/quality.py",
            "identification/terms.py",
            "identification/regression.py", "identification/runs.py", "identification/signals.py",
        ): (
            "test_reference_motion.py", "test_reference_runs.py", "test_reference_fits.py", "test_regression.py",
            "test_reference_identification.py", "test_motion.py", "test_constant_velocity.py",
        ),
    },
    "health": {
        ("logs/health/*.py", "logs/resolution.py"): (
            "test_reference_health_gate.py", "test_reference_health_time.py", "test_reference_health_samples.py",
            "test_reference_health_motion.py", "test_reference_health_torque.py", "test_reference_health_slip.py",
            "test_reference_health.py", "test_reference_health_frozen.py", "test_health.py",
        ),
    },
    "readers": {
        (
            "logs/readers/bag.py", "logs/readers/db3.py", "logs/readers/mcap.py", "logs/readers/_jointstate.py",
            "logs/readers/_chunks.py", "logs/readers/_bag.py",
        ): (
            "test_reference_bags.py", "test_reference_mcap.py", "test_reference_readers.py", "test_readers.py",
        ),
        (
            "logs/readers/mapping.py", "logs/readers/units.py", "logs/readers/_channels.py", "logs/readers/_names.py",
            "logs/readers/_expression.py",
        ): (
            "test_reference_names.py", "test_reference_channels.py", "test_reference_columns.py", "test_reference_readers.py",
            "test_mapping.py", "test_readers.py",
        ),
        ("logs/readers/csv_.py", "logs/readers/_dialect.py", "logs/readers/[hjnp]*.py", "logs/readers/mat.py"): (
            "test_reference_tables.py", "test_reference_formats.py", "test_reference_readers.py", "test_reference_columns.py",
            "test_mapping.py", "test_readers.py",
        ),
        ("logs/readers/columns.py", "logs/readers/__init__.py", "logs/readers/_formats.py"): (
            "test_reference_guard.py", "test_reference_readers.py", "test_reference_columns.py", "test_mapping.py",
            "test_readers.py",
        ),
        ("logs/readers/guard.py", "logs/readers/_worker.py", "logs/readers/limits.py"): (
            "test_reference_guard.py", "test_reference_readers.py", "test_readers.py", "test_readers_guard.py",
        ),
    },
    "model file": {
        (
            "model/friction_model.py", "model/joint_friction.py", "model/file.py", "model/former.py", "model/covariance.py",
        ): (
            "test_reference_model.py", "test_reference_readers.py", "test_model_file.py", "test_model_schema.py", "test_presets.py",
        ),
    },
}  # fmt: skip

#: Rooms whose numbers are those of equations: there 5 % and every edge have to be noticed too.
EXACT = ("kernels", "compensators", "estimators", "loop", "model file")

#: Room, file, what stands there (once), what a slip would make of it.
NAMED: tuple[tuple[str, str, str, str], ...] = (
    # LuGre's damping does not fade, or as the speed and not its square
    ("kernels", "laws/elements/lugre.py", "return sigma_1 * np.exp(-r * r)", "return sigma_1"),
    ("kernels", "laws/elements/lugre.py", "return sigma_1 * np.exp(-r * r)", "return sigma_1 * np.exp(-abs(r))"),
    # GMS: slipping elements follow the rate law at another pace, or not at all
    ("kernels", "laws/elements/gms.py", "(1.0 + dt * C / abs(s))", "(1.0 + dt * C)"),
    ("kernels", "laws/elements/gms.py", "C = p[e + 1 + 2 * n]", "C = 1.05 * p[e + 1 + 2 * n]"),
    # adaptation: what is put down to noise is not taken off the error, or nothing is put down to noise
    ("estimators", "control/estimators/level.py", "e -= np.copysign(dead_zone, e)", "e -= 0.0"),
    ("estimators", "control/estimators/level.py", "if abs(e) <= dead_zone:", "if False:"),
    # the loop's outputs do not fade while readings are not believed
    ("loop", "control/guard.py", "        g[EXTERNAL, j] /= fading", "        pass"),
    ("loop", "control/guard.py", "        wanted = out / fading", "        wanted = out"),
    # a sweep's delay 5 % off; what is taken for significant
    ("identification", "identification/sweep_delay.py", "return delay, float(error[1]", "return 1.05 * delay, float(error[1]"),
    ("identification", "identification/sweep_delay.py", "float(error[1] / theta[0]), grows", "float(error[1]), grows"),
    ("identification", "identification/sweep_delay.py", "SIGNIFICANT = 4.0", "SIGNIFICANT = 8.0"),
    ("identification", "identification/sweep_delay.py", "SIGNIFICANT = 4.0", "SIGNIFICANT = 4.5"),
    ("identification", "identification/load_fit.py", "SIGNIFICANT = 4.0", "SIGNIFICANT = 8.0"),
    # samples lost to mean and slope are not taken off
    ("identification", "identification/noise.py", "lost = _lost(Q, QQ, correlation)", "lost = 0.0 * _lost(Q, QQ, correlation)"),
    ("identification", "identification/noise.py", "return across - np.einsum(\"abh,ab->h\", QQ, Q.T @ G)", "return across"),
    # few blocks widen nothing, or half as much
    ("identification", "identification/regression.py", "few = 1.0 + 1.22 / (used - 1)", "few = 1.0"),
    ("identification", "identification/regression.py", "few = 1.0 + 1.22 / (used - 1)", "few = 1.0 + 0.61 / (used - 1)"),
    # torque's sign: how much friction must drive, and how surely
    ("health", "logs/health/torque_sign.py", "SURE, SHARE = 4.0, 0.05", "SURE, SHARE = 4.0, 0.06"),
    ("health", "logs/health/torque_sign.py", "SURE, SHARE = 4.0, 0.05", "SURE, SHARE = 4.0, 0.04"),
    ("health", "logs/health/torque_sign.py", "SURE, SHARE = 4.0, 0.05", "SURE, SHARE = 3.0, 0.05"),
    # outliers: times the usual excess, times what is around, what smooth motion leaves, steps, share of the range
    *(
        ("health", "logs/health/outlier.py", "_RANGE = 2.5, 3.0, 8.0, 4.0, 1e-2", f"_RANGE = {numbers}")
        for numbers in (
            "3.0, 3.0, 8.0, 4.0, 1e-2", "2.0, 3.0, 8.0, 4.0, 1e-2", "2.5, 3.5, 8.0, 4.0, 1e-2", "2.5, 2.5, 8.0, 4.0, 1e-2",
            "2.5, 3.0, 10.0, 4.0, 1e-2", "2.5, 3.0, 6.0, 4.0, 1e-2", "2.5, 3.0, 8.0, 6.0, 1e-2", "2.5, 3.0, 8.0, 3.0, 1e-2",
            "2.5, 3.0, 8.0, 4.0, 2e-2", "2.5, 3.0, 8.0, 4.0, 5e-3",
        )
    ),
    ("health", "logs/health/outlier.py", "_SPOILS = 2.0", "_SPOILS = 3.0"),
    # MCAP: any checksum will do; chunks are limited one by one and not together
    ("readers", "logs/readers/mcap.py", "if checksum and zlib.crc32(data) != checksum:", "if False:"),
    ("readers", "logs/readers/mcap.py", "zlib.crc32(data) != checksum", "zlib.adler32(data) != checksum"),
    ("readers", "logs/readers/_bag.py", "self.expanded += size", "self.expanded = size"),
)  # fmt: skip

#: File, line as it reads, line as mutated, and why nobody could tell.
EQUIVALENT: tuple[tuple[str, str, str, str], ...] = (
    (
        "laws/elements/maxwell_slip.py", "return np.nan", "pass",
        "no row has so many elements: the constructor refuses them, and the line is there for the compiler",
    ),
    (
        "logs/readers/_names.py", 'return "", name', "pass",
        "of a name without a place the lines below make the same: no head, and the name with its number",
    ),
    (
        "logs/readers/_dialect.py", 'regular=all(kind == "number" for kind in kinds) and not comma,',
        'regular=((all(kind == "number" for kind in kinds)) or (not comma)),',
        "the quick way then gives up at the first cell that is no number, and the careful one reads the table",
    ),
    (
        "identification/sweep_equations.py", "uneven = np.linalg.svd(np.ones((1, K)))[2][1:].T",
        "uneven = np.linalg.svd(np.ones((2, K)))[2][1:].T", "a row twice spans what it spans once",
    ),
    *(
        ("identification/sweep_windows.py", f"direction, {end} = {sign}1, i", f"direction, {end} = {sign}2, i",
         "only its sign is asked for")
        for end, sign in (("low", "-"), ("high", ""))
    ),
    *(
        ("logs/health/_survey.py", "_PIECE = 1 << 13", f"_PIECE = {other}", "how much is read at once, and nothing else")
        for other in ("2 << 13", "1 << 26")
    ),
    ("logs/health/_runs.py", "if long.size > _MOST:", "if long.size >= _MOST:", "the longest 200 of 200 are all of them, in order"),
    (
        "logs/health/degrees.py", "return span if min(forth, back) > 0.2 * max(forth, back) else 0.0",
        "return span if min(forth, back) > 0.2 * max(forth, back) else 1.0", "either is far from a stroke that is suspected",
    ),
    ("logs/health/degrees.py", "return 0.0", "return 1.0", "either is far from a stroke that is suspected"),
    ("logs/health/outlier.py", "return ends", "pass", "a shortcut: below the bound there is no row, and the ends are what is left"),
    *(
        (f"laws/{file}", line, line.replace(number, mutated), "the power with that exponent is the same number, only slower")
        for file, line, number, mutated in (
            ("rates/degressive.py", "if n == 0.5:", "0.5", "(-0.5)"),
        )
    ),
    *(
        (
            "laws/elements/leuven.py", "FAR = 1e5  # limit of a torque against the motion, relative to the bound [-]",
            f"FAR = {more}  # limit of a torque against the motion, relative to the bound [-]",
            "far beyond what any root is, and near enough that its power does not overflow",
        )
        for more in ("(105000.0)", "(200000.0)")
    ),
    *(
        (f"engine/{file}.py", "if y * e > 0.0:" if file == "drives" else "if u * e > 0.0:",
         "if y * e >= 0.0:" if file == "drives" else "if u * e >= 0.0:", "an error of zero adds nothing to the integral")
        for file in ("drives", "servo")
    ),
    *(
        (f"laws/{file}.py", f"side = {sign}1", f"side = {sign}2", "only its sign is asked for")
        for file in ("kernels", "elements/elastoplastic", "elements/leuven", "elements/smoothed_maxwell_slip")
        for sign in ("", "-")
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Job:
    """A mutation and the tests that are to notice; None: the tree as it is."""

    room: str
    tests: tuple[str, ...]
    mutation: Mutation | None = None

    def title(self) -> str:
        """Return place and operator."""
        if self.mutation is None:
            return "as it is"
        source = (ROOT / self.mutation.path).read_bytes()
        return f"{self.mutation.path}:{self.mutation.line(source)} {self.mutation.operator}"


@dataclass(frozen=True)
class Outcome:
    """How the tests of a job ended: `passed`, `failed` or `late`, what they said last, and how long they took [s]."""

    job: Job
    ended: str
    said: str
    seconds: float


def matching(folder: Path, patterns: Sequence[str]) -> list[str]:
    """Return the files that patterns name, in their order, relative to the tree; a pattern that names none ends the program."""
    found: list[str] = []
    for pattern in patterns:
        files = sorted(folder.glob(pattern))
        if not files:
            sys.exit(f"{folder / pattern} names no file: bring the table of rooms up to date")
        found += [
            str(f.relative_to(ROOT)) for f in files if f.name != "__init__.py" or f.stat().st_size > 1000
        ]
    return list(dict.fromkeys(found))


def rooms() -> dict[str, dict[str, tuple[str, ...]]]:
    """Return room -> file -> tests, as the tree is now."""
    return {
        room: {
            file: tuple(matching(ROOT / "tests", tests))
            for patterns, tests in parts.items()
            for file in matching(ROOT / SOURCE, patterns)
        }
        for room, parts in ROOMS.items()
    }


def drawn(table: dict[str, dict[str, tuple[str, ...]]], each: int, seed: int) -> list[Job]:
    """Return mutations at random, as many from every room, every place of a room with the same chance."""
    jobs = []
    for room, files in table.items():
        dice = random.Random(f"{seed} {room}")
        places = [m for file in files for m in mutations(file, (ROOT / file).read_bytes(), room in EXACT)]
        jobs += [Job(room, files[m.path], m) for m in dice.sample(places, min(each, len(places)))]
    return jobs


def wanted(table: dict[str, dict[str, tuple[str, ...]]]) -> list[Job]:
    """Return the named mutations."""
    jobs = []
    for room, file, old, new in NAMED:
        path = f"{SOURCE}/{file}"
        try:
            jobs.append(Job(room, table[room][path], named(path, (ROOT / path).read_bytes(), old, new)))
        except (KeyError, OSError, ValueError) as error:
            sys.exit(f"the named mutation of {file} has no place ({error}): bring the table up to date")
    return jobs


def argued(mutation: Mutation) -> str:
    """Return why a mutation changes nothing, empty where nobody says so."""
    lines = mutation.lines((ROOT / mutation.path).read_bytes())
    for file, old, new, why in EQUIVALENT:
        if mutation.path == f"{SOURCE}/{file}" and lines == (old, new):
            return why
    return ""


class Copy:
    """A copy of the tree, in which one mutation after the other is tried."""

    def __init__(self, folder: Path):
        self.folder = folder
        for name in COPIED:
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", ".*"))
        for file in ("pyproject.toml", "README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE"):
            shutil.copy(ROOT / file, folder / file)
        # numbers the same everywhere, and no log that is not made here
        self.environment = {
            k: v for k, v in os.environ.items() if not k.startswith(("BACKDRIVE", "NUMBA"))
        } | {
            "PYTHONPATH": str(folder / "src"),
            "NUMBA_DISABLE_JIT": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "OMP_NUM_THREADS": "1",
        }

    def run(self, job: Job, limit: float) -> Outcome:
        """Run the tests of a job on its mutation."""
        if job.mutation is None:
            return self.tested(job, limit)
        file = self.folder / job.mutation.path
        before = file.read_bytes()
        try:
            self.write(file, job.mutation.applied(before))
            return self.tested(job, limit)
        finally:
            self.write(file, before)

    def write(self, file: Path, content: bytes) -> None:
        """Write a source file and forget what was compiled of it: stamps of equal second and size would hide the change."""
        file.write_bytes(content)
        for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*.pyc"):
            compiled.unlink()

    def tested(self, job: Job, limit: float) -> Outcome:
        """Run pytest in a group of its own, that nothing outlives the limit."""
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            "--tb=line",
            *job.tests,
        ]
        start = time.perf_counter()
        with subprocess.Popen(
            command, cwd=self.folder, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL, start_new_session=True,
        ) as process:  # fmt: skip
            try:
                said, _ = process.communicate(timeout=limit)
                ended = {0: "passed", 1: "failed", 2: "failed"}.get(process.returncode, "broken")
            except subprocess.TimeoutExpired:
                said, ended = b"", "late"
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
        last = [
            line
            for line in said.decode(errors="replace").splitlines()
            if line.startswith(("FAILED", "ERROR"))
        ]
        return Outcome(
            job, ended, last[0] if last else said.decode(errors="replace")[-300:], time.perf_counter() - start
        )


def tried(jobs: Sequence[Job], copies: Sequence[Copy], limits: dict[tuple[str, ...], float]) -> list[Outcome]:
    """Run jobs, as many at once as there are copies; print each as it ends."""
    free: Queue[Copy] = Queue()
    for copy in copies:
        free.put(copy)

    def one(job: Job) -> Outcome:
        copy = free.get()
        try:
            outcome = copy.run(job, limits.get(job.tests, SLOWEST))
        finally:
            free.put(copy)
        word = {"passed": "SURVIVED", "failed": "killed", "late": "killed, late", "broken": "BROKEN"}[
            outcome.ended
        ]
        word = word if job.mutation else outcome.ended
        by = outcome.said.split("::")[-1][:60] if outcome.ended == "failed" else ""
        print(f"  {word:12s} {outcome.seconds:6.1f} s  {job.room:15s} {job.title()}  {by}", flush=True)
        return outcome

    with ThreadPoolExecutor(len(copies)) as pool:
        return list(pool.map(one, jobs))


def shown(mutation: Mutation) -> str:
    """Return a mutation as a difference."""
    source = (ROOT / mutation.path).read_bytes()
    old, new = (part.replace("\n", "\n      ") for part in mutation.lines(source))
    return f"    {mutation.path}:{mutation.line(source)} {mutation.operator}\n    - {old}\n    + {new}"


def judged(outcomes: Sequence[Outcome], judge: Judge) -> None:
    """Print what survived and require what has to hold."""
    survived = [o for o in outcomes if o.ended == "passed"]
    equal = [o for o in survived if o.job.mutation and argued(o.job.mutation)]
    left = [o for o in survived if o not in equal]
    drawn = [o for o in outcomes if o.job.mutation and o.job.mutation.operator != "named"]
    for title, some in (("survived", left), ("argued to be equivalent", equal)):
        print(f"{title}: {len(some)}")
        for outcome in some:
            assert outcome.job.mutation
            print(shown(outcome.job.mutation))
            if some is equal:
                print(f"    because {argued(outcome.job.mutation)}")
    print(f"{'room':15s} {'tried':>6s} {'killed':>7s} {'equivalent':>11s} {'survived':>9s}")
    for room in dict.fromkeys(o.job.room for o in outcomes):
        here = [o for o in outcomes if o.job.room == room]
        of = [sum(o in some for o in here) for some in (equal, left)]
        print(f"{room:15s} {len(here):6d} {len(here) - sum(of):7d} {of[0]:11d} {of[1]:9d}")
    late = sum(o.ended == "late" for o in outcomes)
    print(f"of the killed, {late} by the time that their tests took")
    counted = len(outcomes) - len(equal)
    judge.that("every run of the tests ended in a verdict", all(o.ended != "broken" for o in outcomes))
    special = [o for o in left if o.job.mutation and o.job.mutation.operator == "named"]
    judge.that(f"named mutations killed: all but {len(special)}", not special)
    share = (counted - len(left)) / max(counted, 1)
    judge.that(f"killed: {100 * share:.1f} % of {counted} (at least {100 * KILLED:g} %)", share >= KILLED)
    judge.at_most("argued to be equivalent", len(equal) / max(len(drawn), 1), ARGUED, "of the drawn")


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--seed", type=int, default=0, help="of the draw")
    parser.add_argument("--each", type=int, default=8, help="mutations drawn from every room")
    parser.add_argument("--room", action="append", help="only this room")
    parser.add_argument("--workers", type=int, default=2, help="at once")
    parser.add_argument("--short", action="store_true", help="a few mutations of two rooms, within a minute")
    options = parser.parse_args()
    signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # one that is ignored, as in the background, tests would inherit
    begun, judge = time.perf_counter(), Judge()
    table = rooms()
    if options.short:
        options.room, options.each = ["estimators", "model file"], 3
    jobs = [*wanted(table), *drawn(table, options.each, options.seed)]
    jobs = [job for job in jobs if not options.room or job.room in options.room]
    print(
        f"seed {options.seed}: {len(jobs)} mutations, {sum(j.mutation.operator == 'named' for j in jobs)} of them named"
    )
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies = [Copy(Path(folder) / str(k)) for k in range(options.workers)]
        print("the tests as they are:")
        plain = tried([Job(j.room, j.tests) for j in {j.tests: j for j in jobs}.values()], copies, {})
        judge.that("without a mutation the tests pass", all(o.ended == "passed" for o in plain))
        print("mutations:")
        limits = {o.job.tests: max(PATIENCE[0], PATIENCE[1] * o.seconds) for o in plain}
        judged(tried(jobs, copies, limits), judge)
    print(f"wall time {time.perf_counter() - begun:.0f} s")
    judge.end()


if __name__ == "__main__":
    main()
