"""Files and the machine: whatever happens, the old file is whole, the error is typed, the exit code is the documented one.

Every command runs as a process of its own, on outputs and inputs that are no regular files, on a disk that is full or
read-only, with hostile models and damaged compile caches; it is killed and interrupted. Looked at is what a person would see:
exit code, message, and the bytes that are in the folder afterwards.

    python benchmarks/evidence/files_safety.py --short
    python benchmarks/evidence/files_safety.py --only kills
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from _common import Judge
from _hostile_models import HOSTILE, honest
from _safety_cache import damaged_caches
from _safety_commands import OLD, Bench, Command, Done, commands, half, prepare, whole
from _safety_places import PLACES, fill, huge, look, protect_disk, small_disk

AT_ONCE = min(os.cpu_count() or 1, 4)
STOPPED = (130, -signal.SIGINT)  # a shell shows the latter as 130 too
SOON = 1.0  # from Ctrl-C to the end [s]
REFUSED = 5.0  # until a strange input is refused, on a busy machine [s]


def main() -> None:
    """Run all parts, or those that were asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parts = {f.__name__: f for f in (outputs, inputs, disks, kills, models, caches, interrupts)}
    parser.add_argument("--short", action="store_true", help="fewer of each, within a minute")
    parser.add_argument(
        "--only", choices=list(parts), action="append", help="only this part; may be repeated"
    )
    parser.add_argument("--seed", type=int, default=11, help="of the moments of kills")
    asked = parser.parse_args()
    signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # a shell's background job ignores it, and hands that on
    judge, begun = Judge(), time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="files-safety-") as scratch:
        bench = Bench(Path(scratch))
        known = undisturbed(bench, judge, asked.short)
        print(
            f"prepared in {time.perf_counter() - begun:.0f} s; {AT_ONCE} processes at once, seed {asked.seed}"
        )
        for name, part in parts.items():
            if asked.only is None or name in asked.only:
                start = time.perf_counter()
                part(bench, judge, known, np.random.default_rng(asked.seed), asked.short)
                print(f"  {name}: {time.perf_counter() - start:.0f} s")
    print(f"wall time {time.perf_counter() - begun:.0f} s")
    judge.end()


Known = dict[str, dict[str, bytes]]


def undisturbed(bench: Bench, judge: Judge, short: bool) -> Known:
    """Run every command once to warm up and once to keep its files and wall time; the longer ones not where time is short."""
    known: Known = {}
    few = ("plan", "show", "laws", "identify", "inspect")
    for name, command in commands(bench).items():
        if short and name not in few:
            continue
        folder = prepare(bench.root / "known" / name, command)
        for _ in range(1 if short else 2):
            done = bench.run(command.words(folder), timeout=600.0)
        if done.code or (half(folder, command, {}) and not all((folder / f).exists() for f in command.files)):
            judge.that(f"{name} undisturbed: {done}", False)
        known[name] = {f: (folder / f).read_bytes() for f in command.files}
        bench.seconds[name] = done.seconds
    return known


def several(work: Sequence[Callable[[], str | None]]) -> list[str]:
    """Do pieces of work, some at a time; return what was wrong."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        return [wrong for wrong in pool.map(lambda piece: piece(), work) if wrong]


def tell(judge: Judge, sentence: str, wrong: list[str]) -> None:
    """Judge a row, and print the first few things that are wrong."""
    for line in wrong[:8]:
        print(f"        {line}")
    judge.that(f"{sentence}: {len(wrong)} wrong", not wrong)


def outputs(bench: Bench, judge: Judge, known: Known, rng: np.random.Generator, short: bool) -> None:
    """What is no regular file is not replaced, and refused before anything is computed; a link to one is followed."""
    slowest: list[float] = []

    def refuse(name: str, command: Command, place: str, i: int) -> str | None:
        folder = bench.root / "outputs" / f"{name}-{i}"
        folder.mkdir(parents=True)
        target = folder / command.files[0]
        word = PLACES[place](target)
        before, there = look(target), sorted(os.listdir(folder))
        done = bench.run(command.words(folder))
        slowest.append(done.seconds)
        good = done.code == 2 and word in done.err and done.tidy
        if good and look(target) == before and sorted(os.listdir(folder)) == there:
            return None
        return f"{name}, {place}: {done}; {sorted(set(os.listdir(folder)) ^ set(there))}"

    def follow(name: str, command: Command) -> str | None:
        folder = prepare(bench.root / "followed" / name, command)
        link = folder / command.files[0]
        real = bench.root / "followed" / f"{name}-real"
        os.replace(link, real)
        link.symlink_to(real)
        done = bench.run(command.words(folder))
        if (
            done.code == 0
            and link.is_symlink()
            and real.read_bytes() != OLD
            and not half(folder, command, known[name])
        ):
            return None
        return f"{name} through a link: {done}"

    writing = {n: c for n, c in commands(bench).items() if c.files and (n in known)}
    if short:
        writing = {n: writing[n] for n in ("show", "identify")}
    work = [
        lambda n=n, c=c, p=p, i=i: refuse(n, c, p, i)
        for n, c in writing.items()
        for i, p in enumerate(PLACES)
    ]
    wrong = several(work)
    tell(
        judge,
        f"{len(writing)} commands x {len(PLACES)} outputs that are no file of ours: refused, untouched",
        wrong,
    )
    print(f"        the slowest refusal took {max(slowest):.1f} s")
    wrong = several([lambda n=n, c=c: follow(n, c) for n, c in writing.items()])
    tell(judge, f"{len(writing)} commands through a link: the link stays, its target is replaced", wrong)


def inputs(bench: Bench, judge: Judge, known: Known, rng: np.random.Generator, short: bool) -> None:
    """What is no regular file, or huge, is not read: no hang, no unbounded read."""
    log, model = (bench.log, "--names", "elbow"), bench.model
    ways: dict[str, Callable[[Path], tuple]] = {
        "show": lambda p: ("show", p),
        "validate": lambda p: ("validate", p, *log),
        "compare": lambda p: ("compare", model, p),
        "tune": lambda p: ("tune", p),
        "inspect": lambda p: ("inspect", p),
        "identify": lambda p: ("identify", p),
        "identify --hold-out": lambda p: ("identify", *log, "--hold-out", p),
        "identify --plan": lambda p: ("identify", *log, "--plan", p),
        "identify --urdf": lambda p: ("identify", *log, "--method", "arm", "--urdf", p),
        "plan --urdf": lambda p: ("plan", "sweep", "--stroke", "1", "--top-speed", "1", "--urdf", p),
        "identify --law": lambda p: ("identify", p, "--law", "auto"),
    }
    if short:
        ways = {name: ways[name] for name in ("show", "inspect", "plan --urdf")}
    places = {n: p for n, p in PLACES.items() if n not in ("write-protected",)} | {"huge": huge}
    slowest: list[float] = []

    def refuse(way: str, place: str, i: int) -> str | None:
        folder = bench.root / "inputs" / f"{way.replace(' ', '')}-{i}"
        folder.mkdir(parents=True)
        places[place](folder / "in.json")
        done = bench.run(ways[way](folder / "in.json"), timeout=20.0)
        slowest.append(done.seconds)
        if done.code == 3 and done.tidy and (done.seconds < REFUSED or os.getloadavg()[0] > AT_ONCE * 2):
            return None
        return f"{way}, {place}: {done}"

    work = [lambda w=w, p=p, i=i: refuse(w, p, i) for w in ways for i, p in enumerate(places)]
    wrong = several(work)
    tell(judge, f"{len(ways)} ways to read x {len(places)} inputs that are no file: refused with 3", wrong)
    print(f"        the slowest refusal took {max(slowest):.1f} s")


def disks(bench: Bench, judge: Judge, known: Known, rng: np.random.Generator, short: bool) -> None:
    """A disk that is full or read-only: said so, and the old files are whole."""
    writing = {n: c for n, c in commands(bench).items() if c.files and n in known}
    if short:
        writing = {n: writing[n] for n in ("show", "plan")}

    def attempt(name: str, command: Command, at: Path, words: Sequence[str], **more) -> str | None:
        folder = at / name
        done = bench.run(command.words(folder), **more)
        left = sorted(set(os.listdir(folder)) - set(command.files))
        old = all((folder / f).read_bytes() == OLD for f in command.files)
        if done.code == 2 and done.tidy and any(w in done.err for w in words) and old and not left:
            return None
        return f"{name}: {done}; {'old files whole' if old else 'OLD FILES LOST'}, left: {left}"

    disk = bench.root / "disk"
    with small_disk(disk) as mounted:
        for name, command in writing.items():
            prepare(disk / name, command)
        if mounted:
            fill(disk)
            wrong = [w for n, c in writing.items() if (w := attempt(n, c, disk, ["disk is full"]))]
            tell(judge, f"{len(writing)} commands on a full disk (a tmpfs of 256 kB): old files whole", wrong)
            if protect_disk(disk):
                wrong = [
                    w for n, c in writing.items() if (w := attempt(n, c, disk, ["Read-only file system"]))
                ]
                tell(judge, f"{len(writing)} commands on a read-only disk: refused, old files whole", wrong)
            else:
                judge.that("a disk could be made read-only here", False)
            return
        print("        no disk may be mounted here: a limit on the size of files stands for a full disk")

        def limited() -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))

        words = ["larger than this system allows"]
        wrong = [w for n, c in writing.items() if (w := attempt(n, c, disk, words, preexec_fn=limited))]
        tell(
            judge, f"{len(writing)} commands that may write 100 bytes (RLIMIT_FSIZE): old files whole", wrong
        )
        for name in writing:
            os.chmod(disk / name, 0o555)
        if os.geteuid():
            wrong = [w for n, c in writing.items() if (w := attempt(n, c, disk, ["Permission denied"]))]
            tell(judge, f"{len(writing)} commands in a read-only folder: refused, old files whole", wrong)
        for name in writing:
            os.chmod(disk / name, 0o755)


SAVING = """
import sys
from backdrive import load_model
model = load_model(sys.argv[1])
print("saving", flush=True)
while True:
    model.save(sys.argv[2])
"""


def kills(bench: Bench, judge: Judge, known: Known, rng: np.random.Generator, short: bool) -> None:
    """SIGKILL at random moments: the file is whole, and the next run leaves no other."""
    count = 6 if short else 30
    writing = [
        (n, c)
        for n, c in commands(bench).items()
        if c.files and n in known and (not short or n != "identify")
    ]
    wrong, left = [], 0
    for i in range(count):
        if i % 2:  # a program that does nothing but save
            folder = bench.root / "kills" / str(i)
            folder.mkdir(parents=True)
            path = folder / "m.json"
            path.write_bytes(bench.model.read_bytes())
            done, before = killed_saver(bench, path, float(rng.uniform(0.0, 0.2)))
            if not whole("m.json", before):
                wrong.append(f"saving, kill {i}: the file is half; {done}")
            more = set(os.listdir(folder)) - {"m.json"}
            after = bench.run(("show", "preset:mx106/m1", "--plot", folder / "next.svg"))
            rest = set(os.listdir(folder)) - {"m.json", "next.svg"}
        else:
            name, command = writing[(i // 2) % len(writing)]
            folder = prepare(bench.root / "kills" / str(i), command)
            total = bench.seconds[name]
            moment = float(rng.uniform(0.0, total) if i % 4 else rng.uniform(0.8 * total, 1.05 * total))
            done = bench.stop(command.words(folder), moment, signal.SIGKILL)
            more = set(os.listdir(folder)) - set(command.files)
            wrong += [
                f"{name}, kill {i}: {w}"
                for w in half(folder, command, known[name])
                if not w.endswith("was left")
            ]
            after = bench.run(command.words(folder), timeout=120.0)
            rest = set(os.listdir(folder)) - set(command.files)
        left += bool(more)
        if after.code or rest:
            wrong.append(f"kill {i}: the next run: {after}; left: {sorted(rest)}")
    tell(judge, f"{count} kills at random moments: files whole, next run good, nothing left after it", wrong)
    print(f"        {left} of the kills struck while a file was being written")


def killed_saver(bench: Bench, path: Path, after: float) -> tuple[Done, bytes]:
    """Kill a program that saves a model again and again; return how it ended and what the file then holds."""
    process = subprocess.Popen(
        [sys.executable, "-c", SAVING, str(bench.model), str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=bench.environment(),
    )
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(after)
    process.kill()
    out, err = process.communicate()
    return Done(process.returncode, out, err, after), path.read_bytes()


def models(bench: Bench, judge: Judge, known: Known, rng: np.random.Generator, short: bool) -> None:
    """Hostile models are refused with the place; negative friction and extrapolation are said."""
    folder = bench.root / "models"
    folder.mkdir()

    def refuse(i: int, kind: str) -> str | None:
        data, words = HOSTILE[kind]
        path = folder / f"{i}.json"
        path.write_bytes(data)
        done = bench.run(("show", path))
        said = words.replace("model file", str(path))
        if done.code == 3 and done.tidy and said in done.err and len(done.err) < 2000:
            return None
        return f"{kind}: {done}"

    kinds = list(HOSTILE)[:: 3 if short else 1]
    wrong = several([lambda i=i, k=k: refuse(i, k) for i, k in enumerate(kinds)])
    tell(judge, f"{len(kinds)} kinds of hostile model: refused with 3 and the place", wrong)
    document = honest()
    document["joints"][0]["parameters"]["positive"]["value"] = [5.0, -1.0, 5.0]
    (folder / "negative.json").write_text(json.dumps(document))
    done = bench.run(("show", folder / "negative.json", "--json"))
    judge.that(
        f"negative friction is said: code {done.code}", done.code == 0 and "Friction is negative" in done.out
    )
    document = honest()
    document["joints"][0]["validity"] = {"velocity": [-0.1, 0.1]}
    (folder / "narrow.json").write_text(json.dumps(document))
    done = bench.run(("validate", folder / "narrow.json", bench.log, "--names", "elbow", "--gate", "1000"))
    judge.that(
        f"a log outside the validity range is said: code {done.code}",
        done.code == 0 and "outside the validity range" in done.out,
    )


def caches(bench: Bench, judge: Judge, known: Known, rng: np.random.Generator, short: bool) -> None:
    """A damaged compile cache is discarded and rebuilt: same output, exit code 0."""
    words = ("show", bench.model, "--json")
    expected = bench.run(words)
    for kind, package, more, note in damaged_caches(bench, rng, short):
        done = bench.run(words, package=package, timeout=300.0, **more)
        good = done.code == 0 and done.out == expected.out and done.tidy
        judge.that(f"cache {kind}: {done if not good else f'same output, {done.seconds:.1f} s'}", good)
        if note:
            judge.that(
                f"cache {kind}: a note says so: {done.err.strip()[:100]!r}", good and bool(done.err.strip())
            )


def interrupts(bench: Bench, judge: Judge, known: Known, rng: np.random.Generator, short: bool) -> None:
    """Ctrl-C: the command ends within a second with 130, files whole, nothing left."""
    slow: list[str] = []
    wrong: list[str] = []
    longest, count = 0.0, 0
    names = [n for n in commands(bench) if n in known and (not short or n in ("identify", "show"))]
    begin = min(bench.run(("laws", "--help")).seconds for _ in range(2))
    for name in names:
        command, total = commands(bench)[name], bench.seconds[name]
        for k in range(2 if short else 5):
            folder = prepare(bench.root / "interrupts" / f"{name}-{k}", command)
            # the first while Python itself starts, the others over the life of the command
            moment = 0.5 * begin if k == 0 else begin + (k - 0.5) / 4 * max(total - begin, 0.1)
            done = bench.stop(command.words(folder), moment, signal.SIGINT)
            count += 1
            longest = max(longest, done.seconds)
            where = f"{name} after {moment:.2f} of {total:.2f} s"
            if done.code not in (*STOPPED, 0):
                wrong.append(f"{where}: {done}")
            elif done.code == 0 and done.alive and moment < 0.9 * total:
                wrong.append(f"{where}: went on to its end; {done}")
            elif k and not done.tidy:
                wrong.append(f"{where}: a traceback; {done}")
            if done.seconds > SOON:
                slow.append(f"{where}: ended {done.seconds:.2f} s later, code {done.code}")
            wrong += [f"{where}: {w}" for w in half(folder, command, known[name])]
    tell(
        judge,
        f"{count} times Ctrl-C in {len(names)} commands: 130 (0 where it had ended), files whole, nothing left",
        wrong,
    )
    print(f"        load of this machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    tell(judge, f"{count} times Ctrl-C: ended within {SOON:g} s, the longest {longest:.2f} s", slow)


if __name__ == "__main__":
    main()
