"""Output shared by all commands: lines, tables or JSON, and one message with an exit code for each failure.

Names from files and users may hold escape bytes; they are quoted here before they reach the terminal.
"""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Iterable, Sequence
from typing import Any

import typer

from backdrive._documents import plain
from backdrive._visible import visible
from backdrive.cli._lines import wrap
from backdrive.errors import BackdriveError


def echo(text: object = "", *, err: bool = False) -> None:
    """Print lines of text, on standard error if asked, broken between words; see `_lines.width_of`."""
    stream = sys.stderr if err else sys.stdout
    typer.echo(wrap(visible(text, keep="\n\t"), stream), err=err)


def console(*, stderr: bool = False) -> Any:
    """Return a `rich` console that prints text unchanged: without markup, coloured numbers, emoji or control characters."""
    from rich.console import Console, RenderHook

    class Quoting(RenderHook):
        def process_renderables(self, renderables):  # pyright: ignore[reportIncompatibleMethodOverride]  (no types)
            return [_Quote(renderable) for renderable in renderables]

    made = Console(stderr=stderr, highlight=False, markup=False, emoji=False)
    made.push_render_hook(Quoting())
    return made


def table(*headings: str, text: Sequence[str] = (), no_wrap: bool = False, title: str | None = None) -> Any:
    """Return a table without lines, for rows of numbers.

    Args:
        headings: of its columns.
        text: those of them that hold words, flush left.
        no_wrap: keep every cell on one line.
        title: above it.
    """
    from rich.table import Table

    made = Table(box=None, pad_edge=False, title=title, title_justify="left")
    for heading in headings:
        made.add_column(heading, justify="left" if heading in text else "right", no_wrap=no_wrap)
    return made


def print_lines(console: Any, lines: Iterable[str], **how: Any) -> None:
    """Print sentences for a person, each on a line of its own; `how` is what `rich` takes, such as a style."""
    for line in lines:
        console.print(line, **how)


class _Quote:
    """A `rich` object whose text is quoted when printed; the colours and cursor moves of `rich` itself are kept."""

    def __init__(self, renderable: Any):
        self.renderable = renderable

    def __rich_console__(self, console, options):
        from rich.segment import Segment

        for segment in console.render(self.renderable, options):
            shown = segment.text if segment.control else visible(segment.text, keep="\n\t")
            yield segment if shown == segment.text else Segment(shown, segment.style)


def is_usage(error: BaseException) -> bool:
    """Return whether an error comes from the command line's parser, in any of its releases."""
    return hasattr(error, "format_message") and hasattr(error, "exit_code")


def refuse(error: Any) -> int:
    """Print how the command is used and what is wrong with its options, and return the exit code."""
    said = io.StringIO()
    error.show(file=said)
    echo(said.getvalue().rstrip("\n"), err=True)
    return error.exit_code


def fail(error: Exception, *, as_json: bool) -> int:
    """Print an error and return its exit code.

    Args:
        error: any exception; one that is not a `BackdriveError` is an internal fault (exit code 4).
        as_json: print one JSON object on standard output instead of a sentence on standard error.
    """
    code = error.exit_code if isinstance(error, BackdriveError) else 4
    kind = type(error).__name__
    message = error.text if isinstance(error, BackdriveError) else f"internal error: {kind}: {error}"
    if as_json:
        print_json({"ok": False, "error": {"kind": kind, "message": message}, "exit_code": code})
    else:
        echo(f"backdrive: {message}", err=True)
    if code == 4:
        if os.environ.get("BACKDRIVE_TRACEBACK"):
            import traceback

            typer.echo(visible("".join(traceback.format_exception(error)), keep="\n\t"), err=True)
        elif not as_json:
            echo("Set BACKDRIVE_TRACEBACK=1 to see where, and please report it.", err=True)
    return code


def print_json(value: Any) -> None:
    """Print one JSON document; numbers that are not finite become null, and control characters are escaped."""
    text = json.dumps(plain(value), indent=2, ensure_ascii=False)
    typer.echo(text if visible(text, keep="\n") == text else json.dumps(plain(value), indent=2))
