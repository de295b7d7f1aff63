"""Lines of text broken between words, but not inside a quotation, an option with its value, a command or a path."""

from __future__ import annotations

import os
import re
import shutil
import sys
import textwrap
from typing import Any

NARROW, USUAL = 40, 80  # least width of a terminal, and width of messages that go elsewhere [characters]
_GLUE = "\ue000"  # stands for a space at which no line is broken
_WHOLE = tuple(
    re.compile(pattern)
    for pattern in (
        r"(?<!\w)\"(?!\s)[^\"\n]{1,70}\"(?!\w)|`[^`\n]{1,70}`|(?<!\w)'[^'\n]{1,70}'(?!\w)",
        r"\(--?[a-z][^()\n]{1,60}\)",
        r"(?<![\w-])--[a-z][\w-]* (?=\S*[=\d\"'*/]|[A-Z]{2})\S+",
        r"(?<![\w/])(?:pip[ ]install|backdrive [a-z][\w-]*)(?: (?:--?[a-z][\w-]*|[A-Z][A-Z_]+|\S*[\"/*\[]\S*|\S+\.\w+))+",
        r"(?<!\S)(?:\.{0,2}/|[A-Za-z]:\\)(?:[^\s:,;]+ ){1,8}?[^\s:,;]*\.\w{1,8}(?=[\s:,;)]|$)",
    )
)


def width_of(stream: Any) -> int | None:
    """Return the width to which text for a stream is broken [characters]; None if its lines stay whole.

    Lines for a terminal are as wide as it is. Messages on standard error that go to a file or a pipe have `COLUMNS`, by
    default 80; results on standard output stay whole there.
    """
    if stream.isatty():
        return max(shutil.get_terminal_size().columns, NARROW)
    if stream is not sys.stderr:
        return None
    columns = os.environ.get("COLUMNS", "")
    return max(int(columns), NARROW) if columns.isdigit() else USUAL


def wrap(text: str, stream: Any) -> str:
    """Return text with long lines broken between words, as wide as a stream asks for; see `width_of`.

    Args:
        text: lines.
        stream: that they go to.
    """
    width = width_of(stream)
    if width is None:
        return text
    lines: list[str] = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip())]
        broken = textwrap.wrap(
            _glue(line),
            width,
            subsequent_indent=f"{indent}  ",
            break_long_words=False,
            break_on_hyphens=False,
            replace_whitespace=False,
        )
        lines += [part.replace(_GLUE, " ") for part in broken] if len(line) > width else [line]
    return "\n".join(lines)


def _glue(line: str) -> str:
    """Return a line whose whole parts hold no space."""
    for whole in _WHOLE:
        line = whole.sub(lambda found: found[0].replace(" ", _GLUE), line)
    return line
