"""A line on standard error that says what is going on; silent where nobody looks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress(*, quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows the present step.

    Args:
        quiet: show nothing, as when JSON is asked for.
    """
    import sys

    if quiet or not sys.stderr.isatty():
        yield lambda sentence: None
        return
    from rich.markup import escape

    from backdrive._visible import visible
    from backdrive.cli._output import console

    with console(stderr=True).status("Starting ...") as status:
        yield lambda sentence: status.update(escape(visible(sentence)) + " ...")
