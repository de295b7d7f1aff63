"""The progress of a run over a fleet: a line that changes, or, without a terminal, a plain line now and then."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from backdrive.cli._output import echo
from backdrive.cli._progress import Share, progress

STEP = 0.1  # share of the logs after which a plain line is printed [-]
EVERY = 60.0  # time after which one is printed in any case [s]


@contextmanager
def fleet_progress(*, quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows a sentence on the progress, which estimates the time left itself.

    Args:
        quiet: show nothing, as when JSON is asked for.
    """
    if not quiet and not sys.stderr.isatty():
        yield PlainLines()
        return
    with progress(quiet=quiet) as say:
        yield lambda sentence: say(sentence, 0.0)  # a share would be a second estimate of the time left


class PlainLines:
    """Prints a sentence on standard error every 10 % of the logs, or every minute."""

    def __init__(self):
        self._heard, self._share, self._at = Share(), 0.0, monotonic()

    def __call__(self, sentence: str) -> None:
        """Hear a sentence, and print it if it is time."""
        share, now = self._heard.hear(sentence), monotonic()
        if share is not None and (share >= self._share + STEP or share == 1.0 or now - self._at >= EVERY):
            self._share, self._at = share, now
            echo(sentence, err=True)
