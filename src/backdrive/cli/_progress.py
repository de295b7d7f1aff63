"""A progress line on standard error: present step, share done and time left. Without a terminal nothing is printed."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from backdrive._visible import visible
from backdrive.cli._output import console

SOON = 2.0  # no time is printed before that [s]
_COUNT = re.compile(r"(?:\b(joint|law|part) )?\b(\d+) of (?:at most )?(\d+)\b")
NESTED = ("joint", "law", "part")  # the first holds the others


class Share:
    """The share of the work that is done, from the counts in the sentences that tell of it.

    "3 of 20" says that three are done. "Joint 2 of 6", "law 3 of 12" and "part 1 of 5" name what has begun. Laws and parts
    belong to the joint named last. A sentence without a count leaves the share as it is. A sentence with a share of its own
    (`share`, as in a search) says it itself.
    """

    def __init__(self):
        self.value: float | None = None
        self._begun: dict[str, tuple[int, int]] = {}

    def hear(self, sentence: str) -> float | None:
        """Return the share after a sentence, None as long as no count was heard."""
        own = getattr(sentence, "share", None)
        if own is not None:
            self.value = max(self.value or 0.0, own)
            return self.value
        for what, number, count in _COUNT.findall(sentence.lower()):
            k, n = int(number), int(count)
            if n and not what:
                self.value = min(k / n, 1.0)
            elif n:
                held = NESTED.index(what)
                if what == "part" and self._begun.get(what, (0, 0))[1] == n:
                    k = max(k, self._begun[what][0])  # a second fit of the same law begins again
                self._begun = {w: c for w, c in self._begun.items() if NESTED.index(w) < held} | {
                    what: (k, n)
                }
                done = 0.0
                for k, n in (self._begun[w] for w in reversed(NESTED) if w in self._begun):
                    done = min(k - 1 + done, n) / n
                self.value = done
        return self.value


def time_words(elapsed: float | None, share: float | None, since: float = 0.0) -> str:
    """Return the elapsed time in words and, where the share done is known, about how much time is left.

    Args:
        elapsed: since the start [s].
        share: that was done, or None.
        since: time since then [s].
    """
    if elapsed is None or elapsed < SOON:
        return ""
    words = f"{elapsed:.0f} s"
    if share is not None and 0.02 <= share < 1.0:
        left = max((elapsed - since) * (1.0 - share) / share - since, 0.0)
        words += f", {100.0 * share:.0f} %" + (f", about {left:.0f} s left" if left >= 0.5 else "")
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
            since = (task.elapsed or 0.0) - task.fields["at"]
            return Text(time_words(task.elapsed, task.fields["share"], since), style="dim")

    words = TextColumn("{task.description}", markup=False, table_column=Column(overflow="fold"))
    shown = Progress(SpinnerColumn(), words, Time(), console=console(stderr=True), transient=True)
    with shown:
        task, heard = shown.add_task("Starting ...", total=None, share=None, at=0.0), Share()

        def say(sentence: str, share: float | None = None) -> None:
            before = heard.value
            known = heard.hear(sentence) if share is None else share
            if known != before:
                shown.update(task, at=shown.tasks[0].elapsed or 0.0)
            shown.update(task, description=visible(sentence) + " ...", share=known)

        yield say
