"""A line on standard error that says what is going on; silent where nobody looks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from backdrive._visible import visible
from backdrive.cli._output import console


@contextmanager
def progress(*, quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows the present step.

    Args:
        quiet: show nothing, as when JSON is asked for.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda sentence: None
        return
    from rich.markup import escape

    with console(stderr=True).status("Starting ...") as status:
        yield lambda sentence: status.update(escape(visible(sentence)) + " ...")
