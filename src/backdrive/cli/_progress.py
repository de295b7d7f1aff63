"""A line on standard error that says what is going on, how much of it is done and for how long yet; silent where nobody looks."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from backdrive._visible import visible
from backdrive.cli._output import console

SOON = 2.0  # before that nothing is said of time [s]
_COUNT = re.compile(r"(\d+) of (?:at most )?(\d+)\b")


def share_of(sentence: str) -> float | None:
    """Return the share that a sentence with a count states ("3 of 20": 0.15), or None."""
    count = _COUNT.search(sentence)
    if count is None or not int(count[2]):
        return None
    return min(int(count[1]) / int(count[2]), 1.0)


def time_words(elapsed: float | None, share: float | None) -> str:
    """Return how long it has taken and, where a share is known, about how long it takes yet.

    Args:
        elapsed: since the begin [s].
        share: that is done, or None.
    """
    if elapsed is None or elapsed < SOON:
        return ""
    words = f"{elapsed:.0f} s"
    if share is not None and 0.02 <= share < 1.0:
        words += f", {100.0 * share:.0f} %, about {elapsed * (1.0 - share) / share:.0f} s left"
    return words


@contextmanager
def progress(*, quiet: bool = False) -> Iterator[Callable[..., None]]:
    """Yield a function of the present step: `say(sentence)`, or `say(sentence, share)` with the share that is done.

    Args:
        quiet: show nothing, as when JSON is asked for.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda sentence, share=None: None
        return
    from rich.progress import Progress, ProgressColumn, SpinnerColumn, TextColumn
    from rich.table import Column
    from rich.text import Text

    class Time(ProgressColumn):
        def render(self, task: Any) -> Text:
            return Text(time_words(task.elapsed, task.fields["share"]), style="dim")

    words = TextColumn("{task.description}", markup=False, table_column=Column(overflow="fold"))
    shown = Progress(SpinnerColumn(), words, Time(), console=console(stderr=True), transient=True)
    with shown:
        task = shown.add_task("Starting ...", total=None, share=None)

        def say(sentence: str, share: float | None = None) -> None:
            known = share_of(sentence) if share is None else share
            shown.update(task, description=visible(sentence) + " ...", share=known)

        yield say
