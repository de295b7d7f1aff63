"""What every evidence program shares: where the real logs lie, and how it ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path


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
        """Print the outcome and exit with 0 or 1."""
        if self.short:
            print("falls short:\n" + "\n".join(f"  {s}" for s in self.short))
            sys.exit(1)
        print("met")
        sys.exit(0)
