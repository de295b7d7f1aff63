"""Exported C against the kernels that it was made from: the same bits, and nothing that leaves the limits.

Every law, estimator, compensator, filter, the admittance and the defended loop run along the same random inputs (rests, strokes,
reversals, steps that are far too large; for the loop wild readings, NaN, late ticks, stops, resets, a joint that runs away) in C by
gcc and clang, without optimisation and with -O3, in the compiled kernels, and in plain Python (a process of its own without the
compiler). Floats are judged by the torque of the loop. Then the loop in C is fed with numbers drawn to do harm, and one joint's
NaN must not change a bit of another's.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from _common import Judge, parser
from _export_references import along, loop_along
from _export_sources import (
    LIMITS,
    LOOP_DRIVER,
    T,
    arm,
    compilers,
    every_law,
    every_part,
    library,
    parts_source,
    pointer,
)

from backdrive.export import export_loop, parts
from backdrive.export.parts import Part, PartsHeader

BLOCK = 10**6 // 2  # steps at a time
HARM = Path(__file__).with_name("_export_harm.c")


def inputs(names: list[str], n: int, random: np.random.Generator) -> np.ndarray:
    """Return rows of inputs by name."""
    t = np.arange(n)
    dp = 2e-3 * np.sin(t / (9.0 + 30.0 * random.random())) * np.exp(random.normal(0.0, 1.0, n))
    dp[random.random(n) < 0.15] = 0.0
    dp[random.random(n) < 1e-3] *= 1e4
    dp[random.random(n) < 1e-5] = 1e200
    dp = (
        np.where(np.abs(dp) < 1.0, np.round(dp / 1e-6) * 1e-6, dp)
        if "q" not in names
        else np.clip(np.round(dp / 1e-6) * 1e-6, -0.1, 0.1)
    )
    columns = {
        "dp": dp,
        "q": np.cumsum(np.clip(dp, -0.1, 0.1)),
        "dt": np.full(n, T),
        "t": T * t,
        "temp": np.full(n, 30.0),
        "level": np.full(n, 0.9),
        "idle": (t % 50 > 40).astype(float),
    }
    return np.column_stack([columns[c] if c in columns else random.normal(0.0, 3.0, n) for c in names])


def loop_inputs(n: int, J: int, random: np.random.Generator, start: float) -> tuple[np.ndarray, ...]:
    """Return readings, torque, intervals and the rest of the loop's inputs."""
    t = start + T * np.arange(n)
    q = 0.3 * np.sin(4.4 * t)[:, None] * np.linspace(0.2, 1.0, J) + 0.05 * np.sin(9.0 * t)[:, None]
    rest = (t % 7.0) > 6.0
    q[rest] = q[np.maximum.accumulate(np.where(rest, 0, np.arange(n)))[rest]]
    q[:, 0] += np.where(t % 11.0 > 10.5, 4.1 * (t % 11.0 - 10.5), 0.0)
    q = np.round(q / 1e-5) * 1e-5
    u, wild, dt = random.normal(size=(n, J)), random.random((n, J)), np.full(n, T)
    q[wild < 1e-4] = np.nan
    q[(wild > 1e-3) & (wild < 1.1e-3)] += 0.98765
    u[wild > 0.99995] = np.inf
    dt[random.random(n) < 0.01] *= 1.7
    dt[random.random(n) < 1e-4] = -1.0
    more = np.stack([1e-3 * np.sin(t), 0.5 * np.sin(5.0 * t), random.normal(size=n)], axis=1)
    return q, u, dt, np.ascontiguousarray(np.repeat(more[:, None, :], J, axis=1))


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Return whether two arrays hold the same numbers, a NaN where the other has one."""
    return bool(np.all((a == b) | (np.isnan(a) & np.isnan(b))))


def kept_of(header: PartsHeader, name: str) -> list[int]:
    """Return which of the numbers that a kernel gives its step in C gives, where it is several."""
    return [i for i, f in enumerate(header.steps[name].fields) if len(f) == 3]


def chosen(few: bool) -> dict[str, Part]:
    """Return laws and parts: all, or a few of each."""
    laws = {name: parts.of_law(law) for name, law in every_law().items()}
    named = laws | every_part()
    return {n: p for i, (n, p) in enumerate(named.items()) if not few or i % 5 == 0}


def check_parts(judge: Judge, folder: Path, steps: int, plain: int, seed: int, few: bool) -> None:
    """Laws and parts: C of every compiler against the compiled kernels, and these against plain Python."""
    named = chosen(few)
    source, header = parts_source(named)
    (folder / "parts.c").write_text(source)
    libraries = {
        f"{name} {level}": library(folder / "parts.c", compiler, level)
        for name, compiler in compilers().items()
        for level in ("-O0", "-O3")
    }
    wrong: dict[str, list[str]] = {name: [] for name in [*libraries, "plain Python"]}
    own = subprocess.Popen(
        [
            sys.executable,
            __file__,
            "--plain",
            str(plain),
            "--seed",
            str(seed),
            "--to",
            str(folder / "plain.npz"),
        ],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )
    total = 0
    begun = {}
    for number, (name, part) in enumerate(named.items()):
        columns = [n for _, n in header.signature(name)]
        data = inputs(columns, steps, np.random.default_rng([seed, number]))
        kept = kept_of(header, name)
        expected = along(part, columns, data, kept)
        begun[name] = expected[:plain].copy()
        out = np.empty((steps, max(len(kept), 1)))
        for who, of in libraries.items():
            getattr(of, f"run_{name}")(steps, pointer(data), pointer(out))
            if not same(out, expected):
                wrong[who].append(name)
        total += steps
    if own.wait() != 0:
        judge.that("plain Python ran", False)
        return
    with np.load(folder / "plain.npz") as lists:
        for name, expected in begun.items():
            if not same(lists[name], expected):
                wrong["plain Python"].append(name)
    for who, names in wrong.items():
        what = f"{len(named)} laws and parts, {plain if who == 'plain Python' else steps:.0e} steps each"
        judge.that(
            f"{who}: the same bits as the compiled kernels, {what} {', '.join(names)}".rstrip(), not names
        )


def write_plain(steps: int, seed: int, target: Path) -> None:
    """What plain Python gives along the first steps, for `check_parts`."""
    length = int(os.environ["EXPORT_STEPS"])
    named = chosen(length < 10**7)
    _, header = parts_source(named)
    out = {}
    for number, (name, part) in enumerate(named.items()):
        columns = [n for _, n in header.signature(name)]
        data = inputs(columns, length, np.random.default_rng([seed, number]))[:steps]
        out[name] = along(part, columns, data, kept_of(header, name))
    np.savez(target, **out)


def check_loop(judge: Judge, folder: Path, steps: int, plain: int, single: int, seed: int) -> None:
    """The defended loop: C against the compiled tick, plain Python, and in floats."""
    loops = arm()
    runs = {}
    for precision in ("double", "float"):
        place = folder / precision
        export_loop(loops, T, place, name="arm", precision=precision)
        (place / "loop.c").write_text(LOOP_DRIVER.replace("REAL", precision))
        for name, compiler in compilers().items():
            for level in ("-O0", "-O3"):
                of = library(place / "loop.c", compiler, level)
                runs[f"{name} {level} {precision}"] = of
                test = of.selftest()
                judge.that(
                    f"self-test of {name} {level}, {precision}: {test}",
                    test == (0 if precision == "double" else 1),
                )
                of.set_up()
    wrong: dict[str, int] = dict.fromkeys(runs, 0)
    apart: dict[str, float] = {name: 0.0 for name in runs if name.endswith("float")}
    codes: set[int] = set()
    reference = loop_along(loops, T)
    own, k, J = None, 0, len(loops)
    if plain:
        environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
        command = [
            sys.executable,
            __file__,
            "--plain-loop",
            str(plain),
            "--seed",
            str(seed),
            "--to",
            str(folder / "loop.npz"),
        ]
        own = subprocess.Popen(command, env=environment)
    begin = np.empty((0, J, 6))
    while k < steps:
        n = min(BLOCK // 10, steps - k)
        q, u, dt, more = loop_inputs(n, J, np.random.default_rng([seed, 99, k]), T * k)
        block = k // (BLOCK // 10)
        if k < single:  # the same numbers for floats
            u, more = u.astype(np.float32).astype(float), more.astype(np.float32).astype(float)
        expected = reference(q, u, dt, more)
        codes |= set(np.unique(expected[..., 5]).astype(int).tolist())
        if len(begin) < plain:
            begin = np.concatenate([begin, expected])[:plain]
        out = np.empty((n, J, 6))
        for name, of in runs.items():
            if name.endswith("float"):
                if k >= single:
                    continue
                a, b = u.astype(np.float32), np.ascontiguousarray(more.astype(np.float32))
                of.run(n, pointer(q), pointer(a), pointer(dt), pointer(b), pointer(out))
                apart[name] = max(apart[name], float(np.abs(out[..., 0] - expected[..., 0]).max()))
            else:
                of.run(n, pointer(q), pointer(u), pointer(dt), pointer(more), pointer(out))
                wrong[name] += not same(out, expected)
        event(block, list(runs.values()), reference, J)
        k += n
    for name in runs:
        if name.endswith("float"):
            judge.at_most(
                f"{name}: torque against doubles, {single:.0e} steps, by the limit",
                apart[name] / LIMITS["limit"],
                1e-5,
            )
        else:
            judge.that(
                f"{name}: the loop gives the same bits, {steps:.0e} steps of {J} joints", wrong[name] == 0
            )
    judge.that(f"statuses that were met: {sorted(codes)}", codes >= {0, 1, 2, 4, 5, 6, 7, 8, 9})
    if own is not None:
        ended = own.wait() == 0
        with np.load(folder / "loop.npz") as lists:
            judge.that(
                f"plain Python: the loop gives the same bits, {plain:.0e} steps",
                ended and same(lists["out"], begin),
            )


def event(block: int, libraries: list, reference, J: int) -> None:
    """Between blocks: stop, acknowledge, reset."""
    at = 0.1 * np.ones(J)
    what = block % 4
    for of in libraries:
        if what == 0:
            of.halt()
        elif what in (1, 3):
            of.again()
        else:
            of.rest(pointer(at))
    if what == 0:
        reference.loop.stop()
    elif what in (1, 3):
        reference.loop.acknowledge()
    else:
        reference.loop.reset(at)


def write_plain_loop(steps: int, seed: int, target: Path, single: int) -> None:
    """What plain Python gives along the first steps of the loop."""
    loops = arm()
    reference, out, k, J = loop_along(loops, T), [], 0, len(loops)
    while k < steps:
        n = BLOCK // 10
        q, u, dt, more = loop_inputs(n, J, np.random.default_rng([seed, 99, k]), T * k)
        if k < single:
            u, more = u.astype(np.float32).astype(float), more.astype(np.float32).astype(float)
        out.append(reference(q, u, dt, more))
        event(k // n, [], reference, J)
        k += n
    np.savez(target, out=np.concatenate(out)[:steps])


def check_harm(judge: Judge, folder: Path, steps: int) -> None:
    """Numbers drawn to do harm: torque stays finite and within the limit, joints do not notice each other's NaN."""
    place = folder / "double"
    (place / "harm.c").write_text(HARM.read_text())
    target = place / "harm"
    name, compiler = next(iter(compilers().items()))
    subprocess.run(
        [*compiler, "-std=c99", "-O3", "-ffp-contract=off", "-o", str(target), str(place / "harm.c"), "-lm"],
        check=True,
    )
    J, started = len(arm()), time.perf_counter()
    halves = [
        subprocess.Popen(
            [str(target), str(steps // J // 2), str(seed), repr(LIMITS["limit"])], stdout=subprocess.PIPE
        )
        for seed in (1, 2)
    ]
    results = [json.loads(p.communicate()[0]) for p in halves]
    count = sum(r["steps"] for r in results) * J
    beyond, leaks = sum(r["beyond"] for r in results), sum(r["leaks"] for r in results)
    print(
        f"  {count:.2e} steps of a joint in {time.perf_counter() - started:.0f} s ({name}); statuses {results[0]['codes']}"
    )
    judge.that(f"outputs that are not finite or beyond the limit: {beyond}", beyond == 0)
    judge.that(f"joints that another joint's NaN has changed: {leaks}", leaks == 0)
    judge.that(f"{count:.1e} steps were run of {steps:.0e}", count >= 0.999 * steps)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--seed", type=int, default=20)
    options.add_argument("--plain", type=int, help="(used by itself) steps of parts in plain Python")
    options.add_argument("--plain-loop", type=int, help="(used by itself) steps of the loop in plain Python")
    options.add_argument("--to", type=Path, help="(used by itself) file for these")
    asked = options.parse_args()
    parts_steps = 2 * 10**5 if asked.short else 10**7
    os.environ.setdefault("EXPORT_STEPS", str(parts_steps))
    single = 5 * 10**4 if asked.short else 10**6
    if asked.plain:
        write_plain(asked.plain, asked.seed, asked.to)
        return
    if asked.plain_loop:
        write_plain_loop(asked.plain_loop, asked.seed, asked.to, int(os.environ["EXPORT_SINGLE"]))
        return
    os.environ["EXPORT_SINGLE"] = str(single)
    if len(compilers()) < 2:
        print(
            f"absent: {', '.join({'gcc', 'clang'} - set(compilers()))} (clang comes with `pip install ziglang` too)"
        )
        sys.exit(2)
    judge = Judge()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print("Laws and parts")
        check_parts(judge, folder, parts_steps, 2 * 10**3 if asked.short else 10**5, asked.seed, asked.short)
        print("The loop")
        check_loop(
            judge,
            folder,
            10**5 if asked.short else 10**7,
            5 * 10**3 if asked.short else 10**5,
            single,
            asked.seed,
        )
        print("Harm")
        check_harm(judge, folder, 4 * 10**7 if asked.short else 10**9)
    judge.end()


if __name__ == "__main__":
    main()
