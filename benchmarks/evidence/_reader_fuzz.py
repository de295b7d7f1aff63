"""Truncated and mutated log files through the guarded child: a log or a typed error every time.

For every format a few small valid files are made, damaged in the ways that break parsers (cuts, flipped bits, moved
blocks, false lengths and counts, damage under an intact compression or checksum), and read one after the other through
one guard. What must never come back: an exception that is not the package's own, a wait beyond the limit, a dead parent.

    python benchmarks/evidence/_reader_fuzz.py --reader mat --n 500
"""

from __future__ import annotations

import argparse
import io
import json
import re
import struct
import subprocess
import sys
import tempfile
import time
import zipfile
import zlib
from collections import Counter
from pathlib import Path

import numpy as np
from _log_files import WRITERS, motion

from backdrive.errors import BackdriveError

_NUMBERS = (
    0,
    1,
    2,
    0x7F,
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    1 << 40,
    (1 << 63) - 1,
    (1 << 64) - 1,
)


def damaged(raw: bytes, rng: np.random.Generator) -> bytes:
    """Return a copy of a file's bytes, damaged in one to four ways."""
    data = bytearray(raw)
    for _ in range(int(rng.integers(1, 5))):
        if not data:
            break
        at = _place(len(data), rng)
        end = min(len(data), at + int(rng.integers(1, max(2, len(data) // 4))))
        match int(rng.integers(9)):
            case 0:
                del data[at:]
            case 1:
                for place in rng.integers(0, len(data), int(rng.integers(1, 17))):
                    data[place] ^= 1 << int(rng.integers(8))
            case 2:
                data[at : at + 8] = rng.bytes(min(8, len(data) - at))
            case 3:
                block = data[at:end]
                to = _place(len(data), rng)
                data[to : to + len(block)] = block
            case 4:
                del data[at:end]
            case 5:
                data[at:at] = data[at:end]
            case 6:
                data[at:end] = bytes(end - at)
            case 7:
                width = int(rng.choice((2, 4, 8)))
                number = int(rng.choice(len(_NUMBERS)))
                order = "little" if rng.random() < 0.8 else "big"
                data[at : at + width] = (_NUMBERS[number] & ((1 << 8 * width) - 1)).to_bytes(width, order)
            case _:
                width = int(rng.choice((1, 2, 4)))
                old = int.from_bytes(data[at : at + width], "little")
                new = (old + int(rng.choice((-8, -1, 1, 8, 256)))) % (1 << 8 * width)
                data[at : at + width] = new.to_bytes(width, "little")
    return bytes(data)


def _place(length: int, rng: np.random.Generator) -> int:
    """Choose a place: often near the beginning or the end, where headers and directories are."""
    kind = rng.random()
    if kind < 0.3:
        return int(rng.integers(min(length, 256)))
    if kind < 0.5:
        return length - 1 - int(rng.integers(min(length, 256)))
    return int(rng.integers(length))


def damaged_npz(raw: bytes, rng: np.random.Generator) -> bytes:
    """Damage one array inside an archive whose checksums stay right."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(raw)) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        victim = int(rng.integers(len(old.namelist())))
        for i, name in enumerate(old.namelist()):
            content = old.read(name)
            if i == victim:
                content = damaged(content, rng)
            new.writestr(name, content)
    return out.getvalue()


def damaged_mat(raw: bytes, rng: np.random.Generator) -> bytes:
    """Damage one variable inside its compression, which stays right."""
    at, out, parts = 128, bytearray(raw[:128]), []
    while at + 8 <= len(raw):
        kind, length = struct.unpack_from("<II", raw, at)
        parts.append((kind, raw[at + 8 : at + 8 + length]))
        at += 8 + length
    victim = int(rng.integers(len(parts)))
    for i, (kind, content) in enumerate(parts):
        if i == victim:
            content = (
                zlib.compress(damaged(zlib.decompress(content), rng)) if kind == 15 else damaged(content, rng)
            )
        out += struct.pack("<II", kind, len(content)) + content
    return bytes(out)


def damaged_pages(raw: bytes, rng: np.random.Generator) -> bytes:
    """Damage a Parquet file's pages, not its footer."""
    footer = len(raw) - 8 - int.from_bytes(raw[-8:-4], "little")
    pages = damaged(raw[4:footer], rng)
    return raw[:4] + pages[: footer - 4].ljust(footer - 4, b"\x00") + raw[footer:]


_WORDS = (
    *(
        "nan",
        "null",
        "1e999",
        "-1e-999",
        "9" * 400,
        '"x"',
        "[",
        "]",
        "{}",
        "[[]]",
        "true",
        "",
        ",",
        ";",
        "\n",
        '"',
        "0x10",
    ),
    *(
        "1_0",
        "\u0661",
        "\x00",
        "[" * 5000,
        '{"a":' * 2000,
        "NaN,NaN",
        "1,5",
        "\xed\xa0\x80",
        "\\ud800",
        "1" + "0" * 5000,
    ),
)


def damaged_words(raw: bytes, rng: np.random.Generator) -> bytes:
    """Put odd words in the places of words or numbers of a text."""
    parts = re.split(rb"([\s,;:\[\]{}]+)", raw)
    for at in rng.integers(0, len(parts), int(rng.integers(1, 6))):
        parts[at] = _WORDS[int(rng.integers(len(_WORDS)))].encode("utf-8")
    return b"".join(parts)


_INSIDE = {
    "npz": damaged_npz,
    "mat": damaged_mat,
    "parquet": damaged_pages,
    "json": damaged_words,
    "csv": damaged_words,
}


def fuzz(reader_name: str, n: int = 10_000, seed: int = 1) -> dict:
    """Read `n` damaged files of one format in a process of its own, so that its death would be seen.

    Args:
        reader_name: key of `WRITERS`.
        n: number of files.
        seed: of the damage.

    Returns:
        counts by error type (`Log` for those that could be read), `untyped`, `hangs`, `parent_deaths`, `restarts` of the
        child, `slowest` [s], `seconds`, and up to five `examples` of what should not have happened.
    """
    command = [
        sys.executable,
        __file__,
        "--reader",
        reader_name,
        "--n",
        str(n),
        "--seed",
        str(seed),
        "--here",
    ]
    started = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return {"reader": reader_name, "n": n, "counts": {}, "untyped": 0, "hangs": 0, "parent_deaths": 1, "restarts": 0,
                "slowest": 0.0, "seconds": time.perf_counter() - started, "examples": [done.stderr[-2000:]]}  # fmt: skip
    return json.loads(done.stdout)


def fuzz_here(reader_name: str, n: int, seed: int) -> dict:
    """Do what `fuzz` promises in this process."""
    from backdrive.logs.readers import read_log
    from backdrive.logs.readers.guard import default_guard
    from backdrive.logs.readers.limits import MIB, Limits

    suffix, write, variants = WRITERS[reader_name]
    limits = Limits(max_seconds=2.0, max_bytes=256 * MIB, max_memory=512 * MIB)
    counts: Counter[str] = Counter()
    untyped, hangs, slowest, examples = 0, 0, 0.0, []
    with tempfile.TemporaryDirectory() as folder:
        whole = []
        for variant in range(variants):
            path = Path(folder) / f"whole{variant}{suffix}"
            write(path, motion(), variant)
            whole.append(path.read_bytes())
            assert len(read_log(path, limits=limits)) > 0, f"the undamaged {path.name} must be readable"
        default_guard().restarts = 0
        path = Path(folder) / f"damaged{suffix}"
        started = time.perf_counter()
        for i in range(n):
            rng = np.random.default_rng((seed, i))
            raw = whole[i % variants]
            inside = _INSIDE.get(reader_name) if rng.random() < 0.5 else None
            path.write_bytes((inside or damaged)(raw, rng))
            begun = time.perf_counter()
            try:
                read_log(path, format=None if i % 5 == 4 else reader_name, limits=limits)
                counts["Log"] += 1
            except BackdriveError as error:
                counts[type(error).__name__] += 1
            except Exception as error:
                untyped += 1
                examples.append(f"file {i}: {type(error).__name__}: {error}")
            took = time.perf_counter() - begun
            slowest = max(slowest, took)
            if took > 2.0 + limits.seconds_for(0):
                hangs += 1
                examples.append(f"file {i}: {took:.2f} s")
        seconds = time.perf_counter() - started
        restarts = default_guard().restarts
        default_guard().close()
    return {"reader": reader_name, "n": n, "counts": dict(sorted(counts.items())), "untyped": untyped, "hangs": hangs,
            "parent_deaths": 0, "restarts": restarts, "slowest": slowest, "seconds": seconds, "examples": examples[:5]}  # fmt: skip


def main() -> int:
    """Print one line a reader; return 1 if anything happened that should not."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--reader", choices=(*WRITERS, "all"), default="all")
    parser.add_argument("--n", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--here", action="store_true", help="in this process, one JSON document on standard output"
    )
    asked = parser.parse_args()
    if asked.here:
        print(json.dumps(fuzz_here(asked.reader, asked.n, asked.seed)))
        return 0
    bad = 0
    for reader in WRITERS if asked.reader == "all" else (asked.reader,):
        found = fuzz(reader, asked.n, asked.seed)
        faults = found["untyped"] + found["hangs"] + found["parent_deaths"]
        bad += faults
        print(
            f"{reader:8s} {found['n']:6d} files {found['seconds']:7.1f} s  slowest {found['slowest']:.2f} s  "
            f"child restarts {found['restarts']:4d}  faults {faults}  {found['counts']}"
        )
        for example in found["examples"]:
            print("   ", example)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
