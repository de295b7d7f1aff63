"""What every evidence program shares: its options, where the real logs lie, fresh seeds, and how it ends."""

from __future__ import annotations

import argparse
import os
import secrets
import sys
import time
from pathlib import Path

BEGUN = time.perf_counter()
FRESH = 10**8  # seeds of tests, and of what thresholds were chosen on, lie below


def parser(words: str | None) -> argparse.ArgumentParser:
    """Return a command line with `--short`: the same with fewer draws, within a minute."""
    made = argparse.ArgumentParser(description=words, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--short", action="store_true", help="fewer draws, within a minute")
    return made


def first_seed(asked: int | None) -> int:
    """Return the first of the seeds that a program draws from, and print it: as asked, or one that nothing can be tuned on."""
    seed = FRESH + 10**5 * secrets.randbelow(20_000) if asked is None else asked
    print(f"seeds from {seed} on (`--seed {seed}` repeats this)", flush=True)
    return seed


def data(*parts: str) -> Path:
    """Return a path below $BACKDRIVE_DATA, or end with 2 where it is absent."""
    root = os.environ.get("BACKDRIVE_DATA")
    path = Path(root, *parts) if root else None
    if path is None or not path.exists():
        print(f"real logs are absent: set BACKDRIVE_DATA to the folder that holds {'/'.join(parts)}")
        sys.exit(2)
    return path


class Judge:
    """Collects what was required and what came out, and ends the program."""

    def __init__(self):
        self.short: list[str] = []

    def at_most(self, what: str, value: float, limit: float, unit: str = "") -> None:
        """Require value <= limit."""
        self.that(f"{what}: {value:.4g} {unit} (at most {limit:g})".replace("  ", " "), value <= limit)

    def that(self, sentence: str, holds: bool) -> None:
        """Require that something holds."""
        print(f"  {'ok   ' if holds else 'SHORT'} {sentence}")
        if not holds:
            self.short.append(sentence)

    def end(self) -> None:
        """Print wall time and outcome, and exit with 0 or 1."""
        print(f"wall time: {time.perf_counter() - BEGUN:.0f} s")
        if self.short:
            print("falls short:\n" + "\n".join(f"  {s}" for s in self.short))
            sys.exit(1)
        print("met")
        sys.exit(0)
